"""What the sensors should have read, whitened: pose at a place on the body, and a gyro with a constant bias."""

from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.flight_data import Flight
from sysid.states import States
from vehicle import Vehicle

SENSOR_NAMES = tuple(f"pose_sensor_{axis}_m" for axis in "xyz") + tuple(
    f"pose_sensor_rotation_{axis}_rad" for axis in "xyz"
)
STILL_M_S = 2.0
"""Without a pose the velocity is taken to be nil within this much: it hovers about in a room."""
HUBER = 2.0
"""Standard deviations beyond which a robust fit counts a pose sample less."""


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of one sample."""

    position_m: float = 3e-3
    attitude_rad: float = 3e-3
    rate_rad_s: float = 2e-2
    force_m_s2: float = 0.3
    """Of the mean over one interval between nodes."""


@dataclass(frozen=True, slots=True)
class PoseSensor:
    """Where the pose sensor sits on the body."""

    offset_body_m: FloatArray
    """(3,) from the centre of mass."""
    rotation_rad: FloatArray
    """(3,) rotation vector that turns sensor axes into body axes."""

    @staticmethod
    def of(vehicle: Vehicle) -> "PoseSensor":
        """As the vehicle file says."""
        values = np.array([vehicle.value(name) for name in SENSOR_NAMES])
        return PoseSensor(values[:3], values[3:])

    @property
    def q_body_sensor(self) -> FloatArray:
        return rotations.exp(self.rotation_rad)

    def reading(self, states: States) -> tuple[FloatArray, FloatArray]:
        """Position (n, 3) and attitude (n, 4) it would report."""
        position = states.position_world_m + rotations.rotate(states.q_world_body, self.offset_body_m)
        return position, rotations.multiply(states.q_world_body, self.q_body_sensor)


@dataclass(frozen=True, slots=True)
class SensorRows:
    """Residuals (n, 9) of position, attitude, rate with derivatives by state (n, 9, 12) and sensor (n, 9, 9)."""

    residual: FloatArray
    by_state: FloatArray
    by_sensor: FloatArray
    """Columns: offset (3), rotation (3), gyro bias (3)."""


def residuals(flight: Flight, states: States, sensor: PoseSensor, bias_rad_s: FloatArray) -> FloatArray:
    """(n, 9) measured minus expected: metres, radians, rad/s; zero where no rate was measured."""
    if not flight.has_pose:
        return _anchors(flight, states, bias_rad_s)
    expected, q = sensor.reading(states)
    turned = rotations.log(rotations.multiply(rotations.conjugate(q), flight.q_world_sensor))
    rate = flight.rate_body_rad_s - states.rate_body_rad_s - bias_rad_s
    return np.concatenate([flight.position_world_m - expected, turned, np.nan_to_num(rate)], axis=1)


def linearise(flight: Flight, states: States, sensor: PoseSensor, bias_rad_s: FloatArray) -> SensorRows:
    """Residuals with derivatives; the attitude residual is small, so its own Jacobian is taken as one."""
    n = len(flight)
    R = rotations.matrix(states.q_world_body)
    by_state, by_sensor = np.zeros((n, 9, 12)), np.zeros((n, 9, 9))
    if not flight.has_pose:
        return _anchors_linearised(flight, states, bias_rad_s)
    has_rate = np.where(np.isfinite(flight.rate_body_rad_s).all(axis=1), 1.0, 0.0)
    by_state[:, 0:3, 0:3] = -np.eye(3)
    by_state[:, 0:3, 6:9] = R @ rotations.hat(sensor.offset_body_m)
    by_state[:, 3:6, 6:9] = -rotations.matrix(sensor.q_body_sensor).T
    by_state[:, 6:9, 9:12] = -has_rate.reshape(-1, 1, 1) * np.eye(3)
    by_sensor[:, 0:3, 0:3] = -R
    by_sensor[:, 3:6, 3:6] = -_right_jacobian(sensor.rotation_rad)
    by_sensor[:, 6:9, 6:9] = by_state[:, 6:9, 9:12]
    return SensorRows(residuals(flight, states, sensor, bias_rad_s), by_state, by_sensor)


def _anchors(flight: Flight, states: States, bias_rad_s: FloatArray) -> FloatArray:
    """Without a pose, what keeps the states from wandering off, in the pose's rows (scaled for `deviations`).

    Position and heading are free by nature: the first node is at the origin, the last has about its guessed heading.
    Velocity is nil within `STILL_M_S`, which is what ties the tilt to gravity.
    """
    rows = np.zeros((len(flight), 9))
    usual = SensorNoise()
    rows[:, 0:3] = -states.velocity_world_m_s * (usual.position_m / STILL_M_S)
    rows[0, 3:6] = -states.position_world_m[0] * usual.attitude_rad
    rows[-1, 5] = -rotations.yaw(states.q_world_body[-1]) * usual.attitude_rad
    rows[:, 6:9] = np.nan_to_num(flight.rate_body_rad_s - states.rate_body_rad_s - bias_rad_s)
    return rows


def _anchors_linearised(flight: Flight, states: States, bias_rad_s: FloatArray) -> SensorRows:
    n = len(flight)
    by_state, by_sensor = np.zeros((n, 9, 12)), np.zeros((n, 9, 9))
    usual = SensorNoise()
    by_state[:, 0:3, 3:6] = -np.eye(3) * (usual.position_m / STILL_M_S)
    by_state[0, 3:6, 0:3] = -np.eye(3) * usual.attitude_rad
    by_state[-1, 5, 6:9] = -usual.attitude_rad * rotations.matrix(states.q_world_body[-1])[2]
    by_state[:, 6:9, 9:12] = -np.eye(3)
    by_sensor[:, 6:9, 6:9] = -np.eye(3)
    return SensorRows(_anchors(flight, states, bias_rad_s), by_state, by_sensor)


def deviations(noise: SensorNoise) -> FloatArray:
    """(9,) standard deviation of each row."""
    return np.repeat([noise.position_m, noise.attitude_rad, noise.rate_rad_s], 3)


def robust_weights(whitened: FloatArray) -> FloatArray:
    """(n, 9) square roots of Huber's weights, one per pose sample and kind of measurement."""
    size = np.sqrt((whitened.reshape(len(whitened), 3, 3) ** 2).mean(axis=2))
    weights = np.where(size > HUBER, HUBER / np.maximum(size, HUBER), 1.0)
    return np.repeat(np.sqrt(weights), 3, axis=1)


def _right_jacobian(rotation_rad: FloatArray) -> FloatArray:
    """d exp: how a change of a rotation vector turns the rotated axes, (3, 3)."""
    angle = float(np.linalg.norm(rotation_rad))
    hat = rotations.hat(rotation_rad)
    if angle < 1e-4:
        return np.eye(3) - 0.5 * hat + hat @ hat / 6.0
    first = (1.0 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.eye(3) - first * hat + second * hat @ hat
