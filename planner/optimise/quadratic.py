"""Minimum snap with inequalities, through OSQP: corridors, gates with a tolerance, boxes on speed and acceleration.

The unknowns are the knot states, so continuity through jerk holds exactly whatever the solver's residual. Inequalities
are put on the Bernstein control points of each segment: the curve lies in their hull, so they hold between samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray, InfeasibleError, InputError, polynomial
from planner.curve import minimum_snap
from planner.request.options import StopFlag, check_stop
from planner.route.corridor import Box

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

_FACES = 6
_PRECISION = 1e-6
"""OSQP's own default, 1e-3, misses waypoints by millimetres."""
_ITERATIONS = 20000
"""Of OSQP in a first solve, at most. Boxes of hardly any width need up to 16,000 where times differ sixtyfold, others
some hundreds; each takes 3 us of processor time a segment."""
_BETWEEN_STOPS = 250
"""Iterations after which the stop flag is asked: 50 ms with 60 segments. OSQP goes on from where it was, and the answer
is the same to the last bit."""
_STIFF = 10.0
"""OSQP's weight of the bounds (rho) where they are not met otherwise. Snap goes with T^-7: with times of 0.15 to 2.7 s
the cost spans ten decades, and OSQP adapts rho to 0.03, at which 5 mm were missing after 20,000 iterations in boxes of
hardly any width. At 10, kept, it was 0.5 mm after 4000; at 100 and 1000 it is slower again."""
_STIFF_ITERATIONS = 8000
"""Iterations of a second solve, at most: twice what those boxes needed."""
_UNFINISHED = ("solved inaccurate", "maximum iterations reached")


@cache
def control_points(derivative: int) -> FloatArray:
    """(8 - derivative, 8): Bernstein control points of a derivative by u, from the scaled states of both ends."""
    M = minimum_snap.monomials_from_states()
    points = polynomial.bernstein_from_seconds(polynomial.differentiate(M.T, derivative), np.ones(minimum_snap.SIZE))
    return points.T


@dataclass(frozen=True, slots=True, eq=False)
class Constraints:
    """What the path must keep, besides being at rest at both ends."""

    waypoints: FloatArray
    """(k + 1, 3) where the knots should be; rows of NaN are free."""
    tolerance_m: float = 0.0
    """Half the edge of the cube round each waypoint that the path must pass; the two ends are always exact."""
    corridor: Sequence[Box] | None = None
    """A box for each segment."""
    speed_axis_m_s: float | None = None
    """Bound on each axis of the velocity."""
    acceleration_axis_m_s2: float | None = None
    """Bound on each axis of the acceleration."""
    residual: float = 1e-4
    """Largest violation accepted of any inequality, in its own unit (m, m/s, m/s^2)."""


