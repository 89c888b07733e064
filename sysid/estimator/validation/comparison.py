"""Models against measurements on flights: open-loop prediction error by horizon, and residual force and torque."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flight import FlightLog, InputError, Progress, rotations, silent, within
from flight.rotations import FloatArray
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights.flight_data import Flight, left_out
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.identification import not_settled, smooth
from sysid.estimator.joint_problem.solver import Solution
from sysid.estimator.motors import motor, rotor_speed
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare_all, require_pose
from sysid.estimator.result import CHANNELS, LARGE_FORCE_M_S2, LARGE_TORQUE_RAD_S2, SPAN_S
from sysid.estimator.trajectory.midpoint import Middle, middle
from sysid.estimator.trajectory.model import unexplained
from sysid.estimator.trajectory.states import States
from sysid.estimator.validation.observed import Observed, observed, wrench_at
from sysid.estimator.validation.prediction import Predictor, predict
from sysid.logs.checks.payload import as_flown
from vehicle import Vehicle, rigid_body

SCHEMA_VERSION = 1
"""Version of `Comparison.as_dict`."""

HORIZONS_S = (0.1, 0.2, 0.5, 1.0)
JUDGED_S = 0.5
"""After how long predictions are compared in a verdict."""
QUANTITIES = {"position": "m", "velocity": "m/s", "attitude": "rad", "rate": "rad/s"}
"""What prediction errors are given in; the unit of each."""

SMOOTHING_STEPS = 20
"""Steps for the states of one model, where the options say nothing else."""
FIRST_SHARE = 0.4
"""Of the time, for the first states: all that follow start from them."""
REFERENCE_LOOSENESS = 2.0
"""The reference states trust the first model this much less than its own residuals suggest, so as to take no side."""


@dataclass(frozen=True, slots=True)
class Residual:
    """What one model leaves unexplained on one flight."""

    time_s: FloatArray
    """(k,) middle of each interval."""
    wrench: FloatArray
    """(k, 6) force (N) and torque (N m) in body axes: measured less modelled."""
    velocity_body_m_s: FloatArray
    """(k, 3)."""
    rate_body_rad_s: FloatArray
    """(k, 3)."""
    position_world_m: FloatArray
    """(k, 3)."""
    sigma: FloatArray
    """(6,) standard deviation that white noise of the estimated strength gives to a mean over `SPAN_S`, N and N m."""
    flight: Flight
    """With the rotor speeds that drove the model."""
    mid: Middle
    """The smoothed motion in the middle of each interval."""
    disturbance: FloatArray | None = None
    """(k, 6) measured disturbance: what the vehicle's observer found, N and N m, body axes, NaN where it did not run.
    None: the log holds none."""

    def means(self) -> FloatArray:
        """(m, 6) wrench as means over `SPAN_S`: what is faster is noise."""
        return means_over(self.wrench, self.time_s, SPAN_S)

    def disturbance_means(self) -> FloatArray | None:
        """(m, 6) measured disturbance as such means; None where the log holds none."""
        return None if self.disturbance is None else means_over(self.disturbance, self.time_s, SPAN_S)


@dataclass(frozen=True, slots=True)
class Deviation:
    """Predicted less measured pose of one model on one flight, one horizon after each start."""

    time_s: FloatArray
    """(k,) when the predictions end."""
    pose: FloatArray
    """(k, 6) of position, m, world axes, and of attitude: the rotation vector from measured to predicted, rad, axes of
    the pose sensor."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Result of `compare`."""

    flights: tuple[Flight, ...]
    models: Mapping[str, Vehicle]
    errors: Mapping[str, Mapping[str, tuple[float, ...]]]
    """Model, quantity: root mean square error at each of `HORIZONS_S`, all flights together."""
    flight_errors: Mapping[str, tuple[float, ...]]
    """Model: root mean square position error at 0.5 s of each flight."""
    residuals: Mapping[str, tuple[Residual, ...]]
    """Model: residual wrench on each flight, the smoothed process noise under that model."""
    deviations: Mapping[str, tuple[tuple[Deviation, ...], ...]]
    """Model: where its predictions ended on each flight, for each of `HORIZONS_S`."""
    predictions: int
    """Number of predictions behind each error."""
    left_out: tuple[str, ...]
    """In words, stretches of the flights that were not judged, and why."""
    not_converged: tuple[str, ...]
    """In words, models under which the states of the flights did not converge, so that their errors may be off."""

    def wrench_rms(self, model: str) -> FloatArray:
        """(6,) root mean square of the residual force (N) and torque (N m) of one model, after a 0.1 s mean."""
        parts = [r.means() for r in self.residuals[model]]
        return np.sqrt((np.concatenate(parts) ** 2).mean(axis=0))

    def disturbance_rms(self) -> FloatArray | None:
        """(6,) root mean square of the measured disturbance after a 0.1 s mean, N and N m; None where no log has it."""
        parts = [r.disturbance_means() for r in next(iter(self.residuals.values()))]
        means = np.concatenate([part for part in parts if part is not None] or [np.empty((0, 6))])
        means = means[np.isfinite(means).all(axis=1)]
        return np.sqrt((means**2).mean(axis=0)) if len(means) else None

    @property
    def remarks(self) -> tuple[str, ...]:
        """A sentence on each model that cannot be these flights' vehicle as it is, or whose figures are not settled."""
        said = list(self.not_converged)
        for name, vehicle in self.models.items():
            body, wrench = rigid_body(vehicle), self.wrench_rms(name)
            force = float(wrench[:3].max()) / body.mass_kg
            turning = float(np.abs(np.linalg.solve(body.inertia_kg_m2, np.diag(wrench[3:]))).max())
            if force > LARGE_FORCE_M_S2 or turning > LARGE_TORQUE_RAD_S2:
                said.append(
                    f"{name} leaves {force:.2g} m/s2 and {turning:.2g} rad/s2 unexplained: too much for any missing "
                    "effect. It is another vehicle's model, or units, frames or rotor order are wrong; see "
                    "`goshawk log check FLIGHT --vehicle VEHICLE`"
                )
        return tuple(said)

    def as_dict(self) -> dict[str, Any]:
        """The figures as plain JSON values."""
        disturbance = self.disturbance_rms()
        return {
            "schema": "goshawk-comparison",
            "version": SCHEMA_VERSION,
            "flights": [f.name for f in self.flights],
            "horizons_s": list(HORIZONS_S),
            "predictions": self.predictions,
            "remarks": list(self.remarks),
            "left_out": list(self.left_out),
            "measured_disturbance_rms": None
            if disturbance is None
            else dict(zip(CHANNELS, disturbance.tolist(), strict=True)),
            "models": {
                name: {
                    "vehicle": vehicle.name,
                    "effects": list(vehicle.effects),
                    "error_rms": {
                        f"{quantity}_{unit.replace('/', '_')}": list(self.errors[name][quantity])
                        for quantity, unit in QUANTITIES.items()
                    },
                    "position_error_at_0.5_s_by_flight_m": list(self.flight_errors[name]),
                    "residual_rms": dict(zip(CHANNELS, self.wrench_rms(name).tolist(), strict=True)),
                }
                for name, vehicle in self.models.items()
            },
        }


