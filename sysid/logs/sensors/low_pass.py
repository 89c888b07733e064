"""The low-pass that a firmware's accelerometer went through before it was logged; kept in the log's metadata."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TypeGuard

import numpy as np

from flight import FlightLog, FloatArray

KEY = "accelerometer_low_pass"


@dataclass(frozen=True, slots=True)
class LowPass:
    """Of second order: 1 / (1 + 2 d s / w + (s / w)^2), w natural frequency, d damping."""

    natural_rad_s: float
    damping: float

    def metadata(self) -> dict[str, dict[str, float]]:
        return {KEY: {"natural_rad_s": self.natural_rad_s, "damping": self.damping}}

    def means(self, values: FloatArray, step_s: float) -> FloatArray:
        """(k, ...) means of the output over intervals, of means (k, ...) of the input, which was steady before."""
        from scipy.signal import lfilter, lfilter_zi

        over, under = _discrete(self, step_s)
        before = np.multiply.outer(lfilter_zi(over, under), values[0])
        return np.asarray(lfilter(over, under, values, axis=0, zi=before)[0], dtype=np.float64)


def of(log: FlightLog) -> LowPass | None:
    """As its reader found it; None where the log does not say."""
    said = log.metadata.get(KEY)
    if not isinstance(said, Mapping):
        return None
    said_of = (said.get(name) for name in ("natural_rad_s", "damping"))
    numbers = [float(one) for one in said_of if _is_number(one) and 0.0 < one < math.inf]
    return LowPass(*numbers) if len(numbers) == 2 else None


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


@cache
def _discrete(low_pass: LowPass, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator from mean to mean, exact for an input that is constant over each interval.

    The states are output, its slope, and its integral since the interval began, under a constant input.
    """
    from scipy.linalg import expm
    from scipy.signal import ss2tf

    w, d = low_pass.natural_rad_s, low_pass.damping
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[2, 0] = 1.0
    rates[1] = [-w * w, -2.0 * d * w, 0.0, w * w]
    after = expm(rates * step_s)
    over, under = ss2tf(after[:2, :2], after[:2, 3:], after[2:3, :2] / step_s, after[2:3, 3:] / step_s)
    return np.asarray(over[0], dtype=np.float64), np.asarray(under, dtype=np.float64)
