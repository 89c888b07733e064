"""What sampling leaves open of a motor's lag: a command is known to within the interval between two samples.

A pose would show a late command; without one the lag takes up what the command is off in time, uniform over a sample
(Widrow and Kollar, Quantization Noise, 2008, chapter 4).
"""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.unknowns import Unknowns

LAGS = ("motor_lag.rise_s", "motor_lag.fall_s")


def variances(flights: Sequence[Flight], unknowns: Unknowns) -> FloatArray:
    """(p,) of the shared unknowns, s² where they are lags; zero where a flight has a pose."""
    result = np.zeros(unknowns.size)
    if any(flight.has_pose for flight in flights):
        return result
    step_s = max(float(np.median(flight.step_s)) for flight in flights)
    for name in set(LAGS) & set(unknowns.names):
        result[unknowns.names.index(name)] = step_s**2 / 12.0
    return result
