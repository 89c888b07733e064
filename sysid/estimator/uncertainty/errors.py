"""Standard errors of what was estimated: of noise, of errors correlated in time, of clocks and of what is held."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.solver import Solution, robust_covariance
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.uncertainty import gyro_feedback, sampled_commands, unsettled
from sysid.estimator.uncertainty.assumed_clock import Assumed, assumed
from sysid.estimator.uncertainty.unsettled import Unsettled

NORMAL_90 = 1.6449
"""Half width of a normal 90 % interval in standard deviations."""
STRONGLY_CORRELATED = 5.0
"""Errors correlated in time make a standard error so many times the plain one before it is worth a sentence."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Of all shared parameters, in the order of the unknowns' names."""

    covariance: FloatArray
    """(p, p) if all noise were white and all forms exact."""
    robust: FloatArray
    """(p,) standard errors that allow for errors correlated in time, for slightly wrong forms, for clocks that the fit
    cannot be sure of, and for what is held."""
    interval90: FloatArray
    """(p,) half widths of the 90 % intervals."""
    correlated: NDArray[np.bool_]
    """(p,) whether errors are strongly correlated in time."""
    by_command: Assumed
    """What it costs to take commands to be on time."""

    @property
    def plain(self) -> FloatArray:
        """(p,) standard errors if all noise were white and all forms exact."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> FloatArray:
        """(p, p)"""
        safe = np.where(self.plain > 0.0, self.plain, 1.0)
        return self.covariance / np.outer(safe, safe)


def standard_errors(
    flights: Sequence[Flight], unknowns: Unknowns, solution: Solution, held: Sequence[Unsettled]
) -> Errors:
    """Errors of a solved problem.

    Args:
        held: parameters that are held because the fit did not settle with them free.
    """
    from scipy.special import stdtrit

    plain = solution.covariance()
    sandwich, freedom = robust_covariance(solution, len(unknowns.bias) + len(unknowns.delay))
    by_command = assumed(solution, unknowns, flights)
    # the scatter of a few flights may come out smaller than the noise alone makes it, by chance: the larger of both
    # (Angrist and Pischke, Mostly Harmless Econometrics, 2009, section 8.1)
    variance = np.maximum(np.diag(sandwich), np.diag(plain))
    off_s = gyro_feedback.biases_s(flights, unknowns, solution, np.sqrt(variance))
    by_clocks = by_command.shift**2 + (gyro_feedback.shifts(off_s, plain) ** 2).sum(axis=1)
    by_causes = 0.0 if solution.shifts is None else (solution.shifts**2).sum(axis=1)
    by_samples = sampled_commands.variances(flights, unknowns, solution.point.vehicle)
    besides = by_clocks + by_causes + unsettled.variances(held, unknowns) + by_samples
    # Student's quantile is for the sandwich alone: it rests on few blocks
    of_blocks, of_noise = stdtrit(freedom, 0.95) ** 2 * np.diag(sandwich), NORMAL_90**2 * np.diag(plain)
    return Errors(
        covariance=plain,
        robust=np.sqrt(variance + besides),
        interval90=np.sqrt(np.maximum(of_blocks, of_noise) + NORMAL_90**2 * besides),
        correlated=np.diag(sandwich) > STRONGLY_CORRELATED**2 * np.diag(plain),
        by_command=by_command,
    )
