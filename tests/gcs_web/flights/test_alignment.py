"""How far a flight's clock is moved to stand beside another's: known shifts come back, and doubt is said."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_bridge.controller import State
from flight import FloatArray, InputError, flight_log, project
from gcs_web.flights import aligning, alignment
from gcs_web.flights.alignment import Signal
from gcs_web.flights.recorded import Recorded


def course(time_s: FloatArray) -> FloatArray:
    """A speed that repeats nowhere, m/s: three accelerations of different lengths, at rest before and after."""
    return sum(
        size * np.exp(-(((time_s - at_s) / wide_s) ** 2))
        for at_s, wide_s, size in ((6, 1, 2), (11, 2, 4), (17, 0.7, 3))
    )


def sampled(period_s: float, shift_s: float = 0.0, *, noise: float = 0.0, seed: int = 0) -> Signal:
    """The course as a clock shows it that is `shift_s` behind."""
    time_s = np.arange(0.0, 25.0, period_s)
    rng = np.random.default_rng(seed)
    return Signal(time_s - shift_s, course(time_s) + noise * rng.standard_normal(len(time_s)))


@given(
    shift_s=st.floats(-30, 30), rates_hz=st.tuples(st.integers(20, 300), st.integers(20, 300)), seed=st.integers(0, 99)
)
@settings(max_examples=40)
def test_a_known_shift_comes_back_from_noisy_signals_of_different_rates(shift_s, rates_hz, seed):
    one, other = (
        sampled(1 / rates_hz[0], noise=0.1, seed=seed),
        sampled(1 / rates_hz[1], shift_s, noise=0.1, seed=seed + 100),
    )
    found = alignment.by_correlation(one, other, least_spread=0.05)
    assert found.shift_s == pytest.approx(shift_s, abs=0.05)
    assert found.peak > 0.97
    assert found.elsewhere < found.peak - alignment.LEAST_LEAD
    assert 0.2 < found.half_width_s < 4.0


@given(begin_s=st.floats(1, 18), lost_s=st.floats(0.5, 5), cut_s=st.floats(0, 4))
@settings(max_examples=30)
def test_a_gap_and_a_log_that_ends_early_move_nothing(begin_s, lost_s, cut_s):
    whole, other = sampled(0.01), sampled(0.02, 3.21)
    time_s = other.time_s + 3.21
    kept = ((time_s < begin_s) | (time_s > begin_s + lost_s)) & (time_s < 25.0 - cut_s)
    missing = Signal(other.time_s, np.where(kept, other.values, np.nan))
    for cut in (missing, Signal(other.time_s[kept], other.values[kept])):
        assert alignment.by_correlation(whole, cut, least_spread=0.05).shift_s == pytest.approx(3.21, abs=0.02)


def test_the_shift_of_one_beside_the_other_is_the_negative_of_the_other_beside_the_one():
    one, other = sampled(0.01), sampled(0.01, 2.0)
    there, back = (alignment.by_correlation(*pair, least_spread=0.05) for pair in ((one, other), (other, one)))
    assert there.shift_s == pytest.approx(-back.shift_s, abs=1e-6)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (lambda t: 1.0 + 0.0 * t, "flat"),
        (lambda t: np.full(len(t), np.nan), "not measured"),
        (lambda t: np.random.default_rng(1).standard_normal(len(t)), "at most"),
        (lambda t: -course(t), "at most|no peak"),
    ],
)
def test_what_does_not_correlate_is_said_to_be_undecided(values, said):
    one = sampled(0.02)
    with pytest.raises(InputError, match=said):
        alignment.by_correlation(one, Signal(one.time_s, values(one.time_s)), least_spread=0.05)


def test_a_course_of_equal_laps_does_not_say_which_lap_is_which():
    time_s = np.arange(0.0, 30.0, 0.02)
    laps = Signal(time_s, 2.0 + np.sin(2.0 * np.pi * time_s / 3.0))
    with pytest.raises(InputError, match="two shifts fit"):
        alignment.by_correlation(laps, Signal(time_s + 0.4, laps.values), least_spread=0.05)


def test_a_steady_climb_has_no_peak():
    time_s = np.arange(0.0, 20.0, 0.02)
    with pytest.raises(InputError, match=r"no peak|two shifts"):
        alignment.by_correlation(Signal(time_s, time_s), Signal(time_s, time_s - 3.0), least_spread=0.05)


@given(at_s=st.floats(1, 15), rate_hz=st.integers(20, 300), seed=st.integers(0, 99))
@settings(max_examples=30)
def test_an_event_is_found_where_it_lasts_and_a_knock_before_it_is_none(at_s, rate_hz, seed):
    time_s = np.arange(0.0, 20.0, 1 / rate_hz)
    values = np.clip(time_s - at_s, 0.0, 1.5) + 0.01 * np.random.default_rng(seed).standard_normal(len(time_s))
    values[(time_s > 0.4 * at_s) & (time_s < 0.4 * at_s + 0.1)] = 2.0
    height = alignment.above_beginning(Signal(time_s, 7.0 + values))
    when_s = alignment.first_above(height, alignment.TAKE_OFF_M)
    assert when_s == pytest.approx(at_s + alignment.TAKE_OFF_M, abs=0.06 + 1 / rate_hz)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.full(300, 1.0), "from the beginning"),
        (np.zeros(300), "does not come"),
        (np.full(300, np.nan), "not measured"),
    ],
)
def test_a_log_without_the_event_says_so(values, said):
    with pytest.raises(InputError, match=said):
        alignment.first_above(Signal(0.01 * np.arange(300), values), alignment.MOTION_M_S)


# --- of flights ---


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    """`a` and `b` fly one course, b's clock 12.5 s ahead and its trajectory 0.75 s later; `c` begins while it flies."""
    made = project.create(tmp_path / "project", "flights")
    made.flight("x").parent.mkdir()
    for name, clock_s, late_s, from_s in (("a", 0.0, 0.0, 0.0), ("b", 12.5, 0.75, 0.0), ("c", 0.0, 0.0, 8.0)):
        time_s = np.arange(from_s, 25.0, 0.01)
        place_m = np.stack([0.0 * time_s, 0.0 * time_s, 0.5 * course(time_s)], axis=1)
        velocity_m_s = np.gradient(place_m, 0.01, axis=0)
        state = np.where(time_s < 3.0, State.ARMED, np.where(time_s < 9.0 + late_s, State.HOLD, State.TRAJECTORY))
        log = flight_log.from_vectors(
            time_s + clock_s,
            {"position_world_m": place_m, "velocity_world_m_s": velocity_m_s},
            scalars={"mission_state": state.astype(float)} if name != "c" else {},
        )
        flight_log.save(made.flight(name), log)
    return Recorded(made)


