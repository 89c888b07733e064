"""Corrections of the reduced model by hand: what is kept of which segment, what is measured, what rises and falls."""

import numpy as np
import pytest

from planner.curve import minimum_snap
from planner.gate import limits
from planner.optimise import airframe, time_allocation
from planner.optimise.corrections import _FARTHER_M, _MOST, _NEAR, _SPARE, Corrections, _approached, measured_excess
from planner.optimise.time_allocation import SAMPLES, Problem, Weights

TILT, YAW_RATE = airframe.NAMES.index("tilt"), airframe.NAMES.index("yaw rate")


def numbered(segments: int) -> Corrections:
    """Each array says which segment it is about, and which array it is."""
    found = Corrections(segments)
    for i, values in enumerate(vars(found).values()):
        values[:] = 100.0 * i + np.arange(segments).reshape(-1, *[1] * (values.ndim - 1))
    return found


@pytest.mark.parametrize(
    ("first", "last", "segments"),
    [(1, 3, 2), (1, 3, 1), (1, 3, 4), (2, 2, 1), (2, 5, 0), (0, 5, 5), (0, 5, 2), (4, 5, 1)],
)
def test_new_segments_begin_with_what_the_same_number_of_old_ones_knew_or_with_nothing(first, last, segments):
    old = numbered(5)
    for name, values in vars(old.spliced(first, last, segments)).items():
        before, there = getattr(old, name), getattr(Corrections(segments), name)
        middle = before[first:last] if segments == last - first else there
        np.testing.assert_array_equal(values, np.concatenate([before[:first], middle, before[last:]]), name)
        assert not np.shares_memory(values, before)


def test_a_copy_without_multipliers_knows_all_that_was_measured():
    old = numbered(3)
    copy = old.unpressed()
    assert not copy.multiplier.any()
    assert old.multiplier.any()
    for name in vars(old).keys() - {"multiplier"}:
        np.testing.assert_array_equal(getattr(copy, name), getattr(old, name), name)


def test_the_total_is_the_sum_of_model_between_multiplier_and_what_is_kept_for_the_gate():
    found = Corrections(2)
    np.testing.assert_array_equal(found.total(), np.full((2, SAMPLES, airframe.COLUMNS), _SPARE))
    found.model[1], found.between[1], found.multiplier[1], found.gate[1] = 1.0, 20.0, 300.0, 4000.0
    assert (found.total()[1] == 4321.0).all()
    assert (found.total()[0] == _SPARE).all()


def test_segments_that_lack_clearance_aim_at_as_much_more_within_bounds_and_others_at_what_they_did():
    found, (least_m, most_m) = Corrections(5), _FARTHER_M
    for _ in range(2):
        found.farther(np.array([0.0, 0.1 * least_m, 0.5 * most_m, 3.0 * most_m, np.inf]))
    np.testing.assert_allclose(found.farther_m, [0.0, 2.0 * least_m, most_m, 2.0 * most_m, 2.0 * most_m])


def test_multipliers_follow_what_is_believed_in_touched_segments_alone_and_are_never_negative():
    found = Corrections(3)
    found.believed[:, 4, TILT] = 0.1
    found.believed[:, 5, TILT] = -1.0
    found.multiplier[:, 5] = 0.5
    found.multiplier[:, 6] = 0.25
    found.press(np.array([True, False, True]))
    for i in (0, 2):
        assert found.multiplier[i, 4, TILT] == pytest.approx(0.1 + _SPARE)
        assert found.multiplier[i, 5, TILT] == 0.0
        assert found.multiplier[i, 6, TILT] == pytest.approx(0.25 + _SPARE)
    assert found.multiplier[1, 4:7, TILT].tolist() == [0.0, 0.5, 0.25]


def test_the_active_limit_has_the_largest_sum_of_multipliers_and_untouched_segments_keep_theirs():
    found = Corrections(6)
    found.believed[:] = -1.0
    found.believed[:4, 2:4, TILT] = 0.1  # more in sum, less at most
    found.believed[:4, 5, YAW_RATE] = 0.15
    found.believed[1, 7, YAW_RATE] = 0.15
    found.multiplier[2:4, 0, 0] = 1e-3
    found.multiplier[3, 0, 0] = 0.0
    found.believed[4, 0, 0], found.believed[5, 0, 0] = -_SPARE, -0.5 * _SPARE
    before = found.multiplier.copy()
    touched = np.array([True, True, False, False, True, True])
    assert found.active(touched) == ("tilt", "yaw rate", "speed", "", "", "speed")
    np.testing.assert_array_equal(found.multiplier, before)
    found.multiplier[0, 5, YAW_RATE] = 0.1
    assert found.active(np.ones(6, dtype=bool))[0] == "yaw rate"


