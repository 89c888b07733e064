"""Written by dialect/generate.py from goshawk.xml; do not edit."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

from firmware_bridge.dialect.message import Message


class Command(IntEnum):
    ARM = 0
    """Start the rotors at idle."""
    DISARM = 1
    """Stop the rotors; refused in the air. Leads out of a fault."""
    TAKE_OFF = 2
    """Climb by value (m), then hold."""
    START = 3
    """Fly the active trajectory; its id and CRC must match."""
    PAUSE = 4
    """Slow down along the trajectory and stand on it."""
    RESUME = 5
    """Continue a paused trajectory."""
    HOLD = 6
    """Leave the trajectory and hover."""
    LAND = 7
    """Brake along the path, then land straight down."""
    KILL = 8
    """Stop the rotors now, in the air too."""
    TIME_SCALE = 9
    """Fly the path at value (0.1 to 1) times its planned rate."""
    LOG_START = 100
    """Empty the on-board log and record."""
    LOG_STOP = 101
    """Stop recording; the log stays readable."""
    STATE_RATE = 102
    """Send GOSHAWK_STATE value times a second (0: never)."""


class MissionState(IntEnum):
    DISARMED = 0
    """rotors stopped"""
    ARMED = 1
    """rotors idle on the ground"""
    TAKE_OFF = 2
    """straight up"""
    HOLD = 3
    """hovers at a point"""
    APPROACH = 4
    """slides from the hover point to the start of the trajectory"""
    TRAJECTORY = 5
    """flies the active trajectory"""
    PAUSING = 6
    """slows down along the path to stand on it"""
    PAUSED = 7
    """stands on the path"""
    STOPPING = 8
    """slows down along the path, then holds"""
    ABORTING = 9
    """slows down along the path, then lands"""
    LANDING = 10
    """straight down until touchdown"""
    EMERGENCY = 11
    """position lost: level, sinking gently"""
    FAULT = 12
    """rotors stopped; only disarming leads out"""
    SHADOW = 13
    """another controller flies; this one computes and commands nothing"""


class LinkReason(IntEnum):
    NOT_IN_CONTROL = 70
    """another station holds control of the vehicle"""
    UNSUPPORTED = 71
    """this vehicle knows no such command"""
    OTHER_TRAJECTORY = 72
    """another trajectory is active"""
    NO_LOG_MEMORY = 73
    """this vehicle has no memory for a log"""
    SAMPLES_MISSING = 74
    """the check samples have not arrived"""


@dataclass(slots=True)
class Heartbeat(Message):
    """Sent at 1 Hz by everyone on the link."""

    ID: ClassVar[int] = 0
    CRC_EXTRA: ClassVar[int] = 50
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IBBBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)
    custom_mode: int = 0
    """PX4's main mode in byte 2 and sub mode in byte 3; of a generic autopilot the mission state."""
    type: int = 0
    """MAV_TYPE: 2 quadrotor, 6 ground station."""
    autopilot: int = 0
    """MAV_AUTOPILOT: 12 PX4 or 0 generic (tc_link_identity), 8 none (a ground station)."""
    base_mode: int = 0
    """MAV_MODE_FLAG: 128 armed, 8 guided, 1 custom mode."""
    system_status: int = 0
    """MAV_STATE: 3 standby, 4 active, 6 emergency."""
    mavlink_version: int = 0
    """3."""


@dataclass(slots=True)
class SysStatus(Message):
    """What the vehicle has, and whether it is well. Bits are MAV_SYS_STATUS_SENSOR."""

    ID: ClassVar[int] = 1
    CRC_EXTRA: ClassVar[int] = 124
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIIHHhHHHHHHbIII")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    onboard_control_sensors_present: int = 0
    """What there is."""
    onboard_control_sensors_enabled: int = 0
    """What is used."""
    onboard_control_sensors_health: int = 0
    """What is well; bit 28 (pre-arm check): arming would be accepted now."""
    load: int = 0
    """0, not measured."""
    voltage_battery: int = 0
    """mV; UINT16_MAX unknown."""
    current_battery: int = 0
    """-1, unknown."""
    drop_rate_comm: int = 0
    """0."""
    errors_comm: int = 0
    """0."""
    errors_count1: int = 0
    """0."""
    errors_count2: int = 0
    """0."""
    errors_count3: int = 0
    """0."""
    errors_count4: int = 0
    """0."""
    battery_remaining: int = 0
    """-1, unknown."""
    onboard_control_sensors_present_extended: int = 0
    """0."""
    onboard_control_sensors_enabled_extended: int = 0
    """0."""
    onboard_control_sensors_health_extended: int = 0
    """0."""


