import threading
from dataclasses import replace

import numpy as np
import pytest

from flight import InfeasibleError, InputError
from planner import PlanCancelledError, StopFlag
from planner.curve import minimum_snap
from planner.optimise import quadratic
from planner.optimise.quadratic import Constraints, SnapProgram
from planner.request import space
from planner.route import corridor


def random_problem(seed: int, segments: int = 6) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(size=(segments + 1, 3)), axis=0), rng.uniform(0.5, 1.5, segments)


def dense(spline: minimum_snap.Spline, derivative: int = 0) -> np.ndarray:
    path = minimum_snap.trajectory(spline)
    return path.position(path.sample(0.002), derivative)


@pytest.mark.parametrize("seed", range(4))
def test_without_inequalities_it_agrees_with_the_closed_form(seed):
    waypoints, T = random_problem(seed)
    program, exact = SnapProgram(Constraints(waypoints)).solve(T), minimum_snap.solve(waypoints, T)
    assert program.snap_cost() == pytest.approx(exact.snap_cost(), rel=1e-6)
    assert np.abs(program.states[:, 0] - waypoints).max() < 1e-12
    assert np.abs(program.states - exact.states).max() < 1e-3 * np.abs(exact.states).max()


def test_joins_are_continuous_through_jerk_whatever_the_solver_left_over():
    waypoints, T = random_problem(3)
    path = minimum_snap.trajectory(SnapProgram(Constraints(waypoints, speed_axis_m_s=12.0)).solve(T))
    for derivative in range(4):
        assert np.abs(path.join_jumps(derivative)).max() < 1e-9 * (1 + np.abs(path.coefficients).max())


def test_a_tolerance_lowers_the_snap_and_is_kept():
    waypoints, T = random_problem(2)
    exact = SnapProgram(Constraints(waypoints)).solve(T)
    loose = SnapProgram(Constraints(waypoints, tolerance_m=0.1)).solve(T)
    assert loose.snap_cost() < 0.95 * exact.snap_cost()
    assert np.abs(loose.states[:, 0] - waypoints).max() < 0.1 + 1e-5
    assert np.abs((loose.states[:, 0] - waypoints)[[0, -1]]).max() == 0.0


def test_speed_and_acceleration_stay_in_their_boxes_between_samples():
    waypoints, T = random_problem(5)
    T = 2.0 * T
    free = minimum_snap.solve(waypoints, T)
    hull = minimum_snap.segment_states(free.states) * minimum_snap.time_powers(T)[..., None]
    speed, push = (0.9 * np.abs(quadratic.control_points(r) @ hull / T[:, None, None] ** r).max() for r in (1, 2))
    boxed = SnapProgram(Constraints(waypoints, speed_axis_m_s=speed, acceleration_axis_m_s2=push)).solve(T)
    assert np.abs(dense(boxed, 1)).max() <= speed + 1e-3
    assert np.abs(dense(boxed, 2)).max() <= push + 1e-3
    assert boxed.snap_cost() > 1.001 * free.snap_cost()


def test_updating_the_times_gives_what_a_fresh_program_gives():
    waypoints, T = random_problem(8)
    constraints = Constraints(waypoints, tolerance_m=0.05, speed_axis_m_s=12.0)
    program = SnapProgram(constraints)
    program.solve(T)
    again, fresh = program.solve(1.3 * T), SnapProgram(constraints).solve(1.3 * T)
    assert again.snap_cost() == pytest.approx(fresh.snap_cost(), rel=1e-4)


def test_no_time_for_the_way_is_infeasible():
    with pytest.raises(InfeasibleError):
        SnapProgram(Constraints(np.array([[0.0, 0, 0], [10.0, 0, 0]]), speed_axis_m_s=1.0)).solve(np.array([2.0]))


def test_a_corridor_of_the_wrong_length_is_refused():
    with pytest.raises(InputError):
        SnapProgram(Constraints(np.zeros((3, 3)), corridor=[]))


def test_every_point_of_a_corridor_keeps_the_clearance_and_every_leg_lies_in_its_box(two_rooms):
    legs = np.array([[-3.0, -2.0, 1.0], [-1.0, 2.0, 1.2], [1.0, 2.0, 1.2], [3.0, 0.0, 1.5]])
    assert all(line.free for line in space.check_lines(two_rooms, legs[:-1], legs[1:], 0.3))
    rng = np.random.default_rng(1)
    for box, start, end in zip(corridor.boxes(two_rooms, legs, 0.3), legs[:-1], legs[1:], strict=True):
        assert box.lowest(np.linspace(start, end, 50)).min() > -1e-9
        low, high = -box.offsets_m[:3], box.offsets_m[3:]
        inside = rng.uniform(low, high, (20_000, 3)) @ box.normals[3:]
        assert two_rooms.distance(inside).min() >= 0.3
        assert np.prod(high - low) > 0.1


def test_the_path_through_a_corridor_stays_in_it(two_rooms):
    legs = np.array([[-3.0, -2.0, 1.0], [-1.0, 2.0, 1.2], [1.0, 2.0, 1.2], [3.0, 0.0, 1.5]])
    wanted = legs.copy()
    wanted[1:-1] = np.nan
    boxes = corridor.boxes(two_rooms, legs, 0.3)
    T = np.array([2.0, 1.5, 2.0])
    spline = SnapProgram(Constraints(wanted, corridor=boxes)).solve(T)
    assert two_rooms.distance(dense(spline)).min() >= 0.3 - 1e-4
    unbound = SnapProgram(Constraints(wanted)).solve(T)
    assert two_rooms.distance(dense(unbound)).min() < 0.0


