"""How far the fit's gyro clocks may be off because a controller answers the gyro's noise.

The noise of a gyro turns the vehicle a little later, so a fit, which compares all readings with the motion, finds a
good gyro late: by 4 to 7 ms, ten of its standard errors, where calm flights are flown by a noisy one. A loop of
bandwidth w turns noise n into motion w n at most, so the delay is off by no more than w times the square of the noise
over that of what the flight turned, in rad/s2. Instrumental variables (`logs.checks.gyro_clock`) are not misled at all,
but less exact where the gyro is good. So the fit keeps its own clock, and the error that it states for it holds the
smallest of the three: that bound, what the instruments leave open, and what was known of clocks before any flight.
"""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks.gyro import BLOCK as GYRO
from sysid.estimator.blocks.pose import DELAY
from sysid.estimator.flights.clocks import GYRO as QUANTITY
from sysid.estimator.flights.clocks import PRIOR_S, delay_name
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.solver import Solution
from sysid.estimator.joint_problem.unknowns import Unknowns

LOOP_RAD_S = 40.0
"""Bandwidth of a fast rate loop. By one of 20 rad/s twelve flights were off by 4 to 17 rad/s times those squares."""


def biases_s(flights: Sequence[Flight], unknowns: Unknowns, solution: Solution, std: FloatArray) -> FloatArray:
    """(p,) how far each gyro's delay may be off for this reason; zero of everything else.

    Args:
        std: (p,) standard errors of the parameters, this reason left out.
    """
    found = np.zeros(unknowns.size)
    for flight in flights:
        name = delay_name(QUANTITY, flight.log_index)
        if name in unknowns.delay:
            i = unknowns.names.index(name)
            off_s = min(_bound_s(flight, solution), _left_open_s(flight, solution, name, std[i]), PRIOR_S)
            found[i] = max(found[i], off_s)
    return found


def _bound_s(flight: Flight, solution: Solution) -> float:
    turned = np.square(flight.streams[QUANTITY].slope(flight.time_s)).sum(axis=1).mean()
    return LOOP_RAD_S * float(solution.noise.levels[GYRO.name][0]) ** 2 / max(float(turned), np.finfo(float).tiny)


def _left_open_s(flight: Flight, solution: Solution, name: str, std_s: float) -> float:
    """Error of the instruments, and what the fit differs from them by beyond chance."""
    read, sensors = flight.gyro_clock, solution.point.sensors
    if read is None:
        return np.inf
    apart_s = sensors.get(name, 0.0) - sensors.get(DELAY, 0.0) - read.delay_s
    beyond = max(apart_s**2 - std_s**2 - read.sigma_s**2, 0.0)
    return float(np.sqrt(beyond + read.sigma_s**2))


def shifts(biases: FloatArray, covariance: FloatArray) -> FloatArray:
    """(p, k) by how much all parameters move with each delay that may be off.

    Args:
        biases: (p,) as above.
        covariance: (p, p) of the parameters, the delays estimated with them.
    """
    off = np.flatnonzero(biases)
    return covariance[:, off] / np.diag(covariance)[off] * biases[off]
