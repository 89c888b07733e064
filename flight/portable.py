"""Functions and small algebra with the same bits on every processor, for what lies between a request and its answer.

NumPy's exp, log, arctan2 and others take vector paths that differ between processors, sin and cos are the C library's,
and every `@` and `np.linalg` call is BLAS, whose order of sums is each processor's own. What NumPy does element by
element (+ - * / sqrt), its sums and `np.einsum` (not `optimize`) are the same everywhere.
"""

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flight import _portable

FloatArray = NDArray[np.float64]
_MOST_SWEEPS = 30
_TERMS = 150
"""Of a series whose terms fall once they are past half the square of the argument, here at most 36."""


def sine_cosine(angle_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of each angle, in the shape given."""
    x = np.asarray(angle_rad, dtype=np.float64)
    sine, cosine = np.empty(x.size), np.empty(x.size)
    _portable.sine_cosine(np.ascontiguousarray(x.ravel()), sine, cosine)
    return sine.reshape(x.shape), cosine.reshape(x.shape)


def arctangent2(y: ArrayLike, x: ArrayLike) -> FloatArray:
    """Angle of each vector (x, y), in [-pi, pi]."""
    up, right = np.broadcast_arrays(np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64))
    out = np.empty(up.size)
    _portable.arctangent2(np.ascontiguousarray(up.ravel()), np.ascontiguousarray(right.ravel()), out)
    return out.reshape(up.shape)


def exponential(x: ArrayLike) -> FloatArray:
    return _each(_portable.exponential, x)


def logarithm(x: ArrayLike) -> FloatArray:
    """Natural logarithm; NaN of negative numbers."""
    return _each(_portable.logarithm, x)


def arcsine(x: ArrayLike) -> FloatArray:
    return _each(_portable.arcsine, x)


def arccosine(x: ArrayLike) -> FloatArray:
    return _each(_portable.arccosine, x)


def _each(function: Callable[[FloatArray, FloatArray], None], x: ArrayLike) -> FloatArray:
    values = np.asarray(x, dtype=np.float64)
    out = np.empty(values.size)
    function(np.ascontiguousarray(values.ravel()), out)
    return out.reshape(values.shape)


def length(vectors: FloatArray) -> FloatArray:
    """Euclidean length along the last axis; `np.linalg.norm` of a single vector is BLAS."""
    return np.sqrt((vectors * vectors).sum(axis=-1))


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Matrix product of (..., m, k) and (..., k, n), leading axes equal or absent; `np.einsum` is ten times slower."""
    leading = a.shape[:-2] or b.shape[:-2]
    out = np.empty((*leading, a.shape[-2], b.shape[-1]))
    left, right = (np.ascontiguousarray(x if x.ndim > 2 else x[None]) for x in (a, b))
    together = out if leading else out[None]
    stacks = (x if x.ndim == 3 else x.reshape(-1, *x.shape[-2:]) for x in (left, right, together))
    _portable.product(*stacks)
    return out


def solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """x of A x = b, (..., n, n) and (..., n, m), by Gauss-Jordan elimination; NaN if A is singular."""
    size = matrix.shape[-1]
    work = np.concatenate([matrix, np.broadcast_to(right, (*matrix.shape[:-1], right.shape[-1]))], axis=-1)
    rows = work.reshape(-1, size, work.shape[-1])
    every = np.arange(len(rows))
    with np.errstate(divide="ignore", invalid="ignore"):
        for column in range(size):
            pivot = column + np.abs(rows[:, column:, column]).argmax(axis=1)
            lower = rows[every, pivot]
            rows[every, pivot] = rows[:, column]
            rows[:, column] = lower / lower[:, column, None]
            factors = rows[:, :, column].copy()
            factors[:, column] = 0.0
            rows -= factors[:, :, None] * rows[:, None, column]
    solved = rows[..., size:]
    return np.where(np.isfinite(solved), solved, np.nan).reshape(*matrix.shape[:-1], right.shape[-1])


def solve_banded(band: FloatArray, right: FloatArray) -> FloatArray | None:
    """x (n,) of A x = b for a symmetric A in lower storage, band[i - j, j] = A[i, j]; None unless positive definite."""
    solution = np.array(right, dtype=np.float64)
    return solution if _portable.solve_banded(np.array(band, dtype=np.float64), solution) else None


def symmetric_eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues (n,), in no order, and as columns the eigenvectors (n, n) of a symmetric matrix: cyclic Jacobi.

    NaN throughout where an entry is not finite, or where it does not converge. For a few dozen rows: every pair of
    them is a step in Python.
    """
    a, vectors = 0.5 * (matrix + matrix.T), np.eye(len(matrix))
    if not np.isfinite(a).all():
        return np.full(len(a), np.nan), np.full(a.shape, np.nan)
    smallest = np.finfo(np.float64).eps * float(np.abs(a).max(initial=0.0))
    for _ in range(_MOST_SWEEPS):
        if not (np.abs(np.triu(a, 1)) > smallest).any():
            return a.diagonal().copy(), vectors
        for p, q in combinations(range(len(a)), 2):
            if abs(a[p, q]) > smallest:
                _rotate(a, vectors, p, q)
    return np.full(len(a), np.nan), np.full(a.shape, np.nan)


def _rotate(a: FloatArray, vectors: FloatArray, p: int, q: int) -> None:
    """Turn two axes so that the entry (p, q) becomes zero (Golub and Van Loan, algorithm 8.4.1)."""
    half = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
    tangent = (1.0 if half >= 0.0 else -1.0) / (abs(half) + np.sqrt(1.0 + half * half))
    c = 1.0 / np.sqrt(1.0 + tangent * tangent)
    turn = np.array([[c, c * tangent], [-c * tangent, c]])
    for rows in (a, a.T, vectors.T):
        rows[[p, q]] = turn[0, 0] * rows[p] - turn[0, 1] * rows[q], turn[0, 1] * rows[p] + turn[1, 1] * rows[q]


def normal_share(x: ArrayLike) -> FloatArray:
    """Share of standard normal numbers that are below x, by Taylor's series (Marsaglia 2004); absolute error 2e-15.

    Not for tails: below -8.3 it is 0, and rounding is of one, not of the share.
    """
    at = np.clip(np.asarray(x, dtype=np.float64), -8.5, 8.5)
    term = at.copy()
    total = at.copy()
    for k in range(3, 3 + 2 * _TERMS, 2):
        term = term * at * at / k
        total = total + term
    return np.clip(0.5 + total * exponential(-0.5 * at * at) / np.sqrt(2.0 * np.pi), 0.0, 1.0)
