"""The disturbance just before an instant, from the past alone, so that a prediction can carry it on.

What a model leaves of the acceleration is taken for a first-order Gauss-Markov process (gusts, a moment that the model
lacks) plus white noise. Its size, its time constant and the noise are fitted to flights; on the flight that is
predicted, a Kalman filter runs over what was left of each interval so far.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.joint_problem import gusts


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Force per mass in world axes (m/s2) and turning in body axes (rad/s2) that a model leaves."""

    size: FloatArray
    """(6,) standard deviations of what lasts."""
    lasts_s: FloatArray
    """(6,) its time constants."""
    white: FloatArray
    """(6,) densities of the white rest, the same units times root second."""

    def just_before(self, left: FloatArray, step_s: float, blind_s: float = 0.0) -> FloatArray:
        """(k + 1, 6) expected disturbance at each node, given what was left of the intervals before it alone.

        Args:
            left: (k, 6) unexplained acceleration over each interval.
            step_s: usual length of an interval.
            blind_s: what was left of the intervals that ended less long ago is not known either.
        """
        from scipy.signal import lfilter

        keeps = np.exp(-step_s / self.lasts_s)
        gain = _gain(keeps, self.size**2 * (1.0 - keeps**2), self.white**2 / step_s)
        seen = [
            lfilter([g], [1.0, -(1.0 - g) * keep], column) for g, keep, column in zip(gain, keeps, left.T, strict=True)
        ]
        blind = math.ceil(blind_s / step_s - 1e-6)  # a whole number of steps is not one more
        known = np.stack(seen, axis=1)[: len(left) - blind] * keeps**blind
        return np.concatenate([np.zeros((len(left) + 1 - len(known), 6)), known])


def learn(left: Sequence[FloatArray], time_s: Sequence[FloatArray]) -> Disturbance:
    """Size, time constant and white rest, by Whittle's likelihood over all flights, channel by channel.

    The filter reads single intervals, so what means over time average away (differences of a noisy rate) is part of the
    white rest too.

    Args:
        left: of each flight, (k, 6) unexplained acceleration over each interval.
        time_s: of each flight, (k,) the middle of each interval.
    """
    bins = [means_over(values, at, gusts.BIN_S) for values, at in zip(left, time_s, strict=True)]
    fits = [gusts.fit([b[:, channel] for b in bins], np.inf) for channel in range(6)]
    size, white = np.array([f.size for f in fits]), np.array([f.white for f in fits]) * np.sqrt(gusts.BIN_S)
    step_s = float(np.median(np.diff(time_s[0])))
    rest = np.maximum(np.concatenate(left).var(axis=0) - size**2, 0.0)
    return Disturbance(size, np.array([f.lasts_s for f in fits]), np.maximum(white, np.sqrt(rest * step_s)))


def _gain(keeps: FloatArray, drive: FloatArray, noise: FloatArray) -> FloatArray:
    """Steady gain of the Kalman filter of x' = keeps x + drive, measured with noise (variances, scalar channels).

    The variance P before a measurement solves P = keeps^2 P noise / (P + noise) + drive.
    """
    b = noise * (1.0 - keeps**2) - drive
    before = 0.5 * (-b + np.sqrt(b**2 + 4.0 * noise * drive))
    return before / np.maximum(before + noise, np.finfo(float).tiny)
