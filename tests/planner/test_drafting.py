"""Drafts while a waypoint is dragged: near the plan that follows, never in its way, and nothing that could be flown."""

from dataclasses import fields

import numpy as np
import pytest

import esdf
import planner
from esdf import solids
from flight import InputError, Trajectory, Waypoints
from flight.trajectory import fingerprint
from planner import Conditions, Planner, PlanOptions, drafting
from planner.curve.minimum_snap import Spline
from planner.request import space

OPTIONS = PlanOptions(radius_m=0.15)


def forest(seed: int) -> tuple[Waypoints, esdf.Field]:
    """Ten waypoints among 25 trunks."""
    rng, size = np.random.default_rng(seed), np.array([16.0, 16.0, 3.5])
    trunks = [solids.Cylinder((x, y, 1.75), r, 3.5) for x, y, r in rng.uniform((1, 1, 0.1), (15, 15, 0.4), (25, 3))]
    scene = solids.Scene([solids.Room((0.0, 0.0, 0.0), tuple(size)), *trunks])
    drawn = rng.uniform(0.5, size - 0.5, (200, 3))
    points = drawn[scene.distance(drawn) > 0.5][:10]
    grid = esdf.Grid(np.full(3, -0.3), (0.1,) * 3, (166, 166, 41))
    return Waypoints(points, np.full(10, np.nan)), esdf.build(esdf.rasterize(scene, grid), grid)


def session_in(place: tuple[Waypoints, esdf.Field], drone) -> Planner:
    return Planner(*place, drone, OPTIONS)


@pytest.fixture(scope="module")
def place():
    return forest(0)


@pytest.fixture(scope="module")
def in_a_forest(place, drone) -> Planner:
    return session_in(place, drone)


@pytest.fixture
def in_the_open(drone, open_sky) -> Planner:
    return Planner(walk(12), open_sky, drone)


def walk(count: int) -> Waypoints:
    points = np.cumsum(np.random.default_rng(0).normal(size=(count, 3)) * [3.0, 3.0, 0.7], axis=0)
    return Waypoints(points, np.full(count, np.nan))


def moved(session: Planner, index: int, by_m) -> np.ndarray:
    return session.plan.waypoints.positions_world_m[index] + by_m


def off_m(draft: planner.Draft, point) -> float:
    """How far the samples of a draft pass from a point."""
    return float(np.linalg.norm(draft.position_world_m - point, axis=1).min())


@pytest.mark.parametrize("index", range(10))
def test_a_draft_passes_the_moved_waypoint_and_all_others(in_a_forest, index):
    session = in_a_forest
    target = moved(session, index, [0.1, -0.1, 0.05])
    draft = session.draft(index, target)
    points = session.plan.waypoints.positions_world_m.copy()
    points[index] = target
    assert np.array_equal(draft.waypoints.positions_world_m, points)
    assert max(off_m(draft, point) for point in points) < 1e-6
    assert draft.draft
    assert not session.plan.draft


def test_far_from_the_edit_a_draft_is_the_plan_before_it_and_the_one_after_it(in_the_open):
    session, index = in_the_open, 3
    before, draft = session.plan.trajectory, session.draft(index, moved(in_the_open, index, [0.3, -0.2, 0.1]))
    after = session.move(index, draft.waypoints.positions_world_m[index]).trajectory
    last = draft.position_world_m[-25:]  # of three segments
    for exact, same_m in ((before, 1e-12), (after, 0.005)):
        times_s = exact.starts_s[-4:-1, None] + np.linspace(0.0, 1.0, 9)[:-1] * exact.durations_s[-3:, None]
        there = exact.position(np.append(times_s, exact.duration_s))
        assert np.abs(last - there).max() < same_m


def test_a_draft_takes_nearly_the_time_of_the_plan_that_follows_and_keeps_clear(drone):
    for seed in (0, 1):
        session = session_in(forest(seed), drone)
        for index in (2, 5, 7):
            draft = session.draft(index, moved(session, index, [0.15, 0.1, -0.1]))
            exact = session.move(index, draft.waypoints.positions_world_m[index])
            assert draft.duration_s == pytest.approx(exact.trajectory.duration_s, rel=0.03)
            assert draft.clearance_m > draft.required_clearance_m - 0.02
            assert max(draft.shares.values()) < 1.05


