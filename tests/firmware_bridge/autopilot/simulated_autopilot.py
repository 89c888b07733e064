"""A simulated autopilot: not PX4, not ArduPilot, but what their documents say they do at the line, on a body of ours.

It speaks by pymavlink, which shares no code with the bridge; it arms, changes modes, refuses, and fails safe by its own
parameters; its inner loop follows body rates and thrust. It answers in real time until a guard keeps time with it, and
from there in lock step.
"""

import contextlib
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

import vehicle
from firmware_bridge.offboard import clock
from firmware_bridge.offboard.poses import Pose, tum_line
from flight import rotations
from tests.firmware_bridge.autopilot.simulated_loops import SimulatedPositionLoops

STEP_S = 2e-3
IDLE = 0.03
"""Other than the bridge thinks: it cannot know."""
PX4_OFFBOARD, PX4_HOLD, PX4_LAND, PX4_POSITION = 6 << 16, (4 << 16) | (3 << 24), (4 << 16) | (6 << 24), 3 << 16
GUIDED, LAND, STABILIZE, LOITER = 4, 9, 0, 5
FLIP = np.array([1.0, -1.0, -1.0])
PARAMETERS = {
    "px4": {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 4, "MPC_THR_HOVER": 0.5, "THR_MDL_FAC": 0.0,
            "MC_ROLLRATE_MAX": 600.0, "MC_PITCHRATE_MAX": 600.0, "MC_YAWRATE_MAX": 300.0, "MPC_XY_VEL_MAX": 12.0,
            "MPC_Z_VEL_MAX_UP": 3.0, "MPC_Z_VEL_MAX_DN": 1.5, "MPC_TILTMAX_AIR": 45.0},
    "ardupilot": {"GUID_TIMEOUT": 0.5, "GUID_OPTIONS": 8, "FS_GCS_ENABLE": 5, "FS_GCS_TIMEOUT": 5.0, "SYSID_MYGCS": 255,
                  "MOT_THST_HOVER": 0.3, "ATC_ANGLE_BOOST": 0, "ATC_RATE_R_MAX": 0.0, "ATC_RATE_P_MAX": 0.0,
                  "ATC_RATE_Y_MAX": 0.0, "WPNAV_SPEED": 1000.0, "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0,
                  "WPNAV_ACCEL": 500.0, "WPNAV_ACCEL_Z": 100.0, "ANGLE_MAX": 3000, "PSC_ANGLE_MAX": 0.0},
}  # fmt: skip


