"""Kernels, flight and planning times in the open and in clutter; plans among obstacles are checked by brute force."""

import contextlib
import itertools
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from unittest import mock

import numpy as np
import planner_mixed
import planner_scenes
import report
from planner_scenes import walk

import planner
import vehicle
from esdf import solids
from flight import InfeasibleError, InputError, Waypoints
from planner import mission as missions
from planner.curve import minimum_snap
from planner.optimise import airframe, descents, repair, time_allocation
from planner.request.options import MOST_STARTS
from planner.request.space import DistanceField

SKY = solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])
"""Nothing to bump into."""


def rows() -> list[report.Row]:
    drone = vehicle.example("rigter2019")
    return [
        *snap(),
        *times_alone(drone),
        *in_the_open(drone),
        *dragged(drone),
        *cancelled(drone),
        *optimum_and_flown(drone, 30),
        *answers(20),
        *answers_in_clutter(drone, 4),
        *kernel(drone),
        *in_scenes(drone, 50),
        *in_clutter(drone, 10),
        *on_walks(drone, 40),
        *planner_mixed.rows(200),
        *gate_courses(drone, 50),
    ]


def unheaded(points: np.ndarray) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


def snap() -> list[report.Row]:
    """Fixed times, four axes, coefficients out."""
    found = []
    for count, bar_ms in ((10, 0.008), (50, 0.03), (200, 0.12), (1000, 0.6)):
        rng = np.random.default_rng(0)
        positions, T = np.cumsum(rng.normal(size=(count, 4)), axis=0), rng.uniform(0.5, 2.0, count - 1)

        def work(positions: np.ndarray = positions, T: np.ndarray = T) -> None:
            for _ in range(100):
                spline = minimum_snap.solve(positions, T)
                minimum_snap.coefficients(spline.states, T)

        ms = 10.0 * report.cpu_seconds(work)
        found.append(report.row(f"minimum snap, {count} waypoints", ms, "CPU ms", f"< {bar_ms}", ms < bar_ms))
    return found


def times_alone(drone: vehicle.Vehicle) -> list[report.Row]:
    """Only speed and acceleration bind; one polynomial a leg, from a slow start."""
    free = replace(drone.limits, speed_m_s=5.0, acceleration_m_s2=8.0, tilt_rad=3.0, rate_rad_s=1e3, yaw_rate_rad_s=1e3)
    frame = airframe.reduced(drone, replace(free, rotor_speed_min_rad_s=1e-3, rotor_speed_max_rad_s=1e6))
    found = []
    for count, bar_ms in ((10, 6.0), (50, 25.0), (200, 100.0)):
        knots = np.column_stack([walk(count, 0), np.zeros(count)])
        weights = time_allocation.Weights(snap=1e-7, limits=1500.0, clearance=0.0)
        nothing = np.zeros((count, 4), dtype=bool)
        problem = time_allocation.Problem(knots, nothing, frame, SKY, 0.3, weights)
        slow = np.maximum(np.linalg.norm(np.diff(knots, axis=0), axis=1), 0.3) / 1.5
        ms = 1e3 * report.cpu_seconds(lambda problem=problem, slow=slow: time_allocation.optimise(problem, slow))
        flight_s = time_allocation.optimise(problem, slow).durations_s.sum()
        name = f"times alone, {count} waypoints, 5 m/s, 8 m/s2"
        found.append(report.row(name, ms, "CPU ms", f"< {bar_ms:g}", ms < bar_ms, {"flight s": flight_s}))
    return found


def optimum_and_flown(drone: vehicle.Vehicle, seeds: int) -> list[report.Row]:
    """What the optimiser took for the shortest time, and what passed the gate."""
    apart = []
    for seed in range(seeds):
        plan = planner.plan(unheaded(walk(10, seed)), SKY, drone)
        apart.append(100.0 * (plan.trajectory.duration_s / plan.optimum_s - 1.0))
    median, worst = float(np.median(apart)), float(np.max(apart))
    return [
        report.row(f"flown longer than the optimum, median of {seeds}", median, "%", "< 1", median < 1.0),
        report.row("  worst", worst, "%", "< 2", worst < 2.0),
    ]


