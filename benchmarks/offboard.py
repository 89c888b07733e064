"""Plans on Betaflight's real firmware in a simulated body: tracking, hidden drag, weak rotors, faults.

    python benchmarks/offboard.py --faulty 200

Poses 10 ms old with 0.5 mm and 1 mrad of noise, at 50 to 200 Hz; sticks by MSP over TCP at 250 Hz through the guard.
Errors are by the body's truth. `walk` is a plan of ours round two pillars, with the limits
of the demo's: 5 m/s and 8 m/s2.
"""

import resource
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import report
from report import Row, row

import planner
import vehicle
from esdf import solids
from firmware_bridge.betaflight_sitl.body import STEP_S, Body
from firmware_bridge.betaflight_sitl.process import Sitl
from firmware_bridge.controller import State
from firmware_bridge.offboard.rate_profile import RateProfile
from firmware_bridge.offboard.thrust_map import scaled_to_flight
from flight import (
    FlightError,
    FlightLog,
    FloatArray,
    LinkError,
    Trajectory,
    TrajectoryFile,
    Waypoints,
    rotations,
    silent,
)
from goshawk.commands.fly import offboard
from vehicle import Vehicle

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.firmware_bridge.offboard import curves, faults

HIDDEN = ("rotor_drag_thrust", "parasitic_drag")
"""Effects of the body that the first file of the vehicle does not have."""
CIRCLE, WALK, EIGHT = "circle, 1.5 m at 2.25 m/s", "walk at 5 m/s", "figure of eight at 5 m/s"
KINDS = (
    "kill", "kill and pose lost", "pose lost", "pose frozen", "pose jump", "pose late", "hang", "stick override",
    "low battery", "link lost",
)  # fmt: skip
SLOPE_ROWS = 10
FULL_RAD_S = vehicle.example("rigter2019").limits.rotor_speed_max_rad_s
WEAK, WEAKER = 0.93, 0.8
"""True thrust over that of the file: for the thrust map, and for tracking with it."""
EMPTIED, EMPTY_S = 0.9, 20.0
"""Speed of the rotors with an empty battery, and how soon it is empty."""


def walk() -> Trajectory:
    """Round two pillars, planned."""
    drone = vehicle.example("rigter2019").with_limits(speed_m_s=5.0, acceleration_m_s2=8.0)
    points = np.array([[-6.0, 0.0, 1.2], [-3.0, 2.0, 1.5], [0.0, -1.5, 1.8], [3.0, 2.0, 1.4], [6.0, 0.0, 1.2]])
    pillars = [solids.Cylinder((x, y, 2.0), 0.4, 4.0) for x, y in ((-1.5, 0.5), (1.5, 0.3))]
    scene = solids.Scene([solids.Room((-9.0, -6.0, 0.0), (9.0, 6.0, 4.0)), *pillars])
    return planner.plan(Waypoints(points, np.full(len(points), np.nan)), scene, drone).trajectory


COURSES: dict[str, tuple[Callable[[], Trajectory], float]] = {
    "hover": (curves.hover, 0.010),
    CIRCLE: (curves.circle, 0.030),
    WALK: (walk, 0.060),
}


def flown(
    model: Vehicle, way: Trajectory, truth: Vehicle, rate_hz: float = 100.0, *, empties: bool = False
) -> tuple[FlightLog, FloatArray, str]:
    """The log, the true error (n,) on the trajectory in metres, and why it ended early.

    Args:
        empties: the battery does, from the trajectory's time on, and nobody measures it.
    """
    body = offboard.body_of(truth, way, seed=1, believed=model)
    body.each_step = _emptied if empties else None
    body.tracking = replace(body.tracking, period_s=1.0 / rate_hz)
    file = TrajectoryFile(way, "course", "", "", way.position([0.0, way.duration_s]), {})
    with offboard.rehearsing(body) as (where, restarted):
        log, early = offboard.fly(model, file, where, progress=silent, cancel=lambda: False, restarted=restarted)
    times = np.array([time_s for time_s, _ in body.way])
    places = np.array([place for _, place in body.way])
    rows = log.columns["mission_state"] == State.TRAJECTORY
    true = np.column_stack([np.interp(log.time_s[rows], times, places[:, axis]) for axis in range(3)])
    return log, np.linalg.norm(true - log.vector("setpoint_position_world_m")[rows], axis=1), early


def _emptied(body: Body, _: Sitl) -> None:
    """Less speed for the same output, step by step; the first at a metre's height."""
    if body.full_rad_s > EMPTIED * FULL_RAD_S and body.plant.position_world_m[2] > 1.0:
        body.full_rad_s -= (1.0 - EMPTIED) * FULL_RAD_S * STEP_S / EMPTY_S


