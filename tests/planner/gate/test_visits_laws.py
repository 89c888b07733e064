"""When waypoints count as visited, for trajectories made by hand."""

import numpy as np
import pytest

from flight import Trajectory
from planner import Conditions, PlanOptions
from planner.gate import visits
from planner.gate.visits import BLOCK, Visits
from planner.request import inputs
from tests.planner.gate.by_hand import LEFT_UP, ORIGIN, straight


@pytest.mark.parametrize(
    ("waypoints", "passed"),
    [
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], True),  # at joins
        ([(0, 0.25, 0), (1, -0.25, 0), (2, 0, 0.25)], True),  # just within the tolerance
        ([(0, 0.25, 0), (0.5, -0.25, 0), (2, 0, 0.25)], True),  # the middle one at no join
        ([(0, 0.26, 0), (1, 0, 0), (2, 0, 0)], False),
        ([(0, 0.26, 0), (0.5, 0, 0), (2, 0, 0)], False),
        ([(0, 0, 0), (1, 0.26, 0), (2, 0, 0)], False),
        ([(0, 0, 0), (1, 0, 0), (2, 0.26, 0)], False),
        ([(0, 0, 0), (0.5, 0, 0), (2, 0.26, 0)], False),
        ([(0, 0, 0), (1, 0, 0)], False),  # goes on
        ([(1, 0, 0), (2, 0, 0)], False),  # begins before
        ([(0, 0, 0), (1.5, 0, 0), (0.5, 0, 0), (2, 0, 0)], False),  # the other way round
        ([(0, 0, 0), (np.nan, 0, 0), (2, 0, 0)], False),
        ([(np.nan, np.nan, np.nan)], False),
        (np.zeros((0, 3)), False),
    ],
)
def test_waypoints_are_reached_in_order_from_the_first_to_the_last(verdicts, waypoints, passed):
    check = verdicts(straight((0, 0, 0, 0), (1, 0, 0, 0), (2, 0, 0, 0)), waypoints)["waypoints"]
    assert check.passed == passed
    assert check.bound == 0.25


def test_a_missed_waypoint_is_named_with_its_distance(verdicts):
    way = straight((0, 0, 0, 0), (2, 0, 0, 0))
    found = verdicts(way, [(0, 0, 0), (1, 2, 0), (2, 0, 0)])["waypoints"]
    assert (found.value, found.reason) == (pytest.approx(2.0), "waypoint 2 is missed by 2.000 m")
    found = verdicts(way, [(0, 0.5, 0), (1, 0.125, 0), (2, 0, 0)])["waypoints"]
    assert (found.value, found.reason) == (0.5, "waypoint 1 is missed by 0.500 m")
    found = verdicts(way, [(0, 0, 0), (1, 0.125, 0), (2, 0.75, 0)])["waypoints"]
    assert (found.value, found.passed, found.reason) == (0.75, False, "waypoint 3 is missed by 0.750 m")
    found = verdicts(way, [(0, 0.5, 0), (1, 0.125, 0), (2, 0.75, 0)])["waypoints"]
    assert found.reason.startswith("waypoint 1 is missed by")


def test_a_radius_is_taken_off_the_distance_of_its_own_waypoint(verdicts):
    way, points = straight((0, 0, 0, 0), (4, 0, 0, 0)), [(0, 0, 0), (1, 1, 0), (3, 0.125, 0), (4, 0, 0)]
    for radius, worst in ((0.75, 0.25), (0.875, 0.125), (2.0, 0.125)):
        check = verdicts(way, points, fly_by_m=np.array([0.0, radius, 0.0, 0.0]))["waypoints"]
        assert (check.passed, check.value) == (True, pytest.approx(worst))
    assert not verdicts(way, points, fly_by_m=np.array([0.0, 0.74, 0.0, 0.0]))["waypoints"].passed
    assert not verdicts(way, points, fly_by_m=np.array([0.0, 0.0, 2.0, 0.0]))["waypoints"].passed


def instants(*times_s: float) -> Visits:
    return Visits(*[np.array(times_s)] * 3)


def visited(way, waypoints, tolerance_m=0.125, **conditions):
    options = PlanOptions(waypoint_tolerance_m=tolerance_m)
    return visits.reached(way, np.array(waypoints, dtype=float), Conditions(**conditions), options)[1]


