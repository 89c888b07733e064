"""Clocks: what is certain is put right and counted, a pause stays a pause, and what has no time is refused."""

import numpy as np
import pytest

from flight import FormatError, InputError
from sysid.logs.events.clock import examined
from sysid.logs.events.event import KINDS
from sysid.logs.events.stamps import PERIODS_S

N, STEP_S = 1000, 0.01
TIME_S: np.ndarray = 5.0 + STEP_S * np.arange(N)


def motion(time_s: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Three smooth columns with a little noise."""
    noise = 1e-4 * np.random.default_rng(seed).normal(size=(3, len(time_s)))
    return {f"c{i}": np.sin((1.0 + 0.3 * i) * time_s + i) + noise[i] for i in range(3)}


def noisy(time_s: np.ndarray) -> dict[str, np.ndarray]:
    """A column in which no motion shows."""
    return {"n": np.random.default_rng(1).normal(size=len(time_s))}


def one(time_s: np.ndarray, columns: dict[str, np.ndarray] | None = None):
    """The stream's times and columns after examination, and the events."""
    streams, events = examined({"pose": {"time_s": time_s, **(motion(TIME_S) if columns is None else columns)}})
    return streams["pose"], events


def stepped(at: int, by_s: float) -> np.ndarray:
    time_s = TIME_S.copy()
    time_s[at:] += by_s
    return time_s


@pytest.mark.parametrize(
    ("value", "kind"),
    [(0.0, "zero stamp"), (np.nan, "missing stamp"), (1e9, "wild stamp"), (-40.0, "wild stamp"), (9.503, "wild stamp")],
)
@pytest.mark.parametrize("rows", [[500], [0], [N - 1], [300, 301, 700]])
def test_a_row_without_a_time_of_its_own_is_left_out_and_counted(rows, value, kind):
    if value == 9.503 and rows in ([0], [N - 1]):
        pytest.skip("at the ends that may be a pause")
    time_s = TIME_S.copy()
    time_s[rows] = value
    stream, events = one(time_s)
    np.testing.assert_allclose(stream["time_s"], np.delete(TIME_S, rows))
    np.testing.assert_allclose(stream["c0"], np.delete(motion(TIME_S)["c0"], rows))
    assert [(e.kind, e.size) for e in events] == [(kind, len(rows))]
    assert events[0].certain
    assert events[0].done
    assert events[0].span[0] == pytest.approx(TIME_S[max(rows[0] - 1, 0)], abs=2.0 * STEP_S)


@pytest.mark.parametrize("what", PERIODS_S)
@pytest.mark.parametrize("signed", [False, True])
def test_a_counter_that_begins_anew_goes_on(what, signed):
    period_s = PERIODS_S[what]
    if period_s < N * STEP_S:
        pytest.skip("wraps more than once")
    low_s = -0.5 * period_s if signed else 0.0
    wrapped = np.mod(TIME_S - 9.0, period_s) + low_s
    stream, events = one(wrapped)
    np.testing.assert_allclose(np.diff(stream["time_s"]), STEP_S, atol=1e-6)
    assert [e.kind for e in events] == ["clock wrap"]
    assert events[0].size == pytest.approx(period_s)


@pytest.mark.parametrize("by_s", [-3.0, -0.5, -0.2, -40.0, 0.5, 3.0, 400.0])
@pytest.mark.parametrize("at", [200, 800])
def test_a_step_over_which_the_motion_goes_on_is_the_clocks(at, by_s):
    stream, events = one(stepped(at, by_s))
    np.testing.assert_allclose(stream["time_s"], TIME_S, atol=1e-9)
    assert [e.kind for e in events] == ["clock back" if by_s < 0.0 else "clock ahead"]
    assert events[0].size == pytest.approx(abs(by_s))
    assert events[0].span[0] == pytest.approx(TIME_S[at], abs=0.02)


@pytest.mark.parametrize("lost", [slice(400, 430), slice(400, 600), slice(10, 900)])
@pytest.mark.parametrize("columns", [motion, noisy])
def test_rows_that_are_missing_are_a_pause_and_no_event(lost, columns):
    kept = np.delete(np.arange(N), lost)
    stream, events = one(TIME_S[kept], {name: values[kept] for name, values in columns(TIME_S).items()})
    np.testing.assert_allclose(stream["time_s"], TIME_S[kept])
    assert events == ()


@pytest.mark.parametrize("by_s", [-3.0, 3.0, -0.6])
def test_a_stream_without_motion_is_shifted_if_it_then_ends_with_the_others(by_s):
    streams, events = examined(
        {"esc": {"time_s": stepped(600, by_s), **noisy(TIME_S)}, "pose": {"time_s": TIME_S, **motion(TIME_S)}}
    )
    np.testing.assert_allclose(streams["esc"]["time_s"], TIME_S, atol=1e-9)
    assert [(e.stream, e.size) for e in events] == [("esc", pytest.approx(abs(by_s)))]


def test_a_step_of_all_streams_is_one_event():
    back = stepped(600, -3.0)
    streams, events = examined({"esc": {"time_s": back, **noisy(TIME_S)}, "pose": {"time_s": back, **motion(TIME_S)}})
    np.testing.assert_allclose(streams["esc"]["time_s"], TIME_S, atol=1e-9)
    assert [e.stream for e in events] == ["all streams"]


def test_what_goes_back_for_reasons_that_nothing_shows_is_set_apart_and_not_certain():
    stream, events = one(stepped(600, -3.0), noisy(TIME_S))
    assert (np.diff(stream["time_s"]) > 0.0).all()
    assert np.diff(stream["time_s"]).max() == pytest.approx(1.0)
    assert [(e.kind, e.certain) for e in events] == [("clock back", False)]
    assert events[0].size == pytest.approx(3.0)


def test_two_flights_in_one_file_are_set_apart():
    half = N // 2
    columns = {name: np.concatenate([v[:half], 5.0 + v[half:][::-1]]) for name, v in motion(TIME_S).items()}
    stream, events = one(np.concatenate([TIME_S[:half], TIME_S[:half]]), columns)
    assert np.diff(stream["time_s"]).max() == pytest.approx(1.0)
    assert [(e.kind, e.certain) for e in events] == [("clock back", False)]


@pytest.mark.parametrize("swap", [(400, 401), (400, 405), (3, 6)])
def test_rows_that_changed_places_are_sorted(swap):
    order = np.arange(N)
    order[list(swap)] = order[list(swap)[::-1]]
    stream, events = one(TIME_S[order], {name: v[order] for name, v in motion(TIME_S).items()})
    np.testing.assert_allclose(stream["time_s"], TIME_S)
    np.testing.assert_allclose(stream["c1"], motion(TIME_S)["c1"])
    assert {e.kind for e in events} == {"order"}


@pytest.mark.parametrize("rows", [[500], [20, 21, 22], [N - 1]])
def test_of_rows_with_one_time_the_first_counts(rows):
    time_s = TIME_S.copy()
    time_s[rows] = time_s[rows[0] - 1]
    stream, events = one(time_s)
    np.testing.assert_allclose(stream["time_s"], np.delete(TIME_S, rows))
    assert [(e.kind, e.size) for e in events] == [("repeated stamp", len(rows))]


def test_streams_with_no_time_in_common_are_refused_with_both_spans():
    with pytest.raises(InputError, match=r"attitude runs from .* another zero, 59.000 s earlier"):
        examined({"attitude": {"time_s": TIME_S - 59.0}, "pose": {"time_s": TIME_S}})


@pytest.mark.parametrize("time_s", [np.zeros(N), np.round(TIME_S, 0), np.random.default_rng(0).uniform(0, 10, N)])
def test_a_column_that_is_no_time_is_refused(time_s):
    with pytest.raises(FormatError, match=r"pose: .* time"):
        one(time_s)


@pytest.mark.parametrize("seed", range(20))
def test_good_clocks_have_no_event(seed):
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.choice([0.004, 0.01, 0.02]) * rng.uniform(0.6, 1.4, N))
    time_s = time_s[np.sort(rng.permutation(N)[: N - 50])]
    stream, events = one(time_s, motion(time_s, seed))
    assert events == ()
    np.testing.assert_array_equal(stream["time_s"], time_s)


def test_every_kind_that_is_made_is_in_the_table():
    assert {"zero stamp", "clock back", "order", "reset", "frozen"} <= set(KINDS)
