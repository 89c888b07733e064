"""Weight balance: over a whole flight the vertical force carries the weight, whatever disturbs the vehicle for a while.

The mean vertical force of a flight is known from how its velocity changed, to a thousandth of gravity. A fit whose
torques are wrong must not trade it away: a moment that the model lacks, in a body whose inertia is held, would be made
up for by a sixth of the thrust. So the mean vertical acceleration that a model leaves unexplained may be as large as
disturbances make it; what is beyond is a stiff residual. In a fit that is right it is zero and has no slope.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks import motor
from sysid.estimator.blocks.motion import FORCE, moved_by_acceleration
from sysid.estimator.chain import Rows
from sysid.estimator.flight_data import Flight
from sysid.estimator.midpoint import middle
from sysid.estimator.model import unexplained
from sysid.estimator.noise import Noise
from sysid.estimator.problem import Point
from sysid.estimator.states import States
from vehicle import Vehicle

FREE_M_S2 = 0.3
"""Mean vertical acceleration that a long flight may leave unexplained, 3 % of gravity: updraughts, a low battery."""
SETTLES_S = 10.0
"""Over a flight of this length disturbances may leave sqrt(2) times as much."""
STIFF_M_S2 = 0.02
"""What is beyond is divided by this: 1 m/s2 more costs 1,250, more than torques can gain by it."""


@dataclass(frozen=True, slots=True)
class Balance:
    """One residual per flight, in units of its stiffness, linear in the shared parameters."""

    residual: FloatArray
    """(flights,)."""
    slopes: FloatArray
    """(flights, p)."""

    @property
    def information(self) -> FloatArray:
        """(p, p)."""
        return self.slopes.T @ self.slopes

    @property
    def gradient(self) -> FloatArray:
        """(p,) of the cost."""
        return self.slopes.T @ self.residual


def balance(flights: Sequence[Flight], point: Point, rows: Sequence[Rows], noise: Noise) -> Balance:
    """The residuals with their slopes, which are taken from the linearised motion; states count as known."""
    residual = residuals(flights, point)
    slopes = [_slopes(f, s, r, noise) for f, s, r in zip(flights, point.states, rows, strict=True)]
    return Balance(residual, np.array(slopes) * (residual != 0.0)[:, None])


def residuals(flights: Sequence[Flight], point: Point) -> FloatArray:
    """(flights,) what the mean unexplained vertical acceleration of each flight has beyond its allowance."""
    return np.array([_residual(f, s, point.vehicle) for f, s in zip(flights, point.states, strict=True)])


def cost(flights: Sequence[Flight], point: Point) -> float:
    """Half the sum of squares of the residuals."""
    return 0.5 * float((residuals(flights, point) ** 2).sum())


def _residual(flight: Flight, states: States, vehicle: Vehicle) -> float:
    force = unexplained(motor.driven(flight, vehicle), states, vehicle)[:, FORCE]
    mean_m_s2 = float(_upward(flight, states, force[:, :, None])[0])
    allowed_m_s2 = FREE_M_S2 * np.sqrt(1.0 + SETTLES_S / flight.step_s.sum())
    return float(np.sign(mean_m_s2)) * max(abs(mean_m_s2) - allowed_m_s2, 0.0) / STIFF_M_S2


def _slopes(flight: Flight, states: States, rows: Rows, noise: Noise) -> FloatArray:
    """(p,) slope of a residual that is not zero."""
    place, factor = moved_by_acceleration(FORCE, flight.step_s, noise.process)
    return -_upward(flight, states, rows.defect_border[:, place] / factor[:, :, None]) / STIFF_M_S2


def _upward(flight: Flight, states: States, body: FloatArray) -> FloatArray:
    """(p,) mean over a flight of the vertical parts of vectors in body axes (k, 3, p)."""
    up = middle(flight, states).R_world_body[:, 2]
    return np.einsum("k,ki,kip->p", flight.step_s, up, body) / flight.step_s.sum()