@dataclass(slots=True)
class Ping(Message):
    """A request (target 0, 0) is returned as it came, its target the one who asked. The vehicle's challenge: see docs/reference/link.md."""

    ID: ClassVar[int] = 4
    CRC_EXTRA: ClassVar[int] = 237
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<QIBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0)
    time_usec: int = 0
    """Returned as sent."""
    seq: int = 0
    """Returned as sent."""
    target_system: int = 0
    """0: a request to all; else an answer to this system."""
    target_component: int = 0
    """0: a request to all; else an answer to this component."""


@dataclass(slots=True)
class SetMode(Message):
    """Ask for a mode; the older form of MAV_CMD_DO_SET_MODE."""

    ID: ClassVar[int] = 11
    CRC_EXTRA: ClassVar[int] = 89
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0)
    custom_mode: int = 0
    """PX4's: main mode in byte 2, sub mode in byte 3."""
    target_system: int = 0
    """System asked."""
    base_mode: int = 0
    """MAV_MODE_FLAG: 1, the custom mode counts."""


@dataclass(slots=True)
class ParamRequestRead(Message):
    """Ask for one parameter by index or by name."""

    ID: ClassVar[int] = 20
    CRC_EXTRA: ClassVar[int] = 214
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<hBB16s")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, -1)
    param_index: int = 0
    """Index, or -1."""
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    param_id: str = ""
    """Name; counts when the index is -1."""


@dataclass(slots=True)
class ParamRequestList(Message):
    """Ask for all parameters."""

    ID: ClassVar[int] = 21
    CRC_EXTRA: ClassVar[int] = 159
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<BB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0)
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""


@dataclass(slots=True)
class ParamValue(Message):
    """One parameter."""

    ID: ClassVar[int] = 22
    CRC_EXTRA: ClassVar[int] = 220
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<fHH16sB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, -1, 0)
    param_value: float = 0.0
    """Value."""
    param_count: int = 0
    """How many there are."""
    param_index: int = 0
    """Which one this is."""
    param_id: str = ""
    """Name, zero-terminated unless 16 long."""
    param_type: int = 0
    """MAV_PARAM_TYPE: 9 real32."""


@dataclass(slots=True)
class ParamSet(Message):
    """Set one parameter. The answer is a PARAM_VALUE with what holds then: the old value if it was refused."""

    ID: ClassVar[int] = 23
    CRC_EXTRA: ClassVar[int] = 168
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<fBB16sB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, -1, 0)
    param_value: float = 0.0
    """Value."""
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    param_id: str = ""
    """Name, zero-terminated unless 16 long."""
    param_type: int = 0
    """MAV_PARAM_TYPE: 9 real32."""


@dataclass(slots=True)
class AttitudeQuaternion(Message):
    """Attitude, NED from FRD."""

    ID: ClassVar[int] = 31
    CRC_EXTRA: ClassVar[int] = 246
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Ifffffff4f")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 4)
    time_boot_ms: int = 0
    """Vehicle time."""
    q1: float = 0.0
    """w."""
    q2: float = 0.0
    """x."""
    q3: float = 0.0
    """y."""
    q4: float = 0.0
    """z."""
    rollspeed: float = 0.0
    """Rate about FRD x, rad/s."""
    pitchspeed: float = 0.0
    """Rate about FRD y, rad/s."""
    yawspeed: float = 0.0
    """Rate about FRD z, rad/s."""
    repr_offset_q: tuple[float, ...] = (0.0,) * 4
    """Unused."""


@dataclass(slots=True)
class LocalPositionNed(Message):
    """Position and velocity, NED."""

    ID: ClassVar[int] = 32
    CRC_EXTRA: ClassVar[int] = 185
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Iffffff")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0)
    time_boot_ms: int = 0
    """Vehicle time."""
    x: float = 0.0
    """North, m."""
    y: float = 0.0
    """East, m."""
    z: float = 0.0
    """Down, m."""
    vx: float = 0.0
    """m/s."""
    vy: float = 0.0
    """m/s."""
    vz: float = 0.0
    """m/s."""


@dataclass(slots=True)
class MissionRequestList(Message):
    """Ask for the mission, the fence or the rally points."""

    ID: ClassVar[int] = 43
    CRC_EXTRA: ClassVar[int] = 132
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<BBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0)
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    mission_type: int = 0
    """MAV_MISSION_TYPE: 0 mission, 1 fence, 2 rally points."""


@dataclass(slots=True)
class MissionCount(Message):
    """How many items there are: always none, as trajectories are not missions."""

    ID: ClassVar[int] = 44
    CRC_EXTRA: ClassVar[int] = 221
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<HBBBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0)
    count: int = 0
    """0."""
    target_system: int = 0
    """Who asked."""
    target_component: int = 0
    """Who asked."""
    mission_type: int = 0
    """As asked."""
    opaque_id: int = 0
    """0."""


