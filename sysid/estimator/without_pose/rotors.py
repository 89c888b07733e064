"""Rotor speed over each interval, simulated on a finer grid than the nodes: commands step between them, too.

With one command per interval, its mean, a step inside an interval comes too early or too late, and the likelihood has a
kink wherever a delay puts commands on the nodes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight, LeadIn
from sysid.estimator.motors import motor, rotor_speed
from vehicle import Vehicle

FINEST_S = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """Rotor speed of one flight, and what it depends on."""

    flight: Flight
    """With mean rotor speed and acceleration over its intervals."""
    names: tuple[str, ...]
    """Of the motors' parameters that are estimated."""
    by_speed: FloatArray
    """(k, r, len(names) + 1) derivatives of mean speed by these, and by the delay of what drives the rotors."""
    by_acceleration: FloatArray
    """The same of mean acceleration."""


def driving(flight: Flight) -> str:
    """The quantity that drives the model."""
    return rotor_speed.QUANTITY if rotor_speed.QUANTITY in flight.streams else motor.QUANTITY


def driven(flight: Flight, vehicle: Vehicle, values: Mapping[str, float]) -> Flight:
    """The flight with mean rotor speed and acceleration over its intervals.

    Args:
        values: delays, by name.
    """
    if not flight.driven_by_command:
        return rotor_speed.aligned(flight, values)
    parts = _parts(flight)
    return _joined(flight, motor.driven(_refined(flight, parts, values), vehicle), parts)


def turned(flight: Flight, vehicle: Vehicle, model: tuple[str, ...], values: Mapping[str, float]) -> Turned:
    """Args: model: parameters of the vehicle, of which the motors' are differentiated by."""
    if not flight.driven_by_command:
        aligned = rotor_speed.aligned(flight, values)
        speed, change = rotor_speed.by_delay(aligned, values)
        return Turned(aligned, (), speed[:, :, None], change[:, :, None])
    names = tuple(name for name in model if name in motor.parameters(vehicle))
    parts = _parts(flight)
    fine, *slopes = motor.driven_with_slopes(_refined(flight, parts, values), vehicle, names)
    both = zip(slopes, motor.by_delay(fine), strict=True)
    by = [_coarse(np.concatenate([s, late[:, :, None]], axis=2), parts) for s, late in both]
    return Turned(_joined(flight, fine, parts), names, *by)


def _parts(flight: Flight) -> int:
    """Into how many each interval is divided."""
    return max(1, round(float(np.median(flight.step_s)) / FINEST_S))


def _refined(flight: Flight, parts: int, values: Mapping[str, float]) -> Flight:
    """The flight with its intervals divided, its commands as late as they are; only what drives it is of use."""
    share = np.arange(parts) / parts
    time_s = np.append((flight.time_s[:-1, None] + flight.step_s[:, None] * share).ravel(), flight.time_s[-1])
    before = flight.lead_in
    if before is not None:
        step_s, volts = np.repeat(before.step_s / parts, parts), np.repeat(before.battery_v, parts)
        before = LeadIn(step_s, np.repeat(before.rotor_command_rad_s, parts, axis=0), volts)
    fine = replace(
        flight,
        time_s=time_s,
        rotor_command_rad_s=np.repeat(flight.rotor_command_rad_s, parts, axis=0),
        battery_v=np.repeat(flight.battery_v, parts),
        lead_in=before,
    )
    return rotor_speed.aligned(fine, values)


def _joined(flight: Flight, fine: Flight, parts: int) -> Flight:
    """The flight with the mean speed and acceleration of its divided intervals."""
    return replace(
        flight,
        rotor_speed_rad_s=_coarse(fine.rotor_speed_rad_s, parts),
        rotor_acceleration_rad_s2=_coarse(fine.rotor_acceleration_rad_s2, parts),
    )


def _coarse(values: FloatArray, parts: int) -> FloatArray:
    """Means over the parts of each interval."""
    return values.reshape(-1, parts, *values.shape[1:]).mean(axis=1)
