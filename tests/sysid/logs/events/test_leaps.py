"""Leaps of attitude and position: their time and size, against what turned or moved; quick flying is none."""

import numpy as np
import pytest

from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from sysid.logs.apply import apply
from sysid.logs.events import attitude_leaps, clipped, frozen, position_leaps, recording
from sysid.logs.events.event import DETECTABLE_JUMP_M, DETECTABLE_TURN_DEG, EVENTS, of_log
from sysid.logs.events.resets import of_counter

AT = 480
"""Row from which on something is wrong."""


def changed(log: FlightLog, **vectors: np.ndarray) -> FlightLog:
    columns = {c: v for name, vs in vectors.items() for c, v in zip(COLUMNS[name], vs.T, strict=True)}
    return FlightLog({**log.columns, **columns}, log.metadata)


def without(log: FlightLog, *quantities: str) -> FlightLog:
    gone = {column for quantity in quantities for column in COLUMNS[quantity]}
    return FlightLog({name: v for name, v in log.columns.items() if name not in gone}, log.metadata)


def turned(
    log: FlightLog, rows: slice, deg: float, axis: tuple[float, float, float] = (0, 0, 1), *, body: bool = False
):
    q, turn = log.vector("q_world_body").copy(), rotations.exp(np.deg2rad(deg) * np.array(axis, dtype=float))
    q[rows] = rotations.multiply(q[rows], turn) if body else rotations.multiply(turn, q[rows])
    return changed(log, q_world_body=q)


def moved(log: FlightLog, rows: slice, by_m: tuple[float, float, float]) -> FlightLog:
    position = log.vector("position_world_m").copy()
    position[rows] += by_m
    return changed(log, position_world_m=position)


@pytest.mark.parametrize("size", [1.0, 3.0, 10.0, -15.0, 29.0])
@pytest.mark.parametrize("gyro", [True, False])
def test_a_jump_of_the_attitude_is_named_with_time_and_size(log, size, gyro):
    deg = size * DETECTABLE_TURN_DEG
    jumped = turned(log if gyro else without(log, "rate_body_rad_s"), slice(AT, None), deg)
    (event,) = attitude_leaps.find(jumped)
    assert event.kind == "attitude jump"
    assert event.size == pytest.approx(abs(deg), rel=0.2)
    assert event.span[1] == pytest.approx(log.time_s[AT], abs=0.02)
    assert f"{'+' if deg > 0 else '-'}" in event.sentence
    assert "about the vertical" in event.sentence
    assert event.repair is not None
    mended = apply(jumped, event.repair)
    assert recording.leaps(mended) == []


@pytest.mark.parametrize("body", [True, False])
@pytest.mark.parametrize("rows", [slice(AT, AT + 1), slice(AT, AT + 30), slice(AT, AT + 150)])
@pytest.mark.parametrize("deg", [10.0, 90.0, 180.0])
def test_swapped_markers_are_an_excursion_over_which_nan_is_written(log, rows, deg, body):
    swapped = turned(log, rows, deg, (0.3, 0.0, 1.0) if body else (0, 0, 1), body=body)
    (event,) = attitude_leaps.find(swapped)
    assert event.kind == "attitude excursion"
    assert event.span == pytest.approx((log.time_s[rows.start], log.time_s[rows.stop - 1]))
    assert event.repair is not None
    mended = apply(swapped, event.repair)
    assert recording.find(mended) == []
    assert int(np.isnan(mended.vector("position_world_m")).any(axis=1).sum()) == rows.stop - rows.start


@pytest.mark.parametrize("size", [1.0, 3.0, 10.0, 100.0])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_jump_of_the_position_is_named_with_time_and_size(log, size, velocity):
    by = size * DETECTABLE_JUMP_M * np.array([0.6, 0.0, -0.8])
    measured = np.gradient(log.vector("position_world_m"), log.time_s, axis=0)
    base = changed(log, velocity_world_m_s=measured) if velocity else log
    (event,) = position_leaps.find(moved(base, slice(AT, None), tuple(by)))
    assert event.kind == "position jump"
    assert event.size == pytest.approx(size * DETECTABLE_JUMP_M, rel=0.2)
    assert event.span[1] == pytest.approx(log.time_s[AT], abs=0.02)