@dataclass(slots=True)
class MissionAck(Message):
    """Answer to a station that wants to send a mission."""

    ID: ClassVar[int] = 47
    CRC_EXTRA: ClassVar[int] = 153
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<BBBBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0)
    target_system: int = 0
    """Who asked."""
    target_component: int = 0
    """Who asked."""
    type: int = 0
    """MAV_MISSION_RESULT: 3, unsupported."""
    mission_type: int = 0
    """As asked."""
    opaque_id: int = 0
    """0."""


@dataclass(slots=True)
class CommandInt(Message):
    """A command of the common set, with a position as integers."""

    ID: ClassVar[int] = 75
    CRC_EXTRA: ClassVar[int] = 158
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<ffffiifHBBBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    param1: float = 0.0
    """Parameter 1."""
    param2: float = 0.0
    """Parameter 2."""
    param3: float = 0.0
    """Parameter 3."""
    param4: float = 0.0
    """Parameter 4."""
    x: int = 0
    """Parameter 5; INT32_MAX none."""
    y: int = 0
    """Parameter 6; INT32_MAX none."""
    z: float = 0.0
    """Parameter 7."""
    command: int = 0
    """MAV_CMD."""
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    frame: int = 0
    """MAV_FRAME of the position."""
    current: int = 0
    """Unused."""
    autocontinue: int = 0
    """Unused."""


@dataclass(slots=True)
class CommandLong(Message):
    """A command of the common set."""

    ID: ClassVar[int] = 76
    CRC_EXTRA: ClassVar[int] = 152
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<fffffffHBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    param1: float = 0.0
    """Parameter 1."""
    param2: float = 0.0
    """Parameter 2."""
    param3: float = 0.0
    """Parameter 3."""
    param4: float = 0.0
    """Parameter 4."""
    param5: float = 0.0
    """Parameter 5."""
    param6: float = 0.0
    """Parameter 6."""
    param7: float = 0.0
    """Parameter 7."""
    command: int = 0
    """MAV_CMD."""
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    confirmation: int = 0
    """0 at first, then counts repeats."""


@dataclass(slots=True)
class CommandAck(Message):
    """Answer to COMMAND_LONG and COMMAND_INT."""

    ID: ClassVar[int] = 77
    CRC_EXTRA: ClassVar[int] = 143
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<HBBiBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)
    command: int = 0
    """MAV_CMD."""
    result: int = 0
    """MAV_RESULT: 0 accepted, 1 rejected for now (not in control), 2 denied, 3 unsupported."""
    progress: int = 0
    """Unused."""
    result_param2: int = 0
    """tc_reason or GOSHAWK_LINK_REASON."""
    target_system: int = 0
    """Who asked."""
    target_component: int = 0
    """Who asked."""


@dataclass(slots=True)
class Timesync(Message):
    """Clock comparison. A request has tc1 = 0; the answer carries the answerer's time there."""

    ID: ClassVar[int] = 111
    CRC_EXTRA: ClassVar[int] = 34
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<qqBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0)
    tc1: int = 0
    """Answerer's time, ns."""
    ts1: int = 0
    """Asker's time, ns, returned as sent."""
    target_system: int = 0
    """System asked; 0 all."""
    target_component: int = 0
    """Component asked; 0 all."""


@dataclass(slots=True)
class Altitude(Message):
    """Height. There is no sea level here: heights count from where the vehicle last stood."""

    ID: ClassVar[int] = 141
    CRC_EXTRA: ClassVar[int] = 47
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Qffffff")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0)
    time_usec: int = 0
    """Vehicle time."""
    altitude_monotonic: float = 0.0
    """World z, m."""
    altitude_amsl: float = 0.0
    """Above where it last stood, m."""
    altitude_local: float = 0.0
    """World z, m."""
    altitude_relative: float = 0.0
    """Above where it last stood, m."""
    altitude_terrain: float = 0.0
    """NaN, unknown."""
    bottom_clearance: float = 0.0
    """NaN, unknown."""