@pytest.mark.parametrize(
    ("believed", "measured", "then"),
    [(0.0, 0.4, 0.1), (0.0, 0.05, 0.05), (0.3, 0.1, 0.2), (-0.2, 0.3, -0.1), (0.1, -0.3, -0.1), (0.2, 0.2, 0.2)],
)
def test_a_correction_rises_by_a_tenth_at_most_and_falls_half_way(believed, measured, then):
    assert _approached(np.array([believed]), np.array([measured])) == pytest.approx([then])


@pytest.fixture(scope="module")
def walk() -> minimum_snap.Spline:
    """Too fast at first, then slow."""
    steps = np.random.default_rng(3).normal(size=(9, 4)) * [2.5, 2.5, 0.7, 0.4]
    steps[0], steps[4:] = 0.0, 0.1
    return minimum_snap.solve(np.cumsum(steps, axis=0), np.array([1.3, 0.9, 1.1, 1.5, 1.5, 1.5, 1.5, 1.5]))


def measured(walk, drone, open_sky, touched, found=None):
    """Corrections that measured a walk once, what they returned, and the reduced model's excess and its peaks."""
    frame = airframe.reduced(drone, drone.limits)
    problem = Problem(walk.states[:, 0], np.zeros((9, 4), dtype=bool), frame, open_sky, 0.3, Weights())
    path = minimum_snap.trajectory(walk)
    found = Corrections(8) if found is None else found
    excess = found.measure(problem, walk, path, drone, touched)
    full = measured_excess(frame, drone, path, np.arange(8), time_allocation.FRACTIONS)
    return found, excess, full, *time_allocation.excess(problem, walk)


def test_touched_segments_near_a_limit_are_measured_and_no_others(walk, drone, open_sky):
    touched = np.arange(8) != 1
    found, excess, full, reduced, peaks = measured(walk, drone, open_sky, touched)
    near = peaks.max(axis=(1, 2)) > -_NEAR
    assert near.tolist() == [True] * 4 + [False] * 4
    for i in range(8):
        asked = bool(touched[i] and near[i])
        assert found.measured[i].any() == asked
        if asked:
            there = np.isfinite(full[i])
            wanted = np.clip(full[i] - reduced[i], -_MOST, _MOST)
            np.testing.assert_allclose(found.measured[i][there], wanted[there], atol=1e-9)
            np.testing.assert_allclose(found.model[i], _approached(np.zeros_like(wanted), found.measured[i]))
    np.testing.assert_allclose(found.between, _approached(np.zeros_like(peaks), peaks - reduced))
    np.testing.assert_allclose(found.believed, peaks + found.model)
    np.testing.assert_allclose(excess, peaks + found.measured)


def test_a_segment_counts_as_near_a_limit_with_its_correction(walk, drone, open_sky):
    touched, far = np.ones(8, dtype=bool), 5
    gap = -measured(walk, drone, open_sky, touched)[4][far].max()
    assert gap > _NEAR
    for more, asked in ((0.99, False), (1.01, True)):
        found = Corrections(8)
        found.model[far] = more * (gap - _NEAR)
        measured(walk, drone, open_sky, touched, found)
        assert found.measured[far].any() == asked


def test_corrections_are_bounded_and_an_impossible_motion_exceeds_every_rotors_limit(walk, drone, open_sky):
    quick = minimum_snap.solve(walk.states[:, 0], walk.durations_s * ([0.3] * 4 + [1.0] * 4))
    found, _, full, reduced, _ = measured(quick, drone, open_sky, np.ones(8, dtype=bool))
    impossible = ~np.isfinite(full)
    assert impossible.any()
    wanted = np.minimum(np.maximum(-reduced, 0.0) + 0.2, _MOST)
    np.testing.assert_allclose(found.measured[impossible], wanted[impossible])
    assert (found.measured == _MOST).any()
    assert (found.measured == -_MOST).any()


def test_a_limit_the_gate_found_exceeded_is_kept_from_by_the_excess_within_bounds(drone):
    columns = [limits.NAMES.index(name) for name in airframe.NAMES]
    for share, more in ((1.004, 0.005), (1.02, 0.02), (1.04, 0.04), (3.0, 0.05), (np.nan, 0.005)):
        value = np.full((len(limits.NAMES), 2), 0.5)
        value[columns[-1]] = 1.5
        shares = np.full_like(value, 0.5)
        value[columns[TILT], 1], shares[columns[TILT], 1] = share, share
        used = limits.Usage(value, np.zeros_like(value), shares, np.ones(len(limits.NAMES)))
        found = Corrections(2)
        found.stricter(used, {"speed": np.array([True, False])})
        added = found.gate[:, 0] - _SPARE
        assert added[1, TILT] == pytest.approx(more)
        assert added[0, 0] == pytest.approx(0.005)
        assert np.count_nonzero(np.abs(added) > 1e-12) == 2
