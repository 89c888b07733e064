"""The motion half-way between neighbouring states, where the model is evaluated (implicit midpoint rule)."""

from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.states import States


@dataclass(frozen=True, slots=True)
class Middle:
    """What the model needs half-way through each interval."""

    step_s: FloatArray
    """(k, 1)."""
    R_world_body: FloatArray
    """(k, 3, 3)."""
    turn_rad: FloatArray
    """(k, 3) rotation vector from the state before to the state after."""
    q_world_body: FloatArray
    """(k, 4)."""
    position_world_m: FloatArray
    """(k, 3)."""
    velocity_world_m_s: FloatArray
    """(k, 3)."""
    velocity_body_m_s: FloatArray
    """(k, 3)."""
    rate_body_rad_s: FloatArray
    """(k, 3)."""
    gravity_world_m_s2: FloatArray
    """(3,)."""


def middle(flight: Flight, states: States) -> Middle:
    """The mid-states of all intervals."""
    q0, q1 = states.q_world_body[:-1], states.q_world_body[1:]
    turn = rotations.log(rotations.multiply(rotations.conjugate(q0), q1))
    q = rotations.multiply(q0, rotations.exp(0.5 * turn))
    R = rotations.matrix(q)
    velocity = 0.5 * (states.velocity_world_m_s[:-1] + states.velocity_world_m_s[1:])
    return Middle(
        step_s=flight.step_s[:, None],
        R_world_body=R,
        turn_rad=turn,
        q_world_body=q,
        position_world_m=0.5 * (states.position_world_m[:-1] + states.position_world_m[1:]),
        velocity_world_m_s=velocity,
        velocity_body_m_s=(velocity[:, None, :] @ R)[:, 0],
        rate_body_rad_s=0.5 * (states.rate_body_rad_s[:-1] + states.rate_body_rad_s[1:]),
        gravity_world_m_s2=gravity_world(flight),
    )


def gravity_world(flight: Flight) -> FloatArray:
    """(3,) in m/s2, z up."""
    return np.array([0.0, 0.0, -flight.gravity_m_s2])


def rates_of_change(states: States, mid: Middle) -> FloatArray:
    """(k, 6) specific force and angular acceleration that the states show over each interval, body axes."""
    dv = np.diff(states.velocity_world_m_s, axis=0) / mid.step_s - mid.gravity_world_m_s2
    specific_force = (dv[:, None, :] @ mid.R_world_body)[:, 0]
    return np.concatenate([specific_force, np.diff(states.rate_body_rad_s, axis=0) / mid.step_s], axis=1)