class SnapProgram:
    """One quadratic program: set up once for its structure, then solved for one set of times after the other."""

    def __init__(self, constraints: Constraints) -> None:
        self.constraints = constraints
        self.segments = len(constraints.waypoints) - 1
        if self.segments < 1 or (constraints.corridor is not None and len(constraints.corridor) != self.segments):
            raise InputError(f"{self.segments} segments do not fit the corridor")
        self._solver: Any = None
        self._pattern_P = _Pattern(*self._places_P(), upper=True)
        self._pattern_A = _Pattern(*self._places_A(), upper=False)

    def solve(self, durations_s: FloatArray, stop: StopFlag | None = None) -> minimum_snap.Spline:
        """The path of least snap for these times.

        Raises:
            InfeasibleError: no path keeps the constraints at these times, or the solver did not finish.
            PlanCancelledError: `stop` was set.
        """
        T = np.asarray(durations_s, dtype=np.float64)
        knot_time = np.sqrt(np.concatenate([T[:1], T]) * np.concatenate([T, T[-1:]]))
        ratio = np.concatenate(  # T^r / knot_time^r for both ends: the solver's unknowns are all metres
            [polynomial.powers(T / knot_time[:-1], 4), polynomial.powers(T / knot_time[1:], 4)], axis=1
        )
        # Snap in units of a typical segment keeps the cost of order one whatever the times.
        cost = (
            minimum_snap.snap_matrix()
            * ratio[:, :, None]
            * ratio[:, None, :]
            * polynomial.powers(T.mean() / T, 8)[:, 7:, None]
        )
        P = self._pattern_P.fill(np.broadcast_to(cost[:, None], (self.segments, 3, 8, 8)).ravel())
        A = self._pattern_A.fill(self._values_A(ratio))
        low, high = self._limits(T)
        found = self._run(P, A, low, high, stop)
        states = found.reshape(-1, 4, 3) / polynomial.powers(knot_time, 4)[..., None]
        states[[0, -1], 1:] = 0.0
        pinned = np.isfinite(self.constraints.waypoints).all(axis=1) & self._exact()
        states[pinned, 0] = self.constraints.waypoints[pinned]
        return minimum_snap.Spline(T, states)

    def _run(
        self, P: "csc_matrix", A: "csc_matrix", low: FloatArray, high: FloatArray, stop: StopFlag | None
    ) -> FloatArray:
        if self._solver is None:
            self._solver = self._set_up(P, A, low, high)
        else:  # starts from the last answer
            self._solver.update(Px=P.data, Ax=A.data, l=low, u=high)
        x, status = _solved(self._solver, _ITERATIONS, stop)
        if not _violation(A, x, low, high).max() <= self.constraints.residual:
            stiff = self._set_up(P, A, low, high, rho=_STIFF, adaptive_rho=False)
            x, status = _solved(stiff, _STIFF_ITERATIONS, stop)
        violation = _violation(A, x, low, high)
        worst = int(violation.argmax())
        if not violation[worst] <= self.constraints.residual:
            knot = int(A.getrow(worst).indices[0]) // 12
            place = ", ".join(f"{p:.2f}" for p in x.reshape(-1, 4, 3)[knot, 0])
            raise InfeasibleError(
                f"the quadratic program stopped {violation[worst]:.1e} short of its bounds near ({place}) m: {status}; "
                "allow more time or a wider corridor there"
            )
        return x

    def _set_up(self, P: "csc_matrix", A: "csc_matrix", low: FloatArray, high: FloatArray, **settings: Any) -> Any:
        """OSQP with a problem of its own."""
        import osqp

        solver = osqp.OSQP()
        solver.setup(
            P=P, q=np.zeros(12 * (self.segments + 1)), A=A, l=low, u=high, verbose=False, polishing=True,
            eps_abs=_PRECISION, eps_rel=_PRECISION, max_iter=_BETWEEN_STOPS, **settings,
        )  # fmt: skip
        return solver

    def _exact(self) -> np.ndarray:
        exact = np.full(self.segments + 1, self.constraints.tolerance_m <= 0.0)
        exact[[0, -1]] = True
        return exact

    def _column(self, knot: np.ndarray, order: np.ndarray, axis: np.ndarray) -> np.ndarray:
        return (knot * 4 + order) * 3 + axis

    def _places_P(self) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
        i, axis, a, b = np.meshgrid(np.arange(self.segments), np.arange(3), np.arange(8), np.arange(8), indexing="ij")
        rows, columns = (self._column(i + s // 4, s % 4, axis).ravel() for s in (a, b))
        size = 12 * (self.segments + 1)
        return rows, columns, (size, size)

    def _blocks(self) -> list[tuple[int, int]]:
        """(derivative, rows per control point) of each family of inequalities, in order."""
        c = self.constraints
        families = [(0, _FACES)] if c.corridor is not None else []
        families += [(1, 3)] if c.speed_axis_m_s is not None else []
        return families + ([(2, 3)] if c.acceleration_axis_m_s2 is not None else [])

    def _places_A(self) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
        size = 12 * (self.segments + 1)
        rows, columns, count = [np.arange(size)], [np.arange(size)], size  # every unknown has its own bounds
        for derivative, faces in self._blocks():
            shape = (self.segments, 8 - derivative, faces, 8, 3)
            i, j, f, s, axis = np.meshgrid(*[np.arange(n) for n in shape], indexing="ij")
            rows.append((count + (i * shape[1] + j) * faces + f).ravel())
            columns.append(self._column(i + s // 4, s % 4, axis).ravel())
            count += self.segments * shape[1] * faces
        return np.concatenate(rows), np.concatenate(columns), (count, size)

    def _values_A(self, ratio: FloatArray) -> FloatArray:
        values = [np.ones(12 * (self.segments + 1))]
        for derivative, _ in self._blocks():
            weights = control_points(derivative)[None] * ratio[:, None, :]
            if derivative == 0 and self.constraints.corridor is not None:
                normals = np.stack([box.normals for box in self.constraints.corridor])
            else:
                normals = np.broadcast_to(np.eye(3), (self.segments, 3, 3))
            values.append(np.einsum("ijs,ifx->ijfsx", weights, normals).ravel())
        return np.concatenate(values)

    def _limits(self, T: FloatArray) -> tuple[FloatArray, FloatArray]:
        c = self.constraints
        low = np.full((self.segments + 1, 4, 3), -np.inf)
        high = np.full((self.segments + 1, 4, 3), np.inf)
        low[[0, -1]], high[[0, -1]] = 0.0, 0.0
        slack = np.where(self._exact(), 0.0, c.tolerance_m)[:, None]
        given = np.isfinite(c.waypoints).all(axis=1)
        low[given, 0], high[given, 0] = (c.waypoints - slack)[given], (c.waypoints + slack)[given]
        lows, highs = [low.ravel()], [high.ravel()]
        for derivative, _ in self._blocks():
            if derivative == 0 and c.corridor is not None:
                most = np.repeat(np.stack([box.offsets_m for box in c.corridor])[:, None], 8, axis=1).ravel()
                least = np.full_like(most, -np.inf)
            else:
                bound = c.speed_axis_m_s if derivative == 1 else c.acceleration_axis_m_s2
                most = np.repeat((bound or np.inf) * polynomial.powers(T, 3)[:, derivative], 3 * (8 - derivative))
                least = -most
            lows.append(least)
            highs.append(most)
        return np.concatenate(lows), np.concatenate(highs)


def _solved(solver: Any, iterations: int, stop: StopFlag | None) -> tuple[FloatArray, str]:
    """The unknowns and OSQP's status.

    Raises:
        InfeasibleError: OSQP proved that there is no answer.
        PlanCancelledError: `stop` was set.
    """
    while True:
        check_stop(stop)
        result = solver.solve(raise_error=False)
        iterations -= _BETWEEN_STOPS
        if result.info.status not in _UNFINISHED or iterations <= 0:
            break
    if result.info.status not in ("solved", *_UNFINISHED):
        raise InfeasibleError(f"no path keeps the corridor and limits at these times ({result.info.status})")
    return np.asarray(result.x, dtype=np.float64), result.info.status


def _violation(A: "csc_matrix", x: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """(m,) how far each bound is missed; negative where it is kept."""
    product = A @ x
    return np.maximum(low - product, product - high)


class _Pattern:
    """A sparse matrix whose places are fixed and whose values come and go; repeated places add up."""

    def __init__(self, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int], *, upper: bool) -> None:
        self._used = np.flatnonzero(rows <= columns) if upper else np.arange(len(rows))
        key = columns[self._used] * shape[0] + rows[self._used]
        places, self._target = np.unique(key, return_inverse=True)
        counts = np.bincount(places // shape[0], minlength=shape[1])
        self._index = (places % shape[0], np.concatenate([[0], np.cumsum(counts)]))
        self._shape = shape

    def fill(self, values: FloatArray) -> "csc_matrix":
        from scipy.sparse import csc_matrix

        data = np.bincount(self._target, weights=values[self._used], minlength=len(self._index[0]))
        return csc_matrix((data, *self._index), shape=self._shape)
