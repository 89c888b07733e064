"""Prediction: from given states, rotor speeds as measured, which motion follows over a horizon?"""

from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.estimator.trajectory.midpoint import gravity_world
from sysid.estimator.trajectory.model import surroundings
from sysid.estimator.trajectory.states import States
from sysid.estimator.validation.closed_loop import ClosedLoop
from sysid.logs.checks.payload import as_flown
from vehicle import Vehicle, acceleration


@dataclass(frozen=True, slots=True)
class Predictor:
    """What is taken to act on the vehicle between a start and its horizon."""

    force: Vehicle | None
    """The vehicle whose force acts; None: the velocity is held."""
    turning: Vehicle | ClosedLoop | None
    """What turns the body: a vehicle's moment, or its controller; None: the rate is held."""
    lasts_s: FloatArray | None = None
    """(6,) time constants with which the disturbance among the starting states (`States.gust`) decays; None: there
    is none."""

    def acceleration(self, flight: Flight, interval: IndexArray, at: States) -> tuple[FloatArray, FloatArray]:
        """(n, 3) acceleration in world axes and (n, 3) angular acceleration in body axes, the disturbance not included.

        Args:
            interval: (n,) whose rotor speeds drive the vehicle.
            at: (n, ...) the states to evaluate at.
        """
        force, turning = np.zeros((2, len(interval), 3))
        if self.force is not None:
            specific_force, turning = _of_vehicle(self.force, flight, interval, at)
            force = rotations.rotate(at.q_world_body, specific_force) + gravity_world(flight)
        if self.turning is None:
            return force, np.zeros_like(force)
        if isinstance(self.turning, ClosedLoop):
            return force, self.turning.angular_acceleration(at)
        if self.turning is not self.force:
            turning = _of_vehicle(self.turning, flight, interval, at)[1]
        return force, turning


def _of_vehicle(vehicle: Vehicle, flight: Flight, interval: IndexArray, at: States) -> tuple[FloatArray, FloatArray]:
    """Specific force and angular acceleration, body axes."""
    around = surroundings(at.position_world_m, at.q_world_body, flight.rotor_acceleration_rad_s2[interval])
    air = rotations.rotate(rotations.conjugate(at.q_world_body), at.velocity_world_m_s)
    flown = as_flown(vehicle, flight.carries_payload)
    return acceleration(flown, air, at.rate_body_rad_s, flight.rotor_speed_rad_s[interval], around)


@dataclass(frozen=True, slots=True)
class Predictions:
    """States predicted from many starts, one column of starts per horizon."""

    start: IndexArray
    """(s,) node each prediction starts from."""
    steps: tuple[int, ...]
    """Intervals from the start to each horizon."""
    states: tuple[States, ...]
    """Per horizon, (s, ...) each."""


def predict(
    flight: Flight, states: States, predictor: Predictor, horizons_s: tuple[float, ...], every_s: float
) -> Predictions:
    """Integrate from the state at every `every_s` (0: at every node) over each horizon, rotor speeds as measured."""
    usual_s = float(np.median(flight.step_s))
    steps = tuple(max(1, round(horizon / usual_s)) for horizon in horizons_s)
    stride = max(1, round(every_s / usual_s))
    starts = np.arange(0, len(flight) - max(steps), stride)
    now = states.picked(starts)
    reached = {}
    for step in range(max(steps)):
        now = _advance(flight, starts + step, now, predictor)
        if step + 1 in steps:
            reached[step + 1] = now
    return Predictions(starts, steps, tuple(reached[s] for s in steps))


def _advance(flight: Flight, interval: IndexArray, now: States, predictor: Predictor) -> States:
    """One interval by the explicit midpoint rule, rotor speed at its mean: as exact as the estimator's own rule."""
    h = flight.step_s[interval][:, None]
    half = _moved(now, now, 0.5 * h, predictor, flight, interval)
    return _moved(now, half, h, predictor, flight, interval)


def _moved(
    origin: States, at: States, h: FloatArray, predictor: Predictor, flight: Flight, interval: IndexArray
) -> States:
    """From `origin` over h with the velocity, rate and accelerations found at `at`."""
    force, turning = predictor.acceleration(flight, interval, at)
    gust = at.gust
    if predictor.lasts_s is not None and gust is not None and origin.gust is not None:
        force, turning = force + gust[:, :3], turning + gust[:, 3:]
        gust = origin.gust * np.exp(-h / predictor.lasts_s)
    return States(
        origin.position_world_m + h * at.velocity_world_m_s,
        origin.velocity_world_m_s + h * force,
        rotations.multiply(origin.q_world_body, rotations.exp(h * at.rate_body_rad_s)),
        origin.rate_body_rad_s + h * turning,
        gust,
    )


def unexplained(flight: Flight, states: States, predictor: Predictor) -> FloatArray:
    """(k, 6) what a predictor leaves of the acceleration over each interval: force per mass in world axes, turning."""
    before, after = states.picked(slice(None, -1)), states.picked(slice(1, None))
    force, turning = predictor.acceleration(flight, np.arange(len(flight) - 1), before.half_way(after))
    h = flight.step_s[:, None]
    left = (after.velocity_world_m_s - before.velocity_world_m_s) / h - force
    return np.concatenate([left, (after.rate_body_rad_s - before.rate_body_rad_s) / h - turning], axis=1)
