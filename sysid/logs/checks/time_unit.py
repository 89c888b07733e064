"""Does the attitude turn 10, 100, 1000 times as fast as the gyro says? Then the time is in another unit."""

import numpy as np

from flight import FlightLog, rotations
from flight.rotations import FloatArray
from sysid.logs.checks.finding import Finding, error
from sysid.logs.checks.motion import correlation, sampled
from sysid.logs.events.leaps import integrated, steps_of
from sysid.logs.events.repair import Repair

STRIDES = (5, 25, 125)
"""Turns are compared over the first so many samples of the attitude that show enough of them."""
LEAST_COUNT = 30
"""Fewer turns, three for an interval, are not judged."""
LEAST_TURN_RAD = 0.02
"""Root mean square of these turns, below which noise decides."""
LEAST_QUALITY = 0.9
"""Correlation of the two, below which nothing is said."""
WITHIN = 0.1
"""In logarithms to base ten."""


def check(log: FlightLog) -> list[Finding]:
    """By the turn between samples of the attitude over the integral of the gyro, at any time step and smoothed by none.

    A gyro in degrees per second is off by 57: no power of ten.
    """
    if not sampled(log, "q_world_body") or not sampled(log, "rate_body_rad_s"):
        return []
    for stride in STRIDES:
        turned, by_gyro = _turns(log, stride)
        if len(turned) >= LEAST_COUNT and np.sqrt((turned**2).mean()) > LEAST_TURN_RAD:
            break
    else:
        return []
    if correlation(turned, by_gyro) < LEAST_QUALITY:
        return []
    power = float(np.log10(float(turned @ by_gyro) / float(by_gyro @ by_gyro)))
    if round(power) == 0 or abs(power - round(power)) > WITHIN:
        return []
    factor = 10.0 ** round(power)
    sentence = f"the attitude turns {10.0**power:.3g} times as fast as the gyro says: the time is in another unit"
    repair = Repair("scale", ("time_s",), factor=factor)
    return [error("time unit", sentence, f"multiply time_s by {factor:g}", repair=repair)]


def _turns(log: FlightLog, stride: int) -> tuple[FloatArray, FloatArray]:
    """(3 m,) turns from sample to sample of the attitude, and what the gyro makes of them."""
    q, rate = log.vector("q_world_body"), log.vector("rate_body_rad_s")
    q = np.where((np.linalg.norm(q, axis=1) > 0.5)[:, None], q, np.nan)
    rows, known = steps_of(log.time_s, q)[::stride], np.isfinite(rate).all(axis=1)
    at = rotations.normalise(q[rows])
    turned = rotations.log(rotations.multiply(rotations.conjugate(at[:-1]), at[1:]))
    by_gyro = integrated(log.time_s[known], rate[known], log.time_s[rows])
    both = np.isfinite(by_gyro).all(axis=1)
    return turned[both].ravel(), by_gyro[both].ravel()
