"""Turns on the spot, and other input of which little is left."""

import itertools

import numpy as np
import pytest

import planner
from esdf import solids
from flight import InputError, Trajectory, Waypoints
from flight.mission import FlyBy, Gate, Ground, KeepIn, Laps, Mission, Stay, Velocity
from planner import PlanOptions, mission
from planner.gate import gate, limits
from planner.optimise import methods
from planner.route import routes

A, B, C = (0.0, 0.0, 1.0), (3.0, 0.6, 1.0), (4.0, 3.0, 1.2)
OPEN = np.nan


def ask(points, yaw, **more) -> Mission:
    return Mission(Waypoints(np.array(points), np.array(yaw)), **more)


def turned(trajectory) -> np.ndarray:
    """(n,) the heading while the vehicle is where it was half a second ago."""
    values = trajectory.evaluate(trajectory.sample(0.005))
    return values[:-100, 3][np.linalg.norm(values[100:, :3] - values[:-100, :3], axis=1) < 1e-9]


@pytest.mark.parametrize("by", [0.1, 1.0, 2.0, 3.1, -3.1, 4.0])
def test_a_turn_goes_the_short_way_in_one_place_as_fast_as_a_limit_allows(open_sky, drone, by):
    plan = mission.plan(ask([A, A], [0.4, 0.4 + by]), open_sky, drone)
    path = plan.trajectory
    values = path.evaluate(path.sample(0.002))
    assert plan.gate.passed
    assert np.abs(values[:, :3] - A).max() < 1e-9
    short = np.angle(np.exp(1j * by))
    assert values[[0, -1], 3] == pytest.approx([0.4, 0.4 + short])
    assert (np.diff(values[:, 3]) * short >= -1e-12).all()
    bounds = PlanOptions().limits_for(drone)
    assert not all(check.passed for check in limits.check(path.scale_time(0.97), drone, bounds, step_s=0.002))


def test_a_slower_vehicle_turns_more_slowly(open_sky, drone):
    durations = [
        mission.plan(ask([A, A], [0.0, 3.0]), open_sky, drone.with_limits(yaw_rate_rad_s=rate)).trajectory.duration_s
        for rate in (3.0, 1.0, 0.25)
    ]
    assert all(b > 2.0 * a for a, b in itertools.pairwise(durations))


