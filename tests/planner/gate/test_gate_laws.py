"""The gate's answers for trajectories made by hand, with and without the fault that each check is there for."""

import dataclasses

import numpy as np
import pytest

from flight import MapError, Trajectory, TrajectoryFile
from planner import PlanOptions
from planner.gate import conditions_met, gate, visits
from planner.gate.visits import BLOCK
from tests.planner.gate.by_hand import LEFT_UP, straight


def passes(path, centre, start=0, edges=LEFT_UP, step_s=2.0**-10):
    """What `_first_pass` finds among samples at multiples of the step."""
    times = np.arange(0.0, path.duration_s + 0.5 * step_s, step_s)
    return visits.first_pass(path, times, path.position(times), start, np.array(centre), edges)


# -- openings ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("blocks", [1, 2])
@pytest.mark.parametrize("start", [0, 3])
def test_a_crossing_is_found_on_and_between_samples_on_both_sides_of_a_blocks_border(blocks, offset, start):
    sample = start + blocks * BLOCK + offset
    path = straight((0, 0, 0, 0), (4, 0, 0, 0), leg_s=4.0)  # a sample every 2^-10 m
    found = passes(path, (sample / 1024.0, 0.0, 0.0), start)
    assert found is not None
    index, time_s, off_m = found
    assert index == np.ceil(sample)
    assert time_s == pytest.approx(sample / 1024.0, abs=2e-9)
    assert off_m == -0.5


@pytest.mark.parametrize("blocks", [1, 2])
def test_a_crossing_between_the_last_two_samples_is_found_where_a_block_begins_with_them(blocks):
    last = blocks * BLOCK + 1
    found = passes(straight((0, 0, 0, 0), (last / 1024.0, 0, 0, 0), leg_s=last / 1024.0), ((last - 0.5) / 1024.0, 0, 0))
    assert found is not None
    assert found[0] == last


@pytest.mark.parametrize(("y", "passed"), [(0.019, True), (0.021, False)])
def test_an_opening_counts_however_small_it_is(verdicts, y, passed):
    edges = np.array([np.zeros((2, 3)), 0.04 * LEFT_UP, np.zeros((2, 3))])
    path, points = straight((0, y, 0, 0), (2, y, 0, 0)), [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
    assert verdicts(path, points, gate_edges_m=edges)["waypoints"].passed == passed


def test_a_path_that_begins_in_an_openings_plane_or_ends_before_it_does_not_cross_it():
    path = straight((0, 0, 0, 0), (1, 0, 0, 0))
    assert passes(path, (0.5, 0.0, 0.0), start=512) is None
    assert passes(path, (1.0 + 2.0**-12, 0.0, 0.0)) is None
    assert passes(path, (1.0, 0.0, 0.0))[0] == 1024
    assert passes(straight((1, 0, 0, 0), (0, 0, 0, 0)), (0.5, 0.0, 0.0)) is None  # backwards


def test_where_the_plane_is_crossed_decides_not_the_samples_beside_it():
    """Between two samples the path moves sideways by twice the width of the opening."""
    at_s, aside = 512.5 / 1024.0, 2.0 * 1024.0
    middle = straight((0, -aside * at_s, 0, 0), (1, aside * (1.0 - at_s), 0, 0))
    index, time_s, off_m = passes(middle, (at_s, 0.0, 0.0))
    assert (index, time_s) == (513, pytest.approx(at_s, abs=1e-9))
    assert off_m == pytest.approx(-0.5, abs=1e-5)
    for sample in (512, 513):  # inside at either sample, outside in the plane
        begin = -aside * sample / 1024.0
        assert passes(straight((0, begin, 0, 0), (1, begin + aside, 0, 0)), (at_s, 0.0, 0.0)) is None


@pytest.mark.parametrize(
    ("y", "z", "off_m"),
    [(0.0, 0.0, -0.5), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (0.25, -0.375, -0.125), (0.51, 0, None), (0, -0.51, None)],
)
def test_an_opening_reaches_up_to_its_edges(y, z, off_m):
    found = passes(straight((0, y, z, 0), (1, y, z, 0)), (0.5, 0.0, 0.0))
    assert (None if found is None else found[2]) == off_m


def test_an_opening_that_is_wide_and_low_has_a_size_for_each_edge():
    edges = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 0.25]])
    for y, z, off_m in ((1.75, 0.125, -0.125), (1.0, 0.5, None), (1.9375, 0.0, -0.0625), (2.5, 0.0, None)):
        found = passes(straight((0, y, z, 0), (1, y, z, 0)), (0.5, 0.0, 0.0), edges=edges)
        assert (None if found is None else found[2]) == off_m


