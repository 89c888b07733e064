"""How much of an effect that is not in the model the flights leave possible, and how far that moves the parameters.

Before any flight its size is normal about zero with the usual size as standard deviation. The flights tell of it, too:
one Gauss-Newton step from the optimum estimates it beside the parameters. What both leave possible, its root mean
square, states the error of having left it out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.problem import Point
from sysid.estimator.joint_problem.solver import Score, Solution, robust_covariance
from sysid.estimator.trajectory.states import States
from sysid.estimator.without_pose import airspeed
from sysid.estimator.without_pose.sensing import Shown

WRONG_FORM = 5.0
"""Standard errors by which a lag or filter of another form may mislead such an estimate: in a real flight that hardly
rolls, inflow came out 8 of them wrong, which is then within a 90 % interval."""
NOTHING = 1e-6
"""Information on a cause that no flight shows: a thousand times its usual size."""


def with_causes(flight: Flight, part: Shown, point: Point, states: States) -> Shown:
    """The derivatives by causes of usual size before those by the unknowns."""
    causes = np.stack([*airspeed.felt(flight, point, states)], axis=2)
    return replace(part, by=np.concatenate([causes, part.by], axis=2))


def moves(solution: Solution, information: FloatArray) -> FloatArray:
    """(p, c) by how much leaving out causes of usual size moves the parameters.

    Args:
        information: (c + p, c + p) of the flights and all priors, the causes before the parameters.
    """
    count = len(information) - len(solution.prior_information)
    return solution.covariance() @ information[count:, :count]


def possible(solution: Solution, scores: Sequence[Sequence[Score]], prior: FloatArray, own: int) -> FloatArray:
    """(c, c) second moments of the causes' sizes, in usual ones, by prior and flights.

    Args:
        scores: of the blocks of each flight, the causes before the parameters.
        prior: (c + p, c + p) of all but the flights and the causes' own.
        own: how many of the parameters, the last ones, belong to single logs.
    """
    size, covariance = _estimate(solution, scores, prior, own)
    posterior = np.linalg.inv(np.eye(len(size)) + np.linalg.inv(covariance))
    mean = posterior @ np.linalg.solve(covariance, size)
    return posterior + np.outer(mean, mean)


def root(moments: FloatArray) -> FloatArray:
    """(c, c) symmetric, whose square they are; of rounding below zero, zero."""
    values, vectors = np.linalg.eigh(moments)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T, dtype=np.float64)


def _estimate(
    solution: Solution, scores: Sequence[Sequence[Score]], prior: FloatArray, own: int
) -> tuple[FloatArray, FloatArray]:
    """Sizes (c,) of the causes by the flights alone, and their covariance (c, c), wrong forms allowed for."""
    count = len(prior) - len(solution.prior_information)
    causes, weak = slice(0, count), np.zeros(len(prior))
    weak[causes] = NOTHING
    beside = replace(
        solution,
        information=tuple(np.sum([one for one, _ in flight], axis=0) for flight in scores),
        prior_information=prior + np.diag(weak),
    )
    covariance = beside.covariance()
    pull = np.sum([gradient for flight in scores for _, gradient in flight], axis=0)
    pull[count:] = 0.0  # the parameters are at their optimum
    step = -covariance @ pull
    there = tuple(tuple((i, gradient + i @ step) for i, gradient in flight) for flight in scores)
    plain = covariance[causes, causes]
    scatter = np.diag(robust_covariance(replace(beside, scores=there), own)[0])[causes]
    larger = WRONG_FORM * np.sqrt(np.maximum(scatter / np.diag(plain), 1.0))
    return step[causes], plain * np.outer(larger, larger)