def test_the_clearance_of_a_draft_holds_at_every_sample_and_nearly_at_the_point_that_it_names(in_a_forest, place):
    draft = in_a_forest.draft(4, moved(in_a_forest, 4, [0.1, 0.1, 0.0]))
    assert draft.clearance_m <= space.distance(place[1], draft.position_world_m).min()
    there = space.distance(place[1], np.array([draft.clearance_point_world_m]))[0]
    assert draft.clearance_m == pytest.approx(there, abs=0.01)
    assert draft.required_clearance_m == OPTIONS.clearance_m


def test_a_draft_that_comes_too_close_says_so(drone):
    wall = solids.Scene([solids.Box((-0.1, -20.0, -20.0), (0.1, 20.0, 20.0))])
    session = Planner(Waypoints(np.array([[-3.0, 0, 0], [-2, 2, 0], [-3, 4, 0]]), np.full(3, np.nan)), wall, drone)
    assert session.draft(1, np.array([-2.2, 2.0, 0.0])).is_clear
    beyond = session.draft(1, np.array([2.0, 2.0, 0.0]))  # no way leads there
    assert not beyond.is_clear
    assert beyond.clearance_m < 0.0


def test_a_waypoint_dragged_into_an_obstacle_is_refused_at_once_in_the_words_of_a_move(pillar, drone):
    points = np.array([[-3.0, -2, 1], [-3, 2, 1], [0, 3, 1]])
    session = Planner(Waypoints(points, np.full(3, np.nan)), pillar, drone)
    said = []
    for edit in (session.draft, session.move):
        with pytest.raises(InputError, match=r"waypoint 2 .* inside an obstacle") as refused:
            edit(1, np.array([0.0, 0.0, 1.0]))
        said.append(str(refused.value))
    assert said[0] == said[1]
    with pytest.raises(InputError, match="no waypoint 4"):
        session.draft(3, points[0])


def test_a_draft_is_never_saved_and_has_no_trajectory_in_it(in_a_forest, tmp_path):
    session = in_a_forest
    draft = session.draft(3, moved(session, 3, [0.1, 0.0, 0.0]))
    with pytest.raises(InputError, match="it is a draft"):
        planner.trajectory_file(draft, name="a")
    with pytest.raises(InputError, match="it is a draft"):
        planner.save_plan(tmp_path / "a", draft, name="a")
    assert list(tmp_path.iterdir()) == []
    held = [getattr(draft, field.name) for field in fields(draft)]
    assert not any(isinstance(value, Trajectory | Spline | planner.GateReport | planner.Plan) for value in held)


def test_plans_after_any_drafts_are_those_without_drafts_bit_by_bit(place, drone):
    answers = []
    steps = [(3, [0.1, 0.1, 0.0]), (3, [-0.1, -0.1, 0.0]), (6, [0.0, -0.1, 0.1]), (4, [0.05, 0.1, 0.0])]
    for drafted in (False, True):
        session, found = session_in(place, drone), []
        for index, step in steps:  # the second one takes the first one back
            target = moved(session, index, step)
            before = session.plan
            for share in (0.2, 0.6, 1.0, 0.4) if drafted else ():
                session.draft(index, moved(session, index, share * np.array(step)))
                session.draft(index + 1, moved(session, index + 1, share * np.array(step)))
            assert session.plan is before
            found.append(fingerprint(session.move(index, target).trajectory))
        answers.append(found)
    assert answers[0] == answers[1]


def test_a_move_that_was_foreseen_gives_the_plan_that_it_gives_without_bit_by_bit(place, drone):
    by_m, answers = [0.1, 0.1, 0.0], []
    for foreseen in (False, True):
        session = session_in(place, drone)
        before = session.plan
        if foreseen:
            for share in (0.5, 1.0):
                plan = session.foresee(3, moved(session, 3, share * np.array(by_m)))
                assert plan.gate.passed
                assert session.plan is before
        found = [session.move(3, moved(session, 3, by_m))]
        found.append(session.move(3, before.waypoints.positions_world_m[3]))  # no more what was foreseen
        answers.append([fingerprint(plan.trajectory) for plan in found])
    assert answers[0] == answers[1]
    assert answers[0][0] != answers[0][1]


