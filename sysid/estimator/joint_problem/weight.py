"""Weight balance: over a whole flight the vertical force carries the weight, whatever disturbs the vehicle for a while.

The mean vertical force of a flight is known from how its velocity changed, to a thousandth of gravity. A fit whose
torques are wrong must not trade it away: a moment that the model lacks, in a body whose inertia is held, would be made
up for by a sixth of the thrust. So the mean vertical acceleration that a model leaves unexplained may be as large as
disturbances make it; where all logs lack thrust beyond that, or all have too much, it is a stiff residual of the one
that is nearest to balance. In a fit that is right it is zero and has no slope. Logs of vehicles of different mass, of
which some lack what others have too much, are left to `agreement`. The pieces of one log count together: a short piece
may be in balance by chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.blocks.motion import FORCE, moved_by_acceleration
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.chain import Rows
from sysid.estimator.joint_problem.problem import Point, linearise
from sysid.estimator.joint_problem.unknowns import Unknowns, has_thrust
from sysid.estimator.motors import motor
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import surroundings
from sysid.estimator.trajectory.states import States
from sysid.logs.checks.payload import as_flown
from vehicle import Vehicle, acceleration

FREE_M_S2 = 0.3
"""Mean vertical acceleration that a long flight may leave unexplained, 3 % of gravity: updraughts, a low battery."""
SETTLES_S = 10.0
"""Over a flight of this length disturbances may leave sqrt(2) times as much."""
STIFF_M_S2 = 0.3
"""Scatter of the disturbances from interval to interval: 1 m/s2 beyond costs n / (2 0.3^2) with n intervals in all
flights, so that it grows with the flights as what the torques gain by it."""

REACHED = 0.95
"""Share of the allowance from which on it held a fit: fits that a stiff bound holds end up to 1 % on either side."""

EVERY = 4
"""Nodes of which one is enough for a mean over a flight."""


@dataclass(frozen=True, slots=True)
class Balance:
    """One residual per log, in units of its stiffness, linear in the shared parameters."""

    residual: FloatArray
    """(logs,)."""
    slopes: FloatArray
    """(logs, p)."""

    @property
    def information(self) -> FloatArray:
        """(p, p)."""
        return self.slopes.T @ self.slopes

    @property
    def gradient(self) -> FloatArray:
        """(p,) of the cost."""
        return self.slopes.T @ self.residual


def balance(flights: Sequence[Flight], point: Point, unknowns: Unknowns, noise: Noise) -> Balance:
    """The residuals with their slopes, which are taken from the linearised motion; states count as known."""
    residual = residuals(flights, point, unknowns)
    slopes = np.zeros((len(residual), unknowns.size))
    log, duration_s = _logs(flights)
    per_m_s = _stiffness(flights) / duration_s
    for i in np.flatnonzero(residual[log]).tolist():
        rows = linearise(flights[i], point.states[i], point, unknowns, noise, False)
        slopes[log[i]] += per_m_s[log[i]] * _slopes(flights[i], point.states[i], rows, noise)
    return Balance(residual, slopes)


def residuals(flights: Sequence[Flight], point: Point, unknowns: Unknowns) -> FloatArray:
    """(logs,) mean unexplained vertical acceleration beyond its allowance, of the log that has least of it.

    Zero where not all logs are beyond it to the same side, where no thrust is estimated, which could be traded away, or
    where a flight has no pose, which alone shows what speed was gained.
    """
    if not _acts(flights, unknowns):
        return np.zeros(len(_logs(flights)[1]))
    mean, allowed = _unexplained(flights, point)
    return _least_beyond(mean, allowed) * _stiffness(flights)


def held_m_s2(flights: Sequence[Flight], point: Point, unknowns: Unknowns) -> float | None:
    """Mean unexplained vertical acceleration at which the balance held a fit: positive where thrust lacks.

    That of the log nearest to balance; None where the fit ended without reaching its allowance.
    """
    if not _acts(flights, unknowns):
        return None
    mean, allowed = _unexplained(flights, point)
    reached = np.flatnonzero(_least_beyond(mean, REACHED * allowed))
    return float(mean[reached[0]]) if reached.size else None


def cost(flights: Sequence[Flight], point: Point, unknowns: Unknowns) -> float:
    """Half the sum of squares of the residuals."""
    return 0.5 * float((residuals(flights, point, unknowns) ** 2).sum())


def _stiffness(flights: Sequence[Flight]) -> float:
    """Residual at 1 m/s2 beyond what is allowed."""
    return float(np.sqrt(sum(len(flight) - 1 for flight in flights))) / STIFF_M_S2


def _acts(flights: Sequence[Flight], unknowns: Unknowns) -> bool:
    return has_thrust(unknowns.model) and all(flight.has_pose for flight in flights)


def _least_beyond(mean: FloatArray, bound: FloatArray) -> FloatArray:
    """(logs,) by how much a mean is beyond its bound, of the log where that is least; else zero.

    Zero for all unless all are beyond to the same side.
    """
    beyond = np.sign(mean) * np.maximum(np.abs(mean) - bound, 0.0)
    one_sided = (beyond > 0.0).all() or (beyond < 0.0).all()
    least = np.arange(len(beyond)) == np.argmin(np.abs(beyond))
    return np.where(one_sided & least, beyond, 0.0)


def _unexplained(flights: Sequence[Flight], point: Point) -> tuple[FloatArray, FloatArray]:
    """(logs,) mean vertical acceleration that the model leaves unexplained, and what disturbances may make of it."""
    log, duration_s = _logs(flights)
    lacking_m_s = [_lacking_m_s(f, s, point.vehicle) for f, s in zip(flights, point.states, strict=True)]
    return np.bincount(log, lacking_m_s) / duration_s, FREE_M_S2 * np.sqrt(1.0 + SETTLES_S / duration_s)


def _logs(flights: Sequence[Flight]) -> tuple[np.ndarray, FloatArray]:
    """(flights,) log that each is a piece of, counted from 0, and (logs,) how long the pieces of each last together."""
    _, log = np.unique([flight.log_index for flight in flights], return_inverse=True)
    duration_s = np.array([flight.step_s.sum() for flight in flights])
    return log, np.array([duration_s[log == i].sum() for i in range(log.max() + 1)])


def _lacking_m_s(flight: Flight, states: States, vehicle: Vehicle) -> float:
    """Upward speed that a flight gained and the model does not explain."""
    gained_m_s = states.velocity_world_m_s[-1, 2] - states.velocity_world_m_s[0, 2]
    unexplained_m_s2 = flight.gravity_m_s2 - _upward_force(flight, states, vehicle).mean()
    return float(gained_m_s + flight.step_s.sum() * unexplained_m_s2)


def _upward_force(flight: Flight, states: States, vehicle: Vehicle) -> FloatArray:
    """Vertical force per mass by the model, at every fourth node with the rotor speed of the interval that follows."""
    flight = motor.driven(flight, vehicle)
    nodes = np.arange(0, len(flight) - 1, EVERY)
    q = states.q_world_body[nodes]
    R = rotations.matrix(q)
    force = acceleration(
        as_flown(vehicle, flight.carries_payload),
        (states.velocity_world_m_s[nodes, None] @ R)[:, 0],
        states.rate_body_rad_s[nodes],
        flight.rotor_speed_rad_s[nodes],
        surroundings(states.position_world_m[nodes], q, flight.rotor_acceleration_rad_s2[nodes]),
    )[0]
    return (R[:, 2] * force).sum(axis=1)


def _slopes(flight: Flight, states: States, rows: Rows, noise: Noise) -> FloatArray:
    """(p,) slope of the speed that a flight lacks."""
    place, factor = moved_by_acceleration(FORCE, flight.step_s, noise.process)
    up = middle(flight, states).R_world_body[:, 2]
    body = rows.defect_border[:, place] / factor[:, :, None]
    return -np.einsum("k,ki,kip->p", flight.step_s, up, body)
