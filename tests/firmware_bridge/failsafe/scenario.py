"""What is to be flown in the simulated body: orders, faults, a path, the world, the vehicle, its sensors.

SI units, world z up, heights relative to the take-off point.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[3]
CONTROLLER = ROOT / "firmware_bridge" / "controller"
FROM_START = 100
SEGMENTS = 32
_LEG_COEFFICIENTS = np.array([0.5, 1.09375, 0.0, -1.09375, 0.0, 0.65625, 0.0, -0.15625])
"""Septic from 0 to 1 in s = -1 .. 1, at rest to the third derivative at both ends."""


class State(IntEnum):
    """`tc_mission_state`."""

    DISARMED = 0
    ARMED = 1
    TAKE_OFF = 2
    HOLD = 3
    APPROACH = 4
    TRAJECTORY = 5
    PAUSING = 6
    PAUSED = 7
    STOPPING = 8
    ABORTING = 9
    LANDING = 10
    EMERGENCY = 11
    FAULT = 12
    SHADOW = 13


class Command(IntEnum):
    """`tc_command`, and the integrator's three calls."""

    ARM = 0
    DISARM = 1
    TAKE_OFF = 2
    START = 3
    PAUSE = 4
    RESUME = 5
    HOLD = 6
    LAND = 7
    KILL = 8
    TIME_SCALE = 9
    SHADOW = 100
    ENGAGE = 101
    RELEASE = 102


_REASONS = re.findall(r"TC_(\w+) = (\d+)", (CONTROLLER / "include/goshawk_controller/reason.h").read_text())
Reason = IntEnum("Reason", {name: int(number) for name, number in _REASONS})
"""`tc_reason`, as its header lists them."""


class Kind(IntEnum):
    """`body_fault_kind`; what `values` means stands in body_flight.h."""

    POSITION_LOST = 0
    ATTITUDE_LOST = 1
    ALL_LOST = 2
    JUMP = 3
    RELOCALIZED = 4
    RESET_MISSED = 5
    DRIFT = 6
    LARGE_STD = 7
    CLOCK_STEP = 8
    CLOCK_JITTER = 9
    CLOCK_STUCK = 10
    STAMP_OFFSET = 11
    ROTOR_HEALTH = 12
    GUST = 13
    LINK_LOST = 14
    BATTERY = 15
    PARAMETER = 16
    FLOOR = 17
    NO_SPECIFIC_FORCE = 18
    NO_VERTICAL_VELOCITY = 19
    KICK = 20
    BLOCKED = 21
    HANG = 22
    VELOCITY_BIAS = 23
    POSE_AGE = 24
    HEADING_JUMP = 25
    GYRO_AXIS = 26
    ROTOR_SPEED = 27
    STUCK = 28
    CARRIED = 29
    VIBRATION = 30
    SPEED_WRONG = 31


class Loss(IntEnum):
    """How a part of the estimate is lost: the first value of the three losses."""

    FROZEN = 1
    NOT_VALID = 2
    NAN = 3
    NO_XY = 4
    """Horizontal position and velocity only are marked not valid."""


class Policy(IntEnum):
    """`tc_link_loss_policy`."""

    FINISH = 0
    HOLD = 1
    LAND = 2


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that goes wrong."""

    kind: Kind
    values: tuple[float, ...] = ()
    """Up to four numbers."""
    after_s: float = 0.0
    """Since the state `since` was first entered."""
    duration_s: float = 0.0
    """0 = for good."""
    since: int = State.HOLD
    """Mission state, or `FROM_START`."""
    parameter: str = ""
    """With `PARAMETER`: its name; `values` is then its new value alone."""


@dataclass(frozen=True, slots=True)
class Order:
    """What the ground (or the integrator) asks for, and when."""

    command: Command
    value: float = 0.0
    after_s: float = 0.0
    """Since the state `since` was first entered."""
    since: int = State.HOLD
    """Mission state, or `FROM_START`."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A trajectory to upload: centred polynomials."""

    durations_us: NDArray[np.uint32]
    """(n,) microseconds."""
    coefficients: NDArray[np.float32]
    """(n, 4, k): x, y, z, yaw in ascending powers of s in [-1, 1]."""
    clearance_m: float = 0.0
    """0 = not stated."""
    policy: Policy = Policy.HOLD

    @property
    def duration_s(self) -> float:
        return float(self.durations_us.sum()) * 1e-6