def test_a_move_takes_what_was_foreseen_of_it_and_of_no_other_plan(in_the_open):
    session, there = in_the_open, moved(in_the_open, 4, [0.2, 0.1, 0.0])
    foreseen = session.foresee(4, there)
    assert session.move(4, there) is foreseen
    ahead = session.foresee(5, moved(session, 5, [0.2, 0.0, 0.0]))
    session.move(6, moved(session, 6, [0.1, 0.0, 0.0]))
    session.move(6, foreseen.waypoints.positions_world_m[6])  # the same waypoints again, by another path
    assert session.move(5, ahead.waypoints.positions_world_m[5]) is not ahead


def test_what_is_foreseen_does_not_touch_a_move_of_another_waypoint(drone, open_sky):
    found = []
    for foreseen in (False, True):
        session = Planner(walk(8), open_sky, drone)
        if foreseen:
            session.foresee(3, moved(session, 3, [0.3, 0.1, 0.0]))
        found.append(fingerprint(session.move(4, moved(session, 4, [0.1, 0.0, 0.1])).trajectory))
    assert found[0] == found[1]


def test_the_same_drag_gives_the_same_drafts_whatever_was_drafted_before(in_a_forest):
    session = in_a_forest
    target = moved(session, 5, [0.2, 0.1, 0.0])
    first = session.draft(5, target)
    session.draft(5, moved(session, 5, [-0.3, 0.0, 0.1]))
    again = session.draft(5, target)
    assert np.array_equal(first.position_world_m, again.position_world_m)
    assert np.array_equal(first.time_s, again.time_s)
    assert first.shares == again.shares


def test_how_long_a_draft_is_worked_on_does_not_depend_on_the_path(drone, open_sky, monkeypatch):
    """Segments times iterations are bounded, however many waypoints there are."""
    asked: list[tuple[int, int]] = []

    def counted(descent):
        def work(problem, start, *, iterations, **more):
            asked.append((len(problem.knots) - 1, iterations))
            return descent(problem, start, iterations=iterations, **more)

        return work

    for count in (4, 40):
        session = Planner(walk(count), open_sky, drone, PlanOptions(pieces=8))
        asked.clear()
        with monkeypatch.context() as patched:
            for name in ("optimise", "refine"):
                patched.setattr(drafting.time_allocation, name, counted(getattr(drafting.time_allocation, name)))
            session.draft(2, moved(session, 2, [0.1, 0.1, 0.0]))
        for (segments, iterations), work in zip(asked, drafting._WORK, strict=True):
            assert work - segments < segments * iterations <= work
            assert segments < len(session.plan.trajectory.durations_s)


def test_a_path_in_a_corridor_is_drawn_along(two_rooms, through, drone):
    asked = PlanOptions(method="corridor")
    session = Planner(through((-3.0, 0.0, 1.0), (0.0, 2.0, 1.0), (3.0, 0.0, 1.0)), two_rooms, drone, asked)
    assert session.plan.method == "corridor"
    target = np.array([3.2, 0.2, 1.1])
    draft = session.draft(2, target)
    assert off_m(draft, target) < 1e-9
    assert off_m(draft, session.plan.waypoints.positions_world_m[1]) < 1e-9
    assert np.abs(draft.position_world_m[0] - session.plan.waypoints.positions_world_m[0]).max() < 1e-12


def test_a_draft_passes_a_moved_ball_and_a_moved_gate_inside(drone, open_sky):
    edges = np.zeros((6, 2, 3))
    edges[4] = [[0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]
    asked = Conditions(fly_by_m=np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0]), gate_edges_m=edges)
    session = Planner(walk(6), open_sky, drone, conditions=asked)
    ball, gate = (moved(session, index, [0.2, 1.2, 0.1]) for index in (2, 4))
    assert off_m(session.draft(2, ball), ball) < 0.5
    off = session.draft(4, gate).position_world_m - gate
    crossing = np.flatnonzero(np.diff(np.sign(off[:, 0])))
    assert (np.abs(off[crossing, 1:]) < 0.5).all(axis=1).any()


def test_a_waypoint_dragged_far_gives_its_legs_more_time(drone, open_sky):
    points = np.cumsum(np.random.default_rng(1).normal(size=(8, 3)) * [3.0, 3.0, 0.7], axis=0)
    session = Planner(Waypoints(points, np.full(8, np.nan)), open_sky, drone)
    draft = session.draft(3, points[3] + [0.0, 10.0, 0.0])
    exact = planner.plan(draft.waypoints, open_sky, drone)
    assert draft.duration_s == pytest.approx(exact.trajectory.duration_s, rel=0.1)