def weakened(model: Vehicle, share: float) -> Vehicle:
    """Of every rotor's thrust."""
    for name in ("k1_n_s2", "k2_n_s2_m"):
        model = model.with_value(f"thrust_bem.{name}", share * model.value(f"thrust_bem.{name}"))
    return model


def weak(model: Vehicle) -> list[Row]:
    """Other thrust than the file says: all rotors weaker, and a battery that empties."""
    table: list[Row] = []
    for name, (course, bar_m) in COURSES.items():
        for what, truth, empties in (
            ("rotors 20 % weaker", weakened(model, WEAKER), False),
            ("battery emptying, unmeasured", model, True),
        ):
            _, error_m, early = flown(model, course(), truth, empties=empties)
            to_the_end(error_m, early)
            mean_m = float(error_m.mean())
            print(name, what, mean_m, flush=True)
            table.append(row(f"{name}, {what}", 1e3 * mean_m, "mm", f"<= {1e3 * bar_m:g}", mean_m <= bar_m))
    return table


def tracking(model: Vehicle, rates_hz: list[float]) -> list[Row]:
    table: list[Row] = []
    for name, (course, bar_m) in COURSES.items():
        for rate_hz in rates_hz:
            label = f"{name}, poses at {rate_hz:g} Hz"
            table += or_failed(label, lambda: tracked(label, model, course(), bar_m, rate_hz))  # noqa: B023 - at once
    return table


def tracked(label: str, model: Vehicle, way: Trajectory, bar_m: float, rate_hz: float) -> list[Row]:
    _, error_m, early = flown(model, way, model, rate_hz)
    to_the_end(error_m, early)
    mean_m = float(error_m.mean())
    print(label, mean_m, flush=True)
    return [
        row(f"{label}: mean error", 1e3 * mean_m, "mm", f"<= {1e3 * bar_m:g}", mean_m <= bar_m),
        row(f"{label}: largest", 1e3 * float(error_m.max()), "mm"),
    ]


def to_the_end(error_m: FloatArray, early: str) -> None:
    """
    Raises:
        LinkError: a flight ended early, or never flew its course.
    """
    if early or not error_m.size:
        raise LinkError(early or "the course was not flown")


def or_failed(label: str, measured: Callable[[], list[Row]]) -> list[Row]:
    """The rows of a measurement, or one that is not ok: a flight that breaks off leaves the others their turn."""
    try:
        return measured()
    except (FlightError, ArithmeticError, ValueError) as error:
        print(label, "did not come to its end:", error, flush=True)
        return [row(f"{label}: did not come to its end", np.inf, "", "to the end", ok=False)]


def without_drag(model: Vehicle) -> Vehicle:
    for name in HIDDEN:
        model = model.without_effect(name)
    return model


def learnt(believed: Vehicle, log: FlightLog) -> Vehicle:
    """The drag of a flight, of the log alone: what its motion shows beside thrust and weight.

    Linear least squares of m R^T (a + g), along body x and y, on -T v (rotor drag) and -|v| v (parasitic drag). The
    log's motion is the predictor's, so that its acceleration is the slope of its velocity over 80 ms.
    """
    rows = log.columns["mission_state"] == State.TRAJECTORY
    q, velocity = log.vector("q_world_body")[rows], log.vector("velocity_world_m_s")[rows]
    smooth = np.apply_along_axis(lambda v: np.convolve(v, np.full(SLOPE_ROWS, 1.0 / SLOPE_ROWS), "same"), 0, velocity)
    felt = np.gradient(smooth, log.time_s[rows], axis=0) + np.array([0.0, 0.0, believed.gravity_m_s2])
    to_body = rotations.conjugate(q)
    force_n, v = believed.mass_kg * rotations.rotate(to_body, felt), rotations.rotate(to_body, velocity)
    terms = np.stack([-force_n[:, 2:] * v[:, :2], -np.abs(v[:, :2]) * v[:, :2]], axis=-1)
    inner = slice(SLOPE_ROWS, -SLOPE_ROWS)
    rotor, parasitic = np.linalg.lstsq(terms[inner].reshape(-1, 2), force_n[inner, :2].ravel(), rcond=None)[0]
    print(f"drag learnt: {rotor:.4f} s/m, {parasitic:.4f} kg/m", flush=True)
    found = believed.with_effect("rotor_drag_thrust", drag_s_m=max(float(rotor), 0.0))
    return found.with_effect("parasitic_drag", drag_xy_kg_m=max(float(parasitic), 0.0))


