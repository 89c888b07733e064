"""Leaps of the velocity: named with time and size where accelerometer or position show none; a blow is none."""

import numpy as np
import pytest

from flight import FlightLog
from sysid.logs.apply import apply
from sysid.logs.events import recording, velocity_leaps
from sysid.logs.events.event import DETECTABLE_JUMP_M_S
from tests.sysid.logs.events.test_leaps import AT, changed, without

WITNESSES = ("specific_force_body_m_s2", "position_world_m")


@pytest.fixture
def moving(log: FlightLog) -> FlightLog:
    """The flight with the velocity of its own position."""
    position = log.vector("position_world_m")
    smooth = np.stack([np.convolve(column, np.full(15, 1 / 15.0), "same") for column in position.T], axis=1)
    velocity = np.gradient(smooth, log.time_s, axis=0)
    velocity[:20], velocity[-20:] = velocity[20], velocity[-21]
    return changed(log, velocity_world_m_s=velocity)


def leapt(log: FlightLog, rows: slice, by_m_s: float) -> FlightLog:
    velocity = log.vector("velocity_world_m_s").copy()
    velocity[rows] += by_m_s * np.array([0.6, 0.0, 0.8])
    return changed(log, velocity_world_m_s=velocity)


def test_a_good_velocity_has_no_event(moving):
    assert velocity_leaps.find(moving) == []


@pytest.mark.parametrize("size", [1.0, 3.0, 10.0])
def test_a_jump_of_the_velocity_is_named_with_time_and_size(moving, size):
    jumped = leapt(moving, slice(AT, None), size * DETECTABLE_JUMP_M_S)
    (event,) = recording.find(jumped)
    assert event.kind == "velocity jump"
    assert event.size == pytest.approx(size * DETECTABLE_JUMP_M_S, rel=0.2)
    assert event.span[1] == pytest.approx(moving.time_s[AT], abs=0.02)
    assert "the position shows" in event.sentence
    assert event.repair is not None
    assert recording.find(apply(jumped, event.repair)) == []


def test_no_fit_refuses_a_log_for_its_velocity(moving):
    assert recording.leaps(leapt(moving, slice(AT, None), 5.0)) == []


def test_without_a_second_sensor_a_leap_of_the_velocity_may_be_a_blow(moving):
    assert velocity_leaps.find(leapt(without(moving, *WITNESSES), slice(AT, None), 5.0)) == []


def test_a_blow_that_the_position_shows_is_no_event(moving):
    by_m_s, since_s = 3.0, np.maximum(moving.time_s - moving.time_s[AT], 0.0)
    moved = moving.vector("position_world_m") + by_m_s * since_s[:, None] * np.array([0.6, 0.0, 0.8])
    assert velocity_leaps.find(changed(leapt(moving, slice(AT, None), by_m_s), position_world_m=moved)) == []