@pytest.mark.parametrize("how", ["take_off", "motion", "speed", "height"])
def test_one_course_stands_side_by_side_by_each_way(recorded, how):
    (found,) = aligning.align(recorded, ["a", "b"], how)
    assert found.by_s == pytest.approx(0.75, abs=0.01), found.words


def test_the_begin_of_the_trajectory_is_what_shifted_times_begin_with(recorded):
    there, missing = aligning.align(recorded, ["a", "b", "c"], "trajectory")
    assert there.by_s == 0.0
    assert missing.by_s is None
    assert "cannot tell: begin of the trajectory of c is not in the log" in missing.words


def test_the_words_give_the_peak_and_its_sharpness(recorded):
    (found,) = aligning.align(recorded, ["a", "b"], "speed")
    assert re.fullmatch(
        r"correlation of speed 1\.00, half of it within ±\d\.\d\d s, elsewhere at most 0\.\d\d", found.words
    )


def test_a_log_that_begins_in_the_air_has_no_take_off_and_no_first_motion(recorded):
    (found,) = aligning.align(recorded, ["a", "c"], "motion")
    assert (found.by_s, found.words) == (None, "cannot tell: first motion of c was there from the beginning of the log")


def test_one_flight_alone_is_not_aligned(recorded):
    with pytest.raises(InputError, match="second flight"):
        aligning.align(recorded, ["a"], "speed")
    with pytest.raises(InputError, match="no flight none"):
        aligning.align(recorded, ["a", "none"], "speed")