def legs(
    points_m: Sequence[Sequence[float]],
    *,
    speed_m_s: float = 2.0,
    acceleration_m_s2: float = 4.0,
    clearance_m: float = 0.0,
    policy: Policy = Policy.HOLD,
) -> Curve:
    """Straight from point to point, at rest at each; speed and acceleration are the peaks of every leg."""
    points = np.asarray(points_m, dtype=float)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    durations = np.maximum(2.1875 * lengths / speed_m_s, np.sqrt(7.5132 * lengths / acceleration_m_s2))
    coefficients = np.zeros((len(steps), 4, 8))
    coefficients[:, :3] = steps[:, :, None] * _LEG_COEFFICIENTS
    coefficients[:, :3, 0] += points[:-1]
    return Curve(
        np.round(np.maximum(durations, 0.1) * 1e6).astype(np.uint32),
        coefficients.astype(np.float32),
        clearance_m,
        policy,
    )


def circle(
    speed_m_s: float, *, radius_m: float = 4.0, turns: float = 2.0, height_m: float = 1.5, clearance_m: float = 0.0
) -> Curve:
    """Level, through the hover point, from rest to rest; fitted piece by piece."""
    angle = 2 * np.pi * turns
    cruise_s = angle * radius_m / speed_m_s
    rise_s = max(2.5, speed_m_s / 3.0)
    duration_s = cruise_s + rise_s
    count = min(int(np.ceil(duration_s / 0.6)), SEGMENTS)
    edges = np.linspace(0.0, duration_s, count + 1)
    nodes = np.cos(np.pi * (np.arange(40) + 0.5) / 40)

    def ramp(u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Integral of a smooth step from 0 to 1 over u = 0 .. 1, going on with slope 1."""
        v = np.clip(u, 0, 1)
        return 7 * v**5 - 14 * v**6 + 10 * v**7 - 2.5 * v**8 + np.clip(u - 1, 0, None)

    coefficients = np.zeros((count, 4, 12))
    for i in range(count):
        t = edges[i] + 0.5 * (edges[i + 1] - edges[i]) * (nodes + 1)
        phase = angle * rise_s / cruise_s * (ramp(t / rise_s) - ramp((t - cruise_s) / rise_s))
        curve = [radius_m * np.sin(phase), radius_m * (1 - np.cos(phase)), np.full_like(t, height_m), np.zeros_like(t)]
        for axis, values in enumerate(curve):
            fit = np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(nodes, values, 11))
            coefficients[i, axis, : len(fit)] = fit
    durations = np.diff(np.round(edges * 1e6)).astype(np.uint32)
    return Curve(durations, coefficients.astype(np.float32), clearance_m)


TAKE_OFF_M = 1.5
TAKE_OFF = (Order(Command.ARM, 0, 0.3, FROM_START), Order(Command.TAKE_OFF, TAKE_OFF_M, 0.8, FROM_START))
"""Arm, and hover 1.5 m up about four seconds later."""
START = Order(Command.START, after_s=0.5)
"""Half a second after hovering, slide to the path's start and fly it."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A flight to be flown: the world, the vehicle, the sensors, what is asked and what goes wrong."""

    orders: tuple[Order, ...] = TAKE_OFF
    faults: tuple[Fault, ...] = ()
    path: Curve | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Of the controller, by name."""
    vehicle: Mapping[str, float | Sequence[float]] = field(default_factory=dict)
    """Fields of `body_vehicle` that differ from Rigter et al.'s."""
    world: Mapping[str, float | Sequence[float]] = field(default_factory=dict)
    """Fields of `body_world`; a level floor at height 0 otherwise."""
    sensors: Mapping[str, float | Sequence[float]] = field(default_factory=dict)
    """Fields of `body_sensors_config`."""
    seed: int = 1
    tick_s: float = 0.002
    tick_jitter: float = 0.0
    """The true step varies by this share."""
    limit_s: float = 60.0
    link: bool = True
    start_m: tuple[float, float, float] | None = None
    """In the air at first, another controller flying; None: standing on the floor."""
    start_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    falling: bool = False
    """With `start_m`: nobody flies it, its rotors stand."""
    pilot_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Velocity that the other controller flies."""


def land(after_s: float, since: int = State.HOLD) -> Order:
    return Order(Command.LAND, 0.0, after_s, since)


TABLE = {"plate_m": 0.0, "plate_min_m": (-0.6, -0.6), "plate_max_m": (0.6, 0.6)}
"""The vehicle starts on a plate at height 0; add the floor's height `floor_m`."""