@dataclass(slots=True)
class BatteryStatus(Message):
    """Battery."""

    ID: ClassVar[int] = 147
    CRC_EXTRA: ClassVar[int] = 154
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<iih10HhBBBbiB4HBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0)
    current_consumed: int = 0
    """-1, unknown."""
    energy_consumed: int = 0
    """-1, unknown."""
    temperature: int = 0
    """INT16_MAX, unknown."""
    voltages: tuple[int, ...] = (0,) * 10
    """mV; UINT16_MAX where unused."""
    current_battery: int = 0
    """-1, unknown."""
    id: int = 0
    """0."""
    battery_function: int = 0
    """0."""
    type: int = 0
    """1, lithium polymer."""
    battery_remaining: int = 0
    """-1, unknown."""
    time_remaining: int = 0
    """0, unknown."""
    charge_state: int = 0
    """0, unknown."""
    voltages_ext: tuple[int, ...] = (0,) * 4
    """Unused."""
    mode: int = 0
    """0."""
    fault_bitmask: int = 0
    """0."""


@dataclass(slots=True)
class AutopilotVersion(Message):
    """Who the vehicle is."""

    ID: ClassVar[int] = 148
    CRC_EXTRA: ClassVar[int] = 178
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<QQIIIIHH8B8B8B18B")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 8, 8, 8, 18)
    capabilities: int = 0
    """MAV_PROTOCOL_CAPABILITY: 2 float parameters, 8 COMMAND_INT, 2048 termination, 8192 MAVLink 2."""
    uid: int = 0
    """Unique id of the vehicle."""
    flight_sw_version: int = 0
    """Version of the controller."""
    middleware_sw_version: int = 0
    """0."""
    os_sw_version: int = 0
    """0."""
    board_version: int = 0
    """0."""
    vendor_id: int = 0
    """0."""
    product_id: int = 0
    """0."""
    flight_custom_version: tuple[int, ...] = (0,) * 8
    """0."""
    middleware_custom_version: tuple[int, ...] = (0,) * 8
    """0."""
    os_custom_version: tuple[int, ...] = (0,) * 8
    """0."""
    uid2: tuple[int, ...] = (0,) * 18
    """0."""


@dataclass(slots=True)
class HomePosition(Message):
    """Where the vehicle last stood on the ground with its rotors idle or off."""

    ID: ClassVar[int] = 242
    CRC_EXTRA: ClassVar[int] = 104
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<iiifff4ffffQ")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 4, 0, 0, 0, 0)
    latitude: int = 0
    """0: there is no global position."""
    longitude: int = 0
    """0: there is no global position."""
    altitude: int = 0
    """0: there is no global position."""
    x: float = 0.0
    """North, m."""
    y: float = 0.0
    """East, m."""
    z: float = 0.0
    """Down, m."""
    q: tuple[float, ...] = (0.0,) * 4
    """Of the ground: level."""
    approach_x: float = 0.0
    """0."""
    approach_y: float = 0.0
    """0."""
    approach_z: float = 0.0
    """0."""
    time_usec: int = 0
    """Vehicle time."""


@dataclass(slots=True)
class ExtendedSysState(Message):
    """Whether the vehicle is on the ground."""

    ID: ClassVar[int] = 245
    CRC_EXTRA: ClassVar[int] = 130
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<BB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0)
    vtol_state: int = 0
    """0."""
    landed_state: int = 0
    """MAV_LANDED_STATE: 0 not known, 1 on the ground, 2 in the air, 3 taking off, 4 landing."""


@dataclass(slots=True)
class Statustext(Message):
    """A sentence for the pilot."""

    ID: ClassVar[int] = 253
    CRC_EXTRA: ClassVar[int] = 83
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<B50sHB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, -1, 0, 0)
    severity: int = 0
    """MAV_SEVERITY: 3 error, 4 warning, 6 info."""
    text: str = ""
    """Zero-terminated unless 50 long."""
    id: int = 0
    """0: the text is whole; else the same for all chunks of one text."""
    chunk_seq: int = 0
    """Which chunk."""


@dataclass(slots=True)
class EscStatus(Message):
    """Rotor speeds."""

    ID: ClassVar[int] = 291
    CRC_EXTRA: ClassVar[int] = 10
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Q4i4f4fB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 4, 4, 4, 0)
    time_usec: int = 0
    """Vehicle time."""
    rpm: tuple[int, ...] = (0,) * 4
    """Speed, rev/min."""
    voltage: tuple[float, ...] = (0.0,) * 4
    """V."""
    current: tuple[float, ...] = (0.0,) * 4
    """A; 0, unknown."""
    index: int = 0
    """First rotor of this message: 0."""


@dataclass(slots=True)
class ProtocolVersion(Message):
    """Which MAVLink is spoken: 2 only."""

    ID: ClassVar[int] = 300
    CRC_EXTRA: ClassVar[int] = 217
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<HHH8B8B")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 8, 8)
    version: int = 0
    """200."""
    min_version: int = 0
    """200."""
    max_version: int = 0
    """200."""
    spec_version_hash: tuple[int, ...] = (0,) * 8
    """0."""
    library_version_hash: tuple[int, ...] = (0,) * 8
    """0."""


