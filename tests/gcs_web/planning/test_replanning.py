"""Planning on from the last answer: the path answers the document, whatever led there, and has passed the gate."""

import threading

import msgspec
import numpy as np
import pytest

import planner
import vehicle
from flight import Waypoints
from flight.mission import KeepIn
from gcs_web.document import missions
from gcs_web.document.document import Content, Opening, Point
from gcs_web.planning import replanning

POINTS = np.array([[0.0, 0.0, 1.0], [3.0, 1.0, 1.4], [6.0, -1.0, 1.2], [9.0, 0.0, 1.0]])
DRONE = vehicle.example("rigter2019")


class Sky:
    """Nothing within 10 m."""

    def distance(self, points_world_m, /):
        return np.full(len(np.atleast_2d(points_world_m)), 10.0)


KNOWN = replanning.Known(Sky(), DRONE, planner.PlanOptions())


@pytest.fixture(scope="module")
def begun() -> Content:
    return Content().with_waypoints(Waypoints(POINTS, np.full(4, np.nan)))


def planned(replanner: replanning.Replanner, content: Content) -> planner.Plan:
    replanner.begin()
    plan = replanner.plan(content, KNOWN)
    assert plan.gate.passed
    np.testing.assert_array_equal(plan.waypoints.positions_world_m, content.waypoints().positions_world_m)
    np.testing.assert_array_equal(plan.waypoints.yaw_rad, content.waypoints().yaw_rad)
    return plan


def moved(content: Content, number: int, by_m: float) -> Content:
    points = list(content.points)
    x, y, z = points[number].position_world_m
    points[number] = msgspec.structs.replace(points[number], position_world_m=(x, y, z + by_m))
    return content.with_points(points)


def test_every_kind_of_change_is_answered_by_a_checked_plan_of_just_these_waypoints(begun: Content, monkeypatch):
    replanner = replanning.Replanner()
    planned(replanner, begun)
    scratch = []
    new = planner.Planner
    monkeypatch.setattr(planner, "Planner", lambda *a, **k: scratch.append(1) or new(*a, **k))
    content = moved(begun, 1, 0.3)
    planned(replanner, content)
    planned(replanner, begun)  # as undo does
    extra = msgspec.structs.replace(begun.points[0], id=9, position_world_m=(4.5, 0.5, 1.4), yaw_rad=0.2)
    planned(replanner, begun.with_points([*begun.points[:2], extra, *begun.points[2:]]))
    planned(replanner, begun)
    assert scratch == []  # one waypoint moved, inserted or deleted: planned on
    both = moved(begun, 3, 0.2).points
    planned(replanner, begun.with_points([*both[:2], extra, *both[2:]]))  # inserted and moved
    planned(replanner, begun.with_points(begun.points[::-1]))
    turned = [msgspec.structs.replace(p, yaw_rad=0.5) for p in begun.points]
    planned(replanner, begun.with_points(turned))
    slower = msgspec.structs.replace(begun, settings=msgspec.structs.replace(begun.settings, speed_m_s=2.0))
    planned(replanner, slower)
    asked = [msgspec.structs.replace(begun.points[0], leg_speed_m_s=2.0), *begun.points[1:]]
    plan = planned(replanner, begun.with_points(asked))
    assert any(check.name == "speed of legs" for check in plan.gate.checks)
    assert len(scratch) == 5


def test_a_mission_with_gates_is_planned_on_as_well_and_one_in_a_tube_from_scratch(begun: Content, monkeypatch):
    replanner, scratch, new = replanning.Replanner(), [], planner.Planner
    monkeypatch.setattr(planner, "Planner", lambda *a, **k: scratch.append(1) or new(*a, **k))
    course = begun.with_points([*begun.points[:2], gated(begun.points[2]), begun.points[3]])
    planned(replanner, course)
    for number in (1, 2):
        planned(replanner, moved(course, number, 0.3))
        planned(replanner, course)
    extra = msgspec.structs.replace(begun.points[0], id=9, position_world_m=(4.5, 0.5, 1.4))
    longer = course.with_points([*course.points[:2], extra, *course.points[2:]])
    for content in (longer, course):
        plan = planned(replanner, content)
        assert "gates" in {check.name for check in plan.gate.checks}
        asked = planner.mission.conditions(missions.mission_of(content))
        assert plan.gate.conditions.as_dict() == asked.as_dict()
    assert len(scratch) == 1
    settings = msgspec.structs.replace(course.settings, keep_in=KeepIn(1.5))
    plan = planned(replanner, msgspec.structs.replace(course, settings=settings))
    assert {"gates", "keep-in"} <= {check.name for check in plan.gate.checks}


def gated(point: Point) -> Point:
    return msgspec.structs.replace(point, gate=Opening(1.2, 0.8, 0.1))


def test_a_draft_goes_through_the_dragged_waypoint_and_changes_nothing(begun: Content):
    replanner = replanning.Replanner()
    assert replanner.draft(1, POINTS[1]) is None  # nothing was planned yet
    before = planned(replanner, begun).trajectory
    target = POINTS[1] + [0.2, 0.3, 0.4]
    draft = replanner.draft(begun.points[1].id, target)
    assert draft is not None
    path = draft.position_world_m
    assert np.linalg.norm(path - target, axis=1).min() < 1e-6
    np.testing.assert_allclose(path[[0, -1]], POINTS[[0, -1]], atol=1e-9)
    np.testing.assert_array_equal(planned(replanner, begun).trajectory.coefficients, before.coefficients)
    assert replanner.draft(77, target) is None


def test_a_plan_that_is_cancelled_ends_and_the_next_one_is_made(begun: Content):
    replanner = replanning.Replanner()
    rng = np.random.default_rng(0)
    many = Content().with_waypoints(Waypoints(rng.uniform(-50.0, 50.0, (300, 3)), np.full(300, np.nan)))
    replanner.begin()
    threading.Timer(0.1, replanner.cancel).start()
    with pytest.raises(planner.PlanCancelledError):
        replanner.plan(many, KNOWN)
    planned(replanner, begun)


def test_a_plan_on_from_the_last_one_that_was_cancelled_before_it_began_is_not_made(begun: Content):
    replanner = replanning.Replanner()
    planned(replanner, begun)
    replanner.begin()
    replanner.cancel()  # while the map is read, say
    with pytest.raises(planner.PlanCancelledError):
        replanner.plan(moved(begun, 1, 0.3), KNOWN)
    planned(replanner, moved(begun, 2, 0.3))


def test_a_cancel_at_the_moment_the_edit_begins_is_not_lost(begun: Content, monkeypatch):
    replanner = replanning.Replanner()
    planned(replanner, begun)
    move = planner.Planner.move

    def cancelled_first(session: planner.Planner, *arguments, **options) -> planner.Plan:
        replanner.cancel()
        return move(session, *arguments, **options)

    monkeypatch.setattr(planner.Planner, "move", cancelled_first)
    replanner.begin()
    with pytest.raises(planner.PlanCancelledError):
        replanner.plan(moved(begun, 1, 0.3), KNOWN)
