import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
from esdf import solids
from planner import PlanOptions
from planner.curve import minimum_snap
from planner.optimise import bry
from planner.route import routes

BRY = PlanOptions(method="bry", search_checks=2000)


def walk(seed: int, count: int) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * [3.0, 3.0, 0.7], axis=0)


@settings(max_examples=10)
@given(st.integers(0, 1000), st.integers(2, 12))
def test_the_quadratic_program_is_the_closed_form_where_nothing_binds(seed, count):
    spline = bry.allocate(walk(seed, count), np.ones(count - 1))
    exact = minimum_snap.solve(walk(seed, count), spline.durations_s)
    program, closed = minimum_snap.trajectory(spline), minimum_snap.trajectory(exact)
    times = program.sample(0.01)
    assert np.abs(program.position(times) - closed.position(times)).max() < 1e-5
    assert spline.snap_cost() == pytest.approx(exact.snap_cost(), rel=1e-6)


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_the_gradient_is_that_of_finite_differences(seed):
    points, T = walk(seed, 6), np.random.default_rng(seed).uniform(0.5, 2.0, 5)
    _, slope = bry.cost_and_gradient(minimum_snap.solve(points, T))
    h = 1e-6
    sides = [[bry.cost_and_gradient(minimum_snap.solve(points, T + s * h * e))[0] for s in (1, -1)] for e in np.eye(5)]
    numeric = np.array([(up - down) / (2 * h) for up, down in sides])
    assert np.allclose(slope, numeric, rtol=1e-4, atol=1e-4 * np.abs(numeric).max())


def test_no_single_time_could_be_changed_for_the_better():
    points = walk(3, 8)
    spline = bry.allocate(points, np.ones(7))
    cost, _ = bry.cost_and_gradient(spline)
    for e in np.eye(7):
        for factor in (0.9, 1.1):
            changed = minimum_snap.solve(points, spline.durations_s * (1.0 + (factor - 1.0) * e))
            assert bry.cost_and_gradient(changed)[0] > cost


def test_it_flies_through_the_door(two_rooms, drone, through):
    ask = through((-3, -2, 1), (3, -2, 1))
    plan = planner.plan(ask, two_rooms, drone, BRY)
    assert plan.method == "bry"
    assert two_rooms.distance(plan.trajectory.position(plan.trajectory.sample(0.001))).min() >= 0.3
    assert plan.trajectory.duration_s > planner.plan(ask, two_rooms, drone).trajectory.duration_s


def test_waypoints_are_put_in_where_the_polynomials_collide():
    hall = solids.Scene([solids.Room((0, 0, 0), (10, 10, 3)), solids.Box((1.2, 1.2, -0.1), (10.1, 10.1, 3.1))])
    corners = np.array([[0.6, 9.0, 1.0], [0.6, 0.6, 1.0], [9.0, 0.6, 1.0]])
    spline, route = bry.solve(routes.Route(corners, np.arange(3)), hall, PlanOptions(radius_m=0.15), None)
    assert len(route.points) > 3
    assert set(route.waypoint) == {-1, 0, 1, 2}
    path = minimum_snap.trajectory(spline)
    assert hall.distance(path.position(path.sample(0.001))).min() >= 0.3


def test_in_the_open_it_stops_nowhere_and_is_slower_than_the_fastest(open_sky, drone, through):
    ask = through((0, 0, 1), (4, 0, 2), (4, 4, 1), (0, 4, 2))
    plan = planner.plan(ask, open_sky, drone, BRY)
    inner = plan.trajectory.starts_s[1:-1]
    assert np.linalg.norm(plan.trajectory.position(inner, 1), axis=1).min() > 0.5
    assert plan.trajectory.duration_s > planner.plan(ask, open_sky, drone).trajectory.duration_s


def test_it_can_be_cancelled(open_sky, drone, through):
    flag = planner.StopFlag()
    flag.set()
    with pytest.raises(planner.PlanCancelledError):
        planner.plan(through((0, 0, 1), (3, 0, 1), (4, 4, 1)), open_sky, drone, BRY, stop=flag)
