"""Degree-7 Hermite splines, and the smoothest one through waypoints at given times: least integral of squared snap.

A knot state is (p, v, a, j). With u = t / T in [0, 1] a segment is M S(T) [start state, end state], where S scales the
r-th derivative by T^r and M is a constant matrix; so all about it is a constant times powers of T. For least snap,
unknown are velocity, acceleration and jerk at the interior knots; the conditions for the minimum are block tridiagonal,
symmetric and positive definite, and the same for every axis. Degree 7 is optimal when only positions are given.
"""

from dataclasses import dataclass
from functools import cache
from math import isfinite, perm

import numpy as np

from flight import FloatArray, InputError, Trajectory, polynomial, portable
from planner._planner import snap_coefficients, snap_states

ORDER = 4
"""Numbers in a knot state, and the derivative whose square is minimised (snap)."""
SIZE = 2 * ORDER
"""Coefficients of a segment."""
POWERS = np.tile(np.arange(ORDER), 2)
"""Order of derivative of each of the eight numbers of a segment: (0, 1, 2, 3, 0, 1, 2, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A path of degree-7 segments, given by its knots."""

    durations_s: FloatArray
    """(k,)."""
    states: FloatArray
    """(k + 1, 4, axes): position, velocity, acceleration and jerk at each knot."""

    def snap_cost(self) -> float:
        """Integral of the squared snap over the whole path, all axes together."""
        d = segment_states(self.states)
        return float(np.sum(d * portable.product(energy(self.durations_s), d)))

    def scale_time(self, factor: float) -> "Spline":
        """The same path `factor` times as slowly."""
        powers = polynomial.powers(1.0 / factor, ORDER)
        return Spline(self.durations_s * factor, self.states * powers[:, None])


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


def energy(durations_s: FloatArray) -> FloatArray:
    """(k, 8, 8): the snap integral of each segment as a quadratic form in the states of its two ends."""
    inverse = 7 - POWERS[:, None] - POWERS[None, :]
    return snap_matrix() * polynomial.powers(1.0 / np.asarray(durations_s), 8)[:, inverse]


def solve(
    positions: FloatArray,
    durations_s: FloatArray,
    *,
    start: FloatArray | None = None,
    end: FloatArray | None = None,
    velocity: FloatArray | None = None,
) -> Spline:
    """The minimum-snap spline through `positions` (k + 1, axes) with segments of `durations_s` (k,).

    Args:
        start, end: (3, axes) velocity, acceleration and jerk at the two ends; at rest if left out.
        velocity: (k + 1, axes) to be had at inner knots; a row of NaN, or None, leaves it open.

    Raises:
        InputError: a duration is not positive and finite, or the shapes do not fit.
    """
    positions = np.asarray(positions, dtype=np.float64)
    T = np.ascontiguousarray(durations_s, dtype=np.float64)
    k = T.size
    if positions.ndim != 2 or T.shape != (len(positions) - 1,) or k == 0 or not 1 <= positions.shape[1] <= 4:
        raise InputError(f"positions {positions.shape} and durations {T.shape} do not fit (k + 1, axes) and (k,)")
    if not (T.min() > 0.0 and isfinite(float(T.sum())) and isfinite(float(positions.sum()))):
        raise InputError("positions and durations must be finite, and durations positive")
    states, held = given(positions, start, end, velocity)
    snap_states(states, T, held)
    return Spline(T, states)


def given(
    positions: FloatArray, start: FloatArray | None, end: FloatArray | None, velocity: FloatArray | None
) -> tuple[FloatArray, np.ndarray]:
    """Knot states (k + 1, 4, axes) with what is given and zeros elsewhere, and which knots' velocities are held."""
    states = np.zeros((len(positions), ORDER, positions.shape[1]))
    states[:, 0] = positions
    if start is not None:
        states[0, 1:] = start
    if end is not None:
        states[-1, 1:] = end
    held = np.zeros(len(positions), dtype=np.uint8)
    if velocity is not None:
        held[1:-1] = np.isfinite(velocity[1:-1]).all(axis=1)
        states[held > 0, 1] = velocity[held > 0]
    return states, held


def coefficients(states: FloatArray, durations_s: FloatArray) -> FloatArray:
    """Ascending coefficients in seconds, (k, axes, 8), from knot states (k + 1, 4, axes)."""
    found = np.empty((len(durations_s), states.shape[2], SIZE))
    snap_coefficients(np.ascontiguousarray(states), durations_s, found)
    return found


def derivatives(spline: Spline, fractions: FloatArray) -> FloatArray:
    """(k, n, 5, axes): the path and four derivatives by time at fractions (n,) of each segment."""
    return np.stack([sampled(spline.states, spline.durations_s, fractions, r) for r in range(5)], axis=2)


def trajectory(spline: Spline) -> Trajectory:
    """A flyable trajectory of a spline with axes x, y, z and yaw (0 where it has none)."""
    c = coefficients(spline.states, spline.durations_s)
    level = np.zeros((len(c), 4 - c.shape[1], SIZE))
    return Trajectory(spline.durations_s, np.concatenate([c, level], axis=1))