@dataclass(slots=True)
class Odometry(Message):
    """Pose, velocity and rate in one message."""

    ID: ClassVar[int] = 331
    CRC_EXTRA: ClassVar[int] = 91
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Qfff4fffffff21f21fBBBBb")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 4, 0, 0, 0, 0, 0, 0, 21, 21, 0, 0, 0, 0, 0)
    time_usec: int = 0
    """Vehicle time."""
    x: float = 0.0
    """m."""
    y: float = 0.0
    """m."""
    z: float = 0.0
    """m."""
    q: tuple[float, ...] = (0.0,) * 4
    """w x y z, frame from child frame."""
    vx: float = 0.0
    """In the child frame, m/s."""
    vy: float = 0.0
    """In the child frame, m/s."""
    vz: float = 0.0
    """In the child frame, m/s."""
    rollspeed: float = 0.0
    """rad/s."""
    pitchspeed: float = 0.0
    """rad/s."""
    yawspeed: float = 0.0
    """rad/s."""
    pose_covariance: tuple[float, ...] = (0.0,) * 21
    """NaN first: unknown."""
    velocity_covariance: tuple[float, ...] = (0.0,) * 21
    """NaN first: unknown."""
    frame_id: int = 0
    """MAV_FRAME: 20, local FRD (any heading)."""
    child_frame_id: int = 0
    """MAV_FRAME: 12, body FRD."""
    reset_counter: int = 0
    """0."""
    estimator_type: int = 0
    """0, unknown."""
    quality: int = 0
    """0, unknown."""


@dataclass(slots=True)
class State(Message):
    """All a flight log needs of one instant; also the record of the on-board log."""

    ID: ClassVar[int] = 54000
    CRC_EXTRA: ClassVar[int] = 231
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Q3f3f4f3f3f4f4f3f3f4fffffffHBBBBBBBB3f3f3ff2fB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 3, 3, 4, 3, 3, 4, 4, 3, 3, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 3, 3, 0, 2, 0)
    time_us: int = 0
    """Vehicle time."""
    position_world_m: tuple[float, ...] = (0.0,) * 3
    """Estimate."""
    velocity_world_m_s: tuple[float, ...] = (0.0,) * 3
    """Estimate."""
    q_world_body: tuple[float, ...] = (0.0,) * 4
    """Estimate."""
    rate_body_rad_s: tuple[float, ...] = (0.0,) * 3
    """Gyroscope."""
    specific_force_body_m_s2: tuple[float, ...] = (0.0,) * 3
    """Accelerometer."""
    rotor_speed_rad_s: tuple[float, ...] = (0.0,) * 4
    """Measured."""
    rotor_speed_command_rad_s: tuple[float, ...] = (0.0,) * 4
    """Asked of the motors."""
    setpoint_position_world_m: tuple[float, ...] = (0.0,) * 3
    """Reference."""
    setpoint_velocity_world_m_s: tuple[float, ...] = (0.0,) * 3
    """Reference."""
    setpoint_q_world_body: tuple[float, ...] = (0.0,) * 4
    """Attitude the controller steers to."""
    battery_v: float = 0.0
    """Measured."""
    trajectory_time_s: float = 0.0
    """Time along the active trajectory; negative when none is being flown."""
    path_rate: float = 0.0
    """1 as planned, 0 standing on the path."""
    path_limit: float = 0.0
    """What the supervisor leaves of the rate asked for, 0 to 1."""
    reckoning_s: float = 0.0
    """How long position has been dead reckoned; 0 measured."""
    reckoning_std_m: float = 0.0
    """Standard deviation that the horizontal position has grown to by that."""
    sequence: int = 0
    """Counts these messages, so that a receiver knows what it missed."""
    mission_state: int = 0
    """State of the mission."""
    reason: int = 0
    """tc_reason: why it is in that state."""
    limit_reason: int = 0
    """tc_reason: why path_limit is less than 1; 0 it is not."""
    warnings: int = 0
    """TC_WARNING_ bits."""
    landing_stage: int = 0
    """tc_landing_stage."""
    estimate_valid: int = 0
    """TC_VALID_ bits of the estimate."""
    estimate_faults: int = 0
    """What the controller found wrong with it: bits of tc_telemetry.estimate_faults."""
    saturation: int = 0
    """Bits of the mixer's saturation report."""
    disturbance_force_world_n: tuple[float, ...] = (0.0,) * 3
    """Of everything that is not modelled; zero where the observer does not run."""
    disturbance_torque_body_n_m: tuple[float, ...] = (0.0,) * 3
    """The same."""
    disturbance_torque_std_n_m: tuple[float, ...] = (0.0,) * 3
    """Standard deviation by the gyroscope's noise."""
    disturbance_force_std_n: float = 0.0
    """Standard deviation of one axis by the noise of accelerometer and pose."""
    pose_delay_s: tuple[float, ...] = (0.0,) * 2
    """Of position and attitude beyond their stamps."""
    observer_state: int = 0
    """tc_observer_state."""