def answers(walks: int) -> list[report.Row]:
    """How much an answer depends on what should not matter: the start, the last micrometre, a heading that is free."""
    found = []
    for name, drone in planner_scenes.vehicles().items():
        above, moved, freed, seconds, converged = [], [], [], [], 0
        for seed in range(walks):
            points = planner_scenes.walk(10, seed)
            begun = time.process_time()
            plan = planner.plan(unheaded(points), SKY, drone)
            seconds.append(time.process_time() - begun)
            converged += plan.converged
            duration_s = plan.trajectory.duration_s
            above.append(100.0 * (duration_s / best_of_starts(unheaded(points), SKY, drone) - 1.0))
            near = unheaded(points + 1e-6 * np.random.default_rng(seed).normal(size=points.shape))
            moved.append(100.0 * abs(planner.plan(near, SKY, drone).trajectory.duration_s / duration_s - 1.0))
            steady, free = (
                planner.plan(unheaded(points), SKY, drone, planner.PlanOptions(yaw=yaw)).trajectory.duration_s
                for yaw in ("steady", "free")
            )
            freed.append(100.0 * (free / min(duration_s, steady) - 1.0))
        found += _spread(f"{name}: above the best of 8 starts, 10 x iterations", above, 0.1, 0.3)
        found += _spread("  change by 1e-6 m", moved, 0.02, 0.3)
        found += [
            report.row(
                "  yaw free over the better of along_path, steady, worst", max(freed), "%", "< 0.1", max(freed) < 0.1
            ),
            report.row("  converged", converged, "plans", f"{walks}", converged == walks),
            report.row("  planning, median", float(np.median(seconds)), "CPU s", None, None, {"longest": max(seconds)}),
        ]
    return found


def answers_in_clutter(drone: vehicle.Vehicle, seeds: int) -> list[report.Row]:
    own = planner_scenes.clutter_vehicle(drone)
    options = planner.PlanOptions(radius_m=0.1, margin_m=0.1, control_reserve=0.0)
    above = []
    for kind, seed in itertools.product(planner_scenes.CLUTTER, range(seeds)):
        place = planner_scenes.clutter(kind, seed)
        found_s = planner.plan(place.waypoints, place.field, own, options).trajectory.duration_s
        above.append(100.0 * (found_s / best_of_starts(place.waypoints, place.field, own, options) - 1.0))
    return _spread(f"{len(above)} cluttered scenes: above the best of 8 starts, 10 x iterations", above, 0.1, 0.3)


def best_of_starts(
    waypoints: Waypoints, field: DistanceField, drone: vehicle.Vehicle, options: planner.PlanOptions | None = None
) -> float:
    """The shortest flight of eight: other prices to begin with, other times to start from."""
    asked = replace(planner.PlanOptions() if options is None else options, starts=MOST_STARTS)
    with mock.patch.multiple(descents, _MOST=1500, _FIRST=1500, _PRECISION=1e-6, _KINKED=1e-6, _STEEP=1e-6):
        return planner.plan(waypoints, field, drone, asked).trajectory.duration_s


def _spread(title: str, values: list[float], median: float, worst: float) -> list[report.Row]:
    middle, most = float(np.median(values)), max(values)
    return [
        report.row(f"{title}, median of {len(values)}", middle, "%", f"< {median}", middle < median),
        report.row("  worst", most, "%", f"< {worst}", most < worst),
    ]


