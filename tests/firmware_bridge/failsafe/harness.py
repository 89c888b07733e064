"""Fly the C controller in the simulated body of `firmware_bridge/controller/test/body*.c`: one call, one flight.

    body = harness.load()
    result = body.fly(Scenario(orders=(*TAKE_OFF, Order(Command.LAND, after_s=2.0))))
    assert result.at_rest and result.stop_clearance_m < 0.15

SI units, world z up, heights relative to the take-off point. The body decides what happened; nothing here knows the
controller's idea of the ground.
"""

import ctypes
import hashlib
import os
import re
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[3]
CONTROLLER = ROOT / "firmware_bridge" / "controller"
FROM_START = 100
_SEGMENTS = 32
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
    count = min(int(np.ceil(duration_s / 0.6)), _SEGMENTS)
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
    pilot_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Velocity that the other controller flies."""


def land(after_s: float, since: int = State.HOLD) -> Order:
    return Order(Command.LAND, 0.0, after_s, since)


TABLE = {"plate_m": 0.0, "plate_min_m": (-0.6, -0.6), "plate_max_m": (0.6, 0.6)}
"""The vehicle starts on a plate at height 0; add the floor's height `floor_m`."""


@dataclass(frozen=True, slots=True)
class Change:
    """A transition of the mission, as logged."""

    time_s: float
    before: State
    after: State
    reason: int


@dataclass(frozen=True, slots=True)
class Result:
    """What became of the flight; the body's word unless a field says otherwise."""

    at_rest: bool
    """Rotors stopped and lying still for two seconds at the end."""
    flew: bool
    stop_clearance_m: float
    """Highest clearance at which the controller commanded a flying rotor below its idle; -1 = never."""
    stop_s: float
    stop_tilt_rad: float
    stop_state: State
    stop_reason: int
    touchdowns: int
    first_touchdown_m_s: float
    first_touchdown_s: float
    hardest_touchdown_m_s: float
    hardest_touchdown_s: float
    last_airborne_s: float
    """When it was last well clear of everything: more than 5 cm for 0.1 s."""
    largest_tilt_rad: float
    largest_speed_m_s: float
    largest_error_m: float
    """True position to set-point while on the path."""
    end_s: float
    end_position_m: tuple[float, float, float]
    end_tilt_rad: float
    final_state: State
    final_reason: int
    bad_outputs: int
    """Ticks whose speeds were not finite or out of range."""
    upload_reason: int
    unlogged_slow_s: float
    """How long the path was limited without a limit reason."""
    path_end_s: float
    limit_reasons: frozenset[int]
    warnings: int
    states: frozenset[State]
    ticks: int
    refused_ticks: int
    changes: tuple[Change, ...]
    order_reasons: tuple[int, ...]
    """`tc_reason` of each order, 0 = done."""
    order_times_s: tuple[float, ...]
    """0 = not given."""
    fault_reasons: tuple[int, ...]
    """`tc_reason` of each parameter change."""
    fault_times_s: tuple[float, ...]
    trace: Mapping[str, NDArray[np.float64]]
    """Columns by name; empty unless asked for."""

    def entered_s(self, state: State) -> float:
        """When a state was first entered; `inf` if never."""
        return next((change.time_s for change in self.changes if change.after == state), float("inf"))

    def had(self, reason: int) -> bool:
        """Whether any transition was for this reason."""
        return any(change.reason == reason for change in self.changes)

    def reason_of(self, state: State) -> int:
        """Reason of the first transition into a state; 0 if there was none."""
        return next((change.reason for change in self.changes if change.after == state), 0)


_real, _int = ctypes.c_double, ctypes.c_int32


class _Vehicle(ctypes.Structure):
    _fields_ = (
        ("mass_kg", _real), ("gravity_m_s2", _real), ("inertia_kg_m2", _real * 3), ("centre_of_mass_m", _real * 2),
        ("rotor_x_m", _real * 4), ("rotor_y_m", _real * 4), ("spin", _real * 4), ("k1_n_s2", _real),
        ("k2_n_s2_m", _real), ("cq_n_m_s2", _real), ("air_density_kg_m3", _real), ("disk_area_m2", _real),
        ("rotor_drag_s_m", _real), ("parasitic_kg_m", _real * 3), ("rotor_lag_s", _real), ("rotor_max_rad_s", _real),
        ("ground_effect", _real), ("foot_m", _real * 3), ("top_m", _real * 3), ("contact_n_m", _real),
        ("contact_n_s_m", _real), ("friction", _real),
    )  # fmt: skip


