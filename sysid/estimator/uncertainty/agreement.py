"""Do the flights agree on one vehicle? Each flight's pull on the joint estimate against what chance would pull."""

from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.solver import Solution, covariance_of

SURE_SIGMA = 5.0
"""A flight is odd when some parameter would move by more than this many standard errors without it ..."""
LEAST_SHARE = 0.05
"""... and by more than this share of its size: slightly wrong forms move a little from flight to flight."""
ROUNDING = 1e-13
"""Less than this share of all information about a parameter is none."""


@dataclass(frozen=True, slots=True)
class Odd:
    """A flight that does not fit the others."""

    flight: str
    name: str
    """The parameter that shows it most."""
    others: float
    """Its value from all other flights, to first order."""
    sigma: float
    """Distance to the joint value in standard errors of the difference."""


def odd_flights(solution: Solution, flights: list[Flight], names: tuple[str, ...], sizes: FloatArray) -> list[Odd]:
    """Flights that pull the estimate further than the scatter of their own blocks explains, the oddest first.

    Args:
        names: the parameters judged: the first of the border.
        sizes: (len(names),) usual size of each.
    """
    if len(flights) < 2 or not names:
        return []
    hessian = solution.hessian
    pulls = [np.array([pull for _, pull in scores]) for scores in solution.scores]
    scatter = [_scatter(p) for p in pulls]
    values = solution.point.values(names)
    found = []
    for i, flight in enumerate(flights):
        own = solution.information[i]
        share = own @ covariance_of(hessian)  # of every pull, this is taken up by the flight
        keeps = np.eye(len(hessian)) - share
        rest = sum((s for j, s in enumerate(scatter) if j != i), np.zeros_like(hessian))
        spread = keeps @ scatter[i] @ keeps.T + share @ rest @ share.T
        without = covariance_without(hessian, own)
        move = (without @ pulls[i].sum(axis=0))[: len(names)]
        std = np.sqrt(np.diag(without @ spread @ without))[: len(names)]
        sigma = np.where(np.abs(move) > LEAST_SHARE * sizes, np.abs(move) / np.maximum(std, 1e-300), 0.0)
        worst = int(np.argmax(sigma))
        if sigma[worst] > SURE_SIGMA:
            found.append(Odd(flight.name, names[worst], float(values[worst] + move[worst]), float(sigma[worst])))
    return sorted(found, key=lambda odd: -odd.sigma)


def covariance_without(hessian: FloatArray, own: FloatArray) -> FloatArray:
    """Covariance by all other flights; zero for a parameter that only this flight shows, which contradicts nothing."""
    rest = hessian - own
    shown = np.diag(rest) > ROUNDING * np.diag(hessian)
    covariance = np.zeros_like(rest)
    covariance[np.ix_(shown, shown)] = covariance_of(rest[np.ix_(shown, shown)])
    return covariance


def _scatter(pulls: FloatArray) -> FloatArray:
    """(p, p) covariance of a flight's summed pull, from the scatter of its blocks about their own mean."""
    blocks = len(pulls)
    about = pulls - pulls.mean(axis=0)
    return about.T @ about * (blocks / max(blocks - 1, 1))