def in_the_open(drone: vehicle.Vehicle, walks: int = 10) -> list[report.Row]:
    """Ten random walks of ten waypoints; the textbook peer shares out time by distance and scales it to the limits."""
    ours, textbook, one_piece, seconds = [], [], [], []
    for seed in range(walks):
        points = walk(10, seed)
        start = time.process_time()
        ours.append(planner.plan(unheaded(points), SKY, drone).trajectory.duration_s)
        seconds.append(time.process_time() - start)
        single = planner.plan(unheaded(points), SKY, drone, planner.PlanOptions(pieces=1))
        one_piece.append(single.trajectory.duration_s)
        textbook.append(textbook_duration_s(points, drone))
    gain = 1.0 - np.sum(ours) / np.sum(textbook)
    peers = {"textbook": float(np.mean(textbook)), "one polynomial a leg": float(np.mean(one_piece))}
    found = [
        report.row("10 waypoints, open: flight time, mean of 10 walks", np.mean(ours), "s", None, None, peers),
        report.row("  less than time shared out by distance", 100 * gain, "%", ">= 12", gain >= 0.12),
        report.row("  planning, median", np.median(seconds), "CPU s", "< 0.04", np.median(seconds) < 0.04),
    ]
    for count, bar_s in ((50, 0.12), (200, 0.5), (1000, 3.0)):
        points = unheaded(walk(count, 0))
        cpu_s = report.cpu_seconds(lambda points=points: planner.plan(points, SKY, drone), 1)
        found.append(report.row(f"{count} waypoints, open: planning", cpu_s, "CPU s", f"< {bar_s}", cpu_s < bar_s))
    return found


def dragged(drone: vehicle.Vehicle) -> list[report.Row]:
    """Six waypoints of fifty in the open, and three of ten in each of eight forests, dragged in eight steps each."""
    rng, session = np.random.default_rng(1), planner.Planner(unheaded(walk(50, 0)), SKY, drone)
    in_the_open = [each for index in rng.integers(1, 49, 6) for each in steps(session, int(index), rng)]
    scratch_s = planner.plan(session.plan.waypoints, SKY, drone).trajectory.duration_s
    longer = 100.0 * (session.plan.trajectory.duration_s / scratch_s - 1.0)
    in_forests = []
    for seed in range(100, 108):
        place = planner_scenes.forest_of_ten(seed)
        session = planner.Planner(place.waypoints, place.field, drone, planner_scenes.OPTIONS)
        in_forests += [each for index in rng.integers(0, 10, 3) for each in steps(session, int(index), rng)]
    return [
        *drag_rows("drag open, one of 50", in_the_open, 16.0, 33.0),
        report.row("  longer than planned from scratch after 48 moves", longer, "%", "< 2", longer < 2.0),
        *drag_rows("drag forest, one of 10", in_forests, 33.0, None),
    ]


@dataclass(frozen=True)
class Step:
    """One step of a drag: CPU time of draft and checked plan, and how much longer a flight the draft foretold."""

    draft_ms: float
    exact_ms: float
    longer: float
    lack_m: float
    """Of the draft's clearance."""


def steps(session: planner.Planner, index: int, rng: np.random.Generator) -> list[Step]:
    """Eight steps of one drag, or as many as lead through free space."""
    found, step = [], rng.normal(size=3) * [0.1, 0.1, 0.03]
    for _ in range(8):
        target = session.plan.waypoints.positions_world_m[index] + step
        begun_s = time.process_time()
        try:
            draft = session.draft(index, target)
        except InputError:  # too close to a trunk
            break
        drafted_s = time.process_time()
        exact = session.move(index, target)
        done_s = time.process_time()
        longer = draft.duration_s / exact.trajectory.duration_s - 1.0
        lack_m = max(draft.required_clearance_m - draft.clearance_m, 0.0)
        found.append(Step(1e3 * (drafted_s - begun_s), 1e3 * (done_s - drafted_s), longer, lack_m))
    return found


