"""The state trajectory of one flight, and a first guess of it by smoothing the pose alone."""

from dataclasses import dataclass, replace

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight, IndexArray

POSITION, VELOCITY, ATTITUDE, RATE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
"""Places of a node's unknowns; of the attitude, the rotation vector of its error."""
MOTION = 12
"""How many these are."""
GUST_FORCE, GUST_TORQUE = slice(12, 15), slice(15, 18)
"""Further unknowns of a node when disturbances that last are among the states."""
GUST = 6
"""How many these are."""

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
    gust: FloatArray | None = None
    """(n, 6) disturbance that lasts: force per mass in world axes (m/s2), turning in body axes (rad/s2)."""

    @property
    def size(self) -> int:
        """Unknowns per node."""
        return MOTION if self.gust is None else MOTION + GUST

    def with_gust(self) -> "States":
        """The same with a disturbance, which is zero so far."""
        return replace(self, gust=np.zeros((len(self.position_world_m), GUST)))

    def picked(self, nodes: IndexArray | slice) -> "States":
        """The states at some of the nodes."""
        return States(
            self.position_world_m[nodes],
            self.velocity_world_m_s[nodes],
            self.q_world_body[nodes],
            self.rate_body_rad_s[nodes],
            None if self.gust is None else self.gust[nodes],
        )

    def half_way(self, other: "States") -> "States":
        """The states in the middle between these and others, without a disturbance."""
        turn = rotations.log(rotations.multiply(rotations.conjugate(self.q_world_body), other.q_world_body))
        return States(
            0.5 * (self.position_world_m + other.position_world_m),
            0.5 * (self.velocity_world_m_s + other.velocity_world_m_s),
            rotations.multiply(self.q_world_body, rotations.exp(0.5 * turn)),
            0.5 * (self.rate_body_rad_s + other.rate_body_rad_s),
        )

    def moved(self, change: FloatArray) -> "States":
        """The states after a change (n, size); the attitude turns by a rotation vector in body axes."""
        return States(
            self.position_world_m + change[:, POSITION],
            self.velocity_world_m_s + change[:, VELOCITY],
            rotations.normalise(rotations.multiply(self.q_world_body, rotations.exp(change[:, ATTITUDE]))),
            self.rate_body_rad_s + change[:, RATE],
            None if self.gust is None else self.gust + change[:, MOTION:],
        )


def first_guess(flight: Flight, offset_body_m: FloatArray, q_body_sensor: FloatArray) -> States:
    """States from the pose alone, by local cubic fits; without a pose, from the IMU."""
    from scipy.signal import savgol_filter

    if not flight.has_pose:
        return _from_imu(flight)
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


def _from_imu(flight: Flight) -> States:
    """Attitude by turning with the gyro, pulled slowly so that the accelerometer points up; at rest at the origin."""
    n, pull_per_s = len(flight), 0.3
    q, up = np.empty((n, 4)), np.array([0.0, 0.0, 1.0])
    q[0] = rotations.IDENTITY
    step_s, rate = np.diff(flight.time_s), 0.5 * (flight.rate_body_rad_s[:-1] + flight.rate_body_rad_s[1:])
    force = flight.specific_force_body_m_s2 / np.linalg.norm(flight.specific_force_body_m_s2, axis=1, keepdims=True)
    for k in range(n - 1):
        tilt = rotations.cross(force[k], rotations.rotate(rotations.conjugate(q[k]), up))
        q[k + 1] = rotations.multiply(q[k], rotations.exp(step_s[k] * (rate[k] + pull_per_s * tilt)))
    zero = np.zeros((n, 3))
    return States(zero, zero, rotations.normalise(q), flight.rate_body_rad_s.copy())
