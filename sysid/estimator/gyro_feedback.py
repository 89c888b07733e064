"""How far the fit's gyro clocks may be off because a controller answers the gyro's noise.

The noise of a gyro turns the vehicle a little later, so a fit, which compares all readings with the motion, finds a good
gyro late: by 4 to 7 ms, ten of its standard errors, where calm flights are flown by a noisy one. Instrumental variables
(`sysid.logs.gyro_clock`) are not misled, but less exact where the gyro is good. So the fit keeps its own clock, and the
error that it states for it holds the bias that the two readings together show.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks.pose import DELAY
from sysid.estimator.clocks import GYRO, delay_name
from sysid.estimator.flight_data import Flight
from sysid.estimator.unknowns import Unknowns

WEAK_S = 1e-3
"""A standard error of the instrumental variables from which on they cannot confirm a clock to the millisecond."""


def biases_s(
    flights: Sequence[Flight], unknowns: Unknowns, sensors: Mapping[str, float], std: FloatArray
) -> FloatArray:
    """(p,) how far each gyro's delay may be off for this reason; zero of everything else.

    Args:
        sensors: values of the delays found.
        std: (p,) their standard errors, this reason left out.
    """
    found = np.zeros(unknowns.size)
    for flight in flights:
        name, read = delay_name(GYRO, flight.log_index), flight.gyro_clock
        if read is None or not np.isfinite(read.sigma_s) or name not in unknowns.delay:
            continue
        i = unknowns.names.index(name)
        apart_s = sensors.get(name, 0.0) - sensors.get(DELAY, 0.0) - read.delay_s
        bias = max(apart_s**2 - std[i] ** 2 - read.sigma_s**2, 0.0)  # its square, without what chance has in it
        found[i] = np.sqrt(bias + (read.sigma_s**2 if read.sigma_s > WEAK_S else 0.0))
    return found


def shifts(biases: FloatArray, covariance: FloatArray) -> FloatArray:
    """(p, k) by how much all parameters move with each delay that may be off.

    Args:
        biases: (p,) as above.
        covariance: (p, p) of the parameters, the delays estimated with them.
    """
    off = np.flatnonzero(biases)
    return covariance[:, off] / np.diag(covariance)[off] * biases[off]
