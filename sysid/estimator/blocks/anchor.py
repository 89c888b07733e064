"""Anchor: without a pose, what keeps the states from wandering off. No measurement, so it has no noise to estimate."""

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.blocks.base import At, Block, Linear
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.states import ATTITUDE, POSITION, VELOCITY

STILL_M_S = 2.0
"""The velocity is taken to be zero within this much: it hovers about in a room. That ties the tilt to gravity."""
MOVING, FIRST, HEADING = slice(0, 3), slice(3, 6), 5
"""Rows: of the velocity; of the first node's position; of the last node's heading."""


class Anchor(Block):
    """Position and heading are free by nature: the first is at the origin, the last has about its guessed heading."""

    name = "anchor"
    order = 3
    level_of_row = (0, 0, 0, 1, 1, 1)

    def measured(self, flight: Flight) -> bool:
        return not flight.has_pose

    def residual(self, at: At) -> FloatArray:
        rows = np.zeros((len(at.flight), 6))
        rows[:, MOVING] = -at.states.velocity_world_m_s / STILL_M_S
        rows[0, FIRST] = -at.states.position_world_m[0]
        rows[-1, HEADING] = -rotations.yaw(at.states.q_world_body[-1])
        return rows

    def linear(self, at: At) -> Linear:
        by_state = at.by_state(6, self.between)
        by_state[:, MOVING, VELOCITY] = -np.eye(3) / STILL_M_S
        by_state[0, FIRST, POSITION] = -np.eye(3)
        by_state[-1, HEADING, ATTITUDE] = -rotations.matrix(at.states.q_world_body[-1])[2]
        return Linear(self.residual(at), (by_state,), np.zeros((len(at.flight), 6, 0)), ())


BLOCK = Anchor()
