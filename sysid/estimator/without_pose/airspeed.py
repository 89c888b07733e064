"""The speed that the accelerometer shows over a few seconds, and how far a fit may be off for it is badly known.

Thrust depends on the air speed: inflow takes from it in a climb, and sideways speed adds to it. The noise model takes
that for noise, but what goes with the commands moves parameters: inertia about z came out 6 % small in RotorPy's
flights that climb as they yaw. So the climb drives the model. What is left, an error of the climb and effects of usual
size that are not in the model, is stated by how far it would have moved each parameter.
"""

from dataclasses import replace

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.problem import Point, with_values
from sysid.estimator.trajectory.model import along
from sysid.estimator.trajectory.states import States
from sysid.estimator.without_pose import rotors
from sysid.estimator.without_pose.sensing import resting
from vehicle import Vehicle, effects
from vehicle.sizes import usual

SPAN_S = 4.0
"""Speeds that last longer are not told from errors of attitude."""
CAUSES = ("inflow_linear", "translational_lift")
"""Along the thrust; drag sideways hardly moves anything that is estimated."""
CLIMB_OFF = 0.2
"""Share of the climb that may be wrong: wind, attitude, and what lasts longer."""


def velocity_body_m_s(flight: Flight, states: States) -> FloatArray:
    """(k, 3) over each interval, less its mean over `SPAN_S` in the world: the specific force integrated.

    Args:
        states: whose attitude is that of the gyro.
    """
    from scipy.ndimage import uniform_filter1d

    q_world_body = states.q_world_body[:-1]
    force = rotations.rotate(q_world_body, flight.specific_force_body_m_s2)
    gained = np.cumsum((force - [0.0, 0.0, flight.gravity_m_s2]) * flight.step_s[:, None], axis=0)
    width = max(1, round(SPAN_S / float(np.median(flight.step_s))))
    lively = gained - uniform_filter1d(gained, width, axis=0, mode="nearest")
    return rotations.rotate(rotations.conjugate(q_world_body), lively)


def with_climb(flight: Flight, states: States) -> Flight:
    """The flight with the speed along its thrust."""
    return replace(flight, climb_m_s=velocity_body_m_s(flight, states)[:, 2])


def felt(flight: Flight, point: Point, states: States) -> list[FloatArray]:
    """(k, 6) of each cause: specific force and angular acceleration that are not in the model."""
    driven = rotors.driven(flight, point.vehicle, point.sensors)
    still, velocity = resting(flight), velocity_body_m_s(flight, states)
    moving = replace(still, velocity_world_m_s=velocity, velocity_body_m_s=velocity)
    hover_rad_s = float(np.sqrt(np.mean(driven.rotor_speed_rad_s**2)))
    found = []
    for cause in CAUSES:
        vehicle = _with_usual(point.vehicle, cause, hover_rad_s)
        there, without = (
            [along(v, driven, mid) for mid in (moving, still)] for v in (vehicle, vehicle.without_effect(cause))
        )
        known = CLIMB_OFF * (there[0] - there[1] - without[0] + without[1])
        found.append(known if cause in point.vehicle.effects else there[0] - without[0])
    return found


def _with_usual(vehicle: Vehicle, effect: str, hover_rad_s: float) -> Vehicle:
    """The vehicle with an effect as it was fitted, or as large as is usual."""
    if effect in vehicle.effects:
        return vehicle
    specs = effects.find(effect).parameters
    names = tuple(f"{effect}.{spec.name}" for spec in specs)
    return with_values(
        vehicle.with_effect(effect), names, np.array([usual(spec, vehicle, hover_rad_s) for spec in specs])
    )