def test_a_tube_is_a_distance_field_that_never_promises_more_than_there_is(two_rooms):
    legs = np.array([[-3.0, -2.0, 1.0], [-1.0, 2.0, 1.2], [1.0, 2.0, 1.2], [3.0, 0.0, 1.5]])
    tube = corridor.Tube(corridor.boxes(two_rooms, legs, 0.3), 0.3)
    points = np.random.default_rng(2).uniform([-4, -3, 0.5], [4, 3, 2.5], (400, 3))
    value, gradient = tube.distance_and_gradient(points)
    assert np.array_equal(value, tube.distance(points))
    inside = value >= 0.3
    assert inside.any()
    assert (two_rooms.distance(points[inside]) >= 0.3 - 1e-9).all()
    step = 1e-6 * gradient  # unit normals: the value grows as fast as one moves along them
    assert np.allclose(tube.distance(points + step) - value, 1e-6, atol=1e-9)


def tight(knots: np.ndarray, half_width_m: float) -> Constraints:
    """From the first knot to the last in boxes about the legs between, which run along an axis each."""
    ends = np.sort(np.stack([knots[:-1], knots[1:]]), axis=0)
    sides = np.vstack([np.eye(3), -np.eye(3)])
    reach_m = [np.concatenate([high, -low]) + half_width_m for low, high in zip(*ends, strict=True)]
    wanted = np.full_like(knots, np.nan)
    wanted[[0, -1]] = knots[[0, -1]]
    return Constraints(wanted, corridor=[corridor.Box(sides, reach) for reach in reach_m], residual=1e-3)


@pytest.fixture
def narrow():
    """A way round five corners in boxes 2 mm wide, at times that differ by a factor of sixty."""
    knots = np.array(
        [[0.0, 0, 0], [1, 0, 0], [1, 0.5, 0], [1, 0.5, 0.4], [1.8, 0.5, 0.4], [1.8, 1.2, 0.4], [2.4, 1.2, 0.4]]
    )
    return tight(knots, 0.001), np.array([2.5, 0.04, 1.0, 0.1, 2.0, 0.3])


def hurry(monkeypatch):
    """Give the first solve 25 iterations: it misses its bounds by decimetres."""
    monkeypatch.setattr(quadratic, "_BETWEEN_STOPS", 25)
    monkeypatch.setattr(quadratic, "_ITERATIONS", 25)


def test_bounds_that_the_first_solve_misses_are_met_by_a_second_one(narrow, monkeypatch):
    constraints, T = narrow
    exact = SnapProgram(constraints).solve(T)
    hurry(monkeypatch)
    again = SnapProgram(constraints).solve(T)
    assert again.snap_cost() == pytest.approx(exact.snap_cost(), rel=0.01)
    path = minimum_snap.trajectory(again)
    for box, start_s, duration_s in zip(constraints.corridor, path.starts_s, T, strict=False):
        times = start_s + np.linspace(0.0, duration_s, 50)
        assert box.lowest(path.position(times)).min() > -1e-3


def test_the_second_solve_is_sooner_within_its_bounds_than_the_first(narrow, monkeypatch):
    """It weighs them more: after a hundred iterations it misses them by a millimetre, the first by centimetres."""
    hurry(monkeypatch)
    constraints, T = narrow
    monkeypatch.setattr(quadratic, "_STIFF_ITERATIONS", 100)
    SnapProgram(replace(constraints, residual=5e-3)).solve(T)


@pytest.mark.parametrize("seed", [4, 6])
def test_the_second_solve_keeps_its_weight_of_the_bounds(monkeypatch, seed):
    """One that adapts to the snap, as in the first solve, leaves 3 and 9 mm where this leaves 0.1 and 0.3 mm."""
    rng = np.random.default_rng(seed)
    legs = np.zeros((21, 3))
    legs[np.arange(21), rng.integers(3, size=21)] = rng.choice([-1.0, 1.0], 21) * rng.uniform(0.3, 1.2, 21)
    constraints = tight(np.vstack([np.zeros(3), legs.cumsum(axis=0)]), 0.005)
    monkeypatch.setattr(quadratic, "_ITERATIONS", 250)  # the first solve misses its bounds by a centimetre
    monkeypatch.setattr(quadratic, "_STIFF_ITERATIONS", 500)
    SnapProgram(constraints).solve(np.exp(rng.uniform(np.log(0.05), np.log(2.7), 21)))


def test_a_solve_that_asks_for_cancellation_gives_the_answer_of_one_that_does_not(narrow, monkeypatch):
    constraints, T = narrow
    asking = SnapProgram(constraints).solve(T, StopFlag())
    monkeypatch.setattr(quadratic, "_BETWEEN_STOPS", quadratic._ITERATIONS)
    assert np.array_equal(asking.states, SnapProgram(constraints).solve(T).states)


def test_a_single_solve_can_be_cancelled(narrow, monkeypatch):
    """It asks for more digits than there are, and so for seconds."""
    constraints, T = narrow
    monkeypatch.setattr(quadratic, "_PRECISION", 1e-300)
    monkeypatch.setattr(quadratic, "_ITERATIONS", 10**5)
    stop = StopFlag()
    threading.Timer(0.1, stop.set).start()
    with pytest.raises(PlanCancelledError):
        SnapProgram(constraints).solve(T, stop)


def test_a_solver_that_stops_short_of_its_bounds_says_so(narrow, monkeypatch):
    hurry(monkeypatch)
    constraints, T = narrow
    monkeypatch.setattr(quadratic, "_STIFF_ITERATIONS", 25)
    with pytest.raises(InfeasibleError, match=r"short of its bounds near .* maximum iterations reached"):
        SnapProgram(constraints).solve(T)