def hidden_drag(model: Vehicle, name: str, way: Trajectory) -> list[Row]:
    """A course flown with a file without drag, and again with the drag that the first flight's log shows."""
    believed = without_drag(model)
    log, before_m, early = flown(believed, way, model)
    to_the_end(before_m, early)
    _, after_m, early_again = flown(learnt(believed, log), way, model)
    to_the_end(after_m, early_again)
    before, after = float(before_m.mean()), float(after_m.mean())
    ok = after <= 0.5 * before
    learnt_by = "drag by the benchmark's own least squares of that log, not by `identify`"
    return [
        row(f"{name}, drag hidden: mean error", 1e3 * before, "mm"),
        row(
            f"{name}, {learnt_by}",
            1e3 * after,
            "mm",
            f"<= {500.0 * before:.1f}",
            ok,
        ),
    ]


def thrust_error(model: Vehicle) -> list[Row]:
    """A body whose rotors give less than the file says: the map that one log gives, against the body's."""
    truth = weakened(model, WEAK)
    log, error_m, early = flown(model, curves.circle(), truth)
    to_the_end(error_m, early)
    believed, true = offboard.thrust_map(model), offboard.thrust_map(truth)
    rows = np.isin(log.columns["mission_state"], [State.HOLD, State.TRAJECTORY])
    throttle = np.array([believed.throttle(float(force)) for force in log.columns["collective_force_n"][rows]])
    found = scaled_to_flight(believed, throttle, log.columns["felt_force_n"][rows])
    hover = true.throttle(model.mass_kg * model.gravity_m_s2)
    error = abs(found.force_n(hover) / true.force_n(hover) - 1.0)
    return [row("thrust map from one log: error", 100.0 * error, "%", "<= 2", error <= 0.02)]


def drawn(model: Vehicle, number: int) -> faults.Fault:
    """Kinds in turn; when, and how large, at random."""
    rng, kind = np.random.default_rng(number), KINDS[number % len(KINDS)]
    size = float(rng.uniform(0.5, 3.0))
    if kind == "link lost":
        size = float(rng.uniform(0.05, 1.0))
    if kind == "stick override":
        hover = offboard.thrust_map(model).throttle(model.mass_kg * model.gravity_m_s2)
        size = RateProfile((1.0, 1.0, 1.0)).pulses_us(np.zeros(3), hover)[2] + float(rng.uniform(-20.0, 20.0))
    return faults.Fault(kind, after_s=float(rng.uniform(0.5, 9.0)), size=size)


def with_faults(model: Vehicle, count: int, seed: int) -> list[Row]:
    unsafe, hardest, came, broken = 0, 0.0, 0, 0
    for number in range(seed, seed + count):
        fault = drawn(model, number)
        settings = faults.OVERRIDE if fault.kind == "stick override" else ()
        try:
            with tempfile.TemporaryDirectory() as folder:
                ended = faults.fly(Path(folder), model, curves.circle(), fault, seed=number, settings=settings)
        except LinkError as error:  # of the simulator, as of a machine that is too busy
            print(number, fault.kind, "did not come to its end:", error, flush=True)
            broken += 1
            continue
        verdict = "safe" if ended.safe else "UNSAFE"
        print(number, fault.kind, f"after {fault.after_s:.1f} s:", ended, verdict, flush=True)
        came += ended.begun_s is not None
        unsafe += not ended.safe
        hardest = max(hardest, ended.touch_down_m_s)
    return [
        row("flights with a fault", came, "", ">= 200", came >= 200),
        row("unsafe ends", unsafe, "", "0", unsafe == 0),
        row("flights that the simulator broke off", broken, "", "0", broken == 0),
        row("hardest touch-down of them", hardest, "m/s", f"< {faults.SAFE_TOUCH_DOWN_M_S:g}"),
    ]


def rows(faulty: int, seed: int, flights: int) -> list[Row]:
    """`flights` 0: faults only; 1: poses at 100 Hz; 3: at 50, 100 and 200 Hz. `seed`: number of the first fault."""
    model = vehicle.example("rigter2019")
    rates_hz = {0: [], 1: [100.0]}.get(flights, [50.0, 100.0, 200.0])
    table = tracking(model, rates_hz)
    for name, course in ((WALK, walk), (EIGHT, curves.eight)) if flights else ():
        table += or_failed(f"{name}, drag hidden", lambda: hidden_drag(model, name, course()))  # noqa: B023 - at once
    table += or_failed("thrust map from one log", lambda: thrust_error(model)) if flights else []
    table += or_failed("other thrust than the file's", lambda: weak(model)) if flights else []
    table += with_faults(model, faulty, seed) if faulty else []
    return [*table, row("CPU time", cpu_s(), "s")]


def cpu_s() -> float:
    """Of this process and those it started, the firmware's too."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime for each in used)


if __name__ == "__main__":
    report.main(rows, faulty=10, seed=0, flights=1)