def drag_rows(name: str, found: list[Step], draft_ms: float, exact_ms: float | None) -> list[report.Row]:
    """Bars of the drafts' 95th percentile and of the slowest checked plan."""
    rows = []
    for kind, cpu_ms in (("draft", [s.draft_ms for s in found]), ("checked plan", [s.exact_ms for s in found])):
        median, p95, worst = np.percentile(cpu_ms, [50, 95, 100])
        rows.append(report.row(f"{name}, {kind}: median", median, "CPU ms"))
        if kind == "draft":
            rows.append(report.row("  95th percentile", p95, "CPU ms", f"< {draft_ms:g}", p95 < draft_ms))
            rows.append(report.row("  worst", worst, "CPU ms"))
        else:
            rows.append(report.row("  95th percentile", p95, "CPU ms"))
            bar = (None, None) if exact_ms is None else (f"< {exact_ms:g}", worst < exact_ms)
            rows.append(report.row("  worst", worst, "CPU ms", *bar))
    off = 100.0 * float(np.percentile(np.abs([s.longer for s in found]), 95))
    close = 1000.0 * max(s.lack_m for s in found)
    rows.append(report.row("  flight time of drafts off by, 95th percentile", off, "%", "< 3", off < 3.0))
    rows.append(report.row("  clearance that drafts lack, worst", close, "mm"))
    return rows


def cancelled(drone: vehicle.Vehicle, times: int = 24) -> list[report.Row]:
    """Processor time from a stop, at moments all through a long plan in the open and among trunks, to its end."""
    points = walk(200, 0)
    trunks = solids.Scene([solids.Cylinder((*(0.5 * (a + b)), 0.0), 0.3, 200.0) for a, b in crossed(points)])
    late_ms = []
    for scene in (SKY, trunks):
        whole_s = report.cpu_seconds(lambda scene=scene: planner.plan(unheaded(points), scene, drone), 1)
        for n in range(times):
            stop, set_s = planner.StopFlag(), []
            setter = threading.Thread(target=_set_after, args=(stop, (n + 0.5) / times * whole_s, set_s))
            setter.start()
            with contextlib.suppress(planner.PlanCancelledError):
                planner.plan(unheaded(points), scene, drone, stop=stop)
            ended_s = time.process_time()
            setter.join()
            late_ms.append(1e3 * max(ended_s - set_s[0], 0.0))
    worst = max(late_ms)
    return [report.row("cancel a plan of 200 waypoints: worst", worst, "CPU ms", "< 50", worst < 50.0)]


