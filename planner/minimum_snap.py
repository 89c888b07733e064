"""The smoothest way through waypoints at given times: least integral of squared snap, in closed form.

Unknown are velocity, acceleration and jerk at the interior knots; the conditions for the minimum are block tridiagonal,
symmetric and positive definite, and the same for every axis. Degree 7 is optimal when only positions are given.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from flight import FloatArray, InputError, Trajectory
from planner import hermite

_BAND = 6  # a knot couples with the next one: 3 + 3 unknowns


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """The minimum-snap spline through positions, with the factor that made it (for derivatives of it)."""

    durations_s: FloatArray
    """(k,)."""
    states: FloatArray
    """(k + 1, 4, axes): position, velocity, acceleration and jerk at each knot."""
    factor: FloatArray
    """Banded Cholesky factor of the conditions; empty if there is no interior knot."""

    def snap_cost(self) -> float:
        """Integral of the squared snap over the whole path, all axes together."""
        d = hermite.segment_states(self.states)
        return float(np.sum(d * (energy(self.durations_s) @ d)))

    def solve_adjoint(self, gradient_states: FloatArray) -> FloatArray:
        """Solve the same conditions for a right-hand side given at the knots, (k + 1, 4, axes); 0 where pinned."""
        solution = np.zeros_like(gradient_states)
        if self.factor.size:
            inner = gradient_states[1:-1, 1:].reshape(-1, gradient_states.shape[2])
            solved = cho_solve_banded((self.factor, True), inner, check_finite=False)
            solution[1:-1, 1:] = solved.reshape(-1, 3, gradient_states.shape[2])
        return solution


def energy(durations_s: FloatArray) -> FloatArray:
    """(k, 8, 8): the snap integral of each segment as a quadratic form in the states of its two ends."""
    exponents = hermite.POWERS[:, None] + hermite.POWERS[None, :] - 7
    return hermite.snap_matrix() * np.asarray(durations_s)[:, None, None] ** exponents


def solve(
    positions: FloatArray,
    durations_s: FloatArray,
    *,
    start: FloatArray | None = None,
    end: FloatArray | None = None,
) -> Spline:
    """The minimum-snap spline through `positions` (k + 1, axes) with segments of `durations_s` (k,).

    Args:
        start, end: (3, axes) velocity, acceleration and jerk at the two ends; at rest if left out.

    Raises:
        InputError: a duration is not positive and finite, or the shapes do not fit.
    """
    positions = np.asarray(positions, dtype=np.float64)
    T = np.asarray(durations_s, dtype=np.float64)
    if positions.ndim != 2 or T.shape != (len(positions) - 1,) or len(T) == 0:
        raise InputError(f"positions {positions.shape} and durations {T.shape} do not fit (k + 1, axes) and (k,)")
    if not (np.isfinite(positions).all() and np.isfinite(T).all() and T.min() > 0.0):
        raise InputError("positions and durations must be finite, and durations positive")
    states = np.zeros((len(T) + 1, hermite.ORDER, positions.shape[1]))
    states[:, 0] = positions
    states[0, 1:] = 0.0 if start is None else start
    states[-1, 1:] = 0.0 if end is None else end
    return solve_states(states, T)


def solve_states(states: FloatArray, durations_s: FloatArray) -> Spline:
    """As `solve`, from knot states whose interior v, a, j are zero and are filled in (changes `states`)."""
    H = energy(durations_s)
    if len(durations_s) == 1:
        return Spline(durations_s, states, np.empty(0))
    factor = cholesky_banded(_banded(H), lower=True, check_finite=False, overwrite_ab=True)
    force = H @ hermite.segment_states(states)
    right = -(force[:-1, 5:] + force[1:, 1:4])
    solved = cho_solve_banded((factor, True), right.reshape(-1, states.shape[2]), check_finite=False)
    states[1:-1, 1:] = solved.reshape(-1, 3, states.shape[2])
    return Spline(durations_s, states, factor)


def _banded(H: FloatArray) -> FloatArray:
    """The conditions for interior (v, a, j) in LAPACK's lower banded storage."""
    diagonal = H[:-1, 5:, 5:] + H[1:, 1:4, 1:4]
    below = H[1:-1, 5:, 1:4]
    band = np.zeros((_BAND, 3 * len(diagonal)))
    for row in range(3):
        for column in range(3):
            if row >= column:
                band[row - column, column::3] = diagonal[:, row, column]
            band[3 + row - column, column:-3:3] = below[:, row, column]
    return band


def trajectory(spline: Spline) -> Trajectory:
    """A flyable trajectory of a spline with axes x, y, z, yaw."""
    return Trajectory(spline.durations_s, hermite.coefficients(spline.states, spline.durations_s))
