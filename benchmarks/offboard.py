"""Plans on Betaflight's real firmware in a simulated body: tracking, the thrust map, and how flights with faults end.

    python benchmarks/offboard.py --faulty 200

Poses at 100 Hz, 10 ms old, 0.5 mm and 1 mrad of noise; sticks by MSP over TCP at 250 Hz through the guard. Errors are
by the body's truth. The figure of eight is ours, not the demo's walk.
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import report
from report import Row, row

import vehicle
from firmware_bridge.controller import State
from firmware_bridge.offboard.thrust_map import scaled_to_flight
from flight import FlightLog, FloatArray, Trajectory, TrajectoryFile, silent
from goshawk.commands.fly import offboard
from vehicle import Vehicle

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.firmware_bridge.offboard import curves, faults

COURSES: dict[str, tuple[Callable[[], Trajectory], float]] = {
    "hover": (curves.hover, 0.010),
    "circle, 1.5 m at 2.25 m/s": (curves.circle, 0.030),
    "figure of eight, 5 m/s": (curves.eight, 0.060),
}
KINDS = ("kill", "kill and pose lost", "pose lost", "pose frozen", "pose jump", "pose late", "hang")
WEAK = 0.93
"""True thrust over that of the file, for the thrust map."""


def flown(model: Vehicle, way: Trajectory, truth: Vehicle) -> tuple[FlightLog, FloatArray, str]:
    """The log, the true error (n,) on the trajectory in metres, and why it ended early."""
    body = offboard.body_of(truth, way, seed=1, believed=model)
    file = TrajectoryFile(way, "course", "", "", way.position([0.0, way.duration_s]), {})
    with offboard.rehearsing(body) as (where, restarted):
        log, early = offboard.fly(model, file, where, progress=silent, cancel=lambda: False, restarted=restarted)
    times = np.array([time_s for time_s, _ in body.way])
    places = np.array([place for _, place in body.way])
    rows = log.columns["mission_state"] == State.TRAJECTORY
    true = np.column_stack([np.interp(log.time_s[rows], times, places[:, axis]) for axis in range(3)])
    return log, np.linalg.norm(true - log.vector("setpoint_position_world_m")[rows], axis=1), early


def tracking(model: Vehicle) -> list[Row]:
    table: list[Row] = []
    for name, (course, bar_m) in COURSES.items():
        _, error_m, early = flown(model, course(), model)
        mean_m = float(error_m.mean()) if error_m.size else np.inf
        table.append(row(f"{name}: mean error", 1e3 * mean_m, "mm", f"<= {1e3 * bar_m:g}", mean_m <= bar_m))
        table.append(row(f"{name}: largest", 1e3 * float(error_m.max(initial=0.0)), "mm"))
        table.append(row(f"{name}: whole", float(not early), "", "1", not early))
    return table


def thrust_error(model: Vehicle) -> list[Row]:
    """A body whose rotors give less than the file says: the map that one log gives, against the body's."""
    truth = model
    for name in ("k1_n_s2", "k2_n_s2_m"):
        truth = truth.with_value(f"thrust_bem.{name}", WEAK * model.value(f"thrust_bem.{name}"))
    log, _, _ = flown(model, curves.circle(), truth)
    believed, true = offboard.thrust_map(model), offboard.thrust_map(truth)
    rows = np.isin(log.columns["mission_state"], [State.HOLD, State.TRAJECTORY])
    throttle = np.array([believed.throttle(float(force)) for force in log.columns["collective_force_n"][rows]])
    found = scaled_to_flight(believed, throttle, log.columns["felt_force_n"][rows])
    hover = true.throttle(model.mass_kg * model.gravity_m_s2)
    error = abs(found.force_n(hover) / true.force_n(hover) - 1.0)
    return [row("thrust map from one log: error", 100.0 * error, "%", "<= 2", error <= 0.02)]


def drawn(rng: np.random.Generator) -> faults.Fault:
    return faults.Fault(
        KINDS[int(rng.integers(len(KINDS)))], after_s=float(rng.uniform(0.5, 9.0)), size=float(rng.uniform(0.5, 3.0))
    )


def with_faults(model: Vehicle, count: int, seed: int) -> list[Row]:
    unsafe, hardest, came = 0, 0.0, 0
    for number in range(seed, seed + count):
        fault = drawn(np.random.default_rng(number))
        with tempfile.TemporaryDirectory() as folder:
            ended = faults.fly(Path(folder), model, curves.circle(), fault, seed=number)
        print(
            number, fault.kind, f"after {fault.after_s:.1f} s:", ended, "safe" if ended.safe else "UNSAFE", flush=True
        )
        came += ended.begun_s is not None
        unsafe += not ended.safe
        hardest = max(hardest, ended.touch_down_m_s)
    return [
        row("flights with a fault", came, "", ">= 200", came >= 200),
        row("unsafe ends", unsafe, "", "0", unsafe == 0),
        row("hardest touch-down of them", hardest, "m/s", f"< {faults.SAFE_TOUCH_DOWN_M_S:g}"),
    ]


def rows(faulty: int, seed: int, flights: int) -> list[Row]:
    """`flights` 0: faults only; `seed`: number of the first fault."""
    model = vehicle.example("rigter2019")
    table = [*tracking(model), *thrust_error(model)] if flights else []
    return table + with_faults(model, faulty, seed)


if __name__ == "__main__":
    report.main(rows, faulty=10, seed=0, flights=1)