def test_a_path_that_crosses_beside_an_opening_and_comes_back_through_it_passes(verdicts):
    way = [(0, 2, 0, 0), (2, 2, 0, 0), (0, 2, 0, 0), (0, 0, 0, 0), (2, 0, 0, 0)]
    edges = np.array([np.zeros((2, 3)), LEFT_UP, np.zeros((2, 3))])
    points = [(0, 2, 0), (1, 0, 0), (2, 0, 0)]
    found = verdicts(straight(*way), points, gate_edges_m=edges)
    assert found["waypoints"].passed
    assert (found["gates"].value, found["gates"].bound) == (pytest.approx(-0.5), 0.0)
    assert "1 passed" in found["gates"].reason
    beside = verdicts(straight(*way[:2], (2, 0, 0, 0)), points, gate_edges_m=edges)["waypoints"]
    assert not beside.passed
    assert beside.value == pytest.approx(1.0)


def test_gates_are_passed_in_their_order_and_the_nearest_edge_is_named(verdicts):
    row = straight((0, 0.25, 0, 0), (4, 0.25, 0, 0), leg_s=4.0)
    ends, edges = [(0, 0.25, 0), (4, 0.25, 0)], np.zeros((4, 2, 3))
    edges[1:3] = LEFT_UP
    found = verdicts(row, [ends[0], (1, 0, 0), (2, 0.5, 0.125), ends[1]], gate_edges_m=edges)
    assert found["waypoints"].passed
    assert found["gates"].value == pytest.approx(-0.25)
    found = verdicts(row, [ends[0], (1, 0.25, 0), (2, 0, 0), ends[1]], gate_edges_m=edges)
    assert "nearest to an edge at waypoint 3" in found["gates"].reason
    swapped = verdicts(row, [ends[0], (2, 0, 0), (1, 0, 0), ends[1]], gate_edges_m=edges)
    assert not swapped["waypoints"].passed
    assert "gate at waypoint 3 is not passed forwards" in swapped["waypoints"].reason
    assert swapped["waypoints"].reason.endswith("turn the gate or enlarge it")


def test_a_gate_may_be_passed_backwards_before_and_after_the_visits_beside_it_alone(verdicts):
    """Out through the gate, to a waypoint, back through it: only between its neighbours is that a fault."""
    way = straight((0, 0, 0, 0), (2, 0, 0, 0), (2, 0, 0, 0.1), (0, 0, 0, 0))
    edges = np.zeros((4, 2, 3))
    edges[1] = LEFT_UP
    found = verdicts(way, [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 0, 0)], gate_edges_m=edges)
    assert found["waypoints"].passed
    found = verdicts(way, [(0, 0, 0), (1, 0, 0), (0, 0, 0)], gate_edges_m=edges[[0, 1, 0]][:3])
    assert not found["waypoints"].passed
    assert "backwards too, at 2.50 s: turn the gate or make it smaller" in found["waypoints"].reason
    first = straight((2, 0, 0, 0), (0, 0, 0, 0), (2, 0, 0, 0))
    edges = np.zeros((4, 2, 3))
    edges[2] = LEFT_UP
    assert verdicts(first, [(2, 0, 0), (0, 0, 0), (1, 0, 0), (2, 0, 0)], gate_edges_m=edges)["waypoints"].passed
    found = verdicts(first, [(2, 0, 0), (1, 0, 0), (2, 0, 0)], gate_edges_m=edges[[0, 2, 0]])
    assert "backwards too, at 0.50 s" in found["waypoints"].reason


# -- headings ----------------------------------------------------------------------------------------------------------