def test_a_turn_in_the_middle_of_a_route_joins_two_paths_and_travels_with_the_file(pillar, drone):
    points = [(-3.0, 0.2, 1.0), (0.0, 2.0, 1.5), (0.0, 2.0, 1.5), (3.0, 0.0, 1.2)]
    plan = mission.plan(ask(points, [OPEN, 0.0, 2.0, OPEN]), pillar, drone)
    path = plan.trajectory
    assert plan.method == "direct+turn"
    for derivative in range(4):
        assert np.abs(path.join_jumps(derivative)).max() < 1e-4
    assert np.ptp(turned(path)) > 1.0
    item = planner.trajectory_file(plan, name="turn")
    assert gate.check_file(item, pillar, drone).passed
    coefficients = path.coefficients.copy()
    coefficients[:, 3, 0] += np.where(np.arange(len(coefficients)) < len(coefficients) // 2, 0.0, 0.05)
    report = gate.check(
        Trajectory(path.durations_s, coefficients),
        pillar,
        drone,
        waypoints_world_m=plan.waypoints.positions_world_m,
        yaw_rad=plan.waypoints.yaw_rad,
    )
    assert "heading at waypoints" in {check.name for check in report.failures}


@pytest.mark.parametrize(
    ("points", "yaw", "more"),
    [
        ([A, A, B], [0.0, 2.0, OPEN], {}),
        ([A, B, B], [OPEN, 2.0, -2.0], {}),
        ([A, B, B, B, C], [OPEN, 0.0, 1.5, 0.0, OPEN], {}),
        ([A, B, C, A], [0.0, OPEN, OPEN, 1.5], {"laps": Laps(2)}),
        ([A, B, B, C], [OPEN, 0.0, 1.5, OPEN], {"keep_in": KeepIn(0.5)}),
        ([A, B, B, C, A], [OPEN, 0.0, 1.5, OPEN, OPEN], {"gates": (Gate(3, 1.0, 1.0, 2.0),)}),
        ([A, B, B, C], [OPEN, 0.0, 1.5, OPEN], {"take_off": Ground((-0.5, 0.0, 0.1))}),
    ],
)
def test_turns_go_with_whatever_else_is_asked(open_sky, drone, points, yaw, more):
    plan = mission.plan(ask(points, yaw, **more), open_sky, drone)
    assert plan.gate.passed
    assert np.ptp(turned(plan.trajectory)) > 0.5


def test_a_stay_before_or_after_a_turn_is_held_besides_it(open_sky, drone):
    turn_s = mission.plan(ask([B, B], [0.0, 1.5]), open_sky, drone).trajectory.duration_s
    points, yaw = [A, B, B, C], [OPEN, 0.0, 1.5, OPEN]
    for waypoint, heading in ((1, 0.0), (2, 1.5)):
        plan = mission.plan(ask(points, yaw, stays=(Stay(waypoint, 1.0),)), open_sky, drone)
        path = plan.trajectory
        held = (np.abs(path.coefficients[:, :, 1:]).max(axis=(1, 2)) < 1e-12).nonzero()[0]
        assert path.durations_s[held].tolist() == [1.0]
        assert path.coefficients[held[0], 3, 0] == pytest.approx(heading, abs=1e-6)
        there = np.linalg.norm(path.position(path.sample(0.001)) - B, axis=1) < 1e-9
        assert 0.001 * there.sum() == pytest.approx(1.0 + turn_s, abs=0.01)
        # the turn does not count as part of the stay
        whole = mission.conditions(ask(points, yaw, stays=(Stay(waypoint, 1.5),)))
        report = gate.check(
            path, open_sky, drone, waypoints_world_m=np.array(points), yaw_rad=np.array(yaw), conditions=whole
        )
        assert [check.name for check in report.failures] == ["stays"]


@pytest.mark.parametrize(
    ("points", "yaw", "words"),
    [
        ([A], [0.0], "1 waypoints are given; at least two"),
        ([A, A], [OPEN, OPEN], r"waypoints 1 and 2 are in the same place \(0.00, 0.00, 1.00\); remove one of them, or"),
        ([A, A], [1.0, 1.0], "waypoints 1 and 2 are in the same place"),
        ([A, A], [1.0, 1.0 + 2.0 * np.pi], "waypoints 1 and 2 are in the same place"),
        ([A, A], [1.0, OPEN], "waypoints 1 and 2 are in the same place"),
        ([A, B, B, C], [OPEN] * 4, "waypoints 2 and 3 are in the same place"),
        ([A, A, B, B], [0.0, 1.0, 2.0, OPEN], "waypoints 3 and 4 are in the same place"),
    ],
)
def test_one_waypoint_and_equal_ones_are_refused_by_their_numbers(open_sky, drone, points, yaw, words):
    with pytest.raises(InputError, match=words):
        mission.plan(ask(points, yaw), open_sky, drone)


def test_a_single_path_that_would_turn_on_the_spot_is_referred_to_the_mission(open_sky, drone):
    with pytest.raises(InputError, match=r"waypoints 1 and 2 .* two headings; plan this turn as a mission"):
        planner.plan(ask([A, A], [0.0, 1.0]).waypoints, open_sky, drone)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"fly_bys": (FlyBy(2, 0.3),)}, "waypoint 3 is turned at on the spot and has a radius"),
        ({"velocities": (Velocity(1, (1.0, 0.0, 0.0)),)}, "waypoint 2 is turned at on the spot and has a velocity"),
        ({"gates": (Gate(1, 1.0, 1.0, 0.0),)}, "waypoint 2 is turned at on the spot and has a gate"),
    ],
)
def test_what_is_passed_in_motion_is_no_place_to_turn_on_the_spot(open_sky, drone, more, words):
    with pytest.raises(InputError, match=words):
        mission.plan(ask([A, B, B, C], [OPEN, 0.0, 1.5, OPEN], **more), open_sky, drone)


@pytest.mark.parametrize(
    ("points", "more", "words"),
    [
        ([A, A, C], {"take_off": Ground((0.0, 0.0, 0.1))}, "waypoint 1 is turned at on the spot and has a take-off"),
        ([C, A, A], {"landing": Ground((0.0, 0.0, 0.1))}, "waypoint 3 is turned at on the spot and has a landing"),
    ],
)
def test_the_end_at_the_ground_is_no_place_to_turn_on_the_spot(open_sky, drone, points, more, words):
    with pytest.raises(InputError, match=words):
        mission.plan(ask(points, [0.0, 1.5, 0.0], **more), open_sky, drone)


def test_a_heading_that_is_held_cannot_be_turned_from(open_sky, drone):
    with pytest.raises(InputError, match="yaw steady holds 0 deg"):
        mission.plan(ask([A, A], [0.0, 1.5]), open_sky, drone, PlanOptions(yaw="steady"))


def test_a_turn_too_close_to_an_obstacle_is_refused_by_its_waypoint(pillar, drone):
    near = (0.0, 0.8, 1.0)
    with pytest.raises(InputError, match="waypoint 2 at"):
        mission.plan(ask([(0.0, 3.0, 1.0), near, near], [OPEN, 0.0, 1.0]), pillar, drone)


def test_a_scene_without_anything_in_it_can_be_flown_in(drone):
    assert mission.plan(ask([A, B, C], [OPEN] * 3), solids.Scene([]), drone).gate.passed


def test_a_doubled_point_of_a_route_stays_one_piece(open_sky):
    route = routes.Route(np.array([A, A, B]), np.array([0, -1, 1]))
    dense = methods.subdivided(route, open_sky)
    assert dense.waypoint[[0, -1]].tolist() == [0, 1]
    np.testing.assert_array_equal(dense.points[[0, 1, -1]], [A, A, B])
