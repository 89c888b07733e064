"""What a flight's own sensors say of the motion: states, and the acceleration between them.

No model is asked but for the clocks: streams are read as late as a fit of the states finds them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import FlightLog, rotations
from flight.rotations import FloatArray
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights import clocks
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.identification import not_settled, smooth
from sysid.estimator.joint_problem.unknowns import nuisances
from sysid.estimator.motors import rotor_speed
from sysid.estimator.options import Options
from sysid.estimator.trajectory.midpoint import Middle, middle, rates_of_change
from sysid.estimator.trajectory.states import States, first_guess
from vehicle import Vehicle

VELOCITY = "velocity_world_m_s"
FEWEST = 2
"""A column with fewer finite rows is taken as absent."""


@dataclass(frozen=True, slots=True)
class Delays:
    """Of the streams of all logs, as each model finds them."""

    late: Mapping[str, Mapping[str, float]]
    """Model, name of the delay: seconds."""
    not_converged: tuple[str, ...]
    """In words, models under which the states did not converge, so that delays may be off."""

    @property
    def first(self) -> Mapping[str, float]:
        """The first model's."""
        return next(iter(self.late.values()))


def delays(flights: Sequence[Flight], models: Mapping[str, Vehicle], options: Options) -> Delays:
    """Delays of the streams of all logs, estimated with the states; the vehicles stay as they are."""
    late, open_ = {}, []
    for name, vehicle in models.items():
        found = smooth(list(flights), vehicle, options)
        late[name] = {delay: found.point.sensors[delay] for delay in nuisances(flights, "pose", vehicle)[0].delay}
        open_ += not_settled(name, found)
    return Delays(late, tuple(open_))


def on_time(flight: Flight, late: Mapping[str, float]) -> Flight:
    """The flight with its rotor speed or command, gyro and accelerometer read as late as `delays` has them."""
    readings = dict(flight.readings)
    for quantity, between in ((clocks.GYRO, False), (clocks.ACCELEROMETER, True)):
        if quantity in flight.streams:
            readings[quantity] = readings[quantity] + clocks.moved_reading(quantity, flight, late, between=between)[0]
    return rotor_speed.aligned(replace(flight, readings=readings), late)


def states(flight: Flight, log: FlightLog, sensor: PoseSensor) -> States:
    """The states as measured, at the centre of mass: the lever arm of the pose sensor is taken out.

    Position and attitude are the pose sensor's own. Velocity is the log's where it has one, the rate the gyro's; what
    was not measured comes from local cubic fits to the pose.

    Args:
        flight: a stretch of `log` with a pose.
        sensor: where the pose sensor sits.
    """
    smooth = first_guess(flight, sensor.offset_body_m, sensor.q_body_sensor)
    q = rotations.multiply(flight.q_world_sensor, rotations.conjugate(sensor.q_body_sensor))
    rate = np.where(np.isfinite(flight.rate_body_rad_s), flight.rate_body_rad_s, smooth.rate_body_rad_s)
    measured = replace(
        smooth,
        position_world_m=flight.position_world_m - rotations.rotate(q, sensor.offset_body_m),
        q_world_body=q,
        rate_body_rad_s=rate,
    )
    if not _sampled(log):
        return measured
    velocity = _at(flight.time_s, log.time_s, log.vector(VELOCITY))
    lever = rotations.rotate(q, np.cross(rate, sensor.offset_body_m))
    return replace(measured, velocity_world_m_s=velocity - lever)


def fitted(flight: Flight, log: FlightLog) -> tuple[str, ...]:
    """What of `states` comes from fits to the pose, at some instants at least, because it was not measured there."""
    rate = () if np.isfinite(flight.rate_body_rad_s).all() else ("rate",)
    return rate if _sampled(log) else ("velocity", *rate)


def acceleration(flight: Flight, at: States) -> tuple[FloatArray, Middle]:
    """(k, 6) specific force and angular acceleration over each interval, body axes; and the motion half-way."""
    mid = middle(flight, at)
    return rates_of_change(at, mid), mid


def _sampled(log: FlightLog) -> bool:
    """Whether the log has a velocity, not only a column for it."""
    return log.has(VELOCITY) and int(np.isfinite(log.vector(VELOCITY)).all(axis=1).sum()) >= FEWEST


def _at(time_s: FloatArray, sampled_s: FloatArray, values: FloatArray) -> FloatArray:
    """Samples brought to other instants; rows that are not finite were not sampled."""
    rows = np.isfinite(values).all(axis=1)
    return np.stack([np.interp(time_s, sampled_s[rows], column) for column in values[rows].T], axis=1)
