"""The joint estimation problem: which unknowns there are, where they stand, and their linearised residuals."""

from dataclasses import dataclass, field, replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator import drive, dynamics, gusts, sensors
from sysid.estimator.chain import Rows
from sysid.estimator.flight_data import Flight
from sysid.estimator.gusts import Gusts
from sysid.estimator.midpoint import Middle, middle
from sysid.estimator.model import along, slopes_along
from sysid.estimator.sensors import SENSOR_NAMES, PoseSensor, SensorNoise
from sysid.estimator.states import GUST, States
from vehicle import Parameter, Vehicle, specs


@dataclass(frozen=True, slots=True)
class Unknowns:
    """The border: parameters shared by all states, in this order."""

    model: tuple[str, ...]
    """Parameters of the vehicle's motion."""
    sensor: tuple[str, ...]
    """Of `SENSOR_NAMES`."""
    biased_logs: tuple[int, ...]
    """Logs with a gyro, each with a bias of its own."""
    force_logs: tuple[int, ...] = ()
    """Logs whose accelerometer is used, each with a bias of its own."""

    @property
    def names(self) -> tuple[str, ...]:
        biases = tuple(f"gyro_bias_{axis}_rad_s[{log}]" for log in self.biased_logs for axis in "xyz")
        forces = tuple(f"accelerometer_bias_{axis}_m_s2[{log}]" for log in self.force_logs for axis in "xyz")
        return (*self.model, *self.sensor, *biases, *forces)

    @property
    def size(self) -> int:
        return len(self.model) + len(self.sensor) + 3 * (len(self.biased_logs) + len(self.force_logs))

    @property
    def bias_places(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """Rows and columns of `Point.bias` in the order of the border's tail."""
        gyro = [(log, axis) for log in self.biased_logs for axis in range(3)]
        force = [(log, 3 + axis) for log in self.force_logs for axis in range(3)]
        return tuple(zip(*gyro, *force, strict=True)) if gyro or force else ((), ())


@dataclass(frozen=True, slots=True)
class Noise:
    """How large the random errors are; estimated along with everything else."""

    process: FloatArray = field(default_factory=lambda: np.array([1.0, 1.0, 1.0, 10.0, 10.0, 10.0]))
    """(6,) densities of unmodelled acceleration, body axes: m/s2 and rad/s2 times root second."""
    sensor: SensorNoise = field(default_factory=SensorNoise)
    gusts: Gusts | None = None
    """Disturbances that last; None when all unmodelled acceleration is taken for white."""


@dataclass(frozen=True, slots=True)
class Point:
    """Where the unknowns stand."""

    vehicle: Vehicle
    """With the values tried at the moment."""
    pose_sensor: PoseSensor
    bias: FloatArray
    """(logs, 6) gyro (rad/s) and accelerometer (m/s2)."""
    states: tuple[States, ...]
    """One per flight."""

    def moved(self, unknowns: Unknowns, border: FloatArray, states: list[FloatArray]) -> "Point":
        """The point after a change of border (p,) and states (n, 12 or 18) each."""
        m, s = len(unknowns.model), len(unknowns.sensor)
        change = np.zeros(len(SENSOR_NAMES))
        change[[SENSOR_NAMES.index(name) for name in unknowns.sensor]] = border[m : m + s]
        bias = self.bias.copy()
        bias[unknowns.bias_places] += border[m + s :]
        return replace(
            self,
            vehicle=with_values(self.vehicle, unknowns.model, self.values(unknowns.model) + border[:m]),
            pose_sensor=PoseSensor.of_values(self.pose_sensor.values + change),
            bias=bias,
            states=tuple(s.moved(d) for s, d in zip(self.states, states, strict=True)),
        )

    def value(self, name: str) -> float:
        """Value of one of the model's or the sensor's parameters."""
        if name in SENSOR_NAMES:
            return float(self.pose_sensor.values[SENSOR_NAMES.index(name)])
        return self.vehicle.value(name)

    def values(self, names: tuple[str, ...]) -> FloatArray:
        """Several at once."""
        return np.array([self.value(name) for name in names], dtype=np.float64)


def with_values(vehicle: Vehicle, names: tuple[str, ...], values: FloatArray) -> Vehicle:
    """The vehicle with trial values, clipped by rounding at most (the solver keeps to the bounds)."""
    bounds = specs(vehicle)
    changed = dict(vehicle.parameters)
    for name, value in zip(names, values, strict=True):
        old = changed[name]
        changed[name] = Parameter(float(np.clip(value, *bounds[name].bounds)), old.std, old.unit, old.source)
    return replace(vehicle, parameters=changed)


def linearise(flight: Flight, states: States, point: Point, unknowns: Unknowns, noise: Noise, robust: bool) -> Rows:
    """Whitened residual rows of one flight with all derivatives."""
    flight = drive.driven(flight, point.vehicle)
    mid = middle(flight, states)
    acceleration = slopes_along(point.vehicle, unknowns.model, flight, mid)
    defect = dynamics.defects(states, mid, acceleration.value)
    before, after, by_model = dynamics.defect_jacobians(states, mid, acceleration)
    by_border = np.zeros((len(flight) - 1, 12, unknowns.size))
    by_border[:, :, : len(unknowns.model)] = by_model
    defect, before, after, by_border = dynamics.whiten(mid.step_s, noise.process, defect, before, after, by_border)
    bias = point.bias[flight.log_index]
    further = []
    if noise.gusts is not None:
        further.append(_gust_rows(states, mid, unknowns, noise.gusts))
    if flight.has_accelerometer:
        further.append(_force_rows(flight, states, mid, unknowns, bias[3:], noise.sensor.force_m_s2))
    if further:
        defect, before, after, by_border = (
            np.concatenate(parts, axis=1) for parts in zip((defect, before, after, by_border), *further, strict=True)
        )
    rows = sensors.linearise(flight, states, point.pose_sensor, bias[:3])
    weight = 1.0 / sensors.deviations(noise.sensor)
    weights = np.broadcast_to(weight, rows.residual.shape)
    if robust:
        weights = weights * sensors.robust_weights(rows.residual * weight)
    return Rows(
        defect=defect,
        defect_before=before,
        defect_after=after,
        defect_border=by_border,
        sensor=rows.residual * weights,
        sensor_state=_widened(rows.by_state * weights[:, :, None], states),
        sensor_border=_sensor_border(rows.by_sensor, flight, unknowns) * weights[:, :, None],
    )


def _force_rows(
    flight: Flight, states: States, mid: Middle, unknowns: Unknowns, bias: FloatArray, std: float
) -> tuple[FloatArray, ...]:
    """Whitened accelerometer residuals (k, 3) and their derivatives."""
    residual = dynamics.accelerometer(flight, states, mid, bias)
    before, after = dynamics.accelerometer_jacobians(states, mid)
    border = np.zeros((len(residual), 3, unknowns.size))
    tail = len(unknowns.model) + len(unknowns.sensor) + 3 * len(unknowns.biased_logs)
    place = tail + 3 * unknowns.force_logs.index(flight.log_index)
    border[:, :, place : place + 3] = -np.eye(3)
    return residual / std, _widened(before / std, states), _widened(after / std, states), border / std


def _gust_rows(states: States, mid: Middle, unknowns: Unknowns, of: Gusts) -> tuple[FloatArray, ...]:
    """Whitened rows (k, 6) of the disturbance's own dynamics, and their derivatives."""
    assert states.gust is not None
    border = np.zeros((len(mid.step_s), GUST, unknowns.size))
    return gusts.rows(of, mid.step_s, states.gust), *gusts.jacobians(of, mid.step_s), border


def _widened(by_state: FloatArray, states: States) -> FloatArray:
    """Derivatives (n, m, 12) with columns of zeros for the disturbances, when there are any."""
    return by_state if states.gust is None else np.pad(by_state, ((0, 0), (0, 0), (0, GUST)))


def _sensor_border(by_sensor: FloatArray, flight: Flight, unknowns: Unknowns) -> FloatArray:
    border = np.zeros((len(flight), 9, unknowns.size))
    start = len(unknowns.model)
    for i, name in enumerate(unknowns.sensor):
        border[:, :, start + i] = by_sensor[:, :, SENSOR_NAMES.index(name)]
    if flight.log_index in unknowns.biased_logs:
        place = start + len(unknowns.sensor) + 3 * unknowns.biased_logs.index(flight.log_index)
        border[:, :, place : place + 3] = by_sensor[:, :, len(SENSOR_NAMES) :]
    return border


def cost(flight: Flight, states: States, point: Point, noise: Noise, robust: bool) -> float:
    """Half the sum of squares of one flight's whitened residuals, without derivatives."""
    flight = drive.driven(flight, point.vehicle)
    mid = middle(flight, states)
    defect = dynamics.defects(states, mid, along(point.vehicle, flight, mid))
    (defect,) = dynamics.whiten(mid.step_s, noise.process, defect)
    bias = point.bias[flight.log_index]
    sensor = sensors.residuals(flight, states, point.pose_sensor, bias[:3])
    sensor = sensor / sensors.deviations(noise.sensor)
    if robust:
        sensor = sensor * sensors.robust_weights(sensor)
    force = gust = np.zeros(0)
    if noise.gusts is not None and states.gust is not None:
        gust = gusts.rows(noise.gusts, mid.step_s, states.gust)
    if flight.has_accelerometer:
        force = dynamics.accelerometer(flight, states, mid, bias[3:]) / noise.sensor.force_m_s2
    return 0.5 * float(sum(np.vdot(part, part) for part in (defect, sensor, force, gust)))
