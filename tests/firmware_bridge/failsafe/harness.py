"""Fly the C controller in the simulated body of `firmware_bridge/controller/test/body`: one call, one flight.

    body = harness.load()
    result = body.fly(Scenario(orders=(*TAKE_OFF, Order(Command.LAND, after_s=2.0))))
    assert result.at_rest and result.stop_clearance_m < 0.15

The body decides what happened; nothing here knows the controller's idea of the ground.
"""

import ctypes
import hashlib
import os
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import layout
import numpy as np
from numpy.typing import NDArray
from scenario import CONTROLLER, ROOT, SEGMENTS, Curve, Kind, Scenario, State


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
        self._c.body_uniform.restype = ctypes.c_double
        sizes = (ctypes.c_int32 * 2)()
        self._c.body_sizes(sizes)
        assert list(sizes) == [ctypes.sizeof(layout.Scenario), ctypes.sizeof(layout.Result)], (
            "harness.py and body_flight.h differ"
        )
        self.columns = self._c.body_trace_names().decode().split()

    def reason_text(self, reason: int) -> str:
        return self._c.tc_reason_text(reason).decode()

    def parameter_index(self, name: str) -> int:
        index = self._c.tc_parameters_find(name.encode())
        if index < 0:
            raise KeyError(f"the controller has no parameter {name}")
        return index

    def uniform(self, seed: int, stream: int, count: int) -> NDArray[np.float64]:
        """The first numbers of a stream of noise, (count,) in 0 .. 1."""
        state = ctypes.byref(ctypes.c_uint64())
        self._c.body_seed(state, ctypes.c_uint64(seed), ctypes.c_uint64(stream))
        return np.array([self._c.body_uniform(state) for _ in range(count)])

    def rotor_thrust_n(self, rotor_rad_s: float, axial_m_s: float, lateral_m_s: float) -> float:
        vehicle = layout.Vehicle()
        self._c.body_vehicle_default(ctypes.byref(vehicle))
        numbers = (ctypes.c_double(x) for x in (rotor_rad_s, axial_m_s, lateral_m_s))
        return self._c.body_rotor_thrust_n(ctypes.byref(vehicle), *numbers)

    def fly(self, scenario: Scenario, *, trace_every: int = 0) -> Result:
        """One flight; `trace_every` n > 0 keeps a row of the trace every n ticks."""
        packed, keep = self._pack(scenario)
        result = layout.Result()
        rows = int(scenario.limit_s / scenario.tick_s / trace_every * 1.5) + 2 if trace_every else 0
        table = np.zeros((rows, len(self.columns)))
        pointer = table.ctypes.data_as(ctypes.c_void_p) if rows else None
        written = self._c.body_fly(ctypes.byref(packed), ctypes.byref(result), pointer, rows, max(trace_every, 1))
        del keep
        columns = {name: table[:written, i] for i, name in enumerate(self.columns)} if rows else {}
        return _unpack(result, scenario, columns)

    def _pack(self, s: Scenario) -> tuple[layout.Scenario, object]:
        packed = layout.Scenario()
        self._c.body_scenario_default(ctypes.byref(packed))
        packed.seed, packed.tick_s, packed.tick_jitter, packed.limit_s = s.seed, s.tick_s, s.tick_jitter, s.limit_s
        packed.has_link, packed.in_air = int(s.link), int(s.start_m is not None) + int(s.falling)
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
            packed.fault[i] = layout.Fault(fault.kind, fault.since, fault.after_s, fault.duration_s)
            packed.fault[i].value[: len(values)] = values
        for i, order in enumerate(s.orders):
            packed.order[i] = layout.Order(order.command, order.since, order.after_s, order.value)
        for i, (name, value) in enumerate(s.parameters.items()):
            packed.value[i] = layout.Value(self.parameter_index(name), 0, value)
        return packed, self._pack_path(packed, s.path)

    def _pack_path(self, packed: layout.Scenario, path: Curve | None) -> object:
        if path is None:
            return None
        count, _, k = path.coefficients.shape
        segments = (layout.Segment * count)()
        pieces = [np.uint32(7).tobytes(), np.uint16(count).tobytes(), bytes([k, path.policy])]
        pieces.append(np.float32(path.clearance_m).tobytes())
        for i, segment in enumerate(segments):
            segment.duration_us = int(path.durations_us[i])
            for axis in range(4):
                segment.coefficient[axis][:k] = path.coefficients[i, axis].tolist()
            pieces += [np.uint32(path.durations_us[i]).tobytes(), path.coefficients[i].astype("<f4").tobytes()]
        crc_input = b"".join(pieces)
        crc = self._c.tc_crc32(0, crc_input, ctypes.c_size_t(len(crc_input)))
        packed.header = layout.Header(7, crc, count, k, path.policy, path.clearance_m)
        packed.segment_count = count
        packed.segment = segments
        return segments


def _unpack(r: layout.Result, s: Scenario, trace: Mapping[str, NDArray[np.float64]]) -> Result:
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
    sources = [path for path in sorted((CONTROLLER / "src").rglob("*.c")) if "link" not in path.parts]
    sources += sorted((CONTROLLER / "test" / "body").glob("*.c"))
    headers = [*sorted((CONTROLLER / "include").rglob("*.h")), *sorted((CONTROLLER / "src").rglob("*.h"))]
    headers += sorted((CONTROLLER / "test" / "body").glob("*.h"))
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
    flags += ["-ffp-contract=off", "-fno-math-errno", "-fPIC", f"-DTC_MAXSEGMENTS={SEGMENTS}"]
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
