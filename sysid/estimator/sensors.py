"""What the sensors should have read, whitened: pose at a place on the body, and a gyro with a constant bias."""

from dataclasses import dataclass, replace

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flight_data import Flight
from sysid.estimator.states import States
from vehicle import Vehicle

DELAY = "pose_delay.delay_s"
"""Estimated when the vehicle has the effect `pose_delay`."""
SENSOR_NAMES = (
    *(f"pose_sensor_{axis}_m" for axis in "xyz"),
    *(f"pose_sensor_rotation_{axis}_rad" for axis in "xyz"),
    DELAY,
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
    """Where the pose sensor sits on the body, and how late it is."""

    offset_body_m: FloatArray
    """(3,) from the centre of mass."""
    rotation_rad: FloatArray
    """(3,) rotation vector that turns sensor axes into body axes."""
    delay_s: float = 0.0
    """How much older the pose is than its time stamp."""

    @staticmethod
    def of(vehicle: Vehicle) -> "PoseSensor":
        """As the vehicle file says; without the effect `pose_delay` it is not late."""
        known = vehicle.parameters
        return PoseSensor.of_values(np.array([known[n].value if n in known else 0.0 for n in SENSOR_NAMES]))

    @staticmethod
    def of_values(values: FloatArray) -> "PoseSensor":
        """From numbers in the order of `SENSOR_NAMES`."""
        return PoseSensor(values[:3], values[3:6], float(values[6]))

    @property
    def values(self) -> FloatArray:
        """(7,) in the order of `SENSOR_NAMES`."""
        return np.concatenate([self.offset_body_m, self.rotation_rad, [self.delay_s]])

    @property
    def q_body_sensor(self) -> FloatArray:
        return rotations.exp(self.rotation_rad)

    def reading(self, states: States, time_s: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Position (n, 3) and attitude (n, 4) it would report.

        Args:
            time_s: when the states are neighbours in time, their instants: the delay is then allowed for to second
                order, else to first.
        """
        seen = self.seen(states, time_s)
        position = seen.position_world_m + rotations.rotate(seen.q_world_body, self.offset_body_m)
        return position, rotations.multiply(seen.q_world_body, self.q_body_sensor)

    def seen(self, states: States, time_s: FloatArray | None) -> States:
        """The states as they were when the pose was taken, `delay_s` before."""
        if self.delay_s == 0.0:
            return states
        d, turn = self.delay_s, self.delay_s * states.rate_body_rad_s
        position = states.position_world_m - d * states.velocity_world_m_s
        if time_s is not None:
            position = position + 0.5 * d * d * np.gradient(states.velocity_world_m_s, time_s, axis=0)
            turn = turn - 0.5 * d * d * np.gradient(states.rate_body_rad_s, time_s, axis=0)
        q = rotations.multiply(states.q_world_body, rotations.exp(-turn))
        return replace(states, position_world_m=position, q_world_body=q)


@dataclass(frozen=True, slots=True)
class SensorRows:
    """Residuals (n, 9) of position, attitude, rate with derivatives by state (n, 9, 12) and sensor (n, 9, 10)."""

    residual: FloatArray
    by_state: FloatArray
    by_sensor: FloatArray
    """Columns: offset (3), rotation (3), delay (1), gyro bias (3)."""


def residuals(flight: Flight, states: States, sensor: PoseSensor, bias_rad_s: FloatArray) -> FloatArray:
    """(n, 9) measured minus expected: metres, radians, rad/s; zero where no rate was measured."""
    if not flight.has_pose:
        return _anchors(flight, states, bias_rad_s)
    expected, q = sensor.reading(states, flight.time_s)
    turned = rotations.log(rotations.multiply(rotations.conjugate(q), flight.q_world_sensor))
    rate = flight.rate_body_rad_s - states.rate_body_rad_s - bias_rad_s
    return np.concatenate([flight.position_world_m - expected, turned, np.nan_to_num(rate)], axis=1)


def linearise(flight: Flight, states: States, sensor: PoseSensor, bias_rad_s: FloatArray) -> SensorRows:
    """Residuals with derivatives; the attitude residual is small, so its own Jacobian is taken as one."""
    n = len(flight)
    by_state, by_sensor = np.zeros((n, 9, 12)), np.zeros((n, 9, 10))
    if not flight.has_pose:
        return _anchors_linearised(flight, states, bias_rad_s)
    seen, d = sensor.seen(states, flight.time_s), sensor.delay_s
    R, to_sensor = rotations.matrix(seen.q_world_body), rotations.matrix(sensor.q_body_sensor).T
    has_rate = np.where(np.isfinite(flight.rate_body_rad_s).all(axis=1), 1.0, 0.0)
    # a small turn now, in the axes of the attitude that was seen
    since = rotations.multiply(rotations.conjugate(seen.q_world_body), states.q_world_body)
    turned = np.eye(3) if d == 0.0 else rotations.matrix(since)
    by_turn = R @ rotations.hat(sensor.offset_body_m)
    by_state[:, 0:3, 0:3] = -np.eye(3)
    by_state[:, 0:3, 3:6] = d * np.eye(3)
    by_state[:, 0:3, 6:9] = by_turn @ turned
    by_state[:, 0:3, 9:12] = -d * by_turn
    by_state[:, 3:6, 6:9] = -to_sensor @ turned
    by_state[:, 3:6, 9:12] = d * to_sensor
    by_state[:, 6:9, 9:12] = -has_rate.reshape(-1, 1, 1) * np.eye(3)
    by_sensor[:, 0:3, 0:3] = -R
    by_sensor[:, 3:6, 3:6] = -_right_jacobian(sensor.rotation_rad)
    by_sensor[:, :, 6] = _by_delay(flight, states, by_turn, to_sensor, d)
    by_sensor[:, 6:9, 7:10] = by_state[:, 6:9, 9:12]
    return SensorRows(residuals(flight, states, sensor, bias_rad_s), by_state, by_sensor)


def _by_delay(flight: Flight, states: States, by_turn: FloatArray, to_sensor: FloatArray, delay_s: float) -> FloatArray:
    """(n, 9) derivative of the residuals by the delay: what moved since is missing from the pose."""
    rate, velocity = states.rate_body_rad_s, states.velocity_world_m_s
    if delay_s != 0.0:
        velocity = velocity - delay_s * np.gradient(velocity, flight.time_s, axis=0)
        rate = rate - delay_s * np.gradient(rate, flight.time_s, axis=0)
    turning = (by_turn @ rate[:, :, None])[:, :, 0]
    return np.concatenate([velocity - turning, rate @ to_sensor.T, np.zeros_like(rate)], axis=1)


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
    by_state, by_sensor = np.zeros((n, 9, 12)), np.zeros((n, 9, 10))
    usual = SensorNoise()
    by_state[:, 0:3, 3:6] = -np.eye(3) * (usual.position_m / STILL_M_S)
    by_state[0, 3:6, 0:3] = -np.eye(3) * usual.attitude_rad
    by_state[-1, 5, 6:9] = -usual.attitude_rad * rotations.matrix(states.q_world_body[-1])[2]
    by_state[:, 6:9, 9:12] = -np.eye(3)
    by_sensor[:, 6:9, 7:10] = -np.eye(3)
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
