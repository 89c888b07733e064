from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import planner
from esdf import solids
from flight import Waypoints
from planner.curve import minimum_snap
from planner.gate import limits
from planner.optimise import airframe, attempts, fastest, time_allocation
from planner.optimise import corrections as corrections_module
from planner.optimise.corrections import Corrections
from planner.optimise.time_allocation import Problem, Weights
from planner.request.inputs import Request


@pytest.fixture(scope="module")
def walk() -> minimum_snap.Spline:
    """Fast enough that every limit is near somewhere; the last axis is yaw."""
    rng = np.random.default_rng(3)
    knots = np.cumsum(rng.normal(size=(6, 4)) * [2.5, 2.5, 0.7, 0.4], axis=0)
    return minimum_snap.solve(knots, np.array([1.3, 0.9, 1.1, 0.3, 1.2]))


def test_segments_are_cut_into_equal_pieces_that_are_not_too_short(walk):
    waypoint = np.array([0, -1, 1, -1, 2, 3])
    knots, T, index = attempts._split(walk, waypoint, 3)
    assert T.tolist() == pytest.approx([1.3 / 3] * 3 + [0.3] * 3 + [1.1 / 3] * 3 + [0.3] + [0.4] * 3)
    assert T.min() >= attempts._SHORTEST_S
    assert index.tolist() == [0, -1, -1, -1, -1, -1, 1, -1, -1, -1, 2, -1, -1, 3]
    path = minimum_snap.trajectory(walk)
    starts = np.concatenate([[0.0], np.cumsum(T)])
    assert np.allclose(knots, path.evaluate(np.minimum(starts, path.duration_s)), atol=1e-9)


def test_one_piece_leaves_the_path_as_it_is(walk):
    knots, T, index = attempts._split(walk, np.arange(6), 1)
    assert np.array_equal(knots, walk.states[:, 0])
    assert np.array_equal(T, walk.durations_s)
    assert index.tolist() == list(range(6))


def test_the_corrected_excess_is_that_of_the_vehicles_own_model(walk, drone, open_sky):
    frame = airframe.reduced(drone, drone.limits)
    knots = walk.states[:, 0]
    problem = Problem(knots, np.zeros((6, 4), dtype=bool), frame, open_sky, 0.3, Weights())
    path = minimum_snap.trajectory(walk)
    corrections = Corrections(5)
    for _ in range(25):  # what is measured is believed step by step
        corrections.measure(problem, walk, path, drone, np.ones(5, dtype=bool))
    reduced, _ = time_allocation.excess(problem, walk)
    full = corrections_module.measured_excess(frame, drone, path, np.arange(5), time_allocation.FRACTIONS)
    asked = (reduced.max(axis=2) > -0.2) & (np.abs(full - reduced).max(axis=2) < 0.5)
    assert asked.sum() > 20
    corrected = (reduced + corrections.total() - corrections.between - corrections_module._SPARE)[asked]
    assert np.allclose(corrected, full[asked], rtol=0.0, atol=1e-6)


def test_only_segments_that_exceed_a_limit_are_asked_for_more(walk, drone):
    path = minimum_snap.trajectory(walk)
    speeds = limits.certified_maxima(path, 1)[0]
    bound = 0.5 * float(np.sort(speeds)[-1] + np.sort(speeds)[-2])
    used = limits.usage(path, drone, replace(drone.limits, speed_m_s=bound), step_s=0.01)
    corrections = Corrections(5)
    before = corrections.total()
    nowhere = np.zeros(5, dtype=bool)
    corrections.stricter(used, {"speed": nowhere, "jerk": nowhere})
    more = corrections.total() - before
    fastest_segment = int(np.argmax(speeds))
    least, share = corrections_module._STRICTER
    excess = float(speeds.max()) / bound - 1.0
    assert excess > 0.0
    assert np.allclose(more[fastest_segment, :, 0], np.clip(share * excess, least, 10.0 * least))
    others = np.delete(np.arange(5), fastest_segment)
    assert np.all(more[others, :, 0] == 0.0)
    slow = np.arange(5) == others[0]
    for name in ("speed", "jerk"):  # what is asked for on a leg
        column, before = airframe.NAMES.index(name), corrections.total()
        for asked, raised in ((nowhere, False), (slow, True)):
            corrections.stricter(used, {name: asked})
            more = (corrections.total() - before)[slow, :, column]
            assert (more.max() > 0.0) == raised


