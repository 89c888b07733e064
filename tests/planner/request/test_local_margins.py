"""More margin in places: asked for near a line and nowhere else, kept by the plan, and asked by the gate."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import planner
from flight import FormatError, InputError, Waypoints
from flight.mission import KeepIn, Mission
from planner import LocalMargin, PlanOptions
from planner.gate import gate
from planner.request.local_margins import Roomier, reach_m

MARGIN_M, MORE_M, REQUIRED_M = 0.1, 0.3, 0.4
LINE = ((0.0, -1.2, 1.5), (1.0, -1.0, 1.5))
WAY = Waypoints(np.array([[-4.0, -1.0, 1.5], [4.0, -1.0, 1.5]]), np.full(2, np.nan))
NEAR = LocalMargin(MORE_M, LINE)
COORDINATES = st.floats(-3.0, 3.0)


def roomier(field):
    return Roomier(field, [NEAR], MARGIN_M, REQUIRED_M)


def far_m(points) -> np.ndarray:
    """From the line, by samples of it."""
    line = np.linspace(*LINE, 2001)
    return np.linalg.norm(line - np.asarray(points)[:, None], axis=2).min(axis=1)


@given(st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), min_size=1, max_size=20))
def test_the_further_margin_is_asked_for_near_the_line_and_nowhere_else(pillar, points):
    points = np.array(points)
    free, asked = np.asarray(pillar.distance(points)), roomier(pillar).distance(points)
    far, reach = far_m(points), reach_m(MORE_M - MARGIN_M, REQUIRED_M)
    away = far > reach + 1e-6
    assert ((asked >= REQUIRED_M) == (free >= REQUIRED_M))[away].all()
    near = far < reach - (MORE_M - MARGIN_M) - 1e-3
    assert ((asked >= REQUIRED_M) == (free >= REQUIRED_M + MORE_M - MARGIN_M))[near].all()
    assert (asked <= free + 1e-12).all()


@given(st.floats(0.0, 0.25), st.tuples(COORDINATES, COORDINATES, COORDINATES))
def test_a_margin_of_a_stated_reach_asks_for_no_more_where_less_is_kept_elsewhere(pillar, less_m, point):
    near = LocalMargin(MORE_M, LINE, 0.8)
    radius_m = REQUIRED_M - MARGIN_M
    refused = Roomier(pillar, [near], less_m, radius_m + less_m).distance([point])[0] < radius_m + less_m
    short = pillar.distance([point])[0] < radius_m + (MORE_M if far_m([point])[0] < 0.8 + 1e-3 else less_m)
    assert short or not refused
    assert LocalMargin.from_dict(near.as_dict()) == near


@given(*[st.tuples(COORDINATES, COORDINATES, COORDINATES)] * 2)
def test_it_changes_no_faster_than_the_way(pillar, a, b):
    values = roomier(pillar).distance([a, b])
    assert abs(values[1] - values[0]) <= np.linalg.norm(np.subtract(b, a)) + 1e-9


def test_a_plan_keeps_the_margin_near_the_line_and_takes_less_time_than_one_that_keeps_it_everywhere(pillar, drone):
    options = PlanOptions(margin_m=MARGIN_M).sized(drone)
    last = [8.0 - options.body_radius_m - 0.2, -1.0, 1.5]  # too near a wall for the larger margin
    waypoints = Waypoints(np.concatenate([WAY.positions_world_m, [last]]), np.full(3, np.nan))
    plain, local = (planner.plan(waypoints, pillar, drone, replace(options, local_margins=m)) for m in ((), (NEAR,)))

    def clear_m(plan):
        points = plan.trajectory.position(plan.trajectory.sample(0.002))
        return pillar.distance(points)[far_m(points) < REQUIRED_M].min() - options.body_radius_m

    assert clear_m(plain) < MORE_M - 0.05
    assert clear_m(local) >= MORE_M
    assert local.trajectory.duration_s >= plain.trajectory.duration_s
    with pytest.raises(InputError, match="waypoint 3"):
        planner.plan(waypoints, pillar, drone, replace(options, margin_m=MORE_M))


def test_the_gate_refuses_a_plan_that_does_not_keep_it(pillar, drone):
    options = PlanOptions(margin_m=MARGIN_M).sized(drone)
    plain = planner.plan(WAY, pillar, drone, options)
    asked = gate.check(plain.trajectory, pillar, drone, replace(options, local_margins=(NEAR,)))
    assert [check.name for check in asked.failures] == ["local margins"]
    elsewhere = LocalMargin(MORE_M, ((0.0, 6.0, 1.5),))
    assert gate.check(plain.trajectory, pillar, drone, replace(options, local_margins=(elsewhere,))).passed


def test_a_waypoint_without_that_room_is_refused_and_named(pillar, drone):
    points = np.array([[-4.0, -1.0, 1.5], [0.0, -1.0, 1.5], [4.0, -1.0, 1.5]])
    options = PlanOptions(margin_m=MARGIN_M, local_margins=(LocalMargin(0.5, LINE),))
    with pytest.raises(InputError, match=r"waypoint 2 .* less room than the local margin there asks for"):
        planner.plan(Waypoints(points, np.full(3, np.nan)), pillar, drone, options)


def test_they_are_kept_in_the_record_and_a_damaged_one_is_refused():
    options = PlanOptions(radius_m=0.2, local_margins=(NEAR, LocalMargin(0.25, LINE[:1])))
    document = options.as_dict()
    assert PlanOptions.from_dict(document) == options
    assert "local_margins" not in replace(options, local_margins=()).as_dict()
    assert "local_margins" not in repr(PlanOptions())  # of which journals of earlier versions keep the hash
    for damaged in ([{"margin_m": 0.2}], [{"margin_m": -1.0, "polyline_world_m": [[0, 0, 0]]}], 3, [3]):
        with pytest.raises(FormatError, match="damaged"):
            PlanOptions.from_dict(document | {"local_margins": damaged})
    for polyline in ((), ((0.0, np.nan, 0.0),)):
        with pytest.raises(InputError, match="finite points"):
            LocalMargin(0.2, polyline)


def test_it_asks_for_room_to_obstacles_and_not_to_the_tube_to_keep_in(pillar, drone):
    """In the open a margin wider than the tube changes nothing."""
    options = PlanOptions(margin_m=MARGIN_M).sized(drone)
    begin, end = [-4.0, -5.0, 1.5], [4.0, -5.0, 1.5]
    tube = KeepIn(0.3)
    mission = Mission(Waypoints(np.array([begin, end]), np.full(2, np.nan)), keep_in=tube)
    near = replace(options, local_margins=(LocalMargin(0.6, ((0.0, -5.0, 1.5),)),))
    plain, local = (planner.mission.plan(mission, pillar, drone, each) for each in (options, near))
    assert local.trajectory.duration_s == pytest.approx(plain.trajectory.duration_s, rel=1e-3)
    session = planner.Planner(mission.waypoints, pillar, drone, near, conditions=planner.mission.conditions(mission))
    assert session.move(1, [4.0, -5.05, 1.5]).gate.passed
