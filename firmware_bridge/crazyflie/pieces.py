"""Polynomials as the Crazyflie's memory holds them: `poly4d`, 8 coefficients an axis and a duration, as floats."""

import numpy as np

from flight import Trajectory

TERMS, AXES = 8, 4
_FLOATS = AXES * TERMS + 1


def packed(trajectory: Trajectory) -> bytes:
    """132 bytes a piece: x, y, z, yaw in ascending powers of seconds, then the duration."""
    pieces = trajectory.coefficients
    rows = np.zeros((len(pieces), _FLOATS), "<f4")
    rows[:, :-1].reshape(len(pieces), AXES, TERMS)[:, :, : pieces.shape[2]] = pieces
    rows[:, -1] = trajectory.durations_s
    return rows.tobytes()


def unpacked(content: bytes) -> Trajectory:
    """What the memory holds."""
    rows = np.frombuffer(content, "<f4").reshape(-1, _FLOATS).astype(np.float64)
    return Trajectory(rows[:, -1], rows[:, :-1].reshape(len(rows), AXES, TERMS))
