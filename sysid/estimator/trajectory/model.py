"""The vehicle's acceleration along a flight, with derivatives by state and parameters."""

from dataclasses import replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.motors import motor
from sysid.estimator.trajectory.midpoint import Middle, middle, rates_of_change
from sysid.estimator.trajectory.states import States
from sysid.logs.checks.payload import PAYLOAD, as_flown
from vehicle import Jacobian, Surroundings, Vehicle, acceleration, acceleration_jacobian


def surroundings(
    position_world_m: FloatArray, q_world_body: FloatArray, rotor_acceleration: FloatArray
) -> Surroundings:
    """What effects may read besides the motion; the ground is at height zero of the world, the sky is open."""
    return Surroundings(
        q_world_body=q_world_body,
        height_m=position_world_m[:, 2],
        ceiling_gap_m=np.full(len(position_world_m), np.inf),
        rotor_acceleration_rad_s2=rotor_acceleration,
    )


def along(vehicle: Vehicle, flight: Flight, mid: Middle) -> FloatArray:
    """(k, 6) specific force and angular acceleration in body axes over each interval."""
    around = surroundings(mid.position_world_m, mid.q_world_body, flight.rotor_acceleration_rad_s2)
    vehicle = as_flown(vehicle, flight.carries_payload)
    both = acceleration(vehicle, mid.velocity_body_m_s, mid.rate_body_rad_s, flight.rotor_speed_rad_s, around)
    return np.concatenate(both, axis=1)


def unexplained(flight: Flight, states: States, vehicle: Vehicle) -> FloatArray:
    """(k, 6) mean acceleration the vehicle does not explain: body axes, m/s2 and rad/s2."""
    mid = middle(flight, states)
    return rates_of_change(states, mid) - along(vehicle, flight, mid)


def slopes_along(vehicle: Vehicle, names: tuple[str, ...], flight: Flight, mid: Middle) -> Jacobian:
    """The same with derivatives by the state and by the named parameters."""
    around = surroundings(mid.position_world_m, mid.q_world_body, flight.rotor_acceleration_rad_s2)
    known = [name for name in names if not name.startswith(_drive_effects(vehicle))]
    vehicle = as_flown(vehicle, flight.carries_payload)
    found = acceleration_jacobian(
        vehicle,
        mid.velocity_body_m_s,
        mid.rate_body_rad_s,
        flight.rotor_speed_rad_s,
        parameters=known,
        surroundings=around,
    )
    if flight.carries_payload is False:
        found.parameters[:, :, [name.startswith(f"{PAYLOAD}.") for name in known]] = 0.0
    if len(known) == len(names):
        return found
    # the motors act through rotor speed: chain rule
    by_speed, by_change = motor.slopes(flight, vehicle, names)
    columns = found.rotor_speed @ by_speed + found.rotor_acceleration @ by_change
    columns[:, :, [names.index(name) for name in known]] += found.parameters
    return replace(found, parameters=columns)


def _drive_effects(vehicle: Vehicle) -> tuple[str, ...]:
    return tuple({name.split(".")[0] + "." for name in motor.parameters(vehicle)}) or ("\0",)