def test_a_visit_lasts_from_where_the_path_enters_the_radius_to_where_it_leaves_it():
    way = straight((0, 0, 0, 0), (8, 0, 0, 0), leg_s=8.0)  # longer on either side than samples are looked at together
    visits = visited(way, [(0, 0, 0), (4, 0, 0), (8, 0, 0)], fly_by_m=np.array([0.0, 1.875, 0.0]))
    np.testing.assert_allclose(visits.time_s, [0.0, 4.0, 8.0], atol=1e-3)
    np.testing.assert_allclose(visits.enter_s, [0.0, 2.0, 8.0], atol=1e-3)
    np.testing.assert_allclose(visits.leave_s, [0.125, 6.0, 8.0], atol=1e-3)
    assert visits.enter_s[0] == 0.0


def test_a_radius_is_left_sooner_than_it_was_entered_where_the_path_is_faster_behind_it():
    coefficients = np.zeros((2, 4, 8))
    coefficients[:, 0, :2] = [[0.0, 1.0], [4.0, 2.0]]
    way = Trajectory(np.array([4.0, 2.0]), coefficients)
    visits = visited(way, [(0, 0, 0), (3.5, 0, 0), (8, 0, 0)], fly_by_m=np.array([0.0, 1.875, 0.0]))
    np.testing.assert_allclose(visits.enter_s, [0.0, 1.5, 6.0], atol=2e-3)
    np.testing.assert_allclose(visits.leave_s, [0.125, 4.75, 6.0], atol=2e-3)


def test_a_gate_with_a_join_in_its_middle_is_asked_for_its_direction_all_the_same(verdicts):
    edges = np.array([np.zeros((2, 3)), LEFT_UP, np.zeros((2, 3))])
    for way, passed in (([0, 1, 2], True), ([2, 1, 0], False)):
        points = [(float(x), 0.0, 0.0) for x in way]
        path = straight(*[(*point, 0.0) for point in points])
        assert verdicts(path, points, gate_edges_m=edges)["waypoints"].passed == passed


def test_overlapping_radii_are_entered_one_after_the_other():
    way = straight((0, 0, 0, 0), (8, 0, 0, 0), leg_s=8.0)
    points = [(0, 0, 0), (3, 0, 0), (4, 0, 0), (8, 0, 0)]
    visits = visited(way, points, fly_by_m=np.array([0.0, 1.875, 1.875, 0.0]))
    np.testing.assert_allclose(visits.enter_s, [0.0, 1.0, 3.0, 8.0], atol=1e-3)
    np.testing.assert_allclose(visits.leave_s, [0.125, 5.0, 6.0, 8.0], atol=1e-3)


def test_the_visits_of_joins_and_gates_are_instants():
    way = straight((0, 0, 0, 0), (1, 0, 0, 0), (2, 0, 0, 0))
    assert visited(way, [(0, 0, 0), (1, 0, 0), (2, 0, 0)]).leave_s.tolist() == [0.0, 1.0, 2.0]
    edges = np.array([np.zeros((2, 3)), LEFT_UP, np.zeros((2, 3))])
    visits = visited(way, [(0, 0, 0), (1.5, 0, 0), (2, 0, 0)], gate_edges_m=edges)
    for found in (visits.time_s, visits.enter_s, visits.leave_s):
        assert found[1:] == pytest.approx([1.5, 2.0], abs=2e-9)


@pytest.mark.parametrize(
    ("aside_m", "off_rad", "met"),
    [
        (0.0, 0.0, True),
        (inputs.SAME_M, -visits.SAME_RAD, True),
        (1.01 * inputs.SAME_M, 0.0, False),
        (0.0, 1.01 * visits.SAME_RAD, False),
        (0.0, -1.01 * visits.SAME_RAD, False),
    ],
)
def test_a_turn_on_the_spot_is_met_at_the_join_there_that_has_its_heading(aside_m, off_rad, met):
    way = straight((-1, 0, 0, 2), (0, 0, 0, 2), (aside_m, 0, 0, off_rad), (5, 0, 0, 0))
    points = np.array([[-1.0, 0, 0], [0.0, 0, 0], [0.0, 0, 0], [5.0, 0, 0]])
    found = visits.turned(way, instants(0.0, 1.0, 1.0, 3.0), points, np.array([np.nan, 2.0, 0.0, np.nan]))
    for times in (found.time_s, found.enter_s, found.leave_s):
        assert times.tolist() == [0.0, 1.0, 2.0 if met else 1.0, 3.0]