def test_multipliers_rise_where_a_limit_is_exceeded_and_fall_where_it_is_not():
    corrections = Corrections(1)
    excess = np.full(corrections.model.shape, -1.0)
    excess[0, 3, 2] = 0.05
    corrections.believed = excess
    corrections.press(np.array([True]))
    assert corrections.multiplier[0, 3, 2] == pytest.approx(0.05 + corrections_module._SPARE)
    assert np.count_nonzero(corrections.multiplier) == 1
    corrections.believed = np.full_like(excess, -0.02)
    corrections.press(np.array([True]))
    assert 0.0 < corrections.multiplier[0, 3, 2] < 0.05


def test_a_correction_rises_in_steps_and_falls_by_halves():
    believed, measured = np.array([0.0, 0.0, 0.3, 0.3]), np.array([0.4, 0.05, 0.1, -0.1])
    step = corrections_module._approached(believed, measured)
    assert np.allclose(step, [corrections_module._RISE, 0.05, 0.2, 0.1])
    for _ in range(60):
        believed = corrections_module._approached(believed, measured)
    assert np.allclose(believed, measured)


def test_a_slow_segment_does_not_slow_its_neighbours_down(drone, open_sky):
    """A sharp turn in the middle of a long straight: both ends of it are flown at nearly the speed limit."""
    points = np.array([[0.0, 0, 1], [25, 0, 1], [26, 1.5, 1], [25, 3, 1], [0, 3, 1]])
    plan = planner.plan(Waypoints(points, np.full(5, np.nan)), open_sky, drone)
    speed = np.linalg.norm(plan.trajectory.position(plan.trajectory.sample(0.01), 1), axis=1)
    assert speed.max() > 0.985 * drone.limits.speed_m_s
    assert plan.trajectory.duration_s < 1.01 * plan.optimum_s
    assert "speed" in plan.binding


@dataclass(frozen=True)
class Asked:
    """A ball, and the points whose distance to it was asked for."""

    ball: solids.Scene
    points: list[np.ndarray] = field(default_factory=list[np.ndarray])

    def distance(self, points_world_m):
        self.points.append(np.array(points_world_m))
        return self.ball.distance(points_world_m)


def test_segments_proven_clear_are_not_asked_about_again_and_a_changed_one_is(walk, drone, open_sky):
    options, proven = planner.PlanOptions().sized(drone), set[bytes]()

    def lacking(place, trajectory):
        asked = Request(
            Waypoints(walk.states[:, 0, :3], walk.states[:, 0, 3]), place, drone, options, planner.Conditions()
        )
        return fastest._lacking(asked, trajectory, proven)

    far, path = Asked(open_sky), minimum_snap.trajectory(walk)
    assert not lacking(far, path).any()
    asked = len(far.points)
    assert not lacking(far, path).any()
    assert len(far.points) == asked
    changed = replace(path, coefficients=path.coefficients + 0.01 * np.eye(5)[:, 3, None, None])
    assert not lacking(far, changed).any()
    on_it = changed.position(np.linspace(*changed.starts_s[3:5], 500)[:-1])
    for points in far.points[asked:]:
        assert (np.linalg.norm(points[:, None] - on_it, axis=2).min(axis=1) < 0.05).all()
    changed = replace(path, coefficients=path.coefficients + 0.02 * np.eye(5)[:, [1, 3]].sum(axis=1)[:, None, None])
    known, first = set(proven), changed.position(0.5 * (changed.starts_s[1] + changed.starts_s[2]))
    balls = solids.Sphere(tuple(first), 0.2), solids.Sphere(tuple(on_it[250]), 0.1)
    lack_m = lacking(solids.Scene(list(balls)), changed)
    assert np.flatnonzero(lack_m).tolist() == [1, 3]
    assert proven == known
    assert lack_m[[1, 3]] == pytest.approx(options.clearance_m + np.array([0.2, 0.1]), abs=0.05)
