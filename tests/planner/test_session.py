import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import planner
from esdf import solids
from flight import InputError, Waypoints
from flight.mission import Gate
from flight.trajectory import fingerprint
from planner import Conditions, Planner, StopFlag
from planner.gate import gate, limits
from planner.optimise import fastest
from planner.request.options import PlanCancelledError


def walk(count: int, seed: int) -> Waypoints:
    points = np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * [3.0, 3.0, 0.7], axis=0)
    return Waypoints(points, np.full(count, np.nan))


@pytest.fixture
def session(drone, open_sky) -> Planner:
    return Planner(walk(12, 0), open_sky, drone)


def agrees_with_scratch(session: Planner, field, drone, *, slower: float = 0.02) -> None:
    """Another look at everything finds nothing wrong, and planning from scratch would gain no more than `slower`."""
    plan = session.plan
    again = gate.check(plan.trajectory, field, drone, waypoints_world_m=plan.waypoints.positions_world_m)
    assert again.passed, again.failures
    scratch = planner.plan(plan.waypoints, field, drone)
    assert plan.trajectory.duration_s < (1.0 + slower) * scratch.trajectory.duration_s
    assert plan.gate.trajectory_hash == fingerprint(plan.trajectory)


def test_a_moved_waypoint_is_flown_through_and_far_segments_stay_bit_by_bit(session, drone, open_sky):
    before = session.plan
    target = before.waypoints.positions_world_m[3] + [0.4, -0.3, 0.2]
    plan = session.move(3, target)
    assert plan.gate.passed
    assert np.allclose(plan.waypoints.positions_world_m[3], target)
    assert np.array_equal(plan.trajectory.coefficients[-3:], before.trajectory.coefficients[-3:])
    agrees_with_scratch(session, open_sky, drone)


@pytest.mark.parametrize("index", [0, 11])
def test_the_ends_can_be_moved(session, drone, open_sky, index):
    session.move(index, session.plan.waypoints.positions_world_m[index] + [0.3, 0.3, 0.0])
    agrees_with_scratch(session, open_sky, drone)


def test_waypoints_inserted_and_deleted_at_any_place(session, drone, open_sky):
    points = session.plan.waypoints.positions_world_m
    session.insert(5, 0.5 * (points[4] + points[5]) + [0.3, 0.0, 0.2])
    agrees_with_scratch(session, open_sky, drone)
    session.delete(5)
    assert np.array_equal(session.plan.waypoints.positions_world_m, points)
    agrees_with_scratch(session, open_sky, drone)
    session.insert(0, points[0] - [1.0, 0.0, 0.0], yaw_rad=0.5)
    session.delete(12)
    assert np.array_equal(session.plan.waypoints.positions_world_m[1:], points[:-1])
    assert session.plan.waypoints.yaw_rad[0] == 0.5
    agrees_with_scratch(session, open_sky, drone)


def test_an_inserted_heading_is_flown(session):
    points = session.plan.waypoints.positions_world_m
    plan = session.insert(6, 0.5 * (points[5] + points[6]), yaw_rad=1.0)
    states = plan.trajectory.evaluate(plan.trajectory.starts_s[:-1])
    at = int(np.linalg.norm(states[:, :3] - plan.waypoints.positions_world_m[6], axis=1).argmin())
    assert np.cos(states[at, 3] - 1.0) == pytest.approx(1.0, abs=1e-9)


def test_many_moves_in_a_row_stay_as_good_as_a_plan_from_scratch(session, drone, open_sky):
    rng = np.random.default_rng(2)
    for _ in range(12):
        index = int(rng.integers(1, 11))
        session.move(index, session.plan.waypoints.positions_world_m[index] + rng.normal(size=3) * [0.3, 0.3, 0.1])
    agrees_with_scratch(session, open_sky, drone)
    moved, settled = session.plan, session.settle()
    assert settled.trajectory.duration_s < 1.02 * moved.trajectory.duration_s


def test_a_waypoint_dragged_behind_a_pillar_is_planned_round_it(pillar, drone):
    points = np.array([[-3.0, -2, 1], [-3, 0, 1], [-3, 2, 1], [0, 3, 1]])
    session = Planner(Waypoints(points, np.full(4, np.nan)), pillar, drone)
    plan = session.move(3, np.array([3.0, 0.5, 1.0]))
    assert plan.gate.passed
    # from scratch a leg near the pillar has six pieces; the leg that is drawn along keeps its two
    agrees_with_scratch(session, pillar, drone, slower=0.06)
    session.move(3, np.array([0.0, 3.0, 1.0]))
    agrees_with_scratch(session, pillar, drone, slower=0.06)


def test_other_limits_are_kept_for_later_edits(session, drone):
    slow = drone.with_limits(speed_m_s=3.0).limits
    session.limit(slow)
    plan = session.move(4, session.plan.waypoints.positions_world_m[4] + [0.2, 0.0, 0.0])
    speed = next(check for check in plan.gate.checks if check.name == "speed")
    assert speed.value <= speed.bound == 3.0


