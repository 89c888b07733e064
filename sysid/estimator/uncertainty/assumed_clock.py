"""What it costs to take commands to be on time: by how much the estimates would move were their delay estimated.

A delay of commands and a motor lag do the same to first order, so the delay is not estimated unless asked for (see
`flights.clocks`). Yet flights show a difference: commands logged every 5 ms by a controller that runs every
2.5 ms act 1.25 ms before what holding each until the next makes of them; other clocks, and motors that follow no single
lag, come to more. Estimates rest on the assumption by as much as they would move without it. The delay is a consider
parameter (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter 8) whose standard deviation
is what the flights themselves call for.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.clocks import COMMAND, LEAST_DELAY_S, PRIOR_S, SURE_SIGMAS, delay_name, held
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.solver import Solution, covariance_of
from sysid.estimator.joint_problem.unknowns import Unknowns


@dataclass(frozen=True, slots=True)
class Assumed:
    """One Newton step from the solution to where the delays of commands would be estimated."""

    shift: FloatArray
    """(p,) of all shared parameters, in their units; zero where no commands are taken to be on time."""
    sigma: FloatArray
    """(p,) their standard errors there, from the likelihood's curvature."""
    delays: tuple[int, ...]
    """Places of the delays that were held."""

    def sentences(self, unknowns: Unknowns, flights: Sequence[Flight]) -> list[str]:
        """Which delays the flights call for."""
        name_of = {delay_name(COMMAND, flight.log_index): flight.name for flight in flights}
        found = []
        for i in self.delays:
            d, sigma = float(self.shift[i]), float(self.sigma[i])
            if abs(d) > max(LEAST_DELAY_S, SURE_SIGMAS * sigma):
                late = "late" if d > 0.0 else "early"
                found.append(f"{1e3 * abs(d):.1f} ms {late} ({name_of[unknowns.names[i]]})")
        if not found:
            return []
        return [
            f"the flights fit better with commands {', '.join(found)}: another clock, sampling slower than the "
            "controller's, or motors that do not follow one lag; intervals allow for it"
        ]


def assumed(solution: Solution, unknowns: Unknowns, flights: Sequence[Flight]) -> Assumed:
    """What the assumption is worth at a solution."""
    names = held(flights)
    delays = [i for i, name in enumerate(unknowns.names) if name in names]
    if not delays:
        return Assumed(np.zeros(unknowns.size), np.zeros(unknowns.size), ())
    information = solution.hessian
    information[delays, delays] += PRIOR_S**-2 - solution.prior_information[delays, delays]
    gradient = np.zeros(unknowns.size)  # of all others it is zero there, but for an active weight balance
    gradient[delays] = np.sum([pull for flight in solution.scores for _, pull in flight], axis=0)[delays]
    covariance = covariance_of(information)
    return Assumed(-covariance @ gradient, np.sqrt(np.diag(covariance)), tuple(delays))
