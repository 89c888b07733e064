"""At which height a path is flown: a route higher up is tried where it has more room, and kept where it pays."""

import numpy as np
import pytest

import planner
from esdf import solids
from flight import Waypoints
from planner import Conditions, PlanOptions
from planner.optimise import methods
from planner.request import inputs
from planner.route import routes

ACROSS = Waypoints(np.array([[1.0, 3.0, 1.0], [13.0, 3.0, 1.0]]), np.full(2, np.nan))


def posts(top_m: float) -> solids.Scene:
    """A room 3 m high with rows of posts, each in the gaps of the row before, as high as is told."""
    rows = [
        solids.Cylinder((x, y + 0.75 * (i % 2), 0.5 * top_m), 0.25, top_m)
        for i, x in enumerate((3.0, 5.0, 7.0, 9.0, 11.0))
        for y in np.arange(0.0, 6.1, 1.5)
    ]
    return solids.Scene([solids.Room((0.0, 0.0, 0.0), (14.0, 6.0, 3.0)), *rows])


def route_of(scene: solids.Scene, drone, options: PlanOptions) -> routes.Route:
    request = inputs.admitted(ACROSS, scene, drone, options, Conditions(), None)
    return methods.subdivided(routes.find(ACROSS, scene, request.options), scene)


def test_a_higher_route_is_one_with_more_room_through_the_same_waypoints(drone):
    low, options = posts(1.0), PlanOptions(0.2)
    route = route_of(low, drone, options)
    higher = methods.lifted(route, low)
    assert higher is not None
    asked = route.waypoint >= 0
    assert np.array_equal(higher.points[asked], route.points[asked])
    assert (higher.points[~asked, 2] > route.points[~asked, 2] + 0.5).all()
    full = posts(3.0)  # nothing changes with height
    assert methods.lifted(route_of(full, drone, options), full) is None


@pytest.mark.slow
def test_a_higher_route_never_costs_time_worth_speaking_of(drone, monkeypatch):
    low, options = posts(1.0), PlanOptions(0.2)
    plan = planner.plan(ACROSS, low, drone, options)
    assert plan.gate.passed
    monkeypatch.setattr(methods, "lifted", lambda route, field: None)
    alone = planner.plan(ACROSS, low, drone, options)
    assert plan.trajectory.duration_s < 1.003 * alone.trajectory.duration_s
