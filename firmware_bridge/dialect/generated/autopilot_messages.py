"""Written by dialect/generate.py from autopilot.xml; do not edit."""

import struct
from dataclasses import dataclass
from typing import ClassVar

from firmware_bridge.dialect.message import Message


@dataclass(slots=True)
class ServoOutputRaw(Message):
    """The outputs to motors and servos."""

    ID: ClassVar[int] = 36
    CRC_EXTRA: ClassVar[int] = 222
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IHHHHHHHHBHHHHHHHH")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    time_usec: int = 0
    """Vehicle time, us."""
    servo1_raw: int = 0
    """us."""
    servo2_raw: int = 0
    """us."""
    servo3_raw: int = 0
    """us."""
    servo4_raw: int = 0
    """us."""
    servo5_raw: int = 0
    """us."""
    servo6_raw: int = 0
    """us."""
    servo7_raw: int = 0
    """us."""
    servo8_raw: int = 0
    """us."""
    port: int = 0
    """0: the first eight outputs."""
    servo9_raw: int = 0
    """us."""
    servo10_raw: int = 0
    """us."""
    servo11_raw: int = 0
    """us."""
    servo12_raw: int = 0
    """us."""
    servo13_raw: int = 0
    """us."""
    servo14_raw: int = 0
    """us."""
    servo15_raw: int = 0
    """us."""
    servo16_raw: int = 0
    """us."""


@dataclass(slots=True)
class SetGpsGlobalOrigin(Message):
    """Where on Earth the local frame begins; an estimator without GPS needs to be told."""

    ID: ClassVar[int] = 48
    CRC_EXTRA: ClassVar[int] = 41
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<iiiBQ")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0)
    latitude: int = 0
    """1e-7 deg."""
    longitude: int = 0
    """1e-7 deg."""
    altitude: int = 0
    """mm above mean sea level."""
    target_system: int = 0
    """System asked."""
    time_usec: int = 0
    """us."""


@dataclass(slots=True)
class GpsGlobalOrigin(Message):
    """Where on Earth the local frame begins."""

    ID: ClassVar[int] = 49
    CRC_EXTRA: ClassVar[int] = 39
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<iiiQ")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0)
    latitude: int = 0
    """1e-7 deg."""
    longitude: int = 0
    """1e-7 deg."""
    altitude: int = 0
    """mm above mean sea level."""
    time_usec: int = 0
    """us."""


@dataclass(slots=True)
class SetAttitudeTarget(Message):
    """Attitude or body rates, and a collective thrust."""

    ID: ClassVar[int] = 82
    CRC_EXTRA: ClassVar[int] = 49
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<I4fffffBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 4, 0, 0, 0, 0, 0, 0, 0)
    time_boot_ms: int = 0
    """Sender's time."""
    q: tuple[float, ...] = (0.0,) * 4
    """w x y z, NED from FRD."""
    body_roll_rate: float = 0.0
    """rad/s about x forward."""
    body_pitch_rate: float = 0.0
    """rad/s about y right."""
    body_yaw_rate: float = 0.0
    """rad/s about z down."""
    thrust: float = 0.0
    """0 to 1."""
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    type_mask: int = 0
    """128: no attitude; 1, 2, 4: no rate about x, y, z; 64: no thrust."""


@dataclass(slots=True)
class SetPositionTargetLocalNed(Message):
    """Where to be, how fast, and how to turn, in the estimator's local frame."""

    ID: ClassVar[int] = 84
    CRC_EXTRA: ClassVar[int] = 143
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IfffffffffffHBBB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    time_boot_ms: int = 0
    """Sender's time."""
    x: float = 0.0
    """m, NED."""
    y: float = 0.0
    """m."""
    z: float = 0.0
    """m."""
    vx: float = 0.0
    """m/s."""
    vy: float = 0.0
    """m/s."""
    vz: float = 0.0
    """m/s."""
    afx: float = 0.0
    """m/s2."""
    afy: float = 0.0
    """m/s2."""
    afz: float = 0.0
    """m/s2."""
    yaw: float = 0.0
    """rad, from north towards east."""
    yaw_rate: float = 0.0
    """rad/s."""
    type_mask: int = 0
    """0: everything is looked at, the acceleration as one."""
    target_system: int = 0
    """System asked."""
    target_component: int = 0
    """Component asked."""
    coordinate_frame: int = 0
    """1: local NED."""


@dataclass(slots=True)
class VisionPositionEstimate(Message):
    """A pose as a tracking system sees it, for the autopilot's estimator."""

    ID: ClassVar[int] = 102
    CRC_EXTRA: ClassVar[int] = 158
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<Qffffff21fB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0, 0, 21, 0)
    usec: int = 0
    """us, sender's time."""
    x: float = 0.0
    """m, NED."""
    y: float = 0.0
    """m."""
    z: float = 0.0
    """m."""
    roll: float = 0.0
    """rad."""
    pitch: float = 0.0
    """rad."""
    yaw: float = 0.0
    """rad."""
    covariance: tuple[float, ...] = (0.0,) * 21
    """NaN first: unknown."""
    reset_counter: int = 0
    """Jumps of the estimate."""


@dataclass(slots=True)
class CurrentMode(Message):
    """The mode that flies, told oftener than by HEARTBEAT."""

    ID: ClassVar[int] = 436
    CRC_EXTRA: ClassVar[int] = 193
    STRUCT: ClassVar[struct.Struct] = struct.Struct("<IIB")
    ARRAYS: ClassVar[tuple[int, ...]] = (0, 0, 0)
    custom_mode: int = 0
    """As in HEARTBEAT."""
    intended_custom_mode: int = 0
    """As asked for."""
    standard_mode: int = 0
    """MAV_STANDARD_MODE; 0: none."""


BY_ID: dict[int, type[Message]] = {
    36: ServoOutputRaw,
    48: SetGpsGlobalOrigin,
    49: GpsGlobalOrigin,
    82: SetAttitudeTarget,
    84: SetPositionTargetLocalNed,
    102: VisionPositionEstimate,
    436: CurrentMode,
}
