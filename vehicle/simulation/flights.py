"""Simulated flights: fly a controller, record the ground truth, then simulate the sensors' measurements."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flight import FlightLog, FloatArray, InputError, Trajectory, flight_log, rotations
from vehicle import effects as registry
from vehicle.effects.base import Reading, Stage
from vehicle.model import Vehicle, active
from vehicle.simulation import simulate
from vehicle.simulation.simulate import CALM, Fleet, Wind
from vehicle.simulation.tracking import Tracker

Controller = Callable[[Fleet], FloatArray]
"""Rotor speed commands (m, r) for a fleet's present state and `time_s`."""


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Ground truth of m vehicles at t instants."""

    vehicle: Vehicle
    time_s: FloatArray
    """(t,)."""
    rows: FloatArray
    """(t, m, 13 + r) states; see `vehicle.integrate`."""
    command_rad_s: FloatArray
    """(t, m, r) the command held from that instant on."""
    specific_force_body_m_s2: FloatArray
    """(t, m, 3)."""
    wind_world_m_s: FloatArray
    """(t, m, 3)."""
    battery_v: FloatArray
    """(t, m)."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Sensor noise, as standard deviations of independent samples."""

    position_m: float = 0.002
    attitude_rad: float = 0.0021
    """Per axis; 0.12 degrees."""
    rotor_speed_rad_s: float = 4.0
    gyroscope_rad_s: float = 0.005
    accelerometer_m_s2: float = 0.05
    battery_v: float = 0.01