def compare(
    logs: Sequence[FlightLog],
    models: Mapping[str, Vehicle],
    options: Options | None = None,
    *,
    noise: Mapping[str, Noise] | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Judge models on flights, best ones that were not used for fitting.

    Every prediction starts from the state that the smoother finds under the model being judged, so that no model pays
    for the noise of a differentiated pose. Position and attitude errors are taken against the pose sensor itself,
    velocity and rate errors against one set of smoothed states, the same for all models.

    Args:
        noise: by model, levels to start from, as other flights of it had; else those of the model before.

    Raises:
        InputError: no flight, no model, or a log that cannot be used.
    """
    if not logs or not models:
        raise InputError("compare needs at least one flight and one model")
    options = options or Options(max_iterations=SMOOTHING_STEPS)
    flights = prepare_all(logs, options, models.values())
    require_pose(flights)
    longest_s = max(HORIZONS_S)
    touched = left_out(flights)
    flights = [f for f in flights if f.time_s[-1] - f.time_s[0] > 2.0 * longest_s]
    found = [observed(log) for log in logs]
    if not flights:
        raise InputError(f"no flight is longer than {2.0 * longest_s:g} s; predictions need that")
    first = next(iter(models.values()))
    smoothed = smooth(flights, first, options, progress=within(progress, "compare", 0.0, FIRST_SHARE))
    reference = smooth(flights, first, options, process_scale=REFERENCE_LOOSENESS, near=smoothed).point.states
    errors, flight_errors, residuals, deviations = {}, {}, {}, {}
    count, open_ = 0, []
    for i, (name, vehicle) in enumerate(models.items()):
        begun, done = (FIRST_SHARE + (1.0 - FIRST_SHARE) * (i + part) / len(models) for part in (0.0, 0.7))
        near = _at(smoothed, (noise or {}).get(name))
        smoothed = smooth(flights, vehicle, options, near=near, progress=within(progress, "compare", begun, done))
        open_ += not_settled(name, smoothed)
        states = smoothed.point.states
        sensor = PoseSensor.of(vehicle)
        driven = [rotor_speed.aligned(f, smoothed.point.sensors) for f in flights]
        judged = [_errors(*one, vehicle, sensor) for one in zip(driven, states, reference, strict=True)]
        parts, deviations[name] = [found for found, _ in judged], tuple(ended for _, ended in judged)
        errors[name] = {
            quantity: tuple(_rms(np.concatenate([p[quantity][h] for p in parts])) for h in range(len(HORIZONS_S)))
            for quantity in QUANTITIES
        }
        flight_errors[name] = tuple(_rms(p["position"][HORIZONS_S.index(JUDGED_S)]) for p in parts)
        residuals[name] = tuple(
            residual(f, s, vehicle, smoothed.noise.process, found[f.log_index])
            for f, s in zip(driven, states, strict=True)
        )
        count = sum(len(p["position"][0]) for p in parts)
        progress("compare", FIRST_SHARE + (1.0 - FIRST_SHARE) * (i + 1) / len(models))
    return Comparison(
        tuple(flights), dict(models), errors, flight_errors, residuals, deviations, count, touched, tuple(open_)
    )


def _at(near: Solution, noise: Noise | None) -> Solution:
    """A solution with levels of other flights where both have the block; with its own where those had lasting gusts."""
    if noise is None or noise.gusts is not None:
        return near
    levels = {name: noise.levels.get(name, own) for name, own in near.noise.levels.items()}
    return replace(near, noise=replace(near.noise, levels=levels))


def _errors(
    flight: Flight, states: States, reference: States, vehicle: Vehicle, sensor: PoseSensor
) -> tuple[dict[str, list[FloatArray]], tuple[Deviation, ...]]:
    """Per quantity and horizon, the size of the error of each prediction; and where they ended, by horizon."""
    predictions = predict(motor.driven(flight, vehicle), states, Predictor(vehicle, vehicle), HORIZONS_S, every_s=0.1)
    found: dict[str, list[FloatArray]] = {quantity: [] for quantity in QUANTITIES}
    deviations = []
    for steps, predicted in zip(predictions.steps, predictions.states, strict=True):
        end = predictions.start + steps
        position, q = sensor.reading(predicted)
        moved = position - flight.position_world_m[end]
        turned = rotations.log(rotations.multiply(rotations.conjugate(flight.q_world_sensor[end]), q))
        deviations.append(Deviation(flight.time_s[end], np.concatenate([moved, turned], axis=1)))
        found["position"].append(np.linalg.norm(moved, axis=1))
        found["attitude"].append(np.linalg.norm(turned, axis=1))
        found["velocity"].append(
            np.linalg.norm(predicted.velocity_world_m_s - reference.velocity_world_m_s[end], axis=1)
        )
        found["rate"].append(np.linalg.norm(predicted.rate_body_rad_s - reference.rate_body_rad_s[end], axis=1))
    return found, tuple(deviations)


def residual(
    flight: Flight, states: States, vehicle: Vehicle, process: FloatArray, found: Observed | None = None
) -> Residual:
    """What a vehicle leaves unexplained of smoothed states.

    Args:
        process: (6,) strength of the unmodelled acceleration, m/s2 and rad/s2 times root second.
        found: what the vehicle's observer measured on this flight.
    """
    time_s = 0.5 * (flight.time_s[1:] + flight.time_s[:-1])
    mid = middle(flight, states)
    driven = motor.driven(flight, vehicle)
    left = unexplained(driven, states, vehicle)
    body = rigid_body(as_flown(vehicle, flight.carries_payload))
    turning = np.sqrt(body.inertia_kg_m2**2 @ process[3:] ** 2)
    return Residual(
        time_s=time_s,
        wrench=np.concatenate([body.mass_kg * left[:, :3], left[:, 3:] @ body.inertia_kg_m2], axis=1),
        velocity_body_m_s=mid.velocity_body_m_s,
        rate_body_rad_s=mid.rate_body_rad_s,
        position_world_m=mid.position_world_m,
        sigma=np.concatenate([body.mass_kg * process[:3], turning]) / np.sqrt(SPAN_S),
        flight=driven,
        mid=mid,
        disturbance=None if found is None else wrench_at(found, time_s),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))
