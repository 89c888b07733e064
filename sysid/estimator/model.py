"""The vehicle seen by the estimator: which of its parameters flights can show, and its acceleration along a flight."""

from dataclasses import replace

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid.estimator import drive
from sysid.estimator.drive import drive_parameters
from sysid.estimator.flight_data import Flight
from sysid.estimator.midpoint import Middle
from sysid.estimator.sensors import SENSOR_NAMES
from sysid.logs.payload import PAYLOAD, as_flown
from vehicle import Jacobian, Surroundings, Vehicle, acceleration, acceleration_jacobian, effects

ALWAYS_HELD = ("mass_kg", "rotor_radius_m", "air_density_kg_m3")
"""Pose and rotor speed show forces only per mass, and thrust only per air density and disk area."""


def model_parameters(vehicle: Vehicle, by_command: bool = False) -> tuple[str, ...]:
    """Parameters that act on the motion and can be told from it; the motors' only when driven by commands."""
    names = [name for name in vehicle.parameters if name.startswith("inertia_")]
    for effect in vehicle.effects:
        if effects.find(effect).stage.name not in (*drive.STAGES, "SENSOR"):
            names += [f"{effect}.{spec.name}" for spec in effects.find(effect).parameters]
    return (*names, *drive_parameters(vehicle)) if by_command else tuple(names)


def chosen_names(
    vehicle: Vehicle, free: tuple[str, ...] | None, held: tuple[str, ...], by_command: bool = False
) -> tuple[str, ...]:
    """Names of the model's parameters to estimate.

    Raises:
        InputError: a name is not a parameter of the vehicle, or cannot be told from flights.
    """
    possible = model_parameters(vehicle, by_command)
    for name in (*(free or ()), *held):
        vehicle.parameter(name)
    for name in free or ():
        if name in ALWAYS_HELD:
            raise InputError(
                f"{name} cannot be estimated from pose and rotor speed: only ratios to it show; weigh or measure it"
            )
        if name not in possible and name not in SENSOR_NAMES:
            raise InputError(f"{name} does not act on the motion when rotor speed is measured; hold it")
    wanted = possible if free is None else tuple(name for name in possible if name in free)
    return tuple(name for name in wanted if name not in held)


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
    by_speed, by_change = drive.slopes(flight, vehicle, names)
    columns = found.rotor_speed @ by_speed + found.rotor_acceleration @ by_change
    columns[:, :, [names.index(name) for name in known]] += found.parameters
    return replace(found, parameters=columns)


def _drive_effects(vehicle: Vehicle) -> tuple[str, ...]:
    return tuple({name.split(".")[0] + "." for name in drive_parameters(vehicle)}) or ("\0",)
