"""The state trajectory of one flight, and a first guess of it by smoothing the pose alone."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from flight import rotations
from flight.rotations import FloatArray
from sysid.flight_data import Flight

WINDOW_S = 0.15
"""Length of the smoothing window of the first guess: shorter than the vehicle's motion, longer than the noise."""


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """Position and velocity of the centre of mass, attitude and rate of the body, at each node."""

    position_world_m: FloatArray
    """(n, 3)."""
    velocity_world_m_s: FloatArray
    """(n, 3)."""
    q_world_body: FloatArray
    """(n, 4)."""
    rate_body_rad_s: FloatArray
    """(n, 3)."""

    def moved(self, change: FloatArray) -> "States":
        """The states after a change (n, 12); the attitude turns by a rotation vector in body axes."""
        return States(
            self.position_world_m + change[:, 0:3],
            self.velocity_world_m_s + change[:, 3:6],
            rotations.normalise(rotations.multiply(self.q_world_body, rotations.exp(change[:, 6:9]))),
            self.rate_body_rad_s + change[:, 9:12],
        )


def first_guess(flight: Flight, offset_body_m: FloatArray, q_body_sensor: FloatArray) -> States:
    """States from the pose alone, by local cubic fits."""
    uniform_s = np.linspace(flight.time_s[0], flight.time_s[-1], len(flight))
    step_s = uniform_s[1] - uniform_s[0]
    window = 2 * max(2, round(0.5 * WINDOW_S / step_s)) + 1
    window = min(window, len(flight) - 1 + len(flight) % 2)

    def smooth(values: FloatArray, derivative: int) -> FloatArray:
        resampled = _interpolate(uniform_s, flight.time_s, values)
        fitted = np.asarray(savgol_filter(resampled, window, 3, deriv=derivative, delta=step_s, axis=0))
        return _interpolate(flight.time_s, uniform_s, fitted)

    q_measured = rotations.multiply(flight.q_world_sensor, rotations.conjugate(q_body_sensor))
    q = rotations.normalise(smooth(q_measured, 0))
    rate = 2.0 * rotations.multiply(rotations.conjugate(q), smooth(q_measured, 1))[:, 1:]
    sensor_m = rotations.rotate(q, offset_body_m)
    sensor_velocity = rotations.rotate(q, np.cross(rate, offset_body_m))
    return States(
        smooth(flight.position_world_m, 0) - sensor_m,
        smooth(flight.position_world_m, 1) - sensor_velocity,
        q,
        rate,
    )


def _interpolate(at: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack([np.interp(at, x, column) for column in y.T], axis=1)