def test_a_refused_edit_leaves_the_plan_as_it_was(pillar, drone):
    points = np.array([[-3.0, -2, 1], [-3, 2, 1], [0, 3, 1]])
    session = Planner(Waypoints(points, np.full(3, np.nan)), pillar, drone)
    before = session.plan
    with pytest.raises(InputError, match=r"waypoint 2 .* inside an obstacle"):
        session.move(1, np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="no waypoint 4"):
        session.delete(3)
    assert session.plan is before
    assert session.move(1, np.array([-3.0, 1.8, 1.0])).gate.passed


class Slow:
    """Free space that takes its time, so that an edit can be met while it works."""

    def __init__(self) -> None:
        self.slow = False
        self.asked = threading.Event()

    def distance(self, points):
        if self.slow:
            self.asked.set()
            time.sleep(0.002)
        return np.full(len(points), 0.4)  # near enough to be asked again and again


def test_cancelling_and_a_new_edit_both_end_the_one_that_works(drone):
    field = Slow()
    session = Planner(walk(6, 1), field, drone)
    before, ended = session.plan, []

    def edit() -> None:
        try:
            session.settle()
        except PlanCancelledError:
            ended.append(True)

    for ask in (session.cancel, lambda: session.move(2, before.waypoints.positions_world_m[2] + [0.1, 0.0, 0.0])):
        field.slow = True
        field.asked.clear()
        worker = threading.Thread(target=edit)
        worker.start()
        assert field.asked.wait(10.0)
        ask()
        worker.join(10.0)
        field.slow = False
        assert not worker.is_alive()
    assert ended == [True, True]
    assert session.plan.gate.passed
    assert session.plan is not before


def test_segments_that_did_not_change_are_not_looked_at_again_and_the_verdict_is_the_same(session, drone, open_sky):
    before = session.plan
    plan = session.move(9, before.waypoints.positions_world_m[9] + [0.2, 0.2, 0.0])
    waypoints = plan.waypoints.positions_world_m
    assert before.gate.usage is not None
    known = limits.Known((before.trajectory, before.gate.usage))
    quick = gate.check(plan.trajectory, open_sky, drone, waypoints_world_m=waypoints, known=known)
    whole = gate.check(plan.trajectory, open_sky, drone, waypoints_world_m=waypoints)
    assert quick.usage is not None
    assert whole.usage is not None
    assert np.allclose(quick.usage.value, whole.usage.value, rtol=1e-9)
    assert np.allclose(quick.usage.time_s, whole.usage.time_s, rtol=1e-9)
    faster = plan.trajectory.scale_time(0.9)
    assert not gate.check(faster, open_sky, drone, known=known).passed


def test_scenes_without_walls_are_sessions_too(drone):
    """Two waypoints, and every edit of them."""
    sky = solids.Scene([solids.Sphere((100.0, 0.0, 0.0), 1.0)])
    session = Planner(Waypoints(np.array([[0.0, 0, 1], [5, 0, 1]]), np.full(2, np.nan)), sky, drone)
    session.move(1, np.array([5.0, 1.0, 1.0]))
    session.insert(1, np.array([2.0, 2.0, 1.0]))
    session.delete(0)
    agrees_with_scratch(session, sky, drone)


def test_what_was_asked_besides_waypoints_is_checked_after_an_edit_too(drone, open_sky):
    waypoints = walk(6, 0)
    slow = Conditions(leg_speed_m_s=np.array([np.nan, np.nan, 3.0, np.nan, np.nan]))
    session = Planner(waypoints, open_sky, drone, conditions=slow)
    moved = session.move(1, waypoints.positions_world_m[1] + [0.2, 0.1, 0.0])
    assert "speed of legs" in {check.name for check in moved.gate.checks}
    assert moved.gate.conditions.as_dict() == slow.as_dict()  # and so they are in the file


def course(count: int = 12) -> tuple[Waypoints, Conditions]:
    """A walk with gates at waypoints 3 and 7, a radius at 5, and a slow leg behind 9."""
    waypoints = walk(count, 0)
    edges, radius, speed = np.zeros((count, 2, 3)), np.zeros(count), np.full(count - 1, np.nan)
    ahead = waypoints.positions_world_m[2:] - waypoints.positions_world_m[:-2]
    for i in (3, 7):
        x, y, _ = ahead[i - 1]
        edges[i] = Gate(i, 1.0, 0.8, float(np.arctan2(y, x)) + 0.4, 0.2, 0.3).edges_m
    radius[5], speed[9] = 0.5, 2.0
    return waypoints, Conditions(gate_edges_m=edges, fly_by_m=radius, leg_speed_m_s=speed)


