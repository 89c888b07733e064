"""Ways round a gate by hand: the openings beside it, their order, and how often they are tried."""

import numpy as np
import pytest

import vehicle
from esdf import solids
from flight import Waypoints
from flight.mission import Gate
from planner import Conditions, PlanInfeasibleError, PlanOptions, one_way
from planner.curve import minimum_snap
from planner.gate import gate
from planner.optimise.fastest import Path
from planner.request.inputs import Request
from planner.route import routes

CENTRE = np.array([1.0, 2.0, 3.0])
LINE = np.array([[0.0, 0.0, 1.5], [3.0, 0.0, 1.5], [6.0, 0.5, 1.5], [9.0, 0.0, 1.5]])
BACK_AND_FORTH = np.array(
    [[0, 0, 1.5], [3.6, 0.1, 1.5], [2.4, 0.1, 1.5], [3, 0, 1.5], [3.6, 0.1, 1.5], [2.4, 0.1, 1.5], [6, 0.5, 1.5]]
)
"""Both on the way to the gate at (3, 0) and from there it is passed backwards too."""


def asked(points: np.ndarray, *gates: Gate) -> Conditions:
    edges = np.zeros((len(points), 2, 3))
    for there in gates:
        edges[there.waypoint] = there.edges_m
    return Conditions(gate_edges_m=edges)


def request(waypoints: Waypoints, conditions: Conditions, field, options: PlanOptions) -> Request:
    return Request(waypoints, field, vehicle.example(), options, conditions)


def curve(knots, waypoint: list[int], points: np.ndarray, conditions: Conditions, field, drone) -> Path:
    """A curve through knots, of which some are waypoints, as if it had been planned."""
    states = np.column_stack([knots, np.zeros(len(knots))])
    path = minimum_snap.trajectory(minimum_snap.solve(states, np.full(len(knots) - 1, 2.0)))
    report = gate.check(path, field, drone, waypoints_world_m=points, conditions=conditions)
    return Path(path, np.array(waypoint), "direct", report, path.duration_s)


@pytest.mark.parametrize(("width_m", "gap_m"), [(0.6, 0.05), (2.0, 0.05), (4.0, 0.1)])
def test_openings_are_a_gap_beside_a_gate_and_twice_as_long_as_the_edge_they_share(open_sky, width_m, gap_m):
    edges = Gate(1, width_m, 0.8, 0.0).edges_m
    side, height = 0.5 * width_m + gap_m + 0.6, 0.4 + 0.05 + 0.6
    found = one_way.openings_beside(CENTRE, edges, open_sky, 0.3)
    expected = {(0.0, side, 0.0), (0.0, -side, 0.0), (0.0, 0.0, height), (0.0, 0.0, -height)}
    assert {tuple((np.round(opening[0] - CENTRE, 9) + 0.0).tolist()) for opening in found} == expected
    for middle, up, left in found:
        beside = abs((middle - CENTRE)[1]) > 1e-9
        assert np.abs(up) == pytest.approx([0.0, 0.0, 0.8 if beside else 0.6], abs=1e-12)
        assert np.abs(left) == pytest.approx([0.0, 0.6 if beside else width_m, 0.0], abs=1e-12)
        assert np.cross(up, left)[0] < 0.0


@pytest.mark.parametrize(
    ("room_m", "half_m"), [(0.61, 0.6), (0.59, 0.3), (0.31, 0.3), (0.29, 0.15), (0.06, 0.05), (0.04, None)]
)
def test_openings_are_as_wide_as_their_middle_has_room(room_m, half_m):
    """`room_m` is what is left of the way to a wall beside the gate after its half width, the gap and the clearance."""
    wall = solids.Scene([solids.Box((-9.0, 0.5 + 0.05 + 0.3 + room_m, -9.0), (9.0, 9.0, 9.0))])
    found = one_way.openings_beside(np.zeros(3), Gate(1, 1.0, 0.8, 0.0).edges_m, wall, 0.3)
    left = [opening for opening in found if opening[0, 1] > 0.1]
    assert len(left) == (half_m is not None)
    if half_m is not None:
        assert left[0][0, 1] == pytest.approx(0.55 + half_m)
        assert np.linalg.norm(left[0][2]) == pytest.approx(half_m)


