"""Modelled against measured force and moment, axis by axis: root mean square error, and the share explained.

What is measured stands on the sensors alone, no model asked: force is mass times the accelerometer's specific force, or
where there is none the change of the measured velocity less gravity; moment is inertia times the change of the measured
rate, with Euler's coupling. Lever arms of accelerometer and pose sensor are taken out. Both sides are means over 0.1 s.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flight import FlightLog, InputError
from flight.rotations import FloatArray
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights.flight_data import Flight, left_out
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.motors import motor, rotor_speed
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare_all, require_pose
from sysid.estimator.result import CHANNELS, SPAN_S
from sysid.estimator.trajectory.midpoint import Middle
from sysid.estimator.trajectory.model import along
from sysid.estimator.validation import measured
from vehicle import Vehicle, rigid_body

IMU = "imu_errors"
"""The effect that says where the accelerometer sits."""


@dataclass(frozen=True, slots=True)
class WrenchErrors:
    """Result of `wrench_errors`; force in N, moment in N m, body axes."""

    size: FloatArray
    """(6,) root mean square of what was measured: the error of a model without any force or moment."""
    rmse: Mapping[str, FloatArray]
    """Model: (6,) root mean square of measured less modelled."""
    explained: Mapping[str, FloatArray]
    """Model: (6,) one less the mean squared error over the variance of what was measured; negative: worse than a
    constant."""
    accelerometer: bool
    """Whether force is the accelerometer's on every flight."""
    left_out: tuple[str, ...]
    """In words, stretches of the flights that were not judged, and why."""
    not_converged: tuple[str, ...]
    """In words, models under which the states of the flights did not converge, so that their clocks may be off."""

    def as_dict(self) -> dict[str, Any]:
        """The figures as plain JSON values."""

        def by_channel(values: FloatArray) -> dict[str, float]:
            return dict(zip(CHANNELS, values.tolist(), strict=True))

        return {
            "means_over_s": SPAN_S,
            "force_by_accelerometer": self.accelerometer,
            "measured_rms": by_channel(self.size),
            "left_out": list(self.left_out),
            "not_converged": list(self.not_converged),
            "models": {
                name: {"rmse": by_channel(rmse), "explained": by_channel(self.explained[name])}
                for name, rmse in self.rmse.items()
            },
        }


def wrench_errors(
    logs: Sequence[FlightLog], models: Mapping[str, Vehicle], options: Options | None = None
) -> WrenchErrors:
    """Errors of each model over all flights together.

    Mass, inertia, the places of the sensors and the clocks of gyro and accelerometer are the first model's for all, so
    that a model cannot look better by being heavier. Rotor speed is read as late as each model finds it.

    Raises:
        InputError: no flight, no model, or a log that cannot be used.
    """
    if not logs or not models:
        raise InputError("comparing forces needs at least one flight and one model")
    options = replace(options or Options(), use_accelerometer=True)
    first = next(iter(models.values()))
    flights = prepare_all(logs, options, models.values())
    require_pose(flights)
    found = measured.delays(flights, models, options)
    truth, modelled = [], {name: [] for name in models}
    for raw in flights:
        flight = measured.on_time(raw, found.first)
        at = measured.states(flight, logs[flight.log_index], PoseSensor.of(first))
        seen, mid = measured.acceleration(flight, at)
        truth.append(_means(at_centre_of_mass(seen, flight, mid, first), flight, first))
        for name, model in models.items():
            driven = motor.driven(rotor_speed.aligned(raw, found.late[name]), model)
            modelled[name].append(_means(along(model, driven, mid), flight, first))
    both = np.concatenate(truth)
    left = {name: both - np.concatenate(parts) for name, parts in modelled.items()}
    square = {name: (values**2).mean(axis=0) for name, values in left.items()}
    spread = np.maximum(both.var(axis=0), np.finfo(float).tiny)
    return WrenchErrors(
        np.sqrt((both**2).mean(axis=0)),
        {name: np.sqrt(values) for name, values in square.items()},
        {name: 1.0 - values / spread for name, values in square.items()},
        all(flight.has_accelerometer for flight in flights),
        left_out(flights),
        found.not_converged,
    )


def at_centre_of_mass(seen: FloatArray, flight: Flight, mid: Middle, vehicle: Vehicle) -> FloatArray:
    """(k, 6) with the specific force of the accelerometer, brought to the centre of mass, where there is one."""
    if not flight.has_accelerometer:
        return seen
    arm = np.zeros(3)
    if IMU in vehicle.effects:
        arm = np.array([vehicle.value(f"{IMU}.place_{axis}_m") for axis in "xyz"])
    rate, turning = mid.rate_body_rad_s, seen[:, 3:]
    lever = np.cross(turning, arm) + np.cross(rate, np.cross(rate, arm))
    return np.concatenate([flight.specific_force_body_m_s2 - lever, turning], axis=1)


def _means(acceleration: FloatArray, flight: Flight, vehicle: Vehicle) -> FloatArray:
    """(m, 6) force and moment as means over `SPAN_S`; Euler's coupling, the same on both sides, is left out."""
    body = rigid_body(vehicle)
    wrench = np.concatenate([body.mass_kg * acceleration[:, :3], acceleration[:, 3:] @ body.inertia_kg_m2], axis=1)
    return means_over(wrench, 0.5 * (flight.time_s[1:] + flight.time_s[:-1]), SPAN_S)