@dataclass(slots=True)
class LogRequest(Message):
    """Ask for records of the on-board log; nothing wanted asks for GOSHAWK_LOG_INFO."""

    ID: ClassVar[int] = 54001
    CRC_EXTRA: ClassVar[int] = 126
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IBB64B")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 64)
    first: int = 0
    """Index of the first."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    wanted: tuple[int, ...] = (0,) * 64
    """Bit i % 8 of byte i / 8: record first + i is wanted."""


@dataclass(slots=True)
class LogInfo(Message):
    """What the on-board log holds."""

    ID: ClassVar[int] = 54002
    CRC_EXTRA: ClassVar[int] = 114
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIIIIB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)
    log_id: int = 0
    """Changes with every LOG_START."""
    records: int = 0
    """How many there are."""
    capacity: int = 0
    """How many fit."""
    not_stored: int = 0
    """Records that no longer fitted."""
    period_us: int = 0
    """Time between records."""
    running: int = 0
    """1 while recording."""


@dataclass(slots=True)
class LogRecord(Message):
    """One record."""

    ID: ClassVar[int] = 54003
    CRC_EXTRA: ClassVar[int] = 137
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<II227B")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 227)
    log_id: int = 0
    """Of GOSHAWK_LOG_INFO."""
    index: int = 0
    """Which record."""
    record: tuple[int, ...] = (0,) * 227
    """Payload of a GOSHAWK_STATE."""


@dataclass(slots=True)
class TrajectoryBegin(Message):
    """Opens (or re-opens) a transfer into the staging slot; also the header sent on read-back."""

    ID: ClassVar[int] = 54010
    CRC_EXTRA: ClassVar[int] = 54
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIIfHBBBBB8B8B24sI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 8, -1, 0)
    transfer_id: int = 0
    """Chosen by the sender, new for every upload; never 0."""
    trajectory_id: int = 0
    """Identity of the trajectory."""
    crc32: int = 0
    """tc_trajectory_crc32 (trajectory.h)."""
    clearance_m: float = 0.0
    """Proved by the planner: the tracking error at which the vehicle gives up; 0 not stated."""
    segments: int = 0
    """How many."""
    target_system: int = 0
    """Receiver."""
    target_component: int = 0
    """Receiver."""
    coefficient_count: int = 0
    """Per axis, at most 12; the others are zero."""
    link_loss_policy: int = 0
    """tc_link_loss_policy: 0 finish then hold, 1 hold, 2 land."""
    samples: int = 0
    """How many check samples come with it, at most 8."""
    map_hash: tuple[int, ...] = (0,) * 8
    """First bytes of the map's hash."""
    vehicle_hash: tuple[int, ...] = (0,) * 8
    """First bytes of the vehicle's hash."""
    name: str = ""
    """Zero-padded."""
    session: int = 0
    """Of the sender, as in its request for control."""


@dataclass(slots=True)
class TrajectorySegment(Message):
    """One polynomial segment in the centred variable s = 2 t / T - 1."""

    ID: ClassVar[int] = 54011
    CRC_EXTRA: ClassVar[int] = 103
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIHBB48f")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 48)
    transfer_id: int = 0
    """Of the transfer, or of the read-back."""
    duration_us: int = 0
    """T."""
    index: int = 0
    """Which segment."""
    target_system: int = 0
    """Receiver."""
    target_component: int = 0
    """Receiver."""
    coefficients: tuple[float, ...] = (0.0,) * 48
    """x, y, z (m), yaw (rad) of s^0, then of s^1, ... s^11. Last, so that zero ones are not sent."""


@dataclass(slots=True)
class TrajectoryStatus(Message):
    """Which segments of the transfer have arrived."""

    ID: ClassVar[int] = 54012
    CRC_EXTRA: ClassVar[int] = 86
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIHHHBB128B")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 128)
    transfer_id: int = 0
    """0: none is open."""
    frames: int = 0
    """How many frames of this transfer have arrived, repeats included."""
    received: int = 0
    """How many segments have arrived."""
    segments: int = 0
    """Of how many."""
    last_index: int = 0
    """Segment that arrived last."""
    reason: int = 0
    """0 done, else tc_reason or GOSHAWK_LINK_REASON."""
    samples: int = 0
    """1 when the check samples have arrived."""
    bitmap: tuple[int, ...] = (0,) * 128
    """Bit i % 8 of byte i / 8: segment i has arrived. Last, so that its zero end is not sent."""


