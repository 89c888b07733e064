"""What gyro and accelerometer of a flight without a pose show over each interval, less what the vehicle says.

The accelerometer reads the specific force itself, so that neither attitude nor velocity is among the unknowns: the
gyro's means are the body rate, and the air is taken to stand still but for the climb that the accelerometer shows
(`airspeed`). What drag and wind make of that is part of the disturbances, whose correlation in time the fit estimates
(`coloured`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights import clocks
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.midpoint import Middle
from sysid.estimator.trajectory.model import along, slopes_along
from sysid.estimator.without_pose import rotors
from vehicle import Vehicle

PLACE = tuple(f"accelerometer_place_{axis}_m" for axis in "xyz")
"""Of the accelerometer, from the centre of mass; the logs share it."""
BIAS = tuple(f"accelerometer_bias_{axis}_m_s2" for axis in "xyz")
TURN = tuple(f"accelerometer_turn_{axis}_rad" for axis in "xy")
"""By how much it is turned against the gyro's body axes, about x and y; a turn about z hardly shows."""
PRIOR_STD = {**dict.fromkeys(PLACE, 0.1), **dict.fromkeys(BIAS, 0.3), **dict.fromkeys(TURN, 0.05)}
"""Widths of the weak priors on these."""
FELT, TURNED = slice(0, 3), slice(3, 6)
"""Channels of the accelerometer and of the gyro."""
OPEN_AIR_M = 100.0
"""Height without any ground effect."""
PASSING_M_S = np.array([6.0, 4.0, -3.0])
"""An air speed that flights without a pose may have had."""
LOW = 2e-3
"""A height that they may have had, as a share of the open air's."""


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """Of one flight."""

    left: FloatArray
    """(k, 6) mean specific force and angular acceleration over each interval less the vehicle's, m/s2 and rad/s2."""
    by: FloatArray
    """(k, 6, p) derivative of what the vehicle says by the unknowns."""


def own_names(log: int) -> tuple[str, ...]:
    """Of the accelerometer's errors in one log."""
    return tuple(f"{name}[{log}]" for name in (*BIAS, *TURN))


def delay_names(flight: Flight) -> tuple[str, str]:
    """Of what drives the rotors, and of the accelerometer; both against the gyro."""
    return tuple(clocks.delay_name(q, flight.log_index) for q in (rotors.driving(flight), clocks.ACCELEROMETER))  # type: ignore[return-value]


def left(flight: Flight, vehicle: Vehicle, values: Mapping[str, float]) -> FloatArray:
    """(k, 6) as `Shown.left`.

    Args:
        values: of the sensors' places, errors and delays, by name; zero where one is not among them.
    """
    mid = climbing(flight)
    felt, turned = (
        along(vehicle, rotors.driven(flight, vehicle, v), mid) for v in (_when_felt(flight, values), values)
    )
    return measured(flight) - _seen(flight, mid, felt, turned, values)


def shown(
    flight: Flight, vehicle: Vehicle, names: Sequence[str], model: tuple[str, ...], values: Mapping[str, float]
) -> Shown:
    """What is left, and its derivatives by the unknowns of these names, of which `model` are the vehicle's."""
    mid, place = climbing(flight), {name: i for i, name in enumerate(names)}
    felt, turned = (_response(flight, vehicle, model, v) for v in (_when_felt(flight, values), values))
    by = np.zeros((len(mid.step_s), 6, len(names)))
    own, drive = own_names(flight.log_index), [place[name] for name in model]
    by[:, FELT, drive], by[:, TURNED, drive] = felt.by[:, FELT, :-1], turned.by[:, TURNED, :-1]
    drive_name, force_name = (place[name] for name in delay_names(flight))
    by[:, FELT, drive_name], by[:, TURNED, drive_name] = felt.by[:, FELT, -1], turned.by[:, TURNED, -1]
    by[:, FELT, force_name] = -felt.by[:, FELT, -1]
    for i, name in enumerate(PLACE):
        by[:, FELT, place[name]] = _at_place(felt.value[:, TURNED], mid.rate_body_rad_s, np.eye(3)[i])
    by[:, [0, 1, 2], [place[name] for name in own[:3]]] = 1.0
    by[:, 0, place[own[4]]], by[:, 1, place[own[3]]] = -felt.value[:, 2], felt.value[:, 2]
    by[:, FELT], by[:, TURNED] = _as_logged(by[:, FELT], flight), about_nodes(by[:, TURNED])
    return Shown(measured(flight) - _seen(flight, mid, felt.value, turned.value, values), by)


@dataclass(frozen=True, slots=True, eq=False)
class _Response:
    """Specific force and angular acceleration of the vehicle over each interval."""

    value: FloatArray
    """(k, 6)."""
    by: FloatArray
    """(k, 6, p + 1) derivatives by the vehicle's parameters, and by the delay of what drives the rotors."""


def _response(flight: Flight, vehicle: Vehicle, model: tuple[str, ...], values: Mapping[str, float]) -> _Response:
    turned = rotors.turned(flight, vehicle, model, values)
    body = tuple(name for name in model if name not in turned.names)
    said = slopes_along(vehicle, body, turned.flight, climbing(flight))
    of_rotors = said.rotor_speed @ turned.by_speed + said.rotor_acceleration @ turned.by_acceleration
    by = np.empty((len(said.value), 6, len(model) + 1))
    by[:, :, [model.index(name) for name in body]] = said.parameters
    by[:, :, [*(model.index(name) for name in turned.names), len(model)]] = of_rotors
    return _Response(said.value, by)