QUIET = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Sensors without noise."""


def fly(fleet: Fleet, controller: Controller, duration_s: float, *, period_s: float = 0.005) -> Truth:
    """Fly, calling the controller once per period.

    Raises:
        InputError: duration or period is not positive.
    """
    if not (duration_s > 0.0 and period_s > 0.0):
        raise InputError(f"duration {duration_s:g} s and period {period_s:g} s must be positive")
    count = round(duration_s / period_s)
    kept: list[tuple[FloatArray, ...]] = []
    times = np.empty(count)
    for k in range(count):
        times[k] = fleet.time_s
        command = np.broadcast_to(controller(fleet), (len(fleet), fleet.vehicle.rotors)).copy()
        before = (fleet.rows, command, fleet.wind_world_m_s, fleet.battery_v, fleet.specific_force_body_m_s2)
        fleet.step(command, period_s)
        kept.append(before)
    rows, commands, wind, volts, force = (np.stack(column) for column in zip(*kept, strict=True))
    return Truth(fleet.vehicle, times, rows, commands, force, wind, volts)


def fly_trajectory(
    truth: Vehicle,
    trajectory: Trajectory,
    *,
    believed: Vehicle | None = None,
    wind: Wind = CALM,
    rng: np.random.Generator | None = None,
    period_s: float = 0.005,
    ground_m: float = -np.inf,
    ceiling_m: float = np.inf,
) -> Truth:
    """One vehicle along one trajectory with the simple tracking controller, which uses the model `believed`."""
    tracker = Tracker(believed or truth, trajectory, period_s)
    start = trajectory.evaluate(np.zeros(1))[0]
    state = simulate.hovering(believed or truth, start[:3], yaw_rad=float(start[3]))
    fleet = Fleet(truth, [state], wind=wind, rng=rng, ground_m=ground_m, ceiling_m=ceiling_m)
    return fly(fleet, tracker, trajectory.duration_s, period_s=period_s)


def measure(
    truth: Truth, *, noise: Noise = Noise(), rng: np.random.Generator, member: int = 0, commands: bool = True
) -> FlightLog:
    """The flight log a vehicle's sensors would have written: pose of the pose sensor, IMU, rotor speeds, battery.

    The pose columns hold the pose *sensor's* pose: its place and rotation are parameters of the vehicle
    (`pose_sensor_...`), its delay is the effect `pose_delay`. IMU errors are the effect `imu_errors`.

    Args:
        member: which of the fleet.
        commands: whether the log also has the rotor speed commands.
    """
    v, rows = truth.vehicle, truth.rows[:, member]
    count = len(rows)
    reading = _sensor_reading(truth, member)
    position, q = _sensor_pose(v, truth.time_s, rows, float(reading.pose_age_s))
    vectors = {
        "position_world_m": position + rng.normal(0.0, noise.position_m, (count, 3)),
        "q_world_body": rotations.multiply(q, rotations.exp(rng.normal(0.0, noise.attitude_rad, (count, 3)))),
        "rate_body_rad_s": reading.gyroscope_rad_s.T + rng.normal(0.0, noise.gyroscope_rad_s, (count, 3)),
        "specific_force_body_m_s2": reading.accelerometer_m_s2.T
        + rng.normal(0.0, noise.accelerometer_m_s2, (count, 3)),
        "rotor_speed_rad_s": rows[:, 13:] + rng.normal(0.0, noise.rotor_speed_rad_s, (count, v.rotors)),
    }
    if commands:
        vectors["rotor_speed_command_rad_s"] = truth.command_rad_s[:, member]
    battery = truth.battery_v[:, member] + rng.normal(0.0, noise.battery_v, count)
    metadata = {"source": "simulated", "vehicle": v.name}
    return flight_log.from_vectors(truth.time_s, vectors, scalars={"battery_v": battery}, metadata=metadata)


def _sensor_reading(truth: Truth, member: int) -> Reading:
    rows = truth.rows[:, member]
    turn = np.gradient(rows[:, 10:13], truth.time_s, axis=0)
    reading = Reading(rows[:, 10:13].T, truth.specific_force_body_m_s2[:, member].T, turn.T)
    for name in active(truth.vehicle, Stage.SENSOR):
        registry.find(name).apply(reading, truth.vehicle.values(name))
    return reading


def _sensor_pose(v: Vehicle, time_s: FloatArray, rows: FloatArray, age_s: float) -> tuple[FloatArray, FloatArray]:
    """Pose of the sensor `age_s` ago; before the first instant the first state is used."""
    when = np.clip(time_s - age_s, time_s[0], time_s[-1])
    after = np.clip(np.searchsorted(time_s, when), 1, len(time_s) - 1)
    fraction = (when - time_s[after - 1]) / (time_s[after] - time_s[after - 1])
    # cubic in position, constant turning in attitude: both exact to micrometres between samples of a few milliseconds
    position = _hermite(time_s, rows, after, fraction)
    q = rotations.slerp(rows[after - 1, 6:10], rows[after, 6:10], fraction)
    place = np.array([v.value(f"pose_sensor_{axis}_m") for axis in "xyz"])
    turn = np.array([v.value(f"pose_sensor_rotation_{axis}_rad") for axis in "xyz"])
    return position + rotations.rotate(q, place), rotations.multiply(q, rotations.exp(turn))


def _hermite(time_s: FloatArray, rows: FloatArray, after: np.ndarray, fraction: FloatArray) -> FloatArray:
    step, s = (time_s[after] - time_s[after - 1])[:, None], fraction[:, None]
    p0, p1, v0, v1 = rows[after - 1, 0:3], rows[after, 0:3], rows[after - 1, 3:6], rows[after, 3:6]
    rise = s * s * (3.0 - 2.0 * s)
    return p0 + rise * (p1 - p0) + step * (s * (s - 1.0) ** 2 * v0 + s * s * (s - 1.0) * v1)


def noiseless_readings(truth: Truth, sensors: Vehicle, *, noise: Noise = Noise(), member: int = 0) -> FloatArray:
    """All readings of a flight as one vector, each divided by its noise, with the sensors of another vehicle."""
    rows = truth.rows[:, member]
    reading = _sensor_reading(replace(truth, vehicle=sensors), member)
    position, q = _sensor_pose(sensors, truth.time_s, rows, float(reading.pose_age_s))
    turned = rotations.log(rotations.multiply(rotations.conjugate(rows[:, 6:10]), q))
    parts = (
        position / noise.position_m,
        turned / noise.attitude_rad,
        reading.gyroscope_rad_s.T / noise.gyroscope_rad_s,
        reading.accelerometer_m_s2.T / noise.accelerometer_m_s2,
    )
    return np.concatenate([part.ravel() for part in parts])