@dataclass(slots=True)
class TrajectoryCommit(Message):
    """Check the staged trajectory and make it the active one."""

    ID: ClassVar[int] = 54013
    CRC_EXTRA: ClassVar[int] = 180
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIIBBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)
    transfer_id: int = 0
    """Of the transfer."""
    trajectory_id: int = 0
    """As in the beginning."""
    crc32: int = 0
    """As in the beginning."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    session: int = 0
    """Of the sender, as in its request for control."""


@dataclass(slots=True)
class TrajectoryResult(Message):
    """Answer to a commit; whatever the answer, what is active now."""

    ID: ClassVar[int] = 54014
    CRC_EXTRA: ClassVar[int] = 100
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIIHB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0)
    transfer_id: int = 0
    """Of the commit."""
    active_id: int = 0
    """Trajectory now active; 0 none."""
    active_crc32: int = 0
    """Its CRC."""
    segment: int = 0
    """Where the check failed."""
    reason: int = 0
    """0 done, else tc_reason or GOSHAWK_LINK_REASON."""


@dataclass(slots=True)
class TrajectoryRead(Message):
    """Ask for segments of the active trajectory; nothing wanted asks for its header."""

    ID: ClassVar[int] = 54015
    CRC_EXTRA: ClassVar[int] = 243
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IHBB64B")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 64)
    transfer_id: int = 0
    """Chosen by the asker; the answers carry it."""
    first: int = 0
    """Index of the first."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    wanted: tuple[int, ...] = (0,) * 64
    """Bit i % 8 of byte i / 8: segment first + i is wanted."""


@dataclass(slots=True)
class TrajectorySamples(Message):
    """Points of the curve as the planner evaluates it; the vehicle compares at the commit."""

    ID: ClassVar[int] = 54016
    CRC_EXTRA: ClassVar[int] = 180
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<I8I32fBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 8, 32, 0, 0)
    transfer_id: int = 0
    """Of the transfer."""
    sample_us: tuple[int, ...] = (0,) * 8
    """Time from the trajectory's start."""
    values: tuple[float, ...] = (0.0,) * 32
    """x, y, z (m), yaw (rad) of each."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""


@dataclass(slots=True)
class MissionCommand(Message):
    """An order to the mission. A repeated request_id is answered again and not carried out again."""

    ID: ClassVar[int] = 54020
    CRC_EXTRA: ClassVar[int] = 90
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIIfBBBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0)
    request_id: int = 0
    """New for every order; never 0."""
    trajectory_id: int = 0
    """For START."""
    crc32: int = 0
    """For START."""
    value: float = 0.0
    """See GOSHAWK_COMMAND."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    command: int = 0
    """GOSHAWK_COMMAND."""
    session: int = 0
    """Of the sender, as in its request for control."""


@dataclass(slots=True)
class MissionResult(Message):
    """Answer to an order."""

    ID: ClassVar[int] = 54021
    CRC_EXTRA: ClassVar[int] = 206
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0)
    request_id: int = 0
    """Of the order."""
    command: int = 0
    """Of the order."""
    reason: int = 0
    """0 done, else tc_reason or GOSHAWK_LINK_REASON."""
    mission_state: int = 0
    """After it."""


@dataclass(slots=True)
class MissionStatus(Message):
    """Where the mission stands; sent at 5 Hz and on every change."""

    ID: ClassVar[int] = 54022
    CRC_EXTRA: ClassVar[int] = 71
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<QIIIffIIfBBBB8B8B24s")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 8, -1)
    time_us: int = 0
    """Vehicle time."""
    boot_id: int = 0
    """Changes with every restart."""
    active_id: int = 0
    """Trajectory now active; 0 none."""
    active_crc32: int = 0
    """Its CRC."""
    trajectory_time_s: float = 0.0
    """Negative when none is being flown."""
    trajectory_duration_s: float = 0.0
    """Of the active one."""
    frames_refused: int = 0
    """Since the start: unsigned, wrongly signed, replayed, from a stream not opened, beyond the budget, or damaged."""
    parameters_crc32: int = 0
    """Of the parameters in force."""
    path_rate: float = 0.0
    """1 as planned, 0 standing on the path."""
    mission_state: int = 0
    """State."""
    reason: int = 0
    """Why it is in that state."""
    operator_system: int = 0
    """Who holds the lease; 0 nobody."""
    operator_component: int = 0
    """Who holds the lease."""
    map_hash: tuple[int, ...] = (0,) * 8
    """Of the active trajectory."""
    vehicle_hash: tuple[int, ...] = (0,) * 8
    """Of the active trajectory."""
    name: str = ""
    """Of the active trajectory."""