def _when_felt(flight: Flight, values: Mapping[str, float]) -> dict[str, float]:
    """The delays when the accelerometer is read: what it shows is older than what the gyro shows.

    The model is moved, not the readings: moved readings have less noise, and a fit is drawn to that.
    """
    drive, force = delay_names(flight)
    return {**values, drive: values.get(drive, 0.0) - values.get(force, 0.0)}


def resting(flight: Flight) -> Middle:
    """The motion half-way through each interval, as far as it acts on the vehicle: the rate, in air that rests."""
    k = len(flight) - 1
    still = np.zeros((k, 3))
    rate = 0.5 * (flight.rate_body_rad_s[:-1] + flight.rate_body_rad_s[1:])
    level = np.tile([1.0, 0.0, 0.0, 0.0], (k, 1))
    high, axes = np.tile([0.0, 0.0, OPEN_AIR_M], (k, 1)), np.broadcast_to(np.eye(3), (k, 3, 3))
    gravity = np.array([0.0, 0.0, -flight.gravity_m_s2])
    return Middle(flight.step_s[:, None], axes, still, level, high, still, still, rate, gravity)


def climbing(flight: Flight) -> Middle:
    """The same in air that is passed along the thrust, as far as that is known."""
    if flight.climb_m_s is None:
        return resting(flight)
    velocity = flight.climb_m_s[:, None] * [0.0, 0.0, 1.0]
    return replace(resting(flight), velocity_world_m_s=velocity, velocity_body_m_s=velocity)


def shown_at_rest(flight: Flight, vehicle: Vehicle, names: tuple[str, ...]) -> tuple[str, ...]:
    """Of parameters of the vehicle's motion, those whose derivative an unknown velocity and height hardly change.

    The others would be judged by an air speed that nobody measured.
    """
    driven = rotors.driven(flight, vehicle, {})
    still = resting(flight)
    away = replace(
        still,
        velocity_world_m_s=still.velocity_world_m_s + PASSING_M_S,
        velocity_body_m_s=still.velocity_body_m_s + PASSING_M_S,
        position_world_m=still.position_world_m * LOW,
    )
    at_rest, passing = (
        np.sqrt((slopes_along(vehicle, names, driven, mid).parameters ** 2).sum(axis=0)) for mid in (still, away)
    )
    known = (at_rest >= 0.5 * passing).all(axis=0)
    return tuple(name for name, so in zip(names, known, strict=True) if so)


def measured(flight: Flight) -> FloatArray:
    """(k, 6) mean specific force and angular acceleration over each interval by the IMU."""
    turning = np.diff(flight.rate_body_rad_s, axis=0) / _apart_s(flight)[:, None]
    return np.concatenate([flight.specific_force_body_m_s2, turning], axis=1)


def _apart_s(flight: Flight) -> FloatArray:
    """(k,) from the middle of what a reading of the gyro is the mean of to the next one's (`Stretch.around_nodes`).

    Steps between nodes are that only where they are even: of logs that lost 20 % of their rows at random inertias came
    out 4 to 9 % small.
    """
    before_s = 0.0 if flight.lead_in is None else float(flight.lead_in.step_s[-1])
    node_s = flight.time_s
    edge_s = np.concatenate([[node_s[0] - 0.5 * before_s], 0.5 * (node_s[1:] + node_s[:-1]), node_s[-1:]])
    return np.diff(0.5 * (edge_s[1:] + edge_s[:-1]))


def _seen(flight: Flight, mid: Middle, felt: FloatArray, turned: FloatArray, values: Mapping[str, float]) -> FloatArray:
    """(k, 6) what the sensors would show of the body's acceleration (k, 6) when each is read."""
    bias_x, bias_y, bias_z, turn_x, turn_y = (values.get(name, 0.0) for name in own_names(flight.log_index))
    place = np.array([values.get(name, 0.0) for name in PLACE])
    seen = np.concatenate([felt[:, FELT], about_nodes(turned[:, TURNED])], axis=1)
    seen[:, FELT] += _at_place(felt[:, TURNED], mid.rate_body_rad_s, place) + np.array([bias_x, bias_y, bias_z])
    seen[:, 0] -= turn_y * felt[:, 2]
    seen[:, 1] += turn_x * felt[:, 2]
    seen[:, FELT] = _as_logged(seen[:, FELT], flight)
    return seen


def _as_logged(felt: FloatArray, flight: Flight) -> FloatArray:
    """(k, 3, ...) what the accelerometer feels, through the low-pass that its log names; nothing undoes it there."""
    low_pass = flight.accelerometer_low_pass
    return felt if low_pass is None else low_pass.means(felt, float(np.median(flight.step_s)))


def about_nodes(turning: FloatArray) -> FloatArray:
    """(k, 3, ...) means over intervals as a gyro shows them whose readings are means about the nodes (`blocks.gyro`).

    That is a running mean over one interval more, here by its first term: left out, motors of 40 ms seemed 0.1 to 0.3 %
    slower at intervals of 6 ms.
    """
    around = np.concatenate([turning[:1], turning, turning[-1:]])
    return turning + np.diff(around, 2, axis=0) / 24.0


def _at_place(turning: FloatArray, rate: FloatArray, place_m: FloatArray) -> FloatArray:
    """(k, 3) what turning adds to the specific force beside the centre of mass.

    The model's turning, not the gyro's: noise of a gyro's slope would make every place look too small.
    """
    return np.cross(turning, place_m) + np.cross(rate, np.cross(rate, place_m))


def with_delays(flight: Flight) -> Flight:
    """The flight with the delay of its commands to be estimated: the noise model tells it from a motor lag."""
    return replace(flight, commands_on_time=False)
