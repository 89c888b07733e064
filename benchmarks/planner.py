"""Flight time and planning time in the open, and 50 seeded forests and rooms, every plan checked by brute force."""

import time

import numpy as np
import planner_scenes
import report

import planner
import vehicle
from esdf import solids
from flight import InfeasibleError, InputError, Waypoints
from planner import hermite, minimum_snap, repair, time_allocation


def rows() -> list[report.Row]:
    drone = vehicle.example("rigter2019")
    return [*in_the_open(drone), *kernels(drone), *in_scenes(drone, 50)]


def in_the_open(drone: vehicle.Vehicle, walks: int = 10) -> list[report.Row]:
    """Ten random walks of ten waypoints; the textbook peer shares out time by distance and scales it to the limits."""
    sky = solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])
    ours, textbook, one_piece, seconds = [], [], [], []
    for seed in range(walks):
        rng = np.random.default_rng(seed)
        points = np.cumsum(rng.normal(size=(10, 3)) * [3.0, 3.0, 0.7], axis=0)
        ask = Waypoints(points, np.full(10, np.nan))
        start = time.process_time()
        ours.append(planner.plan(ask, sky, drone).trajectory.duration_s)
        seconds.append(time.process_time() - start)
        one_piece.append(planner.plan(ask, sky, drone, planner.PlanOptions(pieces=1)).trajectory.duration_s)
        textbook.append(textbook_duration_s(points, drone))
    gain = 1.0 - np.sum(ours) / np.sum(textbook)
    peers = {"textbook": float(np.mean(textbook)), "one polynomial a leg": float(np.mean(one_piece))}
    return [
        report.row("10 waypoints, open: flight time, mean of 10 walks", np.mean(ours), "s", None, None, peers),
        report.row("  less than time shared out by distance", 100 * gain, "%", ">= 12", gain >= 0.12),
        report.row("  planning, median", np.median(seconds), "CPU s", "< 0.3", np.median(seconds) < 0.3),
    ]


def textbook_duration_s(points: np.ndarray, drone: vehicle.Vehicle) -> float:
    """Minimum snap with time in proportion to a trapezoid of speed on each leg, scaled until the limits are met."""
    speed, push = drone.limits.speed_m_s, drone.limits.acceleration_m_s2
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    T = np.where(lengths > speed**2 / push, lengths / speed + speed / push, 2.0 * np.sqrt(lengths / push))
    spline = minimum_snap.solve(points, T)
    path = repair.position_trajectory(spline)
    return path.scale_time(repair.time_scale(path, drone, drone.limits)).duration_s


def kernels(drone: vehicle.Vehicle) -> list[report.Row]:
    rng = np.random.default_rng(0)
    long = np.cumsum(rng.normal(size=(1001, 4)), axis=0)
    T = rng.uniform(0.5, 2.0, 1000)
    snap = report.cpu_seconds(lambda: minimum_snap.solve(long, T), 5)
    problem = time_allocation.Problem(
        knots=long[:31, :3],
        free=np.ones(31, dtype=bool),
        bounds=planner.limits.point_mass_bounds(drone, drone.limits),
        field=planner_scenes.place(0).field,
        clearance_m=0.3,
        weights=time_allocation.Weights(),
    )
    d = hermite.segment_states(minimum_snap.solve(long[:31, :3], T[:30]).states)

    def many(work) -> float:  # pyright: ignore[reportMissingParameterType]
        return report.cpu_seconds(lambda: [work(problem, d, T[:30]) for _ in range(100)]) / 100

    fast, plain = many(time_allocation._running_cost), many(time_allocation.running_cost_numpy)
    return [
        report.row("minimum snap through 1000 waypoints, 4 axes", 1e3 * snap, "CPU ms", "< 5", snap < 5e-3),
        report.row("running cost and gradient, 30 segments", 1e6 * fast, "CPU us", None, None, {"NumPy": 1e6 * plain}),
    ]


def in_scenes(drone: vehicle.Vehicle, count: int) -> list[report.Row]:
    seconds, methods, faulty, refused = [], [], 0, 0
    for seed in range(count):
        place = planner_scenes.place(seed)
        start = time.process_time()
        try:
            plan = planner.plan(place.waypoints, place.field, drone)
        except (InfeasibleError, InputError):
            refused += 1
            continue
        finally:
            seconds.append(time.process_time() - start)
        methods.append(plan.method)
        faulty += bool(planner_scenes.faults(plan, place, drone))
    share = 100.0 * len(methods) / count
    return [
        report.row(f"{count} scenes: planned", share, "%", ">= 98", share >= 98, {"refused": refused}),
        report.row("  plans that fail the brute-force check", faulty, "plans", "0", faulty == 0),
        report.row("  direct or bent, not by corridor", 100 * np.mean([m in ("direct", "bent") for m in methods]), "%"),
        report.row("  planning, median", np.median(seconds), "CPU s", "< 0.6", np.median(seconds) < 0.6),
        report.row("  planning, longest", np.max(seconds), "CPU s", "< 3", np.max(seconds) < 3),
    ]


if __name__ == "__main__":
    report.main(rows)
