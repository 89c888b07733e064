"""Disturbances and noise of each channel as an autoregressive process, and the filter that makes them white.

With it the likelihood of a series is that of its prediction errors, and a fit in closed loop is consistent: what a
controller answers to is part of the noise model, not of the vehicle (Ljung, System Identification, 1999, section 13.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray

MEMORY_S = 0.1
"""Over which a disturbance is predicted from its past."""
FEWEST, MOST = 4, 40
"""Orders."""
LEAST_STD = 1e-6
"""Floor of a prediction error, m/s2 or rad/s2: a series without any noise stays regular."""


@dataclass(frozen=True, slots=True, eq=False)
class Coloured:
    """Noise of six channels."""

    coefficients: FloatArray
    """(6, order) by which the past predicts the next value."""
    std: FloatArray
    """(6,) of the prediction error."""

    @property
    def order(self) -> int:
        return self.coefficients.shape[1]

    def white(self, values: FloatArray) -> FloatArray:
        """(k - order, 6, ...) of series (k, 6, ...): prediction errors in standard deviations."""
        from scipy.signal import lfilter

        parts = [
            lfilter(np.concatenate([[1.0], -row]) / std, [1.0], values[:, c], axis=0)[self.order :]
            for c, (row, std) in enumerate(zip(self.coefficients, self.std, strict=True))
        ]
        return np.stack(parts, axis=1)


def order_for(step_s: float) -> int:
    """Order that remembers `MEMORY_S`."""
    return int(np.clip(round(MEMORY_S / step_s), FEWEST, MOST))


def fitted(series: Sequence[FloatArray], order: int) -> Coloured:
    """Noise of series (k, 6) of all flights, by least squares."""
    coefficients, std = np.empty((6, order)), np.empty(6)
    for c in range(6):
        past = np.concatenate([np.lib.stride_tricks.sliding_window_view(s[:-1, c], order)[:, ::-1] for s in series])
        now = np.concatenate([s[order:, c] for s in series])
        coefficients[c] = _least_squares(past, now)
        error = now - past @ coefficients[c]
        std[c] = max(float(np.sqrt(error @ error / max(len(error) - order, 1))), LEAST_STD)
    return Coloured(coefficients, std)


def plain(series: Sequence[FloatArray], order: int) -> Coloured:
    """White noise as large as series (k, 6): far from the optimum an autoregression would take the misfit for noise."""
    size = np.sqrt((np.concatenate(series) ** 2).mean(axis=0))
    return Coloured(np.zeros((6, order)), np.maximum(size, LEAST_STD))


def _least_squares(past: FloatArray, now: FloatArray) -> FloatArray:
    """By normal equations: a hundred times cheaper than by singular values, and a little noise keeps them regular."""
    square = past.T @ past
    square[np.diag_indices(len(square))] += 1e-10 * np.trace(square) / len(square) + LEAST_STD**2
    return np.asarray(np.linalg.solve(square, past.T @ now), dtype=np.float64)
