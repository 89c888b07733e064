"""An autopilot as the guard's inner loop: set-points go out, its state and its refusals come in."""

from collections import deque

import numpy as np

from firmware_bridge.autopilot.agreed_frame import AgreedFrame
from firmware_bridge.autopilot.euler import roll_pitch_yaw
from firmware_bridge.autopilot.flavour import ARM_DISARM, DO_SET_MODE, SET_MESSAGE_INTERVAL, refusal
from firmware_bridge.autopilot.line import MavlinkLine
from firmware_bridge.autopilot.settings import ARMED, AUTOPILOT_COMPONENT, heartbeat
from firmware_bridge.autopilot.setup import AutopilotSetup
from firmware_bridge.dialect.generated.autopilot_messages import (
    CurrentMode,
    ServoOutputRaw,
    SetAttitudeTarget,
    SetPositionTargetLocalNed,
    VisionPositionEstimate,
)
from firmware_bridge.dialect.generated.messages import (
    AttitudeQuaternion,
    BatteryStatus,
    CommandAck,
    CommandLong,
    Heartbeat,
    LocalPositionNed,
    Statustext,
    SysStatus,
)
from firmware_bridge.dialect.message import Message
from firmware_bridge.offboard.firmware import Alert, FirmwareState
from firmware_bridge.offboard.ladder import Stage
from firmware_bridge.offboard.messages import Target
from firmware_bridge.offboard.poses import Pose
from flight import FloatArray, frames

RATES_AND_THRUST = 128
"""SET_ATTITUDE_TARGET's type mask: the attitude is not looked at."""
EVERYTHING, LOCAL_NED = 0, 1
"""SET_POSITION_TARGET_LOCAL_NED's type mask and frame."""
CUSTOM_MODE = 1.0
HEARTBEAT_S, ASK_S, ARM_S, VISION_S = 1.0, 1.0, 0.5, 1.0 / 30.0
INTERVALS_HZ = {
    AttitudeQuaternion.ID: 50.0, LocalPositionNed.ID: 25.0, CurrentMode.ID: 10.0, Heartbeat.ID: 5.0,
    ServoOutputRaw.ID: 25.0, SysStatus.ID: 2.0, BatteryStatus.ID: 2.0,
}  # fmt: skip
"""What is asked for, each while it is missing."""
_SILENT_S, _LATE_PERIODS, _TEXT_S, _TEXTS = 0.3, 3.0, 10.0, 3
_ON_ITS_WAY_S = 0.2
"""What came so soon after a request may have been said before it."""
_PREARM = 1 << 28
_ERROR = 4
"""Texts of this severity or worse say why it does not arm."""
_ALERTS = {2: Alert.WARNING, 3: Alert.CRITICAL, 4: Alert.CRITICAL, 5: Alert.CRITICAL}
"""By MAV_BATTERY_CHARGE_STATE."""
_UNKNOWN_MV = 65535