def test_headings_asked_for_are_met_modulo_a_turn_and_open_ones_anywhere(verdicts):
    way, points = straight((0, 0, 0, 1.0), (1, 0, 0, 2.0), (2, 0, 0, 3.0)), [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
    for yaw, passed in (
        ((1.0, 2.0, 3.0), True),
        ((1.0, 2.0 + 2.0 * np.pi, 3.0 - 2.0 * np.pi), True),
        ((np.nan, 2.0, np.nan), True),
        ((np.nan, 2.019, np.nan), True),
        ((np.nan, 2.021, np.nan), False),
        ((np.nan, 1.979, 3.0), False),
        ((np.nan, -2.0, np.nan), False),
    ):
        assert verdicts(way, points, yaw=np.array(yaw))["heading at waypoints"].passed == passed
    assert "heading at waypoints" not in verdicts(way, points, yaw=np.full(3, np.nan))
    assert "heading at waypoints" not in verdicts(way, None, yaw=np.ones(3))
    assert "heading at waypoints" not in verdicts(way, [(0, 5, 0)], yaw=np.ones(1))
    assert "heading at waypoints" not in verdicts(way, points)


def test_a_heading_that_is_held_may_be_left_by_one_fiftieth_of_a_radian(verdicts):
    for turned, passed in ((0.019, True), (-0.019, True), (0.021, False), (-0.021, False)):
        way = straight((0, 0, 0, 0.7), (1, 0, 0, 0.7 + turned), (2, 0, 0, 0.7))
        steady = verdicts(way, options=PlanOptions(yaw="steady"))["heading held"]
        fixed = verdicts(way, options=PlanOptions(yaw="fixed", heading_rad=0.7))["heading held"]
        assert (steady.passed, fixed.passed) == (passed, passed)
        assert steady.value == pytest.approx(abs(turned))
        assert steady.time_s == pytest.approx(1.0)
    level = straight((0, 0, 0, 0.7), (1, 0, 0, 0.7))
    assert not verdicts(level, options=PlanOptions(yaw="fixed", heading_rad=0.0))["heading held"].passed
    assert "heading held" not in verdicts(level)


@pytest.mark.parametrize(("x", "passed"), [(-1.0, True), (-1.001, False), (-3.0, False)])
def test_a_point_looked_at_counts_from_one_metre_on(verdicts, x, passed):
    options = PlanOptions(yaw="look_at", look_at_world_m=(2.0, 5.0, 1.0))
    away = straight((2.0 + x, 5.0, 1.0, np.pi), (2.0 + x, 5.0, 1.0, np.pi))
    towards = straight((2.0 + x, 5.0, 1.0, 0.0), (2.0 + x, 5.0, 1.0, 0.0))
    assert verdicts(away, options=options)["look at the point"].passed == passed
    straight_at_it = verdicts(towards, options=options)["look at the point"]
    assert (straight_at_it.passed, straight_at_it.value) == (True, pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize(("off", "passed"), [(0.59, True), (-0.59, True), (0.61, False), (-0.61, False)])
def test_a_point_may_be_looked_at_from_within_six_tenths_of_a_radian(verdicts, off, passed):
    options = PlanOptions(yaw="look_at", look_at_world_m=(2.0, 5.0, 1.0))
    yaw = np.arctan2(4.0, 3.0) + off
    check = verdicts(straight((-1, 1, 1, yaw), (-1, 1, 1, yaw)), options=options)["look at the point"]
    assert check.passed == passed
    assert check.value == pytest.approx(abs(off))


def test_a_deviation_as_large_as_its_bound_passes():
    check = conditions_met._heading_check("x", np.array([0.25, 0.5, 0.0]), np.array([1.0, 2.0, 3.0]), 0.5)
    assert (check.passed, check.value, check.time_s) == (True, 0.5, 2.0)
    assert not conditions_met._heading_check("x", np.array([0.75, 0.5]), np.array([1.0, 2.0]), 0.5).passed


# -- joins, numbers, identity ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("size", "jump", "passed"), [(0.0, 1e-6, True), (0.0, 1.01e-6, False), (50.0, 4.9e-5, True), (50.0, 6e-5, False)]
)
def test_a_jump_may_be_a_millionth_of_one_or_of_the_largest_value(verdicts, size, jump, passed):
    coefficients = np.zeros((3, 4, 8))
    coefficients[2, 0, 0] = -jump
    coefficients[:, 1, 0] = -size
    check = verdicts(Trajectory(np.ones(3), coefficients))["position at joins"]
    assert (check.passed, check.segment) == (passed, 1)
    assert check.value == pytest.approx(jump)


def test_one_segment_has_no_joins(verdicts):
    check = verdicts(straight((0, 0, 0, 0), (1, 0, 0, 0)))["velocity at joins"]
    assert (check.passed, check.value, check.segment) == (True, 0.0, None)


@pytest.mark.parametrize("durations", [(0.0, 1.0), (1.0, 0.0), (-1.0, 3.0), (np.nan, 1.0), (np.inf, 1.0)])
def test_durations_that_are_not_positive_are_caught(verdicts, durations):
    way = straight((0, 0, 0, 0), (1, 0, 0, 0), (2, 0, 0, 0))
    object.__setattr__(way, "durations_s", np.array(durations))
    object.__setattr__(way, "starts_s", np.concatenate([[0.0], np.cumsum(durations)]))
    assert not gate._finite(way).passed


def test_coefficients_that_are_not_finite_are_counted(verdicts):
    way = straight((0, 0, 0, 0), (1, 0, 0, 0))
    assert (gate._finite(way).passed, gate._finite(way).value, gate._finite(way).bound) == (True, 0.0, 0.0)
    way.coefficients.setflags(write=True)
    way.coefficients[0, 1, 3:5] = np.nan
    assert (gate._finite(way).passed, gate._finite(way).value) == (False, 2.0)
    assert list(verdicts(way)) == ["finite"]


@pytest.mark.parametrize(("off_s", "passed"), [(1.9e-12, True), (2.1e-12, False), (-1.9e-12, True), (-2.1e-12, False)])
def test_starts_are_the_sums_of_durations_to_a_billionth_of_a_millisecond_and_of_themselves(off_s, passed):
    way = straight((0, 0, 0, 0), (1, 0, 0, 0), (2, 0, 0, 0))
    object.__setattr__(way, "starts_s", way.starts_s + np.array([0.0, off_s, 0.0]))
    assert gate._finite(way).passed == passed


def test_short_segments_are_as_good_as_long_ones():
    assert gate._finite(straight((0, 0, 0, 0), (1e-3, 0, 0, 0), (2e-3, 0, 0, 0), leg_s=1e-3)).passed


def test_a_trajectory_without_end_is_reported_without_duration_and_clearance(open_sky, drone):
    way = straight((0, 0, 0, 0), (1, 0, 0, 0))
    object.__setattr__(way, "durations_s", np.array([np.inf]))
    object.__setattr__(way, "starts_s", np.array([0.0, np.inf]))
    report = gate.check(way, open_sky, drone)
    assert (report.passed, report.duration_s, report.clearance_m) == (False, 0.0, -np.inf)
    assert report.clearance_point_world_m == (0.0, 0.0, 0.0)


def test_a_field_without_an_answer_fails_the_clearance_with_its_reason(open_sky, drone):
    class Lost:
        def distance(self, points_world_m):
            raise MapError("the map is lost")

    report = gate.check(straight((0, 0, 0, 0), (1, 0, 0, 0)), Lost(), drone)
    check = {check.name: check for check in report.checks}["clearance"]
    assert (check.passed, check.value, check.time_s, check.segment) == (False, -np.inf, 0.0, 0)
    assert check.reason.startswith("the map is lost")


def test_a_vehicle_may_reach_just_as_far_as_its_clearance(open_sky, drone):
    way = straight((0, 0, 0, 0), (1, 0, 0, 0))
    for radius, passed in ((drone.reach_m, True), (0.999 * drone.reach_m, False)):
        report = gate.check(way, open_sky, drone, PlanOptions(radius_m=radius, margin_m=0.0))
        assert {check.name: check.passed for check in report.checks}["clearance"] == passed


def test_a_trajectory_that_was_not_asked_for_its_limits_has_none_that_binds(open_sky, drone):
    way = straight((0, 0, 0, 0), (1, 0, 0, 0))
    report = gate.check(way, open_sky, drone)
    assert len(report.binding) == 1
    assert dataclasses.replace(report, usage=None).binding == ()


def test_hashes_that_differ_fail_with_their_beginnings():
    same = gate._identity("map", "a" * 64, "a" * 64)
    assert (same.value, same.bound) == (0.0, 0.0)
    check = gate._identity("map", "a" * 64, "b" * 64)
    assert (check.passed, check.value) == (False, 1.0)
    assert check.reason == f"the file names {'a' * 12}, here is {'b' * 12}"
    assert gate._identity("map", "", "b").reason == "the file names none, here is b"


@pytest.mark.parametrize(
    ("kept", "passed", "value", "words"),
    [
        (True, True, 0.0, "as written"),
        (False, False, 1.0, "was changed"),
        (None, True, 0.0, "file version 1 has no hash"),
    ],
)
def test_a_record_that_was_changed_fails_and_one_without_a_hash_is_told(kept, passed, value, words):
    class Item:
        record_kept = kept

    check = gate._record_check(Item())
    assert (check.passed, check.value, check.bound) == (passed, value, 0.0)
    assert words in check.reason


def test_conditions_of_a_file_without_any_are_none_and_others_are_read():
    way = straight((0, 0, 0, 0), (1, 0, 0, 0))
    item = TrajectoryFile(way, "x", "", "", np.array([[0.0, 0, 0], [1.0, 0, 0]]), {})
    assert gate.asked_of(item).as_dict() == {}
    asked = {"conditions": {"leg_speed_m_s": [1.5]}}
    assert gate.asked_of(dataclasses.replace(item, check=asked)).as_dict() == asked["conditions"]