def meets(session: Planner, asked: Conditions, field, drone, *, slower: float = 0.04) -> None:
    """The plan has passed the gate for these conditions, and one from scratch is hardly faster."""
    plan = session.plan
    assert plan.gate.conditions.as_dict() == asked.as_dict()
    points = plan.waypoints.positions_world_m
    again = gate.check(plan.trajectory, field, drone, waypoints_world_m=points, conditions=asked)
    assert again.passed, again.failures
    assert {"gates", "speed of legs"} <= {check.name for check in again.checks}
    scratch = planner.plan(plan.waypoints, field, drone, conditions=asked)
    assert plan.trajectory.duration_s < (1.0 + slower) * scratch.trajectory.duration_s


@pytest.mark.parametrize("index", [2, 3, 4, 5, 8])
def test_a_waypoint_moved_among_gates_and_radii_leaves_far_segments_bit_by_bit(drone, open_sky, index):
    waypoints, asked = course(16)
    session = Planner(waypoints, open_sky, drone, conditions=asked)
    before = session.plan.trajectory.coefficients[-3:]
    session.move(index, waypoints.positions_world_m[index] + [0.3, -0.2, 0.1])
    assert np.array_equal(session.plan.trajectory.coefficients[-3:], before)
    meets(session, asked, open_sky, drone)


def test_waypoints_inserted_and_deleted_near_gates_shift_what_is_asked(drone, open_sky):
    waypoints, asked = course()
    points = waypoints.positions_world_m
    session = Planner(waypoints, open_sky, drone, conditions=asked)
    for index in (3, 4, 10):
        session.insert(index, 0.5 * (points[index - 1] + points[index]) + [0.1, 0.2, 0.0])
        meets(session, asked.inserted(index), open_sky, drone)
        session.delete(index)
        meets(session, asked, open_sky, drone)
    assert np.array_equal(session.plan.waypoints.positions_world_m, points)
    session.delete(3)  # a gate itself
    meets(session, asked.deleted(3), open_sky, drone)
    assert session.plan.gate.conditions.gate_edges_m[3:].any(axis=(1, 2)).tolist() == [False] * 3 + [True] + [False] * 4


def test_what_is_asked_shifts_with_the_waypoints_and_back():
    _, asked = course()
    for index in range(13):
        assert asked.inserted(index).deleted(index).as_dict() == asked.as_dict()
    parted = asked.inserted(10).leg_speed_m_s
    assert np.array_equal(parted[9:11], [2.0, 2.0])
    assert np.array_equal(asked.deleted(9).leg_speed_m_s[8:], [2.0, np.nan], equal_nan=True)
    assert asked.deleted(4).gate_edges_m[6].any()


def test_an_edit_that_would_make_a_gate_an_end_is_refused(drone, open_sky):
    waypoints, asked = walk(4, 0), Conditions(gate_edges_m=np.zeros((4, 2, 3)))
    x, y, _ = waypoints.positions_world_m[2] - waypoints.positions_world_m[0]
    asked.gate_edges_m[1] = Gate(1, 1.0, 1.0, float(np.arctan2(y, x))).edges_m
    session = Planner(waypoints, open_sky, drone, conditions=asked)
    before = session.plan
    with pytest.raises(InputError, match="first and last waypoint are met exactly"):
        session.delete(0)
    assert session.plan is before
    session.move(1, waypoints.positions_world_m[1] + [0.1, 0.0, 0.0])


def test_an_edit_whose_path_the_gate_refuses_is_planned_from_scratch(session, drone, open_sky, monkeypatch):
    mend, refused = fastest.until_flyable, []

    def spoilt(*args, **more):
        path = mend(*args, **more)
        if more.get("wrong") is None:  # from scratch
            return path
        failed = replace(path.report.checks[0], passed=False)
        refused.append(replace(path, report=replace(path.report, checks=(failed, *path.report.checks[1:]))))
        return refused[-1]

    monkeypatch.setattr(fastest, "until_flyable", spoilt)
    plan = session.move(4, session.plan.waypoints.positions_world_m[4] + [0.2, 0.1, 0.0])
    assert len(refused) == 1
    assert plan.gate.passed
    assert plan.trajectory is not refused[0].trajectory
    agrees_with_scratch(session, open_sky, drone)


def test_one_flag_does_for_edits_one_after_the_other_and_is_the_callers_alone_between_them(drone, open_sky):
    waypoints, flag = walk(5, 0), StopFlag()
    session = Planner(waypoints, open_sky, drone, stop=flag)
    for step in (0.1, 0.2):
        session.move(1, waypoints.positions_world_m[1] + [step, 0.0, 0.0], stop=flag)
    session.cancel()
    session.move(2, waypoints.positions_world_m[2] + [0.1, 0.0, 0.0])
    assert not flag.is_set()


@pytest.mark.parametrize("wrong", [[1.0, 2.0], [1.0, 2.0, np.nan], "here", None, [[1.0, 2.0, 3.0]]])
def test_a_position_that_is_not_three_finite_numbers_is_refused_by_every_edit(session, wrong):
    before = session.plan
    for edit in (session.move, session.insert, session.draft, session.foresee):
        with pytest.raises(InputError, match="three"):
            edit(2, wrong)
    assert session.plan is before