class _World(ctypes.Structure):
    _fields_ = (
        ("floor_m", _real), ("slope", _real * 2), ("bump_m", _real), ("bump_length_m", _real), ("plate_m", _real),
        ("plate_min_m", _real * 2), ("plate_max_m", _real * 2), ("wind_m_s", _real * 3), ("gust_std_m_s", _real),
        ("gust_time_s", _real),
    )  # fmt: skip


class _Sensors(ctypes.Structure):
    _fields_ = (
        ("pose_rate_hz", _real), ("delay_s", _real), ("position_noise_m", _real), ("velocity_noise_m_s", _real),
        ("attitude_noise_rad", _real), ("gyro_noise_rad_s", _real), ("accelerometer_noise_m_s2", _real),
        ("vibration_m_s2", _real), ("height_wander_m", _real), ("height_wander_s", _real),
        ("vertical_bias_m_s", _real), ("tilt_error_rad", _real * 2), ("accelerometer_bias_m_s2", _real * 3),
        ("gyro_bias_rad_s", _real * 3),
        ("position_std_m", _real), ("velocity_std_m_s", _real), ("battery_v", _real), ("has_specific_force", _int),
        ("has_vertical_velocity", _int),
    )  # fmt: skip


class _Fault(ctypes.Structure):
    _fields_ = (("kind", _int), ("from_state", _int), ("after_s", _real), ("duration_s", _real), ("value", _real * 4))


class _Order(ctypes.Structure):
    _fields_ = (("command", _int), ("from_state", _int), ("after_s", _real), ("value", _real))


class _Value(ctypes.Structure):
    _fields_ = (("index", _int), ("reserved", _int), ("value", _real))


class _Header(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32), ("crc32", ctypes.c_uint32), ("segment_count", ctypes.c_uint16),
        ("coefficient_count", ctypes.c_uint8), ("link_loss_policy", ctypes.c_uint8), ("clearance_m", ctypes.c_float),
    )  # fmt: skip


class _Segment(ctypes.Structure):
    _fields_ = (("duration_us", ctypes.c_uint32), ("coefficient", ctypes.c_float * 12 * 4))


class _Scenario(ctypes.Structure):
    _fields_ = (
        ("seed", ctypes.c_uint64), ("tick_s", _real), ("tick_jitter", _real), ("limit_s", _real), ("has_link", _int),
        ("in_air", _int), ("start_m", _real * 3), ("start_m_s", _real * 3), ("pilot_m_s", _real * 3),
        ("vehicle", _Vehicle), ("world", _World), ("sensors", _Sensors), ("fault_count", _int), ("order_count", _int),
        ("value_count", _int), ("segment_count", _int), ("fault", _Fault * 8), ("order", _Order * 16),
        ("value", _Value * 24), ("header", _Header), ("segment", ctypes.POINTER(_Segment)),
    )  # fmt: skip


class _Record(ctypes.Structure):
    _fields_ = (
        ("touchdowns", _int), ("first_touchdown_m_s", _real), ("first_touchdown_s", _real),
        ("hardest_touchdown_m_s", _real), ("hardest_touchdown_s", _real), ("last_airborne_s", _real),
        ("largest_tilt_rad", _real), ("largest_speed_m_s", _real), ("rest_s", _real), ("time_s", _real),
    )  # fmt: skip


class _Change(ctypes.Structure):
    _fields_ = (("time_s", _real), ("before", _int), ("after", _int), ("reason", _int), ("reserved", _int))


class _Result(ctypes.Structure):
    _fields_ = (
        ("body", _Record), ("end_s", _real), ("end_position_m", _real * 3), ("end_tilt_rad", _real), ("at_rest", _int),
        ("flew", _int), ("final_state", _int), ("final_reason", _int), ("bad_outputs", _int), ("upload_reason", _int),
        ("stop_clearance_m", _real), ("stop_s", _real), ("stop_tilt_rad", _real), ("stop_state", _int),
        ("stop_reason", _int), ("unlogged_slow_s", _real), ("largest_error_m", _real), ("path_end_s", _real),
        ("limit_reasons", ctypes.c_uint64 * 2), ("warnings", ctypes.c_uint32), ("states", ctypes.c_uint32),
        ("ticks", ctypes.c_uint32), ("refused_ticks", ctypes.c_uint32), ("out_of_command_ticks", ctypes.c_uint32),
        ("change_count", _int), ("change", _Change * 48), ("order_reason", _int * 16), ("order_s", _real * 16),
        ("fault_reason", _int * 8), ("fault_s", _real * 8),
    )  # fmt: skip


