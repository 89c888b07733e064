import numpy as np
import pytest

import vehicle
from flight import Trajectory
from planner.curve import attitude, minimum_snap
from planner.gate import limits, visits
from planner.request.options import PlanOptions
from vehicle import flatness, native


def some_path(seed: int, pace: float = 1.0):
    rng = np.random.default_rng(seed)
    positions = np.cumsum(rng.normal(size=(6, 4)) * [3, 3, 0.7, 0.3], axis=0)
    return minimum_snap.trajectory(minimum_snap.solve(positions, pace * rng.uniform(0.8, 1.6, 5)))


def reference(drone, path, pieces, fractions):
    """The same values from `vehicle.flatness`, which takes differences over milliseconds; (p, f, VALUES)."""
    inside = np.clip(fractions, 1e-9, 1.0 - 1e-9)
    start_s = path.starts_s[pieces.segment] + pieces.start_s
    state = flatness.state(drone, path, (start_s[:, None] + pieces.length_s[:, None] * inside).ravel())
    columns = [np.cos(state.tilt_rad), state.rate_body_rad_s, state.rotor_speed_rad_s]
    return np.column_stack(columns).reshape(len(start_s), len(fractions), 8)


@pytest.mark.parametrize("longest_s", [0.5, 0.2])
def test_interpolated_values_are_those_of_flatness_within_their_allowance(drone, longest_s):
    fractions = np.linspace(0.0, 1.0, 21)
    for seed in range(4):
        path = some_path(seed)
        pieces = attitude.pieces_of(path.durations_s, np.arange(5), longest_s)
        found = attitude.coefficients(drone, path, pieces)
        repeated, tiled = np.repeat(found, 21, axis=0), np.tile(fractions, len(found))
        values = attitude.at_fractions(repeated, tiled).reshape(len(found), 21, 8)
        off = np.abs(values - reference(drone, path, pieces, fractions)).max(axis=1) - limits.allowance(found)
        assert np.nanmax(off[:, attitude.UP]) < 1e-6
        assert np.nanmax(off[:, attitude.RATE]) < 1e-3
        assert np.nanmax(off[:, attitude.ROTOR]) < 1.5  # drag changes sign with a kink in its slope
        assert np.isfinite(off).mean() > 0.8


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])  # whose forces depend on the body rates
def test_without_a_compiled_form_of_the_vehicle_the_answer_is_the_same(name, monkeypatch):
    """As for vehicles with effects of the user's own."""
    drone, path = vehicle.example(name), some_path(1, pace=1.3)
    pieces = attitude.pieces_of(path.durations_s, np.arange(5), 0.5)
    compiled = attitude.coefficients(drone, path, pieces)
    monkeypatch.setattr(native, "compiled", lambda _: None)
    plain = attitude.coefficients(drone, path, pieces)
    assert np.allclose(plain, compiled, rtol=0.0, atol=1e-3, equal_nan=True)


def test_the_hull_holds_the_values_and_samples_of_segments_are_those_of_their_pieces(drone):
    path = some_path(2, pace=1.3)
    fractions = np.linspace(0.0, 1.0, 41)
    segments = np.array([1, 3])
    values = attitude.sampled(drone, path, segments, fractions)
    pieces = attitude.pieces_of(path.durations_s, segments, 0.5)
    points = limits.hull(attitude.coefficients(drone, path, pieces))
    for number, segment in enumerate(segments):
        mine = points[pieces.segment == segment]
        assert (values[number].max(axis=0) <= mine.max(axis=(0, 1)) + 1e-9).all()
        assert (values[number].min(axis=0) >= mine.min(axis=(0, 1)) - 1e-9).all()
        assert (mine.max(axis=(0, 1)) - values[number].max(axis=0))[attitude.ROTOR].max() < 10.0


def test_where_the_motion_is_impossible_there_are_no_rotor_speeds(drone):
    drop = minimum_snap.trajectory(minimum_snap.solve(np.array([[0.0, 0, 9, 0], [0, 0, 0, 0]]), np.array([1.0])))
    found = attitude.coefficients(drone, drop, attitude.pieces_of(drop.durations_s, np.arange(1), 0.5))
    assert np.isnan(found[:, :, attitude.ROTOR]).any()


def test_waypoints_at_joins_are_found_without_looking_between_them(drone):
    path = some_path(5)
    wanted = np.vstack([path.coefficients[:, :3, 0], path.position(np.array([path.duration_s]))])
    tolerance = PlanOptions().waypoint_tolerance_m
    assert visits._at_joins(path, wanted, tolerance) == ([0, 1, 2, 3, 4, 5], pytest.approx(0.0, abs=1e-9))
    assert visits._at_joins(path, wanted[[0, 2, 5]], tolerance) == ([0, 2, 5], pytest.approx(0.0, abs=1e-9))
    assert visits._at_joins(path, wanted[[0, 3, 2, 5]], tolerance) is None
    assert visits._at_joins(path, wanted[:-1], tolerance) is None
    assert visits._at_joins(path, wanted[1:], tolerance) is None
    moved = wanted + np.array([0.0, 0.0, 0.006])
    assert visits._at_joins(path, moved, tolerance) == ([0, 1, 2, 3, 4, 5], pytest.approx(0.006))


def test_of_joins_in_a_row_the_nearest_reaches_a_waypoint_but_the_path_begins_at_its_first():
    """A slow leg has joins within the tolerance before its end; a stay has one in the same place at both ends."""
    x = np.array([0.0, 0.004, 1.0, 1.994, 2.0, 2.0, 2.006, 3.0, 3.996, 4.0])
    knots = np.column_stack([x, np.zeros((len(x), 3))])
    path = minimum_snap.trajectory(minimum_snap.solve(knots, np.ones(len(x) - 1)))
    wanted = np.array([[0.003, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    assert visits._at_joins(path, wanted, 0.01) == ([0, 4, 9], pytest.approx(0.003))
    assert visits._at_joins(path, wanted[[0, 1, 1, 2]], 0.01) == ([0, 4, 4, 9], pytest.approx(0.003))


def changed(path: Trajectory, segment: int, number: int) -> Trajectory:
    """The path with one number of a segment, its duration or a coefficient, the next larger double."""
    durations, coefficients = path.durations_s.copy(), path.coefficients.copy()
    row = durations if number == 0 else coefficients[segment].reshape(-1)
    place = segment if number == 0 else number - 1
    row[place] = np.nextafter(row[place], np.inf)
    return Trajectory(durations, coefficients)


def test_a_segment_that_differs_in_the_last_bit_of_any_number_is_another_one():
    path = some_path(0)
    keys = attitude.segment_keys(path, np.arange(5))
    assert len(set(keys)) == 5
    for number in range(1 + path.coefficients[0].size):
        others = attitude.segment_keys(changed(path, 2, number), np.arange(5))
        assert [a == b for a, b in zip(keys, others, strict=True)] == [True, True, False, True, True]


def test_what_is_remembered_is_what_would_be_found_again(drone):
    memory, path = attitude.Memory(), some_path(1)
    for longest_s, segments in ((0.5, [0, 1, 2, 3, 4]), (0.2, [3, 1]), (0.5, [4, 2]), (0.2, [0, 1, 3])):
        chosen = np.array(segments)
        pieces, found = memory.coefficients(drone, path, chosen, longest_s)
        alone = attitude.pieces_of(path.durations_s, chosen, longest_s)
        assert np.array_equal(pieces.start_s, alone.start_s)
        assert np.allclose(found, attitude.coefficients(drone, path, alone), rtol=1e-9, atol=1e-9, equal_nan=True)
