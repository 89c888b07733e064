"""Roll, pitch and yaw of an attitude, as MAVLink's messages have them; `flight.frames` changes the axes."""

import math

import numpy as np

from flight import FloatArray, rotations


def roll_pitch_yaw(q: FloatArray) -> tuple[float, float, float]:
    """About x, y, z, yaw first: of NED from FRD as the autopilots count, of ours with pitch nose down."""
    R = rotations.matrix(q)
    return math.atan2(R[2, 1], R[2, 2]), -math.asin(float(np.clip(R[2, 0], -1.0, 1.0))), math.atan2(R[1, 0], R[0, 0])