def _put(structure: ctypes.Structure, values: Mapping[str, float | Sequence[float]]) -> None:
    known = {name for name, _ in structure._fields_}
    for name, value in values.items():
        if name not in known:
            raise KeyError(f"{type(structure).__name__} has no {name}; there are {', '.join(sorted(known))}")
        if isinstance(value, Sequence):
            for i, entry in enumerate(value):
                getattr(structure, name)[i] = entry
        else:
            setattr(structure, name, value)


class Body:
    """The shared object: controller, body and harness together."""

    def __init__(self, library: Path) -> None:
        self._c = ctypes.CDLL(str(library))
        self._c.body_trace_names.restype = ctypes.c_char_p
        self._c.tc_parameters_find.argtypes = [ctypes.c_char_p]
        self._c.tc_reason_text.restype = ctypes.c_char_p
        self._c.tc_crc32.restype = ctypes.c_uint32
        self._c.body_rotor_thrust_n.restype = ctypes.c_double
        sizes = (ctypes.c_int32 * 2)()
        self._c.body_sizes(sizes)
        assert list(sizes) == [ctypes.sizeof(_Scenario), ctypes.sizeof(_Result)], "harness.py and body_flight.h differ"
        self.columns = self._c.body_trace_names().decode().split()

    def reason_text(self, reason: int) -> str:
        return self._c.tc_reason_text(reason).decode()

    def parameter_index(self, name: str) -> int:
        index = self._c.tc_parameters_find(name.encode())
        if index < 0:
            raise KeyError(f"the controller has no parameter {name}")
        return index

    def rotor_thrust_n(self, rotor_rad_s: float, axial_m_s: float, lateral_m_s: float) -> float:
        vehicle = _Vehicle()
        self._c.body_vehicle_default(ctypes.byref(vehicle))
        numbers = (ctypes.c_double(x) for x in (rotor_rad_s, axial_m_s, lateral_m_s))
        return self._c.body_rotor_thrust_n(ctypes.byref(vehicle), *numbers)

    def fly(self, scenario: Scenario, *, trace_every: int = 0) -> Result:
        """One flight; `trace_every` n > 0 keeps a row of the trace every n ticks."""
        packed, keep = self._pack(scenario)
        result = _Result()
        rows = int(scenario.limit_s / scenario.tick_s / trace_every * 1.5) + 2 if trace_every else 0
        table = np.zeros((rows, len(self.columns)))
        pointer = table.ctypes.data_as(ctypes.c_void_p) if rows else None
        written = self._c.body_fly(ctypes.byref(packed), ctypes.byref(result), pointer, rows, max(trace_every, 1))
        del keep
        columns = {name: table[:written, i] for i, name in enumerate(self.columns)} if rows else {}
        return _unpack(result, scenario, columns)

    def _pack(self, s: Scenario) -> tuple[_Scenario, object]:
        packed = _Scenario()
        self._c.body_scenario_default(ctypes.byref(packed))
        packed.seed, packed.tick_s, packed.tick_jitter, packed.limit_s = s.seed, s.tick_s, s.tick_jitter, s.limit_s
        packed.has_link, packed.in_air = int(s.link), int(s.start_m is not None)
        packed.start_m[:] = s.start_m or (0.0, 0.0, 0.0)
        packed.start_m_s[:], packed.pilot_m_s[:] = s.start_m_s, s.pilot_m_s
        _put(packed.vehicle, s.vehicle)
        _put(packed.world, s.world)
        _put(packed.sensors, s.sensors)
        packed.fault_count, packed.order_count = len(s.faults), len(s.orders)
        packed.value_count = len(s.parameters)
        for i, fault in enumerate(s.faults):
            values = fault.values
            if fault.kind == Kind.PARAMETER:
                values = (self.parameter_index(fault.parameter), *values)
            packed.fault[i] = _Fault(fault.kind, fault.since, fault.after_s, fault.duration_s)
            packed.fault[i].value[: len(values)] = values
        for i, order in enumerate(s.orders):
            packed.order[i] = _Order(order.command, order.since, order.after_s, order.value)
        for i, (name, value) in enumerate(s.parameters.items()):
            packed.value[i] = _Value(self.parameter_index(name), 0, value)
        return packed, self._pack_path(packed, s.path)

    def _pack_path(self, packed: _Scenario, path: Curve | None) -> object:
        if path is None:
            return None
        count, _, k = path.coefficients.shape
        segments = (_Segment * count)()
        pieces = [np.uint32(7).tobytes(), np.uint16(count).tobytes(), bytes([k, path.policy])]
        pieces.append(np.float32(path.clearance_m).tobytes())
        for i, segment in enumerate(segments):
            segment.duration_us = int(path.durations_us[i])
            for axis in range(4):
                segment.coefficient[axis][:k] = path.coefficients[i, axis].tolist()
            pieces += [np.uint32(path.durations_us[i]).tobytes(), path.coefficients[i].astype("<f4").tobytes()]
        crc_input = b"".join(pieces)
        crc = self._c.tc_crc32(0, crc_input, ctypes.c_size_t(len(crc_input)))
        packed.header = _Header(7, crc, count, k, path.policy, path.clearance_m)
        packed.segment_count = count
        packed.segment = segments
        return segments


