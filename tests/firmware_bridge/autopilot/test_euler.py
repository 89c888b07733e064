"""Angles of an attitude, in our axes and in the autopilots'."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from firmware_bridge.autopilot.euler import roll_pitch_yaw
from flight import frames, rotations

vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
attitudes = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: rotations.exp(np.array(v)))


@given(attitudes, vectors)
def test_turning_then_changing_axes_is_changing_axes_then_turning(q, v):
    there = rotations.rotate(frames.flip_attitude(q), frames.flip_vector(v))
    assert there == pytest.approx(frames.flip_vector(rotations.rotate(q, v)), abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_they_are_yaw_then_pitch_then_roll(roll, pitch, yaw):
    x, y, z = np.eye(3)
    q = rotations.multiply(
        rotations.exp(yaw * z), rotations.multiply(rotations.exp(pitch * y), rotations.exp(roll * x))
    )
    assert roll_pitch_yaw(q) == pytest.approx((roll, pitch, yaw), abs=1e-6)


def test_a_nose_that_dips_has_a_negative_pitch_for_the_autopilot():
    dips = rotations.exp(np.array([0.0, 0.3, 0.0]))  # about y left: x forward goes down
    assert rotations.rotate(dips, np.array([1.0, 0.0, 0.0]))[2] < 0.0
    assert roll_pitch_yaw(frames.flip_attitude(dips)) == pytest.approx((0.0, -0.3, 0.0), abs=1e-12)
    assert roll_pitch_yaw(dips) == pytest.approx((0.0, 0.3, 0.0), abs=1e-12)
