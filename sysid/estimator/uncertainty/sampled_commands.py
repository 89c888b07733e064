"""What sampling leaves open of a motor's lag: a command is known to within the interval between two samples.

Where the delay of commands is not estimated, the lag takes up what the command is off in time, uniform over a sample
(Widrow and Kollar, Quantization Noise, 2008, chapter 4): a controller that runs faster than the log changes it between.
An estimated delay takes up what is of first order in the sample; about its square over twice the lag is left: at 125 Hz
lags of 35 to 45 ms were off by 1.3 ms (4 twins), at 500 Hz by nothing that shows.
"""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.clocks import COMMAND
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.unknowns import Unknowns
from vehicle import Vehicle

LAGS = ("motor_lag.rise_s", "motor_lag.fall_s")


def variances(flights: Sequence[Flight], unknowns: Unknowns, vehicle: Vehicle) -> FloatArray:
    """(p,) of the shared unknowns, s² where they are lags; zero where a pose shows how late commands are.

    Flights whose rotor speed was measured say nothing of it.
    """
    result = np.zeros(unknowns.size)
    driven = [flight for flight in flights if flight.driven_by_command]
    if not driven or any(flight.has_pose and not flight.commands_on_time for flight in driven):
        return result
    sample_s, found = max(_sample_s(flight) for flight in driven), all(not f.commands_on_time for f in driven)
    for name in set(LAGS) & set(unknowns.names):
        off_s = sample_s / np.sqrt(12.0)
        if found:
            off_s = min(off_s, sample_s**2 / (2.0 * max(vehicle.value(name), sample_s)))
        result[unknowns.names.index(name)] = off_s**2
    return result


def _sample_s(flight: Flight) -> float:
    """Between two commands of the log."""
    stream = flight.streams.get(COMMAND)
    return float(np.median(flight.step_s if stream is None else np.diff(stream.spline.x)))
