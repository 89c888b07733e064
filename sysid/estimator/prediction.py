"""Open-loop prediction: from smoothed states, driven by measured rotor speed, how far does the model drift?"""

from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flight_data import Flight, IndexArray
from sysid.estimator.midpoint import GRAVITY_WORLD_M_S2
from sysid.estimator.model import surroundings
from sysid.estimator.states import States
from sysid.logs.payload import as_flown
from vehicle import Vehicle, acceleration


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
    flight: Flight, states: States, vehicle: Vehicle, horizons_s: tuple[float, ...], every_s: float
) -> Predictions:
    """Integrate the vehicle from the state at every `every_s` over each horizon, rotor speeds as measured."""
    usual_s = float(np.median(flight.step_s))
    steps = tuple(max(1, round(horizon / usual_s)) for horizon in horizons_s)
    stride = max(1, round(every_s / usual_s))
    vehicle = as_flown(vehicle, flight.carries_payload)
    starts = np.arange(0, len(flight) - max(steps), stride)
    now = States(
        states.position_world_m[starts],
        states.velocity_world_m_s[starts],
        states.q_world_body[starts],
        states.rate_body_rad_s[starts],
    )
    reached = {}
    for step in range(max(steps)):
        now = _advance(flight, starts + step, now, vehicle)
        if step + 1 in steps:
            reached[step + 1] = now
    return Predictions(starts, steps, tuple(reached[s] for s in steps))


def _advance(flight: Flight, interval: IndexArray, now: States, vehicle: Vehicle) -> States:
    """One interval by the explicit midpoint rule, rotor speed at its mean: as exact as the estimator's own rule."""
    h = flight.step_s[interval][:, None]
    half = _moved(now, now, 0.5 * h, _slope(flight, interval, now, vehicle))
    return _moved(now, half, h, _slope(flight, interval, half, vehicle))


def _slope(flight: Flight, interval: IndexArray, at: States, vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Acceleration in world axes and angular acceleration in body axes."""
    around = surroundings(at.position_world_m, at.q_world_body, flight.rotor_acceleration_rad_s2[interval])
    air = rotations.rotate(rotations.conjugate(at.q_world_body), at.velocity_world_m_s)
    force, angular = acceleration(vehicle, air, at.rate_body_rad_s, flight.rotor_speed_rad_s[interval], around)
    return rotations.rotate(at.q_world_body, force) + GRAVITY_WORLD_M_S2, angular


def _moved(origin: States, at: States, h: FloatArray, slope: tuple[FloatArray, FloatArray]) -> States:
    """From `origin` over h with the velocity, rate and accelerations found at `at`."""
    return States(
        origin.position_world_m + h * at.velocity_world_m_s,
        origin.velocity_world_m_s + h * slope[0],
        rotations.multiply(origin.q_world_body, rotations.exp(h * at.rate_body_rad_s)),
        origin.rate_body_rad_s + h * slope[1],
    )