@dataclass
class SimulatedAutopilot:
    """One vehicle; `run` until its guard is gone and it is disarmed."""

    plant: vehicle.simulate.Plant
    kind: str = "px4"
    parameters: dict[str, float] = field(default_factory=dict)
    prearm: str = ""
    """Why it does not arm."""
    pose_delay_s: float = 0.01
    seed: int = 0
    each_step: Callable[["SimulatedAutopilot"], None] | None = None
    change_pose: Callable[[float, Pose], Pose | None] | None = None
    time_s: float = 1.0
    mode: int = -1
    armed: bool = False
    port: int = 0
    clock_port: int = 0
    given_up: bool = False
    fastest_down_m_s: float = 0.0
    charge_state: int = 1
    said: list[str] = field(default_factory=list)
    """Texts and results that were sent."""
    way: list[tuple[float, np.ndarray]] = field(default_factory=list)
    disarmed_high: bool = False
    origin: tuple[int, int, int] | None = None
    visions: list[tuple[float, float, float]] = field(default_factory=list)
    """x, y, z of VISION_POSITION_ESTIMATE."""
    setpoints: int = 0
    frame_off_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    frame_turned_rad: float = 0.0
    """Of its local frame from that of the poses, z up: turned about z, then moved."""
    compass_off_rad: float = 0.0
    """Of its heading alone, in that frame."""
    targets: int = 0
    """SET_POSITION_TARGET_LOCAL_NED that came."""

    def __post_init__(self) -> None:
        self.parameters = PARAMETERS[self.kind] | self.parameters
        self.mode = self.mode if self.mode >= 0 else (PX4_HOLD if self.kind == "px4" else STABILIZE)
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._mav.robust_parsing = True
        self._socket = socket.socket(type=socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.port = self._socket.getsockname()[1]
        self._server = socket.create_server(("127.0.0.1", 0))
        self.clock_port = self._server.getsockname()[1]
        self._peer: tuple[str, int] | None = None
        self._intervals: dict[int, float] = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
        self._due: dict[int, float] = {}
        self._rates_flu, self._thrust, self._setpoint_s, self._gcs_s = np.zeros(3), 0.0, -np.inf, -np.inf
        self._integral, self._ground_s, self._still_s = np.zeros(3), 0.0, 0.0
        self._target: mavlink.MAVLink_set_position_target_local_ned_message | None = None
        self._loops = SimulatedPositionLoops(self.plant.vehicle)
        self._rng = np.random.default_rng(self.seed)
        self._mix()

    @property
    def address(self) -> str:
        return f"mavlink:udp://127.0.0.1:{self.port}"

    def _mix(self) -> None:
        """Squared rotor speeds for a torque, at hover; and the speed at which all rotors carry a force."""
        model = self.plant.vehicle
        full = model.limits.rotor_speed_max_rad_s
        self.full_rad_s = full

        def wrench(squared: np.ndarray) -> np.ndarray:
            force, torque = vehicle.wrench(model, np.zeros((1, 3)), np.zeros((1, 3)), np.sqrt(squared)[None, :])
            return np.concatenate([force[0, 2:], torque[0]])

        rotors = model.rotors
        hover = np.full(rotors, (0.5 * full) ** 2)
        step = 1e-3 * hover[0]
        columns = [(wrench(hover + step * np.eye(rotors)[i]) - wrench(hover)) / step for i in range(rotors)]
        self._squared = np.linalg.pinv(np.array(columns).T)
        self._full_n = float(wrench(np.full(rotors, full**2))[0])
        self._inertia = np.diag([model.value(f"inertia_{axis}_kg_m2") for axis in ("xx", "yy", "zz")])

    # the line

    def _send(self, message: mavlink.MAVLink_message) -> None:
        if self._peer is not None:
            self._socket.sendto(message.pack(self._mav), self._peer)

    def text(self, severity: int, said: str) -> None:
        self.said.append(said)
        self._send(self._mav.statustext_encode(severity, said.encode()))

    def _receive(self) -> None:
        while True:
            try:
                data, self._peer = self._socket.recvfrom(65536)
            except BlockingIOError:
                return
            for message in self._mav.parse_buffer(data) or ():
                handler = getattr(self, f"_on_{message.get_type().lower()}", None)
                if handler is not None:
                    handler(message)

    def _on_heartbeat(self, message: mavlink.MAVLink_heartbeat_message) -> None:
        if message.get_srcSystem() == self.parameters.get("SYSID_MYGCS", -1):
            self._gcs_s = self.time_s

    def _on_param_request_read(self, message: mavlink.MAVLink_param_request_read_message) -> None:
        value = self.parameters.get(message.param_id)
        if value is None or message.target_system != 1:
            return
        whole = isinstance(value, int)
        if whole and self.kind == "px4":  # the bits of the integer
            (value,) = struct.unpack("<f", struct.pack("<i", value))
        kind = mavlink.MAV_PARAM_TYPE_INT32 if whole else mavlink.MAV_PARAM_TYPE_REAL32
        self._send(self._mav.param_value_encode(message.param_id.encode(), value, kind, 100, 0))

    def _on_set_gps_global_origin(self, message: mavlink.MAVLink_set_gps_global_origin_message) -> None:
        self.origin = (message.latitude, message.longitude, message.altitude)

    def _on_vision_position_estimate(self, message: mavlink.MAVLink_vision_position_estimate_message) -> None:
        self.visions.append((message.x, message.y, message.z))

    def _on_set_attitude_target(self, message: mavlink.MAVLink_set_attitude_target_message) -> None:
        assert message.target_system == 1
        assert message.type_mask == mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
        self.setpoints += 1
        frd = np.array([message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate])
        self._rates_flu, self._thrust, self._setpoint_s = FLIP * frd, float(message.thrust), self.time_s
        self._target = None

    def _on_set_position_target_local_ned(self, message: mavlink.MAVLink_set_position_target_local_ned_message) -> None:
        assert (message.target_system, message.coordinate_frame, message.type_mask) == (
            1, mavlink.MAV_FRAME_LOCAL_NED, 0
        )  # fmt: skip
        self.targets += 1
        self._target, self._setpoint_s, self._thrust = message, self.time_s, 0.5

    def _on_command_long(self, message: mavlink.MAVLink_command_long_message) -> None:
        done = mavlink.MAV_RESULT_ACCEPTED
        if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self._intervals[int(message.param1)] = 1e-6 * message.param2
        elif message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            self._send_requested(int(message.param1))
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            done = self._asked_mode(int(message.param2))
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            done = self._asked_to_arm() if message.param1 == 1.0 else self._asked_to_disarm()
        else:
            done = mavlink.MAV_RESULT_UNSUPPORTED
        self.said.append(f"{message.command}: {done}")
        self._send(self._mav.command_ack_encode(message.command, done))

    def _send_requested(self, message_id: int) -> None:
        if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            version = (1 << 24) | (15 << 16) | (2 << 8)
            self._send(self._mav.autopilot_version_encode(0, version, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0))
        elif message_id == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN and self.origin is not None:
            self._send(self._mav.gps_global_origin_encode(*self.origin))

    # what it decides

    @property
    def estimate(self) -> vehicle.simulate.State:
        """Where it believes to be, in its local frame, z up; without noise."""
        turn, plant = rotations.from_yaw(self.frame_turned_rad), self.plant
        heading = rotations.from_yaw(self.frame_turned_rad + self.compass_off_rad)
        return vehicle.simulate.State(
            position_world_m=rotations.rotate(turn, plant.position_world_m) + self.frame_off_m,
            velocity_world_m_s=rotations.rotate(turn, plant.velocity_world_m_s),
            q_world_body=rotations.multiply(heading, plant.q_world_body),
        )

    @property
    def follows(self) -> bool:
        return self.mode == (PX4_OFFBOARD if self.kind == "px4" else GUIDED)

    def _asked_mode(self, mode: int) -> int:
        if self.kind == "px4":
            if mode != PX4_OFFBOARD >> 16:
                return mavlink.MAV_RESULT_DENIED
            if self.time_s - self._setpoint_s > self.parameters["COM_OF_LOSS_T"]:
                return mavlink.MAV_RESULT_TEMPORARILY_REJECTED  # no set-points stream yet
            self.mode = PX4_OFFBOARD
        else:
            self.mode = mode
        return mavlink.MAV_RESULT_ACCEPTED

    def _asked_to_arm(self) -> int:
        if self.prearm:
            self.text(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {self.prearm}")
            return mavlink.MAV_RESULT_TEMPORARILY_REJECTED if self.kind == "px4" else mavlink.MAV_RESULT_FAILED
        self.armed = True
        return mavlink.MAV_RESULT_ACCEPTED

    def _asked_to_disarm(self) -> int:
        if self.armed and self._ground_s < 0.5:
            return mavlink.MAV_RESULT_DENIED
        self.armed = False
        return mavlink.MAV_RESULT_ACCEPTED

    def _fail_safe(self) -> None:
        if not (self.armed and self.follows):
            return
        if self.kind == "px4" and self.time_s - self._setpoint_s > self.parameters["COM_OF_LOSS_T"]:
            self.mode = PX4_LAND
        elif self.kind == "ardupilot" and self.time_s - self._gcs_s > self.parameters["FS_GCS_TIMEOUT"]:
            self.mode = LAND

    def _asked_for(self) -> tuple[np.ndarray, float]:
        """Body rates and force."""
        timed_out = self.time_s - self._setpoint_s > self.parameters.get("GUID_TIMEOUT", np.inf)
        if self.follows and not timed_out:
            if self._target is not None:
                return self._loops.rates_and_force(self.estimate, self._target)
            self._loops.reset()
            return self._rates_flu, self._force_n(self._thrust)
        climb_m_s = -0.7 if self.mode in (PX4_LAND, LAND) else 0.0
        up = rotations.matrix(self.plant.q_world_body)[2]
        rates = 6.0 * np.array([-up[1], up[0], 0.0])
        model = self.plant.vehicle
        short = climb_m_s - float(self.plant.velocity_world_m_s[2])
        return rates, model.mass_kg * (model.gravity_m_s2 + 3.0 * short) / max(float(up[2]), 0.5)

    def _force_n(self, thrust: float) -> float:
        if self.kind == "ardupilot":
            return thrust * self._full_n
        return (IDLE + (1.0 - IDLE) * thrust) ** 2 * self._full_n

    def _rotor_speeds(self) -> np.ndarray:
        if not self.armed:
            self._integral[:] = 0.0
            return np.zeros(self.plant.vehicle.rotors)
        rates, force_n = self._asked_for()
        if self.follows and self._thrust <= 0.0:
            return np.full(self.plant.vehicle.rotors, IDLE * self.full_rad_s)
        rate = self.plant.rate_body_rad_s
        self._integral += 2.0 * (rates - rate) * STEP_S
        torque = self._inertia @ (25.0 * (rates - rate) + self._integral) + np.cross(rate, self._inertia @ rate)
        collective = np.full(len(self._squared), max(force_n, 0.0) / self._full_n * self.full_rad_s**2)
        squared = collective + self._squared @ np.array([0.0, *torque])
        return np.sqrt(np.clip(squared, (IDLE * self.full_rad_s) ** 2, self.full_rad_s**2))

    # time

    def run(self, *, longest_s: float = 200.0) -> None:
        guard = self._met()
        (pose_port,) = struct.unpack("<H", guard.recv(2, socket.MSG_WAITALL))
        poses, late, steps = socket.socket(type=socket.SOCK_DGRAM), deque[tuple[float, Pose]](), 0
        wakes_s = clock.asked_until(guard)
        with guard, poses:
            while self.time_s < longest_s and (wakes_s is not None or self.armed):
                if self.each_step is not None:
                    self.each_step(self)
                if steps % 5 == 0:
                    self._see(late)
                while late and late[0][0] <= self.time_s:
                    poses.sendto(tum_line(late.popleft()[1]), ("127.0.0.1", pose_port))
                self._receive()
                self._stream()
                while wakes_s is not None and wakes_s <= self.time_s + 1e-9:
                    clock.wake(guard, self.time_s)
                    wakes_s = clock.asked_until(guard)
                self._receive()
                self._step()
                steps += 1

    def _met(self) -> socket.socket:
        begun_s, base_s = time.monotonic(), self.time_s
        while not self.given_up:
            if self._server in select.select([self._server, self._socket], [], [], 0.05)[0]:
                guard = self._server.accept()[0]
                self._server.close()
                return guard
            self._receive()
            self.time_s = base_s + time.monotonic() - begun_s
            self._stream()
        raise RuntimeError("given up before it began")

    def _see(self, late: deque[tuple[float, Pose]]) -> None:
        turned = rotations.exp(0.001 * self._rng.standard_normal(3))
        position = self.plant.position_world_m + 0.0005 * self._rng.standard_normal(3)
        pose: Pose | None = Pose(self.time_s, position, rotations.multiply(self.plant.q_world_body, turned))
        pose = self.change_pose(self.time_s, pose) if self.change_pose is not None else pose
        if pose is not None:
            late.append((self.time_s + self.pose_delay_s, pose))

    def _step(self) -> None:
        self._fail_safe()
        before_m_s, was_armed = float(self.plant.velocity_world_m_s[2]), self.armed
        self.plant.step(self._rotor_speeds(), STEP_S)
        if before_m_s < -0.05 and float(self.plant.velocity_world_m_s[2]) > 0.5 * before_m_s:
            self.fastest_down_m_s = max(self.fastest_down_m_s, -before_m_s)
        low = self.plant.position_world_m[2] < 0.1 and abs(self.plant.velocity_world_m_s[2]) < 0.1
        self._ground_s = self._ground_s + STEP_S if low else 0.0
        if self.mode in (PX4_LAND, LAND) and self._ground_s > 1.0:
            self.armed = False
        self.disarmed_high |= was_armed and not self.armed and bool(self.plant.position_world_m[2] > 0.2)
        self.time_s += STEP_S
        self.way.append((self.time_s, self.plant.position_world_m.copy()))

    def _stream(self) -> None:
        for message_id, period_s in self._intervals.items():
            if self.time_s >= self._due.get(message_id, -np.inf):
                self._due[message_id] = self.time_s + period_s
                if (message := self._message(message_id)) is not None:
                    self._send(message)

    def _message(self, message_id: int) -> mavlink.MAVLink_message | None:
        m, plant, ms = self._mav, self.plant, int(1e3 * self.time_s) & 0xFFFFFFFF
        ids = mavlink
        if message_id == ids.MAVLINK_MSG_ID_HEARTBEAT:
            autopilot = ids.MAV_AUTOPILOT_PX4 if self.kind == "px4" else ids.MAV_AUTOPILOT_ARDUPILOTMEGA
            kind = {4: ids.MAV_TYPE_QUADROTOR, 6: ids.MAV_TYPE_HEXAROTOR}[plant.vehicle.rotors]
            return m.heartbeat_encode(kind, autopilot, 1 | (128 if self.armed else 0), self.mode, 4)
        if message_id == ids.MAVLINK_MSG_ID_ATTITUDE_QUATERNION:
            w, x, y, z = self.estimate.q_world_body
            return m.attitude_quaternion_encode(ms, w, x, -y, -z, *(FLIP * plant.rate_body_rad_s))
        if message_id == ids.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            noise_m = 0.02 * float(self._rng.standard_normal())
            own = self.estimate
            place = FLIP * own.position_world_m + np.array([0.0, 0.0, noise_m])
            return m.local_position_ned_encode(ms, *place, *(FLIP * own.velocity_world_m_s))
        if message_id == ids.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW:
            us = np.rint(1000.0 + 1000.0 * plant.rotor_speed_rad_s / self.full_rad_s).astype(int)
            return m.servo_output_raw_encode(ms, 0, *us.tolist(), *[0] * (8 - len(us)))
        if message_id == ids.MAVLINK_MSG_ID_SYS_STATUS:
            bit = ids.MAV_SYS_STATUS_PREARM_CHECK
            return m.sys_status_encode(bit, bit, 0 if self.prearm else bit, 0, 16200, -1, -1, 0, 0, 0, 0, 0, 0)
        if message_id == ids.MAVLINK_MSG_ID_BATTERY_STATUS:
            volts = [4050] * 4 + [65535] * 6
            return m.battery_status_encode(0, 0, 1, 32767, volts, -1, -1, -1, -1, 0, self.charge_state)
        return None

    def close(self) -> None:
        self._socket.close()
        with contextlib.suppress(OSError):
            self._server.close()
