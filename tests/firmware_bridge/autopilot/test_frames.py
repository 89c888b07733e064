"""Axes of autopilots: half a turn about x, for the world as for the body."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from firmware_bridge.autopilot import frames
from flight import rotations

numbers = st.floats(-10.0, 10.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
attitudes = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: rotations.exp(np.array(v)))


@given(attitudes, vectors)
def test_turning_then_changing_axes_is_changing_axes_then_turning(q, v):
    there = rotations.rotate(frames.attitude(q), frames.vector(v))
    assert there == pytest.approx(frames.vector(rotations.rotate(q, v)), abs=1e-9)


@given(attitudes, vectors)
def test_the_way_there_is_the_way_back(q, v):
    assert np.array_equal(frames.attitude(frames.attitude(q)), q)
    assert np.array_equal(frames.vector(frames.vector(v)), v)


def test_up_is_minus_down_and_left_is_minus_right():
    assert frames.vector(np.array([1.0, 2.0, 3.0])).tolist() == [1.0, -2.0, -3.0]


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_euler_angles_are_yaw_then_pitch_then_roll(roll, pitch, yaw):
    x, y, z = np.eye(3)
    q = rotations.multiply(
        rotations.exp(yaw * z), rotations.multiply(rotations.exp(pitch * y), rotations.exp(roll * x))
    )
    assert frames.roll_pitch_yaw(q) == pytest.approx((roll, pitch, yaw), abs=1e-6)


def test_a_nose_that_dips_pitches_down_for_the_autopilot_and_up_for_none():
    dips = rotations.exp(np.array([0.0, 0.3, 0.0]))  # about y left: x forward goes down
    assert rotations.rotate(dips, np.array([1.0, 0.0, 0.0]))[2] < 0.0
    assert frames.roll_pitch_yaw(frames.attitude(dips)) == pytest.approx((0.0, -0.3, 0.0), abs=1e-12)
    assert frames.roll_pitch(dips) == pytest.approx((0.0, 0.3))