@dataclass(slots=True)
class LeaseRequest(Message):
    """Take (or keep, or give back) control. The holder renews it; it ends 3 s after the last renewal."""

    ID: ClassVar[int] = 54030
    CRC_EXTRA: ClassVar[int] = 167
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IBBBII24s")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, -1)
    nonce: int = 0
    """Returned in the answer."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    action: int = 0
    """0 give back, 1 take if free or renew, 2 take over, 3 only ask and report."""
    session: int = 0
    """Drawn at random by every start of a station: the operator is known by it. 0: a standard station, known by its ids."""
    line_bytes_per_s: int = 0
    """What the line to this station was measured to carry; 0 no limit found."""
    name: str = ""
    """Of the station, for people; when it takes control."""


@dataclass(slots=True)
class LeaseStatus(Message):
    """Answer to a request."""

    ID: ClassVar[int] = 54031
    CRC_EXTRA: ClassVar[int] = 34
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIBBIB24s")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, -1)
    nonce: int = 0
    """Of the request."""
    left_ms: int = 0
    """Until it ends."""
    operator_system: int = 0
    """Holder; 0 nobody."""
    operator_component: int = 0
    """Holder."""
    operator_session: int = 0
    """Holder."""
    operator_link: int = 0
    """Link id of the holder's signatures; 0 unsigned."""
    operator_name: str = ""
    """Holder; sent when somebody else asks."""


@dataclass(slots=True)
class ParametersStage(Message):
    """Some values of a set that is to be applied as a whole; every value has to be sent."""

    ID: ClassVar[int] = 54040
    CRC_EXTRA: ClassVar[int] = 78
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<I48fBBBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 48, 0, 0, 0, 0)
    transfer_id: int = 0
    """New for every set; never 0."""
    values: tuple[float, ...] = (0.0,) * 48
    """In the order of the vehicle's table; behind its end ignored."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    group: int = 0
    """Values 48 group to 48 group + 47."""
    session: int = 0
    """Of the sender, as in its request for control."""


@dataclass(slots=True)
class ParametersCommit(Message):
    """Apply the staged set if it is whole, its CRC fits and the controller accepts it."""

    ID: ClassVar[int] = 54041
    CRC_EXTRA: ClassVar[int] = 168
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIBBI")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0)
    transfer_id: int = 0
    """Of the set."""
    crc32: int = 0
    """CRC-32 of all values, little-endian float32 in table order."""
    target_system: int = 0
    """Vehicle."""
    target_component: int = 0
    """Vehicle."""
    session: int = 0
    """Of the sender, as in its request for control."""


@dataclass(slots=True)
class ParametersResult(Message):
    """Answer to a stage or a commit."""

    ID: ClassVar[int] = 54042
    CRC_EXTRA: ClassVar[int] = 13
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIHBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)
    transfer_id: int = 0
    """Of the set."""
    active_crc32: int = 0
    """Of the values now in force."""
    index: int = 0
    """Parameter that was refused."""
    staged: int = 0
    """Bit i: group i has arrived."""
    committed: int = 0
    """1 when this answers a commit."""
    reason: int = 0
    """0 done, else tc_reason or GOSHAWK_LINK_REASON."""


BY_ID: dict[int, type[Message]] = {
    0: Heartbeat,
    1: SysStatus,
    4: Ping,
    11: SetMode,
    20: ParamRequestRead,
    21: ParamRequestList,
    22: ParamValue,
    23: ParamSet,
    31: AttitudeQuaternion,
    32: LocalPositionNed,
    43: MissionRequestList,
    44: MissionCount,
    47: MissionAck,
    75: CommandInt,
    76: CommandLong,
    77: CommandAck,
    111: Timesync,
    141: Altitude,
    147: BatteryStatus,
    148: AutopilotVersion,
    242: HomePosition,
    245: ExtendedSysState,
    253: Statustext,
    291: EscStatus,
    300: ProtocolVersion,
    331: Odometry,
    54000: State,
    54001: LogRequest,
    54002: LogInfo,
    54003: LogRecord,
    54010: TrajectoryBegin,
    54011: TrajectorySegment,
    54012: TrajectoryStatus,
    54013: TrajectoryCommit,
    54014: TrajectoryResult,
    54015: TrajectoryRead,
    54016: TrajectorySamples,
    54020: MissionCommand,
    54021: MissionResult,
    54022: MissionStatus,
    54030: LeaseRequest,
    54031: LeaseStatus,
    54040: ParametersStage,
    54041: ParametersCommit,
    54042: ParametersResult,
}