def crossed(points: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Where every tenth leg of more than 3 m is, on the ground: a trunk there is in its way."""
    legs = [(a[:2], b[:2]) for a, b in itertools.pairwise(points) if np.linalg.norm(b - a) > 3.0]
    return [(a, b) for a, b in legs[::10] if np.linalg.norm(points[:, :2] - 0.5 * (a + b), axis=1).min() > 0.8]


def _set_after(stop: planner.StopFlag, cpu_s: float, set_s: list[float]) -> None:
    begun_s = time.process_time()
    while time.process_time() - begun_s < cpu_s:
        time.sleep(1e-3)
    set_s.append(time.process_time())
    stop.set()


def textbook_duration_s(points: np.ndarray, drone: vehicle.Vehicle) -> float:
    """Minimum snap with time in proportion to a trapezoid of speed on each leg, scaled until the limits are met."""
    speed, push = drone.limits.speed_m_s, drone.limits.acceleration_m_s2
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    T = np.where(lengths > speed**2 / push, lengths / speed + speed / push, 2.0 * np.sqrt(lengths / push))
    spline = minimum_snap.solve(points, T)
    path = minimum_snap.trajectory(spline)
    return path.scale_time(repair.time_scale(path, drone, drone.limits)).duration_s


def kernel(drone: vehicle.Vehicle) -> list[report.Row]:
    rng = np.random.default_rng(0)
    knots, T = np.cumsum(rng.normal(size=(31, 4)), axis=0), rng.uniform(0.5, 2.0, 30)
    problem = time_allocation.Problem(
        knots=knots,
        free=np.ones((31, 4), dtype=bool),
        airframe=airframe.reduced(drone, drone.limits),
        field=SKY,
        clearance_m=0.3,
        weights=time_allocation.Weights(heading=0.2),
    )

    def many(work: Callable[..., object]) -> float:
        return report.cpu_seconds(lambda: [work(problem, knots, T) for _ in range(100)]) / 100

    fast, plain = many(time_allocation.cost_and_gradient), many(time_allocation.cost_numpy)
    peers = {"NumPy, cost alone": 1e6 * plain}
    return [report.row("cost and gradient, 30 segments", 1e6 * fast, "CPU us", None, None, peers)]


def in_scenes(drone: vehicle.Vehicle, count: int) -> list[report.Row]:
    seconds, methods, faulty, refused = [], [], 0, 0
    for seed in range(count):
        place = planner_scenes.place(seed)
        start = time.process_time()
        try:
            plan = planner.plan(place.waypoints, place.field, drone, planner_scenes.OPTIONS)
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


def in_clutter(drone: vehicle.Vehicle, seeds: int) -> list[report.Row]:
    """Forests, offices and mazes, 0.2 m clear; the check by brute force allows for the map's voxels."""
    own = planner_scenes.clutter_vehicle(drone)
    options = planner.PlanOptions(radius_m=0.1, margin_m=0.1, control_reserve=0.0)
    found, seconds, refused, faulty = [], [], 0, 0
    for kind in planner_scenes.CLUTTER:
        flights = []
        for seed in range(seeds):
            place = planner_scenes.clutter(kind, seed)
            start = time.process_time()
            try:
                plan = planner.plan(place.waypoints, place.field, own, options)
            except (InfeasibleError, InputError):
                refused += 1
                continue
            finally:
                seconds.append(time.process_time() - start)
            flights.append(plan.trajectory.duration_s)
            faulty += bool(planner_scenes.faults(plan, place, own, 0.2))
        found.append(report.row(f"{kind}: flight time, mean of {seeds}", np.mean(flights), "s"))
    solved, median, worst = len(seconds) - refused, float(np.median(seconds)), float(np.max(seconds))
    return [
        *found,
        report.row(f"{len(seconds)} cluttered scenes: planned", solved, "scenes", f"{len(seconds)}", refused == 0),
        report.row("  plans that fail the brute-force check", faulty, "plans", "0", faulty == 0),
        report.row("  planning, median", median, "CPU s", "< 0.15", median < 0.15),
        report.row("  planning, longest", worst, "CPU s", "< 0.4", worst < 0.4),
    ]


def on_walks(drone: vehicle.Vehicle, count: int) -> list[report.Row]:
    """Waypoints along swaying walks, many with little more than the clearance that they must have."""
    seconds, methods, longer, faulty = [], [], [], 0
    for seed in range(count):
        place = planner_scenes.walked(seed)
        start = time.process_time()
        plan = planner.plan(place.waypoints, place.field, drone, planner_scenes.OPTIONS)
        seconds.append(time.process_time() - start)
        methods.append(plan.method)
        longer.append(100.0 * (plan.trajectory.duration_s / plan.optimum_s - 1.0))
        faulty += bool(planner_scenes.faults(plan, place, drone))
    direct, boxed, worst = methods.count("direct"), methods.count("corridor"), float(np.max(longer))
    return [
        report.row(f"{count} walks: planned without being bent away", direct, "walks", None, None, {"corridor": boxed}),
        report.row("  plans that fail the brute-force check", faulty, "plans", "0", faulty == 0),
        report.row("  flown longer than the optimum, worst", worst, "%"),
        report.row("  planning, median", float(np.median(seconds)), "CPU s", None, None, {"longest": max(seconds)}),
    ]


def gate_courses(drone: vehicle.Vehicle, count: int) -> list[report.Row]:
    """Tilted gates, turned more and more from the way through them."""
    found = []
    for off_deg in (60, 90, 180):
        planned = 0
        for seed in range(count):
            with contextlib.suppress(planner.PlanInfeasibleError):
                missions.plan(planner_scenes.gate_course(seed, np.radians(off_deg)), SKY, drone)
                planned += 1
        name = f"{count} gate courses, turned up to {off_deg} deg: planned"
        found.append(report.row(name, planned, "plans", f"{count}", planned == count))
    return found


if __name__ == "__main__":
    report.main(rows)
