"""What is held because a fit does not settle with it free, and what that leaves open of all that goes along with it.

Where flights tell a parameter only together with another one, the fit wanders along the combination that they do not
tell. With the one held the other comes out, as right as the held value is: its standard error is the one that it would
have were that value exact. So the held one is a consider parameter (Bierman, Factorization Methods for Discrete
Sequential Estimation, 1977, chapter 8): all others move with it as far as it may be off.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.joint_problem.solver import Solution
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.uncertainty.gyro_feedback import shifts
from vehicle import Vehicle

CONFOUNDED = 0.9
"""Correlation of two estimates from which on the flights tell one combination of them, hardly each by itself."""
LAST_STEPS = 6
"""Steps of a fit that did not converge by which it is judged what moved most."""


@dataclass(frozen=True, slots=True)
class Unsettled:
    """A parameter that is held and that the flights tell only together with another."""

    name: str
    held: float
    """Value it is held at, where the fit began."""
    unit: str
    confounded: tuple[str, ...]
    """Names of those that these flights tell only together with it."""
    off: float
    """How far the held value may be off: the standard error with it free, and how far away it was in the last steps."""
    moves: Mapping[str, float]
    """By name, how far every other shared parameter moves with it then."""
    why: str = "did not settle"
    """What it did with it free."""

    @property
    def sentence(self) -> str:
        return (
            f"{self.name} {self.why} and was held at {self.held:.4g} {self.unit}, where the fit began. These "
            f"flights tell it only together with {' and '.join(self.confounded)}, as right as that value; intervals "
            f"allow for its being {self.off:.2g} {self.unit} off. Measure it, or fly quicker manoeuvres that excite it"
        )


def least_settled(solution: Solution, unknowns: Unknowns, vehicle: Vehicle) -> Unsettled | None:
    """The vehicle's parameter that moved most over the last steps, in standard errors; None if it is not confounded.

    Args:
        vehicle: has the values that parameters are held at.
    """
    m = len(unknowns.model)
    std = np.sqrt(np.diag(solution.covariance()))
    values = np.array([i.values[:m] for i in solution.record[-LAST_STEPS:]])
    place = int(np.argmax(np.abs(np.diff(values, axis=0)).sum(axis=0) / std[:m]))
    away = float(np.abs(values[:, place] - vehicle.value(unknowns.model[place])).max())
    return _held(solution, unknowns, vehicle, place, away, "did not settle")


def not_identifiable(solution: Solution, unknowns: Unknowns, vehicle: Vehicle, name: str) -> Unsettled | None:
    """The vehicle's parameter of this name, which is to be held for its error is too large; None as above."""
    if name not in unknowns.model:
        return None
    place = unknowns.model.index(name)
    away = abs(solution.point.value(name) - vehicle.value(name))
    return _held(solution, unknowns, vehicle, place, away, "is not identifiable")


def _held(
    solution: Solution, unknowns: Unknowns, vehicle: Vehicle, place: int, away: float, why: str
) -> Unsettled | None:
    """Args: away: how far from the vehicle's value it was."""
    m = len(unknowns.model)
    covariance = solution.covariance()
    std = np.sqrt(np.diag(covariance))
    strong = np.abs(covariance[place, :m]) >= CONFOUNDED * std[:m] * std[place]
    confounded = tuple(unknowns.model[i] for i in np.flatnonzero(strong) if i != place)
    if not confounded:
        return None
    name = unknowns.model[place]
    off = np.zeros(unknowns.size)
    off[place] = np.hypot(std[place], away)
    moves = dict(zip(unknowns.names, shifts(off, covariance)[:, 0].tolist(), strict=True))
    unit, held = vehicle.parameter(name).unit, vehicle.value(name)
    return Unsettled(name, held, unit, confounded, float(off[place]), moves, why)


def variances(held: Sequence[Unsettled], unknowns: Unknowns) -> FloatArray:
    """(p,) of what may be off of each shared parameter because others are held."""
    moved = np.array([[one.moves[name] for name in unknowns.names] for one in held])
    return (moved.reshape(len(held), unknowns.size) ** 2).sum(axis=0)
