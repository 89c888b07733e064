import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from flight import InputError
from planner.request import space
from planner.route import simplify

PATHS = arrays(np.float64, st.tuples(st.integers(1, 40), st.just(3)), elements=st.floats(-10, 10))


@settings(max_examples=60)
@given(PATHS, st.floats(0.0, 3.0))
def test_every_point_stays_within_the_tolerance_of_the_kept_lines(path, tolerance):
    kept = simplify.rdp(path, tolerance)
    assert (np.diff(kept) > 0).all()
    assert np.array_equal(path[kept[0]], path[0])
    assert np.allclose(path[kept[-1]], path[-1])
    for a, b in itertools.pairwise(kept):
        assert simplify.distance_to_chord(path[a : b + 1], path[a], path[b]).max() <= tolerance + 1e-12


@settings(max_examples=40)
@given(PATHS, st.floats(0.01, 3.0))
def test_simplifying_twice_changes_nothing(path, tolerance):
    once = path[simplify.rdp(path, tolerance)]
    assert len(simplify.rdp(once, tolerance)) == len(once)


def test_a_straight_line_needs_two_waypoints_and_a_corner_three():
    line = np.linspace([0.0, 0.0, 1.0], [5.0, 0.0, 1.0], 200)
    corner = np.concatenate([line, np.linspace([5.0, 0.0, 1.0], [5.0, 4.0, 1.0], 200)])
    assert simplify.rdp(line, 0.01).tolist() == [0, 199]
    assert np.allclose(corner[simplify.rdp(corner, 0.01)], [[0, 0, 1], [5, 0, 1], [5, 4, 1]])


def test_headings_are_kept_where_the_path_turned_its_head():
    line = np.linspace([0.0, 0.0, 1.0], [10.0, 0.0, 1.0], 101)
    yaw = np.where(np.arange(101) < 50, 3.1, -3.1)  # through pi: hardly a turn
    assert simplify.rdp(line, 0.01, yaw_rad=yaw).tolist() == [0, 100]
    yaw = np.interp(np.arange(101), [0, 40, 60, 100], [0.0, 0.0, 1.5, 1.5])
    kept = simplify.rdp(line, 0.01, yaw_rad=yaw, yaw_tolerance_rad=0.1)
    assert np.abs(np.interp(np.arange(101), kept, yaw[kept]) - yaw).max() <= 0.1
    assert len(kept) < 8
    yaw[30:70] = np.nan
    assert len(simplify.rdp(line, 0.01, yaw_rad=yaw, yaw_tolerance_rad=0.1)) < 8


def test_a_larger_tolerance_keeps_no_more_points():
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(size=(500, 3)) * 0.05, axis=0)
    counts = [len(simplify.rdp(walk, tolerance)) for tolerance in (0.02, 0.05, 0.1, 0.3, 1.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_with_a_field_no_kept_line_cuts_the_corner_the_path_went_round(pillar):
    turn = np.linspace(np.pi, 0.0, 400)
    arc = np.stack([1.1 * np.cos(turn), 1.1 * np.sin(turn), np.full(400, 1.5)], axis=1)
    blind = arc[simplify.rdp(arc, 0.5)]
    aware = arc[simplify.rdp(arc, 0.5, field=pillar, clearance_m=0.3)]
    assert not all(line.free for line in space.check_lines(pillar, blind[:-1], blind[1:], 0.3))
    assert all(line.free for line in space.check_lines(pillar, aware[:-1], aware[1:], 0.3))
    assert len(blind) < len(aware) < 20


@pytest.mark.parametrize("bad", [np.zeros((0, 3)), np.zeros((4, 2)), np.array([[0.0, np.nan, 0.0]])])
def test_a_path_that_is_no_path_is_refused(bad):
    with pytest.raises(InputError):
        simplify.rdp(bad, 0.1)


def test_a_negative_tolerance_is_refused():
    with pytest.raises(InputError, match="tolerance_m"):
        simplify.rdp(np.zeros((2, 3)), -0.1)


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.floats(0.05, 0.8))
def test_a_line_called_free_is_free_at_every_dense_sample(two_rooms, seed, required):
    rng = np.random.default_rng(seed)
    starts, ends = rng.uniform([-4, -3, 0.5], [4, 3, 2.5], (2, 6, 3))
    for a, b, check in zip(starts, ends, space.check_lines(two_rooms, starts, ends, required), strict=True):
        dense = two_rooms.distance(np.linspace(a, b, 2001)).min()
        if check.free:
            assert dense >= required - 1e-9
        elif np.isfinite(check.distance_m):
            assert dense < required + 2e-3
