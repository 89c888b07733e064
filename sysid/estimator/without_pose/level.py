"""The accelerometer's bias along the thrust, from a flight that begins and ends at about the same speed.

Over such a flight the specific force, turned upright by the gyro, is gravity on average. That is what ties the size of
the thrust to the weight; the noise model of the fit hardly looks at a mean.
"""

from collections.abc import Sequence

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.states import States

GAINED_M_S = 1.5
"""Upward speed that a flight may have gained or lost, standard deviation."""
TILT_M_S2 = 0.05
"""What an attitude off by 0.1 rad makes of gravity."""


def bias(pieces: Sequence[tuple[Flight, States]]) -> tuple[float, float]:
    """Bias along z and its standard deviation by the pieces of one log, m/s2."""
    means, weights = [], []
    for flight, states in pieces:
        duration_s = float(flight.time_s[-1] - flight.time_s[0])
        means.append(float(_upward(flight, states).mean()) - flight.gravity_m_s2)
        weights.append(1.0 / ((GAINED_M_S / duration_s) ** 2 + TILT_M_S2**2))
    return float(np.average(means, weights=weights)), float(np.sum(weights) ** -0.5)


def _upward(flight: Flight, states: States) -> FloatArray:
    """(k,) specific force along world z."""
    up = rotations.matrix(states.q_world_body[:-1])[:, 2]
    return (up * flight.specific_force_body_m_s2).sum(axis=1)
