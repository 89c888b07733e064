"""The descents through whole knot states, and what they start from."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import planner
import vehicle
from esdf import solids
from flight import InputError, Waypoints
from flight.trajectory import fingerprint
from planner.curve import minimum_snap
from planner.optimise import airframe, attempts, descents, methods, time_allocation
from planner.optimise.time_allocation import Problem, Weights
from planner.request import inputs
from planner.request.conditions import Conditions
from planner.request.inputs import Request
from planner.route import routes

SKY = solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])
SEEDS = st.integers(0, 100_000)


def walk(count: int, seed: int) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * [3.0, 3.0, 0.7], axis=0)


def problem(seed: int, segments: int = 6, **given) -> tuple[Problem, minimum_snap.Spline]:
    """A walk whose knots, but for the ends, may move by little; and a slow spline through it."""
    drone, rng = vehicle.example("rigter2019"), np.random.default_rng(seed)
    knots = np.column_stack([walk(segments + 1, seed), 0.3 * rng.normal(size=segments + 1)])
    free = np.zeros((segments + 1, 4), dtype=bool)
    free[1:-1:2] = True
    frame = airframe.reduced(drone, drone.limits)
    weights = Weights(snap=1e-7, limits=40.0, clearance=100.0, heading=0.4, turning=1e-4)
    p = Problem(knots, free, frame, SKY, 0.3, weights, **given)
    T = rng.uniform(0.7, 1.3, segments) * np.maximum(np.linalg.norm(np.diff(knots[:, :3], axis=0), axis=1), 0.5) / 2.0
    return p, p.spline(knots, T)


def cost(p: Problem, spline: minimum_snap.Spline) -> float:
    return time_allocation.slopes(p, spline)[0]


def nudged(p: Problem, spline: minimum_snap.Spline, rng: np.random.Generator, size: float) -> minimum_snap.Spline:
    """Another spline near by that keeps what is given."""
    T = spline.durations_s
    powers = np.append(T, T[-1])[:, None] ** -np.arange(4.0)
    change = size * rng.normal(size=spline.states.shape) * powers[..., None]
    change[[0, -1], 1:] = 0.0
    change[:, 0] *= p.free
    return minimum_snap.Spline(T * np.exp(size * rng.normal(size=T.shape)), spline.states + change)


@settings(max_examples=15)
@given(SEEDS)
def test_the_cost_of_a_minimum_snap_spline_is_that_of_the_first_descent(seed):
    p, spline = problem(seed)
    first, _, _ = time_allocation.cost_and_gradient(p, p.knots, spline.durations_s)
    assert cost(p, spline) == pytest.approx(first, rel=1e-9)


@settings(max_examples=10)
@given(SEEDS)
@example(8196)  # where heavy damping makes steps short, four of them gain nothing
def test_it_costs_less_and_nothing_near_by_costs_less_than_it_promises(seed):
    p, spline = problem(seed)
    found = time_allocation.refine(p, spline, iterations=300)
    assert found.cost <= cost(p, spline)
    assert found.cost == pytest.approx(cost(p, found.spline), rel=1e-12)
    rng = np.random.default_rng(seed)
    if found.converged:
        for size in (1e-5, 1e-4, 1e-3):
            least = min(cost(p, nudged(p, found.spline, rng, size)) for _ in range(10))
            assert least > found.cost * (1.0 - 1e-4)


@settings(max_examples=20)
@given(SEEDS, st.booleans(), st.booleans())
def test_the_gradient_is_that_of_finite_differences(seed, own_time, target):
    rng = np.random.default_rng(seed)
    p, spline = problem(seed, 3)
    normal, across = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    gates, balls = np.zeros((4, 3, 3)), np.zeros((4, 4))
    gates[1] = p.knots[1, :3] + 0.5 * normal + 0.3 * across, 0.3 * normal, 0.2 * across
    balls[2] = [*(p.knots[2, :3] + 0.4 * normal), 0.3]
    given = {"reference_s": None if own_time else rng.uniform(0.5, 2.0, 3), "gates": gates, "balls": balls}
    p = replace(
        p, weights=replace(p.weights, snap=1e-4), target_world_m=rng.normal(size=3) if target else None, **given
    )
    spline = minimum_snap.Spline(0.7 * spline.durations_s, spline.states)
    _, by_states, by_log_durations = time_allocation.slopes(p, spline)
    h = 1e-6
    for _ in range(10):
        along, longer = rng.normal(size=spline.states.shape), rng.normal(size=3)
        ahead, back = (
            time_allocation.slopes(
                p, minimum_snap.Spline(spline.durations_s * np.exp(s * longer), spline.states + s * along)
            )[0]
            for s in (h, -h)
        )
        slope = (by_states * along).sum() + by_log_durations @ longer
        assert (ahead - back) / (2.0 * h) == pytest.approx(slope, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("given", ["nothing", "motion at the ends", "a velocity"])
def test_what_is_given_stays(given):
    rng = np.random.default_rng(3)
    velocity = np.full((7, 4), np.nan)
    velocity[2] = [1.0, 0.5, 0.0, 0.0]
    kinds = {
        "nothing": {},
        "motion at the ends": {"start": 0.5 * rng.normal(size=(3, 4)), "end": 0.5 * rng.normal(size=(3, 4))},
        "a velocity": {"velocity": velocity},
    }
    p, spline = problem(1, **kinds[given])
    found = time_allocation.refine(p, spline, iterations=30).spline
    assert np.allclose(found.states[[0, -1]], spline.states[[0, -1]], rtol=0.0, atol=1e-12)
    assert np.array_equal(found.states[:, 0][~p.free], spline.states[:, 0][~p.free])
    if given == "a velocity":
        assert np.allclose(found.states[2, 1], velocity[2])
        assert not np.allclose(found.states[3, 1], spline.states[3, 1])


def test_a_knot_in_a_gate_moves_in_its_plane_only_and_towards_its_opening():
    p, spline = problem(2)
    free = np.zeros_like(p.free)
    free[3, :3] = True
    normal = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    left, up = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2.0), np.array([0.0, 0.0, 1.0])
    gates = np.zeros((7, 3, 3))
    gates[3] = p.knots[3, :3] + 1.5 * left, 0.4 * left, 0.4 * up  # the knot begins outside
    held = replace(p, free=free, gates=gates)
    found = time_allocation.refine(held, spline, iterations=200).spline
    moved = found.states[3, 0, :3] - spline.states[3, 0, :3]
    assert abs(moved @ normal) < 1e-9
    assert moved @ left == pytest.approx(1.1, abs=0.3)
    assert found.states[3, 1, :3] @ normal > 0.3 * np.linalg.norm(found.states[3, 1, :3])


def test_a_knot_comes_back_into_its_ball():
    p, spline = problem(4)
    free = np.zeros_like(p.free)
    free[3, :3] = True
    balls = np.zeros((7, 4))
    balls[3] = [*(p.knots[3, :3] + [1.0, 0.0, 0.0]), 0.2]
    found = time_allocation.refine(replace(p, free=free, balls=balls), spline, iterations=200).spline
    assert np.linalg.norm(found.states[3, 0, :3] - balls[3, :3]) < 0.3


def walked(seed: int) -> tuple[Problem, minimum_snap.Spline]:
    """Eight waypoints, as the planner comes to them."""
    drone, asked = vehicle.example("rigter2019"), Waypoints(walk(8, seed), np.full(8, np.nan))
    request = Request(asked, SKY, drone, inputs.options_for(drone, None), Conditions())
    route = methods.subdivided(routes.find(asked, SKY, request.options), SKY)
    rough, start = methods.rough(route, SKY, request)
    p, begin, _ = attempts.whole_vehicle(rough, start, route.waypoint, request, methods.CLEARANCE_PRICE)
    return p, begin


@pytest.mark.parametrize("seed", [1, 7])
def test_whole_states_cost_less_than_the_best_path_of_least_snap(seed):
    p, spline = walked(seed)
    least_snap = time_allocation.optimise(p, spline.durations_s, iterations=2000)
    best = next(descents.starts(p, spline, 0.3, None))
    assert best.cost < 0.98 * least_snap.cost


@pytest.mark.parametrize("seed", [2, 5])
def test_from_other_times_the_path_is_the_same_within_a_hundredth(seed):
    p, spline = walked(seed)
    slower = p.spline(p.knots, 1.5 * spline.durations_s)
    costs = [next(descents.starts(p, start, 0.3, None)).cost for start in (spline, slower)]
    assert costs[0] == pytest.approx(costs[1], rel=5e-3)


@pytest.mark.parametrize("seed", [1, 7])
def test_waypoints_moved_by_a_micrometre_do_not_change_the_flight_time(seed):
    drone, points = vehicle.example("rigter2019"), walk(8, seed)
    times = [
        planner.plan(Waypoints(points + off, np.full(8, np.nan)), SKY, drone).trajectory.duration_s
        for off in (0.0, 1e-6 * np.random.default_rng(seed).normal(size=points.shape))
    ]
    assert times[0] == pytest.approx(times[1], rel=3e-3)


@pytest.mark.parametrize("seed", [1, 23, 27])
def test_a_free_heading_never_costs_time(seed):
    """Optimised for itself alone it costs .3 to .8 % on these walks."""
    drone, asked = vehicle.example("rigter2019"), Waypoints(walk(4, seed), np.full(4, np.nan))
    yaws: tuple[planner.request.options.YawMode, ...] = ("along_path", "steady", "free")
    along, steady, free = (
        planner.plan(asked, SKY, drone, planner.PlanOptions(yaw=yaw)).trajectory.duration_s for yaw in yaws
    )
    assert free <= min(along, steady)


@pytest.mark.parametrize("yaw", ["along_path", "free"])
def test_the_fastest_of_several_starts_is_kept_whatever_the_number_of_processors(yaw, monkeypatch):
    drone, asked = vehicle.example("rigter2019"), Waypoints(walk(6, 2), np.full(6, np.nan))
    one, three = (planner.plan(asked, SKY, drone, planner.PlanOptions(starts=n, yaw=yaw)) for n in (1, 3))
    # a free heading goes on from the fastest path with a bound one, which need not lead to the fastest
    most = 1.001 if yaw == "free" else 1.0
    assert three.trajectory.duration_s <= most * one.trajectory.duration_s
    assert np.isnan(one.spread)
    assert 0.0 <= three.spread < 0.05
    monkeypatch.setattr(attempts.os, "cpu_count", lambda: 1)
    again = planner.plan(asked, SKY, drone, planner.PlanOptions(starts=3, yaw=yaw))
    assert fingerprint(again.trajectory) == fingerprint(three.trajectory)


def failing(which: set[int], error: BaseException):
    """`descents.starts`, of which some fail."""
    every = descents.starts

    def starts(problem, spline, clearance_m, stop, number, first):
        if number in which:
            raise error
        yield from every(problem, spline, clearance_m, stop, number, first)

    return starts


@pytest.mark.parametrize("lost", [{0}, {1, 2}])
def test_starts_that_lead_nowhere_do_not_cost_the_plan(lost, monkeypatch):
    drone, asked = vehicle.example("rigter2019"), Waypoints(walk(6, 2), np.full(6, np.nan))
    nowhere = planner.PlanInfeasibleError("nowhere", "start elsewhere")
    monkeypatch.setattr(descents, "starts", failing(lost, nowhere))
    assert planner.plan(asked, SKY, drone, planner.PlanOptions(starts=3)).gate.passed
    monkeypatch.setattr(descents, "starts", failing({0, 1, 2}, nowhere))
    with pytest.raises(planner.PlanInfeasibleError, match="nowhere; start elsewhere"):
        planner.plan(asked, SKY, drone, planner.PlanOptions(starts=3))


def test_ctrl_c_ends_the_starts_that_work(monkeypatch):
    drone, asked, flags = vehicle.example("rigter2019"), Waypoints(walk(6, 2), np.full(6, np.nan)), []
    interrupted = failing({0}, KeyboardInterrupt())

    def starts(problem, spline, clearance_m, stop, number, first):
        flags.append(stop)
        return interrupted(problem, spline, clearance_m, stop, number, first)

    monkeypatch.setattr(descents, "starts", starts)
    with pytest.raises(KeyboardInterrupt):
        planner.plan(asked, SKY, drone, planner.PlanOptions(starts=3))
    assert all(flag.is_set() for flag in flags)


def test_the_progress_of_several_starts_never_goes_back():
    drone, asked, told = vehicle.example("rigter2019"), Waypoints(walk(6, 2), np.full(6, np.nan)), []
    planner.plan(asked, SKY, drone, planner.PlanOptions(starts=3), progress=lambda _, fraction: told.append(fraction))
    assert told == sorted(told)


@pytest.mark.parametrize("starts", [0, 9])
def test_a_number_of_starts_out_of_range_is_refused(starts):
    with pytest.raises(InputError, match=f"starts is {starts}; it must be from 1 to 8"):
        planner.PlanOptions(starts=starts)
