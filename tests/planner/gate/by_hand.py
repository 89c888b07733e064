"""Trajectories made by hand, for the gate's tests."""

import numpy as np

from flight import Trajectory

ORIGIN = np.zeros(3)
LEFT_UP = np.array([[0.0, 0.5, 0.0], [0.0, 0.0, 0.5]])
"""Half edges of an opening 1 m wide and high, passed along x."""


def straight(*points: tuple[float, ...], leg_s: float = 1.0) -> Trajectory:
    """From point (x, y, z, yaw) to point at constant speed, which changes at once."""
    at = np.array(points)
    coefficients = np.zeros((len(at) - 1, 4, 8))
    coefficients[:, :, 0], coefficients[:, :, 1] = at[:-1], np.diff(at, axis=0) / leg_s
    return Trajectory(np.full(len(at) - 1, leg_s), coefficients)
