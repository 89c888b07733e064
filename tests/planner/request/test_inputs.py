"""What cannot be planned is refused by name, before any work."""

from dataclasses import replace

import numpy as np
import pytest

import planner
from flight import InputError, Waypoints
from planner import PlanInfeasibleError, PlanOptions
from planner.request import inputs

POINTS = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [4.0, 4.0, 1.0]])


def ask(points=POINTS, yaw=None) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan) if yaw is None else np.array(yaw))


def test_no_vehicle_and_no_map_are_named(open_sky, drone):
    with pytest.raises(InputError, match="expected a vehicle, got None"):
        planner.plan(ask(), open_sky, None)
    with pytest.raises(InputError, match="expected a map, got None"):
        planner.plan(ask(), None, drone)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"rotor_speed_max_rad_s": 800.0}, r"cannot hover.* the limit is 800; change rotor_speed_max_rad_s"),
        ({"rotor_speed_min_rad_s": 1500.0}, "change rotor_speed_min_rad_s, or lower control_reserve"),
        ({"rotor_speed_max_rad_s": 970.0}, "change rotor_speed_max_rad_s, or lower control_reserve"),
    ],
)
def test_rotor_limits_that_forbid_hover_are_named(open_sky, drone, limits, words):
    with pytest.raises(PlanInfeasibleError, match=words):
        planner.plan(ask(), open_sky, drone.with_limits(**limits))
    with pytest.raises(PlanInfeasibleError, match="cannot hover"):
        planner.plan(ask(), open_sky, drone, PlanOptions(limits=replace(drone.limits, **limits)))


def test_contradictory_limits_are_named_both(drone):
    with pytest.raises(InputError, match="rotor_speed_min_rad_s 1500 is not below rotor_speed_max_rad_s 1000"):
        drone.with_limits(rotor_speed_min_rad_s=1500.0, rotor_speed_max_rad_s=1000.0)


def test_headings_too_far_apart_for_the_yaw_rate_are_named_by_waypoint(open_sky, drone):
    slow = drone.with_limits(yaw_rate_rad_s=0.01)
    with pytest.raises(InputError, match=r"waypoints 1 and 3 ask for headings 172 deg apart, a turn of 300 s"):
        planner.plan(ask(yaw=[0.0, np.nan, 3.0]), open_sky, slow)


def test_a_way_that_takes_hours_is_refused_with_its_longest_leg(open_sky, drone):
    with pytest.raises(InputError, match="between waypoints 1 and 2"):
        planner.plan(ask(np.array([[0.0, 0, 1], [1e6, 0, 1], [1e6, 5, 1]])), open_sky, drone)


def test_a_way_of_many_legs_is_refused_by_their_sum(open_sky, drone):
    leg_m = 0.4 * inputs.LONGEST_S * drone.limits.speed_m_s
    points = np.array([[k * leg_m, 0.0, 1.0] for k in range(4)])
    with pytest.raises(InputError, match=r"takes more than 10000 s; most of it is between"):
        inputs.check_durations(ask(points), drone.limits)
    inputs.check_durations(ask(points[:3]), drone.limits)


@pytest.mark.parametrize(("clear_m", "free"), [(0.31, True), (0.29, False), (0.2, False)])
def test_a_waypoint_nearer_to_an_obstacle_than_the_clearance_is_named(clear_m, free):
    class Wall:
        def distance(self, points_world_m):
            return np.asarray(points_world_m)[:, 1]

    waypoints = ask(np.array([[0.0, 2.0, 1.0], [4.0, clear_m, 1.0]]))
    if free:
        inputs.check_waypoints(waypoints, Wall(), 0.3)
        return
    with pytest.raises(InputError, match=rf"waypoint 2 at .* is {clear_m:.3f} m from an obstacle .* 0\.300 m are"):
        inputs.check_waypoints(waypoints, Wall(), 0.3)


def test_ten_thousand_waypoints_are_refused_with_the_remedy(open_sky, drone):
    many = np.column_stack([np.arange(10_000.0), np.zeros(10_000), np.ones(10_000)])
    with pytest.raises(InputError, match=f"10000 waypoints are given; at most {inputs.MOST_WAYPOINTS}"):
        planner.plan(ask(many), open_sky, drone)


def test_a_leg_or_a_limit_too_slow_for_any_trajectory_is_named(open_sky, drone):
    crawling = planner.Conditions(leg_speed_m_s=np.array([np.nan, 1e-6]))
    with pytest.raises(
        InputError, match=r"between waypoints 2 and 3, 4 m at 1e-06 m/s: move them, or raise the speed ask"
    ):
        planner.plan(ask(), open_sky, drone, conditions=crawling)
    with pytest.raises(InputError, match="at acceleration_m_s2 1e-09: raise the limit"):
        planner.plan(ask(), open_sky, drone.with_limits(acceleration_m_s2=1e-9))
