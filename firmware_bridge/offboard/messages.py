"""What planner and guard tell each other, over a socket that keeps messages apart and shows when one of them dies."""

import json
import struct
from dataclasses import asdict, dataclass, field

import numpy as np

from firmware_bridge.offboard.firmware import Alert
from firmware_bridge.offboard.ladder import Reason, Stage, Wish
from firmware_bridge.offboard.poses import Pose
from firmware_bridge.offboard.rate_profile import RateProfile
from firmware_bridge.offboard.thrust_map import ThrustMap
from flight import FloatArray

_COMMAND, _TARGET = struct.Struct("<6dB"), struct.Struct("<11d")
_STATUS = struct.Struct("<3B?3d4dI3B2?")
_POSE = struct.Struct("<8d")
MOST_POSES = 64
"""In one status; older ones are not told."""
_MOST_SAID = 1000
"""Bytes."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What a guard is started with."""

    address: str
    """Of the flight controller."""
    pose_host: str
    pose_port: int
    pose_delay_s: float
    profile: RateProfile
    thrust: ThrustMap
    mass_kg: float
    gravity_m_s2: float
    by_msp_alone: bool
    arm_channel: int
    arm_us: int
    """Pulse that arms."""
    period_s: float = 0.004
    clock_port: int = 0
    """Of a simulated body; 0: the machine's clock."""

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "Setup":
        values = json.loads(text)
        profile = RateProfile(tuple(values["profile"]["largest_rad_s"]), values["profile"]["throttle_from_us"])
        thrust = ThrustMap(**{**values["thrust"], "coefficients_n": tuple(values["thrust"]["coefficients_n"])})
        return Setup(**{**values, "profile": profile, "thrust": thrust})


@dataclass(frozen=True, slots=True)
class Target:
    """A set-point, for firmware with position loops of its own."""

    position_world_m: FloatArray
    velocity_world_m_s: FloatArray
    acceleration_world_m_s2: FloatArray
    """(3,) each."""
    yaw_rad: float
    yaw_rate_rad_s: float

    def pack(self) -> bytes:
        moves = (*self.position_world_m, *self.velocity_world_m_s, *self.acceleration_world_m_s2)
        return _TARGET.pack(*moves, self.yaw_rad, self.yaw_rate_rad_s)

    @staticmethod
    def unpack(data: bytes) -> "Target | None":
        """None unless it is one, of finite numbers."""
        if len(data) != _TARGET.size:
            return None
        values = np.array(_TARGET.unpack(data))
        if not np.isfinite(values).all():
            return None
        return Target(values[:3], values[3:6], values[6:9], float(values[9]), float(values[10]))


@dataclass(frozen=True, slots=True)
class PlannerCommand:
    """From the planner, one for every status."""

    time_s: float
    pose_s: float
    force_n: float
    rate_body_rad_s: FloatArray
    wish: Wish
    target: Target | None = None
    """On the way of a plan."""

    def pack(self) -> bytes:
        own = _COMMAND.pack(self.time_s, self.pose_s, self.force_n, *self.rate_body_rad_s, self.wish)
        return own + (self.target.pack() if self.target is not None else b"")

    @staticmethod
    def unpack(data: bytes) -> "PlannerCommand | None":
        """None unless it is one, of finite numbers; only a pose that there was not is minus infinity old."""
        if len(data) not in (_COMMAND.size, _COMMAND.size + _TARGET.size):
            return None
        time_s, pose_s, force_n, x, y, z, wish = _COMMAND.unpack_from(data)
        rate = np.array([x, y, z])
        dated = np.isfinite(pose_s) or pose_s == -np.inf
        if not (dated and np.isfinite([time_s, force_n, x, y, z]).all() and wish <= Wish.KILL):
            return None
        return PlannerCommand(time_s, pose_s, force_n, rate, Wish(wish), Target.unpack(data[_COMMAND.size :]))


@dataclass(frozen=True, slots=True)
class GuardStatus:
    """From the guard, every tick."""

    stage: Stage
    reason: Reason
    armed: bool
    sticks_ours: bool
    time_s: float
    heard_s: float
    """When the firmware answered last."""
    battery_v: float
    motors: FloatArray = field(default_factory=lambda: np.full(4, np.nan))
    arming_flags: int = 0
    poses: tuple[Pose, ...] = ()
    """That have come since the last status."""
    other_mode: int = 0
    """Permanent id of a mode that is on and changes what sticks mean; 0: none."""
    battery_alert: Alert = Alert.NONE
    said: str = ""
    """By the firmware: why it does not arm."""
    by_targets: bool = False
    """Its own position loops fly, by the planner's target: force and rates were not sent."""
    apart: str = ""
    """Why it cannot be told, or is told no more, where to be."""
    other_clock: bool = False
    """The poses are stamped by a clock that is not ours."""

    def pack(self) -> bytes:
        poses = self.poses[-MOST_POSES:]
        head = _STATUS.pack(
            self.stage, self.reason, self.armed, self.sticks_ours, self.time_s, self.heard_s, self.battery_v,
            *self.motors, self.arming_flags, self.other_mode, self.battery_alert, len(poses), self.by_targets,
            self.other_clock,
        )  # fmt: skip
        rows = b"".join(_POSE.pack(p.time_s, *p.position_world_m, *p.q_world_body) for p in poses)
        return head + rows + b"\0".join(text.encode()[:_MOST_SAID] for text in (self.said, self.apart))

    @staticmethod
    def unpack(data: bytes) -> "GuardStatus":
        stage, reason, armed, ours, time_s, heard_s, battery_v, *more = _STATUS.unpack_from(data)
        rows = [_POSE.unpack_from(data, _STATUS.size + i * _POSE.size) for i in range(more[7])]
        texts = data[_STATUS.size + len(rows) * _POSE.size :].decode(errors="replace")
        said, _, apart = texts.partition("\0")
        poses = tuple(Pose(row[0], np.array(row[1:4]), np.array(row[4:])) for row in rows)
        return GuardStatus(
            Stage(stage), Reason(reason), bool(armed), ours, time_s, heard_s, battery_v, np.array(more[:4]), more[4],
            poses, more[5], Alert(more[6]), said, more[8], apart, more[9],
        )  # fmt: skip
