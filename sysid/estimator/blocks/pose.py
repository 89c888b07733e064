"""Pose: position and attitude of a sensor at a place on the body, turned against it, and late."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from flight import InputError, rotations
from flight.rotations import FloatArray
from sysid.estimator.blocks.base import At, Block, Channel, Linear
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Stretch
from sysid.estimator.trajectory.states import ATTITUDE, POSITION, RATE, VELOCITY, States
from vehicle import Vehicle

DELAY = "pose_delay.delay_s"
"""Estimated when the vehicle has the effect `pose_delay`."""
PARAMETERS = (
    *(f"pose_sensor_{axis}_m" for axis in "xyz"),
    *(f"pose_sensor_rotation_{axis}_rad" for axis in "xyz"),
    DELAY,
)
PLACE, TURN = slice(0, 3), slice(3, 6)
"""Rows, and parameters, of position and attitude."""


class Pose(Block):
    """Measured less expected pose: metres and radians."""

    name = "pose"
    order = 2
    levels = ("position_m", "attitude_rad")
    usual = (3e-3, 3e-3)
    level_of_row = (0, 0, 0, 1, 1, 1)
    channels = (Channel("position", (0, 1, 2), "mm", 1e3), Channel("attitude", (3, 4, 5), "mrad", 1e3))
    parameters = PARAMETERS

    def read(self, stretch: Stretch) -> dict[str, FloatArray]:
        if not stretch.with_pose:
            return {"position_world_m": stretch.unmeasured(3), "q_world_sensor": stretch.unmeasured(4)}
        q = rotations.continuous(_unit(stretch.at_nodes("q_world_body"), stretch.name))
        return {"position_world_m": stretch.at_nodes("position_world_m"), "q_world_sensor": q}

    def measured(self, flight: Flight) -> bool:
        return flight.has_pose

    def residual(self, at: At) -> FloatArray:
        return residual(at.flight, at.states, PoseSensor.at(at.sensors))

    def linear(self, at: At) -> Linear:
        return linear(at.flight, at.states, PoseSensor.at(at.sensors))


BLOCK = Pose()


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
        return PoseSensor.of_values(np.array([known[n].value if n in known else 0.0 for n in PARAMETERS]))

    @staticmethod
    def at(values: Mapping[str, float]) -> "PoseSensor":
        """From values by name."""
        return PoseSensor.of_values(np.array([values[name] for name in PARAMETERS]))

    @staticmethod
    def of_values(values: FloatArray) -> "PoseSensor":
        """From numbers in the order of `PARAMETERS`."""
        return PoseSensor(values[:3], values[3:6], float(values[6]))

    @property
    def values(self) -> FloatArray:
        """(7,) in the order of `PARAMETERS`."""
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


def residual(flight: Flight, states: States, sensor: PoseSensor) -> FloatArray:
    """(n, 6) measured less expected: metres, radians."""
    expected, q = sensor.reading(states, flight.time_s)
    turned = rotations.log(rotations.multiply(rotations.conjugate(q), flight.q_world_sensor))
    return np.concatenate([flight.position_world_m - expected, turned], axis=1)


def linear(flight: Flight, states: States, sensor: PoseSensor) -> Linear:
    """Residuals with derivatives; the attitude residual is small, so its own Jacobian is taken as one."""
    n = len(flight)
    by_state, by_sensor = np.zeros((n, 6, states.size)), np.zeros((n, 6, len(PARAMETERS)))
    seen, d = sensor.seen(states, flight.time_s), sensor.delay_s
    R, to_sensor = rotations.matrix(seen.q_world_body), rotations.matrix(sensor.q_body_sensor).T
    # a small turn now, in the axes of the attitude that was seen
    since = rotations.multiply(rotations.conjugate(seen.q_world_body), states.q_world_body)
    turned = np.eye(3) if d == 0.0 else rotations.matrix(since)
    by_turn = R @ rotations.hat(sensor.offset_body_m)
    by_state[:, PLACE, POSITION] = -np.eye(3)
    by_state[:, PLACE, VELOCITY] = d * np.eye(3)
    by_state[:, PLACE, ATTITUDE] = by_turn @ turned
    by_state[:, PLACE, RATE] = -d * by_turn
    by_state[:, TURN, ATTITUDE] = -to_sensor @ turned
    by_state[:, TURN, RATE] = d * to_sensor
    by_sensor[:, PLACE, PLACE] = -R
    by_sensor[:, TURN, TURN] = -_right_jacobian(sensor.rotation_rad)
    by_sensor[:, :, PARAMETERS.index(DELAY)] = _by_delay(flight, states, by_turn, to_sensor, d)
    return Linear(residual(flight, states, sensor), (by_state,), by_sensor, PARAMETERS)


def _by_delay(flight: Flight, states: States, by_turn: FloatArray, to_sensor: FloatArray, delay_s: float) -> FloatArray:
    """(n, 6) derivative of the residuals by the delay: what moved since is missing from the pose."""
    rate, velocity = states.rate_body_rad_s, states.velocity_world_m_s
    if delay_s != 0.0:
        velocity = velocity - delay_s * np.gradient(velocity, flight.time_s, axis=0)
        rate = rate - delay_s * np.gradient(rate, flight.time_s, axis=0)
    turning = (by_turn @ rate[:, :, None])[:, :, 0]
    return np.concatenate([velocity - turning, rate @ to_sensor.T], axis=1)


def _right_jacobian(rotation_rad: FloatArray) -> FloatArray:
    """d exp: how a change of a rotation vector turns the rotated axes, (3, 3)."""
    angle = float(np.linalg.norm(rotation_rad))
    hat = rotations.hat(rotation_rad)
    if angle < 1e-4:
        return np.eye(3) - 0.5 * hat + hat @ hat / 6.0
    first = (1.0 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.eye(3) - first * hat + second * hat @ hat


def _unit(q: FloatArray, name: str) -> FloatArray:
    norm = np.linalg.norm(q, axis=1)
    if np.abs(norm - 1.0).max() > 0.02:
        row = int(np.abs(norm - 1.0).argmax())
        raise InputError(f"{name}: q_world_body has length {norm[row]:.3f} in pose sample {row}; it must be 1")
    return q / norm[:, None]
