"""Degree-7 Hermite segments: what lies between two knots whose position, velocity, acceleration and jerk are known.

A knot state is (p, v, a, j). With u = t / T in [0, 1] the segment is M S(T) [start state, end state], where S scales
the r-th derivative by T^r and M is a constant matrix; so everything below is a constant times powers of T.
"""

from functools import cache
from math import perm

import numpy as np

from flight import FloatArray, polynomial, portable

ORDER = 4
"""Numbers in a knot state, and the derivative whose square is minimised (snap)."""
SIZE = 2 * ORDER
"""Coefficients of a segment."""
POWERS = np.tile(np.arange(ORDER), 2)
"""Order of derivative of each of the eight numbers of a segment: (0, 1, 2, 3, 0, 1, 2, 3)."""


def basis(u: FloatArray, derivative: int) -> FloatArray:
    """Derivatives of the monomials at u: (n, 8), row i times ascending coefficients in u is the value at u[i]."""
    u = np.asarray(u, dtype=np.float64)
    rows, powers = np.zeros((len(u), SIZE)), polynomial.powers(u, SIZE)
    for i in range(derivative, SIZE):
        rows[:, i] = perm(i, derivative) * powers[:, i - derivative]
    return rows


@cache
def monomials_from_states() -> FloatArray:
    """M (8, 8): ascending coefficients in u from the scaled states of both ends."""
    ends = [basis(np.array([u]), r)[0] for u in (0.0, 1.0) for r in range(ORDER)]
    return np.round(portable.solve(np.array(ends), np.eye(SIZE)) * 6.0) / 6.0  # the exact entries are whole sixths


@cache
def snap_matrix() -> FloatArray:
    """(8, 8), times T^(powers - 7): integral over the segment of the squared fourth derivative, from the states."""
    i = np.arange(SIZE)
    falling = np.array([perm(n, ORDER) for n in i], dtype=np.float64)
    monomial = np.outer(falling, falling) / np.maximum(i[:, None] + i[None, :] - 2 * ORDER + 1, 1)
    M = monomials_from_states()
    matrix = portable.product(portable.product(M.T, monomial), M)
    return 0.5 * (matrix + matrix.T)


def time_powers(durations_s: FloatArray) -> FloatArray:
    """S(T) as (k, 8): T^0, T^1, T^2, T^3 for each end."""
    return polynomial.powers(durations_s, ORDER)[:, POWERS]


def segment_states(states: FloatArray) -> FloatArray:
    """Knot states (k + 1, 4, axes) as the states of both ends of each segment, (k, 8, axes)."""
    return np.concatenate([states[:-1], states[1:]], axis=1)


def sampled(states: FloatArray, durations_s: FloatArray, fractions: FloatArray, derivative: int) -> FloatArray:
    """(k, n, axes) a derivative by time at fractions (n,) of each segment, from knot states (k + 1, 4, axes)."""
    scaled = segment_states(states) * time_powers(durations_s)[..., None]
    rows = portable.product(basis(fractions, derivative), monomials_from_states())
    return portable.product(rows, scaled) / polynomial.powers(durations_s, derivative + 1)[:, -1, None, None]


def coefficients_numpy(states: FloatArray, durations_s: FloatArray) -> FloatArray:
    """The NumPy reference of `minimum_snap.coefficients`."""
    T = np.asarray(durations_s, dtype=np.float64)
    scaled = segment_states(states) * time_powers(T)[..., None]
    on_unit = np.einsum("ab,kbx->kxa", monomials_from_states(), scaled)
    on_unit[..., :ORDER] = np.swapaxes(scaled[:, :ORDER], 1, 2) / np.array([1.0, 1.0, 2.0, 6.0])
    return on_unit / polynomial.powers(T, SIZE)[:, None]
