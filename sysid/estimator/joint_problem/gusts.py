"""Disturbances that last: force and torque of a first-order Gauss-Markov process, as states beside the motion.

A gust pushes for half a second, the controller answers with rotor speed, and a fit that takes disturbances for white
noise reads the answer as part of the vehicle. With the disturbance among the states its correlation in time is part
of the likelihood: nothing is biased, and errors come out as large as they are.
"""

from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.blocks.gust import LEAST_SIZE
from sysid.estimator.blocks.noise import Gusts
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.motors import motor
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import unexplained
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle

BIN_S = 0.1
"""Unexplained acceleration is judged as means over this long: below, the smoother itself decides what is seen."""
LOGS = 50.0
"""Logarithms beyond this are of no use to a search and overflow when squared."""
SHORTEST_S, LONGEST_S = 0.1, 5.0
"""What lasts less is as good as white; what lasts longer is as good as a constant."""
SURE = 16.0
"""Fall of twice the log likelihood from which on a channel counts as correlated: one in 3,000 by chance."""
FEWEST = 8
"""Frequencies needed to judge a channel."""


def find(
    flights: list[Flight], states: tuple[States, ...], vehicle: Vehicle, bandwidth_rad_s: FloatArray
) -> tuple[Gusts, FloatArray] | None:
    """Size and duration of the disturbances a model leaves, and (6,) densities of the white rest; None if all is white.

    Whittle's likelihood of a Gauss-Markov process plus white noise, for each channel, over all flights.

    Args:
        bandwidth_rad_s: (6,) beyond which the smoother, not the disturbance, shapes what is left; half of it is used.
    """
    series = [left_over(f, s, vehicle) for f, s in zip(flights, states, strict=True)]
    fits = [fit([s[:, channel] for s in series], 0.5 * bandwidth_rad_s[channel]) for channel in range(6)]
    if not any(one.sureness > SURE for one in fits):
        return None
    size = np.maximum([one.size for one in fits], LEAST_SIZE)
    white = np.array([one.white for one in fits]) * np.sqrt(BIN_S)
    return Gusts(size, np.array([one.lasts_s for one in fits])), white


def left_over(flight: Flight, states: States, vehicle: Vehicle) -> FloatArray:
    """(bins, 6) unexplained acceleration: force in world axes, turning in body axes."""
    left = unexplained(motor.driven(flight, vehicle), states, vehicle)
    world = rotations.rotate(middle(flight, states).q_world_body, left[:, :3])
    bins = ((flight.time_s[:-1] - flight.time_s[0]) / BIN_S).astype(int)
    both = np.concatenate([world, left[:, 3:]], axis=1)
    count = np.maximum(np.bincount(bins), 1)
    return np.stack([np.bincount(bins, column) / count for column in both.T], axis=1)


@dataclass(frozen=True, slots=True)
class GaussMarkov:
    """A first-order Gauss-Markov process plus white noise, as found in means over `BIN_S`."""

    size: float
    lasts_s: float
    white: float
    """Standard deviation of the white rest of a bin."""
    sureness: float
    """Twice the log likelihood ratio to white noise alone."""


def fit(series: list[FloatArray], up_to_rad_s: float) -> GaussMarkov:
    """A Gauss-Markov process plus white noise, to the periodograms of a channel."""
    from scipy.optimize import minimize

    angle, power = (np.concatenate(parts) for parts in zip(*map(_periodogram, series), strict=True))
    slow = angle < up_to_rad_s * BIN_S
    angle, power = angle[slow], power[slow]
    if len(power) < FEWEST:
        return GaussMarkov(0.0, SHORTEST_S, np.inf, 0.0)
    mean = max(float(power.mean()), 1e-12)

    def spectrum(logs: FloatArray) -> FloatArray:
        size, lasts, white = np.exp(np.clip(logs, -LOGS, LOGS))
        keeps = np.exp(-BIN_S / np.clip(lasts, SHORTEST_S, LONGEST_S))
        return size**2 * (1.0 - keeps**2) / (1.0 + keeps**2 - 2.0 * keeps * np.cos(angle)) + white**2 + 1e-6 * mean

    def surprise(logs: FloatArray) -> float:
        expected = spectrum(logs)
        return float((np.log(expected) + power / expected).sum())

    start = np.log([np.sqrt(0.7 * mean), 0.5, np.sqrt(0.3 * mean)])
    best = minimize(surprise, start, method="Nelder-Mead", options={"maxiter": 400, "xatol": 0.01, "fatol": 0.01})
    size, lasts, white = np.exp(np.clip(best.x, -LOGS, LOGS))
    white_alone = len(power) * (np.log(mean) + 1.0)
    return GaussMarkov(size, float(np.clip(lasts, SHORTEST_S, LONGEST_S)), white, 2.0 * (white_alone - float(best.fun)))


def _periodogram(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angular frequency per bin and power, without the mean."""
    n = len(values)
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2 / n
    return 2.0 * np.pi * np.arange(1, len(power)) / n, power[1:]