def test_ways_round_are_sorted_by_what_they_add_on_both_sides(open_sky):
    points = np.array([[3.0, 1.0, 0.2], [0.0, 0.0, 0.0], [-3.0, 0.3, -1.0]]) + CENTRE
    conditions = asked(points, Gate(1, 1.0, 0.8, 0.0))

    def length(opening, other):
        return 0.0 if opening is None else np.linalg.norm(other - opening[0]) + np.linalg.norm(opening[0] - points[1])

    for fault in (one_way.Fault(True, False), one_way.Fault(False, True), one_way.Fault(True, True)):
        found = one_way.ways(1, fault, points, conditions, open_sky, 0.3)
        lengths = [length(way.before, points[0]) + length(way.behind, points[2]) for way in found]
        assert len(set(lengths)) == (16 if fault.before and fault.behind else 4)
        assert lengths == sorted(lengths)


@pytest.mark.parametrize("x", [-0.01, 0.0, 0.01])
def test_a_waypoint_in_the_plane_of_a_gate_is_on_neither_side_of_it(open_sky, drone, x):
    points = np.array([[x, 1.0, 1.5], [0.0, 0.0, 1.5], [-x, -1.0, 1.5]])
    conditions = asked(points, Gate(1, 1.0, 0.8, 0.0))
    above = curve(points + np.array([0.0, 0.0, 1.0]), [0, 1, 2], points, conditions, open_sky, drone)
    assert one_way.faults(above, points, conditions) == {1: one_way.Fault(x > 0.0, x > 0.0)}


def test_each_leg_at_a_gate_is_looked_at_from_its_own_waypoints_on(open_sky, drone):
    conditions = asked(LINE, Gate(1, 1.0, 0.8, 0.0))
    for waypoint, fault in (
        ([0, -1, -1, 1, -1, -1, 2], one_way.Fault(True, True)),
        ([-1, 0, -1, 1, -1, -1, 2], one_way.Fault(True, True)),
        ([-1, -1, 0, 1, -1, -1, 2], one_way.Fault(False, True)),
        ([0, -1, -1, 1, 2, -1, -1], one_way.Fault(True, False)),
        ([0, -1, -1, 1, -1, 2, -1], one_way.Fault(True, True)),
    ):
        path = curve(BACK_AND_FORTH, waypoint, LINE, conditions, open_sky, drone)
        assert one_way.faults(path, LINE, conditions) == {1: fault}, waypoint
    clean = curve(BACK_AND_FORTH, [-1, -1, 0, 1, 2, -1, -1], LINE, conditions, open_sky, drone)
    assert one_way.faults(clean, LINE, conditions) == {}
    assert one_way.faults(clean, LINE, Conditions()) == {}


def attempts(open_sky, drone, *answers: Path) -> tuple[list[np.ndarray], PlanInfeasibleError | None]:
    """The waypoints with which a path that is wrong on both legs is planned again, and the refusal.

    The answers are returned one after the other; then there is no way.
    """
    conditions, tried, left = asked(LINE[:3], Gate(1, 1.0, 0.8, 0.0)), [], list(answers)
    wrong = curve(BACK_AND_FORTH, [0, -1, -1, 1, -1, -1, 2], LINE[:3], conditions, open_sky, drone)

    def again(route, asked):
        tried.append(asked.waypoints.positions_world_m)
        if left:
            return left.pop(0)
        raise PlanInfeasibleError("none", "none")

    headed = Waypoints(LINE[:3], np.full(3, np.nan))
    route = routes.Route(LINE[:3], np.arange(3))
    try:
        one_way.planned(wrong, route, request(headed, conditions, open_sky, PlanOptions(0.2)), again)
    except PlanInfeasibleError as refusal:
        return tried, refusal
    return tried, None


