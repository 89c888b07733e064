"""Between our axes and the autopilots': forward left up and forward right down, z up and NED.

Both are half a turn about x, for the world as for the body: the world's x is the autopilot's north. The turn is its own
inverse, so the same functions lead back.
"""

import math

import numpy as np

from flight import FloatArray, rotations

_HALF_TURN = np.array([1.0, -1.0, -1.0])
_HALF_TURN_Q = np.array([1.0, 1.0, -1.0, -1.0])


def vector(v: FloatArray) -> FloatArray:
    """(3,) of the body or the world."""
    return _HALF_TURN * v


def attitude(q: FloatArray) -> FloatArray:
    """(4,) w x y z: world from body, and NED from FRD."""
    return _HALF_TURN_Q * q


def roll_pitch_yaw(q_ned_frd: FloatArray) -> tuple[float, float, float]:
    """Of an attitude NED from FRD, yaw first."""
    R = rotations.matrix(q_ned_frd)
    return math.atan2(R[2, 1], R[2, 2]), -math.asin(float(np.clip(R[2, 0], -1.0, 1.0))), math.atan2(R[1, 0], R[0, 0])


def roll_pitch(q_world_body: FloatArray) -> tuple[float, float]:
    """Roll right and pitch nose down of an attitude in our axes."""
    roll, pitch, _ = roll_pitch_yaw(q_world_body)
    return roll, pitch
