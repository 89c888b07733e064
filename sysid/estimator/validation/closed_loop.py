"""How a vehicle turns under its controller: a linear law of its own state, learned from flights.

A multirotor that is flown by a position controller levels out and brakes: its desired tilt follows the velocity, and an
attitude loop turns it there. Linearised about hover (Mahony, Kumar and Corke 2012, section on control) the angular
acceleration about the level axes is

    -a rate - b (up x z) + c (velocity x z)

in body axes, with the world's upward axis `up` and the body's z. It describes vehicle and controller together and uses
no rotor speed, so it holds for flights with that controller alone: it predicts a flight, and says nothing of what
another controller would make of the vehicle.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.states import States

LAG_S = 0.25
"""Fitted to the mean angular acceleration over this long after each state, as it is used. On flights of a nano-drone,
each kind left out in turn, 0.1 and 0.5 s predict a little worse: rate noise comes in, the vehicle has turned back."""


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """Angular acceleration by the state."""

    rate_per_s: float
    """a: damping of roll and pitch rate."""
    tilt_per_s2: float
    """b: levelling."""
    velocity_per_m_s: float
    """c: braking."""
    yaw_rate_per_s: float
    """Damping of the yaw rate."""

    def angular_acceleration(self, at: States) -> FloatArray:
        """(n, 3) rad/s2, body axes."""
        level = np.array([self.rate_per_s, self.tilt_per_s2, self.velocity_per_m_s])
        turning = np.einsum("nci,c->ni", _columns(at), level)
        turning[:, 2] = -self.yaw_rate_per_s * at.rate_body_rad_s[:, 2]
        return turning


def _columns(at: States) -> FloatArray:
    """(n, 3, 3) what the three coefficients of the law multiply."""
    to_body = rotations.conjugate(at.q_world_body)
    z = np.array([0.0, 0.0, 1.0])
    tilt = np.cross(rotations.rotate(to_body, z), z)
    brake = np.cross(rotations.rotate(to_body, at.velocity_world_m_s), z)
    return np.stack([-at.rate_body_rad_s, -tilt, brake], axis=1)


def learn(flights: Sequence[Flight], states: Sequence[States]) -> ClosedLoop:
    """Least squares over all flights; each counts alike, calm or agile, by the size of its own turning.

    Args:
        flights: longer than `LAG_S`.
        states: of each flight, as measured.
    """
    level, yaw = [], []
    for flight, at in zip(flights, states, strict=True):
        lag = max(1, round(LAG_S / float(np.median(flight.step_s))))
        before = at.picked(slice(None, -lag))
        passed_s = (flight.time_s[lag:] - flight.time_s[:-lag])[:, None]
        turning = (at.rate_body_rad_s[lag:] - before.rate_body_rad_s) / passed_s
        level.append(_alike(np.concatenate([_columns(before)[:, :, i] for i in (0, 1)]), turning[:, :2].T.ravel()))
        yaw.append(_alike(-before.rate_body_rad_s[:, 2:], turning[:, 2]))
    a, b, c = _least_squares(level)
    return ClosedLoop(float(a), float(b), float(c), float(_least_squares(yaw)[0]))


def _alike(columns: FloatArray, turning: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The rows of one flight, scaled so that the squares of its turning add up to one."""
    size = max(float(np.linalg.norm(turning)), 1e-12)
    return columns / size, turning / size


def _least_squares(parts: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    columns, turning = (np.concatenate(part) for part in zip(*parts, strict=True))
    return np.linalg.lstsq(columns, turning, rcond=None)[0]
