"""Gates that a first path passes backwards are gone round, with nothing left of that in the answer."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
import vehicle
from esdf import solids
from flight import Trajectory, Waypoints
from flight.mission import Gate, Laps, Mission, Stay
from planner import Conditions, PlanInfeasibleError, PlanOptions, mission, one_way, planning
from planner.curve import minimum_snap
from planner.gate import gate
from planner.optimise.fastest import Path
from planner.request.inputs import Request
from planner.route import routes

LINE = np.array([[0.0, 0.0, 1.5], [3.0, 0.0, 1.5], [6.0, 0.5, 1.5], [9.0, 0.0, 1.5]])
FEW = settings(max_examples=8, deadline=None, derandomize=True)
CORRIDOR = solids.Room((-2.0, -2.0, 0.0), (11.0, 2.0, 3.0))


def asked(points: np.ndarray, *gates: Gate) -> Conditions:
    edges = np.zeros((len(points), 2, 3))
    for there in gates:
        edges[there.waypoint] = there.edges_m
    return Conditions(gate_edges_m=edges)


def open_headings(points: np.ndarray) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


def flown(field, drone, points: np.ndarray, *gates: Gate, **options) -> planner.Plan:
    return planner.plan(open_headings(points), field, drone, PlanOptions(**options), conditions=asked(points, *gates))


def crossings(path: Trajectory, centre: np.ndarray, edges: np.ndarray) -> list[int]:
    """1 for each time that the path crosses an opening forwards, -1 backwards, by brute force."""
    off = path.position(path.sample(1e-4)) - centre
    side = off @ np.cross(*edges)
    inside = (np.abs(off @ edges.T) <= (edges**2).sum(axis=1)).all(axis=1)
    before = np.flatnonzero((side[:-1] < 0.0) != (side[1:] < 0.0))
    return [1 if side[k] < 0.0 else -1 for k in before if inside[k]]


def hairpin(turn: float, leg_m: float) -> np.ndarray:
    """There and back: the two legs at the second waypoint make an angle of `turn`."""
    back = np.array([leg_m * (1.0 - np.cos(turn)), leg_m * np.sin(turn), 1.5])
    return np.array([[0.0, 0.0, 1.5], [leg_m, 0.0, 1.5], back])


@FEW
@given(
    st.floats(0.05, 1.2),
    st.floats(1.0, 6.0),
    st.floats(-0.6, 0.6),
    st.tuples(st.floats(0.5, 2.0), st.floats(0.5, 2.0)),
    st.booleans(),
)
def test_a_gate_turned_by_at_most_34_degrees_from_either_leg_is_passed_forwards_once(
    open_sky, drone, turn, leg_m, off_rad, size_m, back
):
    points = hairpin(turn, leg_m)[:: -1 if back else 1]
    along = points[1] - points[0]
    there = Gate(1, *size_m, float(np.arctan2(along[1], along[0])) + off_rad)
    path = flown(open_sky, drone, points, there).trajectory
    assert crossings(path, points[1], there.edges_m) == [1]


@pytest.mark.parametrize("waypoint", [1, 2])
@pytest.mark.parametrize("size_m", [0.8, 4.0])
def test_a_gate_turned_against_the_way_is_gone_round_and_no_waypoint_is_added(open_sky, drone, waypoint, size_m):
    there = Gate(waypoint, size_m, 0.5 * size_m, np.pi)
    plan = flown(open_sky, drone, LINE, there)
    assert crossings(plan.trajectory, LINE[waypoint], there.edges_m) == [1]
    assert plan.waypoints.positions_world_m.tolist() == LINE.tolist()
    item = planner.trajectory_file(plan, name="round")
    assert np.array(item.waypoints_world_m).tolist() == LINE.tolist()
    assert plan.gate.conditions.gate_edges_m is not None
    assert len(plan.gate.conditions.gate_edges_m) == len(LINE)
    assert "all 4 in order" in {check.name: check for check in plan.gate.checks}["waypoints"].reason
    assert gate.check_file(item, open_sky, drone).passed


def test_two_gates_in_a_row_may_both_be_turned_against_the_way(open_sky, drone):
    both = Gate(1, 1.0, 0.8, 2.8), Gate(2, 1.4, 1.0, -2.9)
    path = flown(open_sky, drone, LINE, *both).trajectory
    assert [crossings(path, LINE[there.waypoint], there.edges_m) for there in both] == [[1], [1]]


@FEW
@given(st.floats(-0.6, 0.6), st.floats(0.1, 1.2))
def test_a_mirrored_course_is_flown_in_the_same_time(open_sky, drone, off_rad, turn):
    mirror, points = np.array([1.0, -1.0, 1.0]), hairpin(turn, 4.0)
    here = flown(open_sky, drone, points, Gate(1, 1.0, 0.8, off_rad)).trajectory.duration_s
    there = flown(open_sky, drone, points * mirror, Gate(1, 1.0, 0.8, -off_rad)).trajectory.duration_s
    assert abs(here / there - 1.0) < 0.01


def turned_against(count: int = 8) -> tuple[Waypoints, Conditions]:
    """A gate that must be gone round at the second of many waypoints."""
    points = np.column_stack([3.0 * np.arange(count), 0.5 * np.cos(np.arange(count)), np.full(count, 1.5)])
    return open_headings(points), asked(points, Gate(1, 1.0, 0.8, np.pi))


@pytest.mark.parametrize("index", [3, 4, 5, 6])
def test_an_edit_of_legs_that_do_not_end_at_a_gate_keeps_the_way_round_it(open_sky, drone, monkeypatch, index):
    points, conditions = turned_against()
    session = planner.Planner(points, open_sky, drone, conditions=conditions)
    monkeypatch.delattr(planning, "from_scratch")
    plan = session.move(index, points.positions_world_m[index] + [0.0, 0.3, 0.1])
    plan = session.move(index, points.positions_world_m[index] + [0.0, 0.4, 0.2])
    assert crossings(plan.trajectory, points.positions_world_m[1], conditions.gate_edges_m[1]) == [1]


@pytest.mark.parametrize("index", [0, 1, 2, 3])
def test_an_edit_beside_a_gate_still_goes_round_it(open_sky, drone, index):
    points, conditions = turned_against()
    session = planner.Planner(points, open_sky, drone, conditions=conditions)
    plan = session.move(index, points.positions_world_m[index] + [0.0, 0.3, 0.1])
    edges = conditions.gate_edges_m[1]
    assert crossings(plan.trajectory, plan.waypoints.positions_world_m[1], edges) == [1]
    assert len(plan.waypoints.yaw_rad) == len(points.yaw_rad)


def test_a_mission_goes_round_its_gates_between_stays_and_in_laps(open_sky, drone):
    there = Gate(2, 1.0, 0.8, np.pi)
    flight = Mission(open_headings(LINE), gates=(there,), stays=(Stay(1, 1.0),), laps=Laps(2))
    plan = mission.plan(flight, open_sky, drone)
    found = crossings(plan.trajectory, LINE[2], there.edges_m)
    assert -1 not in found
    assert len(found) >= 2  # the way back to the first waypoint leads forwards through it too


@pytest.mark.parametrize("method", ["fastest", "corridor"])
def test_every_method_goes_round_a_gate_among_obstacles(drone, method):
    field = solids.Scene([CORRIDOR, solids.Cylinder((4.5, 0.3, 1.5), 0.2, 3.0)])
    there = Gate(1, 0.8, 0.6, np.pi)
    plan = flown(field, drone, LINE, there, method=method)
    assert crossings(plan.trajectory, LINE[1], there.edges_m) == [1]
    assert (
        field.distance(plan.trajectory.position(plan.trajectory.sample(1e-3))).min() >= plan.gate.required_clearance_m
    )


@pytest.mark.parametrize("heading_rad", [np.pi, 2.6])
def test_a_gate_from_wall_to_wall_that_is_turned_against_the_way_is_refused(drone, heading_rad):
    field = solids.Scene([CORRIDOR])
    with pytest.raises(PlanInfeasibleError, match=r"on no side of it is 0\.343 m of clearance") as refusal:
        flown(field, drone, LINE, Gate(1, 3.8, 2.8, heading_rad))
    assert refusal.value.segment == 0
    assert "between waypoints 1 and 2: the gate at the latter, 3.80 m x 2.80 m" in str(refusal.value)
    assert "turn the gate, make it smaller" in refusal.value.remedy


def test_a_gate_before_a_dead_end_is_refused(drone):
    """The next waypoint is on the near side, and behind the gate is a wall."""
    field = solids.Scene([CORRIDOR, solids.Box((7.0, -2.0, 0.0), (7.2, 2.0, 3.0))])
    points = np.array([[0.0, 0.0, 1.5], [5.0, 0.0, 1.5], [2.0, 0.5, 1.5]])
    with pytest.raises(PlanInfeasibleError, match="passed backwards too"):
        flown(field, drone, points, Gate(1, 3.8, 2.8, 0.0))
    assert flown(field, drone, points, Gate(1, 1.0, 0.8, 0.0)).gate.passed


def test_an_opening_beside_a_gate_lies_in_its_plane_beyond_its_edge_and_is_turned_round(open_sky):
    centre, there = np.array([1.0, 2.0, 3.0]), Gate(1, 1.2, 0.6, 0.4, 0.2, 0.3)
    edges, normal = there.edges_m, np.cross(*there.edges_m)
    found = one_way.openings_beside(centre, edges, open_sky, 0.3)
    assert len(found) == 4
    for middle, *turned in found:
        assert abs((middle - centre) @ normal) < 1e-12
        assert np.cross(*turned) @ normal < 0.0
        corners = [middle + a * turned[0] + b * turned[1] - centre for a in (-1, 1) for b in (-1, 1)]
        shares = np.array([[corner @ edge / (edge @ edge) for edge in edges] for corner in corners])
        assert (np.abs(shares) > 1.0).all(axis=0).any()  # all beyond one pair of edges


def test_openings_are_beside_a_gate_only_where_there_is_room():
    wall = solids.Scene([solids.Box((-5.0, 1.0, -5.0), (5.0, 1.2, 5.0))])
    found = one_way.openings_beside(np.zeros(3), Gate(1, 1.2, 0.6, 0.0).edges_m, wall, 0.3)
    assert len(found) == 4
    found = one_way.openings_beside(np.zeros(3), Gate(1, 1.3, 0.6, 0.0).edges_m, wall, 0.3)
    assert sorted(np.round(opening[0], 6).tolist() for opening in found) == [
        [0.0, -1.3, 0.0],
        [0.0, 0.0, -0.95],
        [0.0, 0.0, 0.95],
    ]


def test_the_shortest_way_round_comes_first_and_only_legs_that_need_one_go_round(open_sky):
    points = np.array([[3.0, 1.0, 0.0], [0.0, 0.0, 0.0], [3.0, -1.0, 0.0]])
    conditions = asked(points, Gate(1, 1.0, 0.8, 0.0))

    def ways(before: bool, behind: bool) -> list[one_way.Around]:
        return one_way.ways(1, one_way.Fault(before, behind), points, conditions, open_sky, 0.3)

    assert [len(ways(*needs)) for needs in ((False, False), (True, False), (False, True), (True, True))] == [
        0,
        4,
        4,
        16,
    ]
    first = ways(True, False)[0]
    assert first.behind is None
    assert first.before is not None
    assert first.before[0, 1] > 0.5  # on the side where it comes from
    assert all(way.before is None for way in ways(False, True))


def test_openings_are_inserted_in_order_among_the_waypoints_and_ask_for_no_heading(open_sky):
    headed, conditions = Waypoints(LINE, np.arange(4.0)), asked(LINE, Gate(1, 1.0, 0.8, np.pi), Gate(2, 1.0, 0.8, 3.0))
    both, before = one_way.Fault(True, True), one_way.Fault(True, False)
    chosen = {i: one_way.ways(i, fault, LINE, conditions, open_sky, 0.35)[0] for i, fault in ((1, both), (2, before))}
    route, asked_there, number = one_way.led_through(chosen, request(headed, conditions, open_sky, PlanOptions(0.2)))
    through, there = asked_there.waypoints, asked_there.conditions
    assert number.tolist() == [0, -1, 1, -1, -1, 2, 3]
    assert np.array_equal(through.yaw_rad, [0.0, np.nan, 1.0, np.nan, np.nan, 2.0, 3.0], equal_nan=True)
    assert np.array_equal(route.points[route.waypoint >= 0], through.positions_world_m)
    assert there.gate_edges_m is not None
    assert [bool(edges.any()) for edges in there.gate_edges_m] == [False, True, True, True, True, True, False]
    assert np.cross(*there.gate_edges_m[1]) @ np.cross(*there.gate_edges_m[2]) < 0.0


GATE = Gate(1, 1.0, 0.8, 0.0)
TO_AND_FRO = np.array(
    [[0, 0, 1.5], [3, 0, 1.5], [3.6, 0.1, 1.5], [2.4, 0.1, 1.5], [3, 0, 1.5], [6, 0.5, 1.5], [9, 0, 1.5]]
)
"""Through the gate forwards, backwards and forwards again."""


def request(waypoints: Waypoints, conditions: Conditions, field, options: PlanOptions) -> Request:
    return Request(waypoints, field, vehicle.example(), options, conditions)


def curve(knots: np.ndarray, waypoint: list[int], conditions: Conditions, field, drone) -> Path:
    """A curve through knots, of which some are waypoints of `LINE`, as if it had been planned."""
    states = np.column_stack([knots, np.zeros(len(knots))])
    path = minimum_snap.trajectory(minimum_snap.solve(states, np.full(len(knots) - 1, 2.0)))
    report = gate.check(path, field, drone, waypoints_world_m=LINE, conditions=conditions)
    return Path(path, np.array(waypoint), "direct", report, path.duration_s)


def test_the_leg_on_which_an_opening_is_crossed_backwards_is_the_one_to_go_round(open_sky, drone):
    conditions = asked(LINE, GATE)
    for waypoint, fault in (
        ([0, 1, -1, -1, -1, 2, 3], one_way.Fault(False, True)),
        ([0, -1, -1, -1, 1, 2, 3], one_way.Fault(True, False)),
    ):
        assert one_way.faults(curve(TO_AND_FRO, waypoint, conditions, open_sky, drone), LINE, conditions) == {1: fault}
    once = curve(LINE, [0, 1, 2, 3], conditions, open_sky, drone)
    assert one_way.faults(once, LINE, conditions) == {}
    beside = curve(LINE + np.array([0.0, 1.0, 0.0]), [0, 1, 2, 3], conditions, open_sky, drone)
    assert one_way.faults(beside, LINE, conditions) == {1: one_way.Fault(False, False)}


@pytest.mark.parametrize(
    ("points", "fault"),
    [
        (np.array([[2.0, 1.0, 1.5], [0.0, 0.0, 1.5], [2.0, -1.0, 1.5]]), one_way.Fault(True, False)),
        (np.array([[-2.0, 1.0, 1.5], [0.0, 0.0, 1.5], [-2.0, -1.0, 1.5]]), one_way.Fault(False, True)),
    ],
)
def test_a_start_in_front_of_a_gate_or_an_end_behind_it_goes_round_its_edge(open_sky, drone, points, fault):
    conditions = asked(points, Gate(1, 1.0, 0.8, 0.0))
    line = curve(points + np.array([0.0, 0.0, 1.0]), [0, 1, 2], asked(LINE), open_sky, drone)  # misses the opening
    assert one_way.faults(line, points, conditions) == {1: fault}


def test_ways_are_tried_in_turn_and_both_legs_go_round_where_each_was_wrong_once(open_sky, drone):
    conditions, through = asked(LINE, GATE), []
    first, second = [0, 1, -1, -1, -1, 2, 3], [0, -1, -1, -1, 1, 2, 3]
    wrong = [curve(TO_AND_FRO, knots, conditions, open_sky, drone) for knots in (first, first, second)]
    good = flown(open_sky, drone, LINE, GATE)
    answers = [PlanInfeasibleError("none", "none"), *wrong[1:]]

    def again(route, asked):
        points = asked.waypoints.positions_world_m
        through.append(points)
        own = [int(np.flatnonzero((points == point).all(axis=1))[0]) for point in LINE]
        if len(through) <= len(answers):
            answer = answers[len(through) - 1]
            if isinstance(answer, PlanInfeasibleError):
                raise answer
            return replace(answer, waypoint=np.array([own[i] if i >= 0 else -1 for i in answer.waypoint]))
        return Path(good.trajectory, np.array([own[0], own[3]]), "direct", good.gate, 1.0)

    route = routes.Route(LINE, np.arange(4))
    found, round_it = one_way.planned(
        wrong[0], route, request(open_headings(LINE), conditions, open_sky, PlanOptions(0.2)), again
    )
    assert found.report.passed
    assert found.waypoint.tolist() == [0, 3]
    assert [len(points) for points in through] == [5, 5, 5, 6]  # behind the gate; twice another way; round both
    assert len({points.tobytes() for points in through}) == 4
    assert len(round_it.points) >= 6


def test_a_gate_that_no_way_round_helps_is_refused_after_a_few(open_sky, drone):
    conditions, tried = asked(LINE, GATE), []
    wrong = curve(TO_AND_FRO, [0, 1, -1, -1, -1, 2, 3], conditions, open_sky, drone)

    def again(route, asked):
        tried.append(asked)
        raise PlanInfeasibleError("none", "none")

    route = routes.Route(LINE, np.arange(4))
    with pytest.raises(PlanInfeasibleError, match="none of 4 ways round its edges can be flown"):
        one_way.planned(wrong, route, request(open_headings(LINE), conditions, open_sky, PlanOptions(0.2)), again)
    assert len(tried) == 4