class Autopilot:
    """An `InnerLoop` by MAVLink."""

    pilot_arms = True
    """Whoever arms it, its own checks decide when it disarms."""

    def __init__(
        self, setup: AutopilotSetup, line: MavlinkLine, *, vision: bool = False, position: bool = False
    ) -> None:
        """
        Args:
            vision: pass poses on to its estimator.
            position: tell it where to be, on the way of a plan, while its frame agrees with that of the poses.
        """
        self._setup, self._line, self._vision = setup, line, vision
        self._frame = AgreedFrame() if position else None
        self.by_targets = False
        self.state = FirmwareState()
        self._mode = -1
        self._came_s: dict[int, float] = {}
        self._was_ours = self._asked_to_arm = False
        self._ground_m, self._altitude_m = 0.0, np.nan
        self._refused: dict[int, str] = {}
        self._texts: deque[tuple[float, str]] = deque(maxlen=_TEXTS)
        self._now_s = self._asked_s = self._beat_s = self._armed_s = self._vision_s = -np.inf
        self._undone_s = np.inf

    @property
    def ours(self) -> bool:
        """Whether it is in the mode that follows us; a pilot's switch ends it."""
        return self._mode == self._setup.custom_mode

    @property
    def said(self) -> str:
        texts = [text for time_s, text in self._texts if self._now_s - time_s < _TEXT_S]
        return "; ".join([*filter(None, self._refused.values()), *dict.fromkeys(texts)])

    @property
    def apart(self) -> str:
        """Before it is armed, why it is not to be; then, why it is not told."""
        if self._frame is None:
            return ""
        return self._frame.apart if self.state.armed else self._frame.unready(self._now_s)

    def listen(self, now_s: float) -> None:
        self._now_s = now_s
        for received in self._line.receive():
            if (received.system_id, received.component_id) == (self._setup.system, AUTOPILOT_COMPONENT):
                self.state.heard_s = self._came_s[received.message.ID] = now_s
                self._take(received.message, now_s)
        if self._frame is not None:
            self._frame.armed = self.state.armed

    def seen(self, now_s: float, pose: Pose) -> None:
        """Passed on at most 30 times a second."""
        if self._frame is not None:
            self._frame.pose(pose)
        if not self._vision or now_s - self._vision_s < VISION_S:
            return
        self._vision_s = now_s
        x, y, z = frames.flip_vector(pose.position_world_m)
        roll, pitch, yaw = roll_pitch_yaw(frames.flip_attitude(pose.q_world_body))
        unknown = (float("nan"), *[0.0] * 20)
        self._line.send(VisionPositionEstimate(round(pose.time_s * 1e6), x, y, z, roll, pitch, yaw, unknown))

    def command(
        self, now_s: float, stage: Stage, force_n: float, rate_body_rad_s: FloatArray, target: Target | None = None
    ) -> None:
        if now_s - self._beat_s >= HEARTBEAT_S:
            self._line.send(heartbeat())
            self._beat_s = now_s
        self._ask_for_messages(now_s)
        self._mind_the_pilot(stage)
        self.by_targets = False
        if stage is Stage.PILOT or (stage is Stage.DOWN and not self.ours):
            return  # nothing from us: PX4's mode cannot even be entered again
        if target is not None and self._frame is not None and self.ours and self._frame.at(now_s):
            self.by_targets = True
            self._line.send(self._at(now_s, target))
        else:
            self._line.send(self._turning(now_s, force_n, rate_body_rad_s))
        self._arm_or_disarm(now_s, stage)

    def _turning(self, now_s: float, force_n: float, rate_body_rad_s: FloatArray) -> SetAttitudeTarget:
        thrust = self._setup.thrust.command(force_n, self.state.battery_v) if force_n > 0.0 else 0.0
        x, y, z = frames.flip_vector(rate_body_rad_s)
        return SetAttitudeTarget(
            time_boot_ms=round(now_s * 1e3) & 0xFFFFFFFF, q=(1.0, 0.0, 0.0, 0.0), body_roll_rate=x,
            body_pitch_rate=y, body_yaw_rate=z, thrust=thrust, target_system=self._setup.system,
            target_component=AUTOPILOT_COMPONENT, type_mask=RATES_AND_THRUST,
        )  # fmt: skip

    def _at(self, now_s: float, target: Target) -> SetPositionTargetLocalNed:
        """Yaw from x towards y, z up, is from north towards west: it changes its sign."""
        x, y, z = frames.flip_vector(target.position_world_m)
        vx, vy, vz = frames.flip_vector(target.velocity_world_m_s)
        ax, ay, az = frames.flip_vector(target.acceleration_world_m_s2)
        return SetPositionTargetLocalNed(
            time_boot_ms=round(now_s * 1e3) & 0xFFFFFFFF, x=x, y=y, z=z, vx=vx, vy=vy, vz=vz, afx=ax, afy=ay, afz=az,
            yaw=-target.yaw_rad, yaw_rate=-target.yaw_rate_rad_s, type_mask=EVERYTHING, coordinate_frame=LOCAL_NED,
            target_system=self._setup.system, target_component=AUTOPILOT_COMPONENT,
        )  # fmt: skip

    def _mind_the_pilot(self, stage: Stage) -> None:
        """His switch ends us before it is armed too."""
        self._was_ours |= stage is Stage.FOLLOWING and self.ours
        self.state.left |= self._was_ours and not self.ours and not self.state.armed

    def _arm_or_disarm(self, now_s: float, stage: Stage) -> None:
        """Whatever it says of arming, a request to arm is undone: what it says may be older."""
        undoes = stage is Stage.DOWN and self._asked_to_arm and self._undone_s > now_s
        if now_s - self._armed_s < ARM_S and not undoes:
            return
        self._armed_s = now_s
        if stage is Stage.DOWN and (self.state.armed or not self.state.arming_told):
            self._undone_s = min(self._undone_s, now_s)
            self._ask(ARM_DISARM, 0.0)
        if stage is Stage.FOLLOWING and self._setup.arms and not self.state.armed and not self.state.left:
            if self.ours:
                self._asked_to_arm, self.state.arming_told = True, False
                self._ask(ARM_DISARM, 1.0)
            else:
                self._ask(DO_SET_MODE, CUSTOM_MODE, float(self._setup.mode_in_command))

    def _ask_for_messages(self, now_s: float) -> None:
        if now_s - self._asked_s < ASK_S:
            return
        self._asked_s = now_s
        for message_id, rate_hz in INTERVALS_HZ.items():
            if now_s - self._came_s.get(message_id, -np.inf) > max(_SILENT_S, _LATE_PERIODS / rate_hz):
                self._ask(SET_MESSAGE_INTERVAL, float(message_id), round(1e6 / rate_hz))

    def _ask(self, command: int, param1: float, param2: float = 0.0) -> None:
        self._line.send(
            CommandLong(
                param1=param1, param2=param2, command=command, target_system=self._setup.system,
                target_component=AUTOPILOT_COMPONENT,
            )
        )  # fmt: skip

    def _take(self, message: Message, now_s: float) -> None:
        state = self.state
        if isinstance(message, Heartbeat):
            state.armed, self._mode = bool(message.base_mode & ARMED), message.custom_mode
            state.arming_told |= now_s > self._undone_s + _ON_ITS_WAY_S
            state.overriding = self.ours
        elif isinstance(message, CurrentMode):
            self._mode = message.custom_mode
            state.overriding = self.ours
        elif isinstance(message, AttitudeQuaternion):
            q = frames.flip_attitude(np.array([message.q1, message.q2, message.q3, message.q4]))
            state.roll_pitch_rad, state.attitude_s = np.array(roll_pitch_yaw(q)[:2]), now_s
            if self._frame is not None:
                self._frame.attitude(now_s, q)
        elif isinstance(message, LocalPositionNed):
            self._take_height(-message.z, now_s)
            if self._frame is not None:
                self._frame.position(now_s, frames.flip_vector(np.array([message.x, message.y, message.z])))
            state.climb_m_s = -message.vz
            state.has_barometer = True  # its estimate of the height has at least one
        elif isinstance(message, ServoOutputRaw) and message.port == 0:
            outputs = (message.servo1_raw, message.servo2_raw, message.servo3_raw, message.servo4_raw)
            state.motors = np.clip((np.array(outputs) - 1000.0) / 1000.0, 0.0, 1.0)
        else:
            self._take_health(message, now_s)

    def _take_height(self, altitude_m: float, now_s: float) -> None:
        """Above where it was armed: the estimator's origin may be anywhere."""
        state = self.state
        if altitude_m != self._altitude_m:
            state.altitude_changed_s = now_s
        if not state.armed:
            self._ground_m = altitude_m
        self._altitude_m, state.altitude_m, state.altitude_s = altitude_m, altitude_m - self._ground_m, now_s

    def _take_health(self, message: Message, now_s: float) -> None:
        state = self.state
        if isinstance(message, SysStatus):
            used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
            state.arming_flags = int(bool(used & ~message.onboard_control_sensors_health & _PREARM))
            known = message.voltage_battery != _UNKNOWN_MV
            state.battery_v = 1e-3 * message.voltage_battery if known else 0.0
        elif isinstance(message, BatteryStatus):
            state.battery_alert = _ALERTS.get(message.charge_state, Alert.NONE)
        elif isinstance(message, CommandAck) and message.command in (ARM_DISARM, DO_SET_MODE, SET_MESSAGE_INTERVAL):
            self._refused[message.command] = refusal(message.command, message.result)
        elif isinstance(message, Statustext) and message.severity <= _ERROR:
            self._texts.append((now_s, message.text))
