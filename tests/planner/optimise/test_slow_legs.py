"""Legs that are asked to be flown slowly: they cost their own time, and no plan is refused for them."""

from functools import partial

import numpy as np
import pytest

import planner
from flight import Waypoints
from planner import Conditions
from planner.curve import minimum_snap
from planner.gate import gate
from planner.optimise import repair
from planner.optimise.fastest import Optimum, Path
from planner.request import inputs

ROUND_THE_ROOMS = np.array(
    [[-4.0, -3.0, 1.2], [-4.0, 3.0, 1.0], [-1.5, -2.0, 1.4], [4.0, -2.0, 1.2], [3.0, 3.0, 1.0], [1.0, -3.0, 1.5]]
)


def ask(points: np.ndarray) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


@pytest.mark.parametrize(
    ("leg", "speed_m_s", "at_least_m"), [(1, 0.2, 5.6), (1, 0.1, 5.6), (2, 0.1, 10.3), (3, 0.4, 5.1)]
)
def test_a_leg_at_a_crawl_among_walls_costs_its_own_time(two_rooms, drone, leg, speed_m_s, at_least_m):
    """From a start that enters the leg at its neighbours' pace no path was found, or one that took up to eight times
    as long; a waypoint counted as reached where the path, already slow, first came within the tolerance."""
    speeds = np.full(5, np.nan)
    speeds[leg] = speed_m_s
    asked = Conditions(leg_speed_m_s=speeds)
    plan = planner.plan(ask(ROUND_THE_ROOMS), two_rooms, drone, conditions=asked)
    free = planner.plan(ask(ROUND_THE_ROOMS), two_rooms, drone)
    assert plan.method == "direct"
    alone_s = at_least_m / speed_m_s
    assert alone_s < plan.trajectory.duration_s < free.trajectory.duration_s + 1.06 * alone_s


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("speed of legs", Conditions(leg_speed_m_s=np.array([np.nan, 0.7, np.nan]))),
        ("jerk of legs", Conditions(leg_jerk_m_s3=np.array([np.nan, np.nan, 3.0]))),
    ],
)
def test_a_path_that_is_slowed_down_as_a_whole_keeps_what_is_asked_of_a_leg(open_sky, drone, name, asked):
    points = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.5], [4.0, 4.0, 1.0], [0.0, 4.0, 1.5]])
    request = inputs.admitted(ask(points), open_sky, drone, None, asked, None)
    ask_gate = partial(gate.judge, request)
    spline = minimum_snap.solve(np.column_stack([points, np.zeros(4)]), np.full(3, 2.0))
    fast = minimum_snap.trajectory(spline)
    first = Path(fast, np.arange(4), "corridor", ask_gate(fast, None), Optimum(fast.duration_s))
    slow = repair.slowed(first, request, ask_gate)
    check = next(check for check in slow.report.checks if check.name == name)
    assert slow.report.passed
    assert 0.95 < check.ratio <= 1.0