def _unpack(r: _Result, s: Scenario, trace: Mapping[str, NDArray[np.float64]]) -> Result:
    body = r.body
    reasons = {i for i in range(1, 128) if r.limit_reasons[i // 64] >> (i % 64) & 1}
    changes = tuple(Change(c.time_s, State(c.before), State(c.after), c.reason) for c in r.change[: r.change_count])
    return Result(
        at_rest=bool(r.at_rest),
        flew=bool(r.flew),
        stop_clearance_m=r.stop_clearance_m if r.stop_s > 0 else -1.0,
        stop_s=r.stop_s,
        stop_tilt_rad=r.stop_tilt_rad,
        stop_state=State(r.stop_state),
        stop_reason=r.stop_reason,
        touchdowns=body.touchdowns,
        first_touchdown_m_s=body.first_touchdown_m_s,
        first_touchdown_s=body.first_touchdown_s,
        hardest_touchdown_m_s=body.hardest_touchdown_m_s,
        hardest_touchdown_s=body.hardest_touchdown_s,
        last_airborne_s=body.last_airborne_s,
        largest_tilt_rad=body.largest_tilt_rad,
        largest_speed_m_s=body.largest_speed_m_s,
        largest_error_m=r.largest_error_m,
        end_s=r.end_s,
        end_position_m=tuple(r.end_position_m),
        end_tilt_rad=r.end_tilt_rad,
        final_state=State(r.final_state),
        final_reason=r.final_reason,
        bad_outputs=r.bad_outputs,
        upload_reason=r.upload_reason,
        unlogged_slow_s=r.unlogged_slow_s,
        path_end_s=r.path_end_s,
        limit_reasons=frozenset(reasons),
        warnings=r.warnings,
        states=frozenset(State(i) for i in range(14) if r.states >> i & 1),
        ticks=r.ticks,
        refused_ticks=r.refused_ticks,
        changes=changes,
        order_reasons=tuple(r.order_reason[: len(s.orders)]),
        order_times_s=tuple(r.order_s[: len(s.orders)]),
        fault_reasons=tuple(r.fault_reason[: len(s.faults)]),
        fault_times_s=tuple(r.fault_s[: len(s.faults)]),
        trace=trace,
    )


@cache
def load(*, sanitize: bool = False) -> Body:
    """Builds the shared object (a few seconds, once for each version of the sources) and loads it."""
    sources = [path for path in sorted((CONTROLLER / "src").glob("*.c")) if not path.name.startswith("link")]
    sources += sorted((CONTROLLER / "test").glob("body*.c"))
    headers = [*sorted((CONTROLLER / "include").rglob("*.h")), *sorted((CONTROLLER / "src").glob("*.h"))]
    headers += sorted((CONTROLLER / "test").glob("body*.h"))
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
    flags += ["-ffp-contract=off", "-fno-math-errno", "-fPIC", f"-DTC_MAX_SEGMENTS={_SEGMENTS}"]
    if sanitize:
        flags += ["-O0", "-g", "-fsanitize=undefined", "-fno-sanitize-recover=undefined"]
    digest = hashlib.sha256(" ".join(flags).encode())
    for path in [*sources, *headers]:
        digest.update(path.name.encode() + path.read_bytes())
    folder = ROOT / "build" / "failsafe"
    library = folder / f"body_{digest.hexdigest()[:16]}.so"
    if not library.exists():
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".so", delete=False) as file:
            fresh = Path(file.name)
        command = ["gcc", *flags, "-shared", f"-I{CONTROLLER / 'include'}", *map(str, sources), "-lm", "-o", str(fresh)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            fresh.unlink()
            raise RuntimeError(f"{' '.join(command)}\n{done.stderr}")
        os.replace(fresh, library)
    return Body(library)