@pytest.mark.parametrize("rows", [slice(AT, AT + 1), slice(AT, AT + 40)])
def test_a_position_that_jumps_and_comes_back_is_an_excursion(log, rows):
    (event,) = position_leaps.find(moved(log, rows, (0.5, -0.5, 0.0)))
    assert event.kind == "position excursion"
    assert event.span == pytest.approx((log.time_s[rows.start], log.time_s[rows.stop - 1]))


def test_an_interpolated_leap_is_one_leap_of_its_whole_size(log):
    jumped = turned(log, slice(AT, None), 20.0)
    q = jumped.vector("q_world_body").copy()
    q[AT] = rotations.slerp(q[AT - 1], q[AT + 1], 0.4)
    (event,) = attitude_leaps.find(changed(jumped, q_world_body=q))
    assert event.size == pytest.approx(20.0, rel=0.1)


def test_good_flights_have_no_event(campaign, log):
    for good in (*campaign, log, without(log, "rate_body_rad_s")):
        assert recording.find(good) == []


def test_signs_of_quaternions_are_no_leap(log):
    q = log.vector("q_world_body") * np.where(np.random.default_rng(0).random(len(log)) < 0.5, -1.0, 1.0)[:, None]
    assert attitude_leaps.find(changed(log, q_world_body=q)) == []


@pytest.mark.parametrize("every", [2, 5, 20])
def test_a_slow_position_held_in_the_rows_of_a_fast_stream_does_not_leap(log, every):
    held = log.vector("position_world_m")[np.arange(len(log)) // every * every]
    assert recording.find(changed(log, position_world_m=held)) == []


def test_a_jump_across_a_pause_is_none(log):
    jumped = moved(log, slice(AT, None), (5.0, 0.0, 0.0))
    kept = np.delete(np.arange(len(log)), slice(AT - 10, AT + 10))
    assert recording.find(FlightLog({name: v[kept] for name, v in jumped.columns.items()}, {})) == []


@pytest.mark.parametrize(
    "quantity", ["position_world_m", "q_world_body", "rate_body_rad_s", "rotor_speed_rad_s", "specific_force_body_m_s2"]
)
@pytest.mark.parametrize("length", [31, 60, 200])
def test_a_frozen_stretch_is_named_once_with_its_length(log, quantity, length):
    force = log.vector("q_world_body")[:, :3] * 9.0 + np.random.default_rng(0).normal(0, 0.1, (len(log), 3))
    base = changed(log, specific_force_body_m_s2=force)
    values = base.vector(quantity).copy()
    values[AT : AT + length] = values[AT - 1]
    (event,) = recording.find(changed(base, **{quantity: values}))
    assert (event.kind, event.stream) == ("frozen", quantity)
    assert event.size == pytest.approx(0.01 * length, rel=0.2)
    assert event.span[0] == pytest.approx(log.time_s[AT], abs=0.02)


def test_a_coarse_value_that_hardly_moves_is_not_frozen(log):
    t = log.time_s
    hover = np.stack(
        [0.001 * np.round(1.2 * np.sin(0.5 * t)), np.zeros_like(t), 0.001 * np.round(np.cos(0.3 * t))], axis=1
    )
    assert frozen.find(changed(log, position_world_m=hover)) == []


def test_a_sensor_at_the_end_of_its_range_is_named(log):
    rate = log.vector("rate_body_rad_s").copy()
    rate[AT : AT + 6] = 34.9
    (event,) = clipped.find(changed(log, rate_body_rad_s=rate))
    assert event.span == pytest.approx((log.time_s[AT], log.time_s[AT + 5]))
    assert clipped.find(log) == []


def test_a_reset_that_the_file_counts_is_one_event_with_the_size_of_the_leap(log):
    counter = (np.arange(len(log)) >= AT).astype(float)
    nothing = np.full(len(log), np.nan)
    events = of_counter("q_world_body", log.time_s, counter, nothing, name="quat_reset_counter", unit="deg")
    jumped = turned(FlightLog(log.columns, {EVENTS: [e.placed().as_dict() for e in events]}), slice(AT, None), 40.0)
    assert [e.kind for e in of_log(jumped)] == ["reset"]
    (event,) = recording.find(jumped)
    assert event.kind == "reset"
    assert event.size == pytest.approx(40.0, rel=0.05)
    assert event.repair is not None
    assert recording.find(apply(jumped, event.repair)) == []