def test_sixteen_ways_round_are_tried_eight_times_at_most_each_once(open_sky, drone):
    tried, refusal = attempts(open_sky, drone)
    assert len({points.tobytes() for points in tried}) == len(tried) == 8
    assert all(len(points) == 5 for points in tried)
    assert refusal is not None
    assert "1.00 m x 0.80 m, is passed backwards too, and none of 8 ways" in str(refusal)
    assert refusal.segment == 0


def test_a_path_that_is_refused_for_something_else_is_not_the_end_of_the_search(open_sky, drone):
    conditions = asked(LINE[:3], Gate(1, 1.0, 0.8, 0.0))
    elsewhere = curve(LINE[:3], [0, 2, 4], LINE[:3] + 1.0, conditions, open_sky, drone)  # asked for at another place
    assert not elsewhere.report.passed
    tried, refusal = attempts(open_sky, drone, elsewhere, elsewhere)
    assert len({points.tobytes() for points in tried}) == len(tried) == 8
    assert refusal is not None


def test_of_several_gates_the_first_one_is_named(open_sky, drone):
    points = LINE * [1.0, 0.0, 1.0]
    conditions = asked(points, Gate(1, 1.0, 0.8, 0.0), Gate(2, 1.4, 0.8, 0.0))
    there = BACK_AND_FORTH[1:6] - BACK_AND_FORTH[3]
    knots = np.concatenate([points[:1], points[1] + there, points[2] + there, points[3:]])
    wrong = curve(knots, [0, -1, -1, 1, -1, -1, -1, -1, 2, -1, -1, 3], points, conditions, open_sky, drone)
    both = one_way.Fault(True, True)
    assert one_way.faults(wrong, points, conditions) == {1: both, 2: both}

    def again(route, asked):
        raise PlanInfeasibleError("none", "none")

    headed, route = Waypoints(points, np.full(4, np.nan)), routes.Route(points, np.arange(4))
    with pytest.raises(
        PlanInfeasibleError, match=r"1\.00 m x 0\.80 m, is passed backwards too, and none of 8"
    ) as refusal:
        one_way.planned(wrong, route, request(headed, conditions, open_sky, PlanOptions(0.2)), again)
    assert refusal.value.segment == 0


def test_a_path_that_no_gate_is_at_fault_for_is_returned_as_it_is(open_sky, drone):
    conditions = asked(LINE, Gate(1, 1.0, 0.8, 0.0))
    path = curve(LINE, [0, 1, 2, 3], LINE, conditions, open_sky, drone)
    route = routes.Route(LINE, np.arange(4))
    headed = Waypoints(LINE, np.full(4, np.nan))
    found = one_way.planned(path, route, request(headed, conditions, open_sky, PlanOptions(0.2)), None)
    assert found == (path, route)


def test_a_gate_that_is_missed_between_waypoints_before_and_behind_it_has_no_way_round(open_sky, drone):
    conditions = asked(LINE, Gate(2, 1.0, 0.8, 0.0))
    beside = curve(LINE + np.array([0.0, 2.0, 0.0]), [0, 1, 2, 3], LINE, conditions, open_sky, drone)
    headed, route = Waypoints(LINE, np.full(4, np.nan)), routes.Route(LINE, np.arange(4))
    with pytest.raises(PlanInfeasibleError, match="is not passed forwards within its opening") as refusal:
        one_way.planned(beside, route, request(headed, conditions, open_sky, PlanOptions(0.2)), None)
    assert refusal.value.segment == 1


@pytest.mark.parametrize("fault", [one_way.Fault(True, False), one_way.Fault(False, True), one_way.Fault(True, True)])
def test_a_gate_without_room_on_any_side_is_refused_on_the_leg_before_it_whichever_leg_is_wrong(fault, open_sky):
    conditions, headed = asked(LINE, Gate(2, 1.0, 0.8, 0.0)), Waypoints(LINE, np.full(4, np.nan))
    refusal = one_way._refused(2, one_way._Tried(fault), request(headed, conditions, open_sky, PlanOptions(0.2)))
    assert "passed backwards too, and on no side of it is" in str(refusal)
    assert refusal.segment == 1
