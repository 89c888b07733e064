"""Polynomials as coefficient arrays, ascending powers along the last axis, in three bases.

`seconds`: t from the segment's start. `centred`: s = 2 t / T - 1 in [-1, 1], the basis of the wire format.
`Bernstein`: control points on [0, T]; the curve lies in their convex hull.
"""

from functools import cache
from math import comb, perm

import numpy as np
from numpy.typing import ArrayLike

from flight import portable
from flight.portable import FloatArray


def evaluate(coefficients: ArrayLike, t: ArrayLike) -> FloatArray:
    """Horner's rule; the leading axes of `coefficients` broadcast against `t`."""
    c = np.asarray(coefficients, dtype=np.float64)
    t = np.asarray(t, dtype=np.float64)
    value = c[..., -1] + np.zeros_like(t)
    for i in range(c.shape[-1] - 2, -1, -1):
        value = value * t + c[..., i]
    return value


def differentiate(coefficients: ArrayLike, order: int = 1) -> FloatArray:
    """Coefficients of the derivative; a constant differentiates to the single coefficient 0."""
    c = np.asarray(coefficients, dtype=np.float64)
    n = int(c.shape[-1])
    if order >= n:
        return np.zeros((*c.shape[:-1], 1))
    falling = np.array([perm(i, order) for i in range(order, n)], dtype=np.float64)  # i (i - 1) ... (i - order + 1)
    return c[..., order:] * falling


def scale_argument(coefficients: ArrayLike, factor: ArrayLike) -> FloatArray:
    """Coefficients of p(factor * t). `factor` broadcasts against the leading axes."""
    c = np.asarray(coefficients, dtype=np.float64)
    return c * powers(factor, c.shape[-1])


def shift_argument(coefficients: ArrayLike, offset: ArrayLike) -> FloatArray:
    """Coefficients of p(t + offset) (Taylor shift). `offset` broadcasts against the leading axes."""
    c = np.asarray(coefficients, dtype=np.float64)
    n = int(c.shape[-1])
    power = powers(offset, n)
    shifted = [
        sum((comb(j, i) * power[..., j - i] * c[..., j] for j in range(i + 1, n)), start=c[..., i]) for i in range(n)
    ]
    return np.stack(np.broadcast_arrays(*shifted), axis=-1)


def powers(x: ArrayLike, n: int) -> FloatArray:
    """1, x, x^2, ... x^(n-1) along a new last axis."""
    x = np.asarray(x, dtype=np.float64)
    found = np.ones((*x.shape, n))
    for k in range(1, n):
        found[..., k] = found[..., k - 1] * x
    return found


def centred_from_seconds(coefficients: ArrayLike, duration_s: ArrayLike) -> FloatArray:
    """p(t), t in [0, T], as a polynomial in s = 2 t / T - 1."""
    half = 0.5 * np.asarray(duration_s, dtype=np.float64)
    return shift_argument(scale_argument(coefficients, half), np.ones_like(half))


def seconds_from_centred(coefficients: ArrayLike, duration_s: ArrayLike) -> FloatArray:
    """The inverse of `centred_from_seconds`."""
    T = np.asarray(duration_s, dtype=np.float64)
    return scale_argument(shift_argument(coefficients, -np.ones_like(T)), 2.0 / T)


@cache
def _bernstein_matrix(n: int) -> FloatArray:
    degree = n - 1
    return np.array([[comb(i, j) / comb(degree, j) if j <= i else 0.0 for j in range(n)] for i in range(n)])


def bernstein_from_seconds(coefficients: ArrayLike, duration_s: ArrayLike) -> FloatArray:
    """Bernstein control points of p on [0, T]: min <= p(t) <= max over the control points."""
    on_unit = scale_argument(coefficients, duration_s)
    n = on_unit.shape[-1]
    return portable.product(on_unit.reshape(-1, n), _bernstein_matrix(n).T).reshape(on_unit.shape)