def test_a_heading_near_both_of_those_of_a_turn_meets_them_at_once_and_an_earlier_one_counts_for_nothing():
    points = np.array([[0.0, 0, 0], [0.0, 0, 0], [5.0, 0, 0]])
    near = 0.75 * visits.SAME_RAD
    way = straight((0, 0, 0, 0), (0, 0, 0, near), (5, 0, 0, near))
    assert visits.turned(way, instants(0.0, 0.0, 2.0), points, np.array([0.0, near, np.nan])).time_s[1] == 0.0
    way = straight((0, 0, 0, 1), (0, 0, 0, 0), (0, 0, 0, 1), (5, 0, 0, 1))
    assert visits.turned(way, instants(1.0, 1.0, 3.0), points, np.array([0.0, 1.0, np.nan])).time_s[1] == 2.0


def test_waypoints_just_within_the_tolerance_of_joins_are_met_there(verdicts):
    way, points = straight((0, 0, 0, 0), (1, 0, 0, 0), (2, 0, 0, 0)), [(0, 0.0625, 0), (1, -0.125, 0), (2, 0, 0)]
    found = visited(way, points)
    for times in (found.time_s, found.enter_s, found.leave_s):
        assert times.tolist() == [0.0, 1.0, 2.0]
    assert verdicts(way, points)["waypoints"].value == 0.125


def distances(*runs: tuple[int, float]) -> np.ndarray:
    """Points on the x axis: so many at each distance from the origin."""
    x = np.concatenate([np.full(count, distance) for count, distance in runs])
    return np.stack([x, np.zeros(len(x)), np.zeros(len(x))], axis=1)


@pytest.mark.parametrize("start", [0, 5])
@pytest.mark.parametrize("before", [0, 1, BLOCK - 1, BLOCK, 2 * BLOCK - 1])
@pytest.mark.parametrize("length", [1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK])
def test_the_first_visit_is_found_wherever_it_begins_and_ends_among_blocks(start, before, length):
    """A nearer visit follows at once, as it does where a waypoint is passed twice."""
    for nearest in sorted({0, length // 2, length - 1}):
        way = distances((start + before, 3.0), (length, 1.0), (1, 2.0), (7, 0.25), (9, 3.0))
        way[start + before + nearest, 0] = 0.5
        assert visits.first_visit(way, start, ORIGIN, 1.0) == (start + before + nearest, 0.5)


@pytest.mark.parametrize("blocks", [1, 2])
def test_a_visit_that_ends_at_a_blocks_border_is_over(blocks):
    """Whatever comes as near again, be it at a border too."""
    way = distances((blocks * BLOCK, 0.5), (BLOCK, 3.0), (7, 0.25))
    assert visits.first_visit(way, 0, ORIGIN, 1.0) == (0, 0.5)


def test_a_visit_may_be_the_first_sample_the_last_one_or_none():
    assert visits.first_visit(distances((1, 0.5), (9, 3.0)), 0, ORIGIN, 1.0) == (0, 0.5)
    assert visits.first_visit(distances((9, 3.0), (1, 0.5)), 0, ORIGIN, 1.0) == (9, 0.5)
    assert visits.first_visit(distances((BLOCK, 0.5)), 0, ORIGIN, 1.0) == (0, 0.5)
    assert visits.first_visit(distances((2 * BLOCK, 1.001)), 0, ORIGIN, 1.0) is None
    assert visits.first_visit(distances((9, 0.5), (9, 3.0)), 9, ORIGIN, 1.0) is None


def test_of_equally_near_samples_the_first_one_counts():
    assert visits.first_visit(distances((3, 2.0), (2 * BLOCK, 0.5)), 0, ORIGIN, 1.0) == (3, 0.5)


@pytest.mark.parametrize("count", [1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK, 2 * BLOCK + 1])
def test_a_stay_within_a_radius_ends_with_its_last_sample_at_any_place_in_a_block(count):
    for after in (0, 1, BLOCK):
        way = distances((count, 1.0), (after, 1.5), (after, 0.5))
        assert visits._staying(way, ORIGIN, 1.0) == count - 1
