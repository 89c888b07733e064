"""Linear algebra of a chain with a border: states coupled to their neighbours in time, a few parameters to all.

One flight is a chain of nodes with s unknowns each, so the normal matrix is block
tridiagonal; the parameters are its border. `eliminate` takes the states out (compiled kernel), the caller adds up what
is left for the border.
"""

from dataclasses import dataclass

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid import _sysid


@dataclass(frozen=True, slots=True)
class Rows:
    """Whitened residuals of one flight and their derivatives; a row is r + d r/d x dx + d r/d parameter dp."""

    defect: FloatArray
    """(k, d) residuals of each interval between nodes: the motion's first, then those of other blocks."""
    defect_before: FloatArray
    """(k, d, s) its derivative with respect to the state before it."""
    defect_after: FloatArray
    """(k, d, s) with respect to the state after it."""
    defect_border: FloatArray
    """(k, d, p) with respect to the parameters."""
    sensor: FloatArray
    """(k + 1, m) residual of the sensors at each node; zero where nothing was measured."""
    sensor_state: FloatArray
    """(k + 1, m, s)."""
    sensor_border: FloatArray
    """(k + 1, m, p)."""

    def cost(self) -> float:
        """Half the sum of squares."""
        return 0.5 * float(np.vdot(self.defect, self.defect) + np.vdot(self.sensor, self.sensor))

    def change(self, states: FloatArray, border: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Change of defect and sensor rows for columns of state (k + 1, s, c) and border (p, c) changes."""
        p, c = border.shape
        defect, sensor = (
            (rows.reshape(rows.shape[0] * rows.shape[1], p) @ border).reshape(*rows.shape[:2], c)
            for rows in (self.defect_border, self.sensor_border)
        )
        return self._plus(states, defect, sensor)

    def freed(self, sensitivity: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Border columns of defects (k, d, p) and sensor rows (k + 1, m, p), the states' answer to them taken out."""
        return self._plus(-sensitivity, self.defect_border.copy(), self.sensor_border.copy())

    def _plus(self, states: FloatArray, defect: FloatArray, sensor: FloatArray) -> tuple[FloatArray, FloatArray]:
        before, after, seen = _plain(self.defect_before), _plain(self.defect_after), _plain(self.sensor_state)
        _sysid.add_change(before, after, seen, _plain(states), defect, sensor)
        return defect, sensor


class Factor:
    """Cholesky factor of a block-tridiagonal matrix, ready to solve with."""

    def __init__(self, diagonal: FloatArray, coupling: FloatArray) -> None:
        """Takes over a factor that the kernel has made, see `factored` and `eliminate`."""
        self._diagonal, self._coupling = diagonal, coupling

    def solve(self, columns: FloatArray) -> FloatArray:
        """H^-1 columns for (nodes, s, c)."""
        return self.solve_in_place(np.array(columns, dtype=np.float64, order="C"))

    def solve_in_place(self, columns: FloatArray) -> FloatArray:
        """The same without a copy; what was given is lost."""
        _sysid.solve(self._diagonal, self._coupling, columns)
        return columns

    def solve_back(self, columns: FloatArray) -> FloatArray:
        """L^-T columns: the second half of `solve`."""
        result = np.array(columns, dtype=np.float64, order="C")
        _sysid.solve(self._diagonal, self._coupling, result, only_back=True)
        return result

    def leverage(self, rows: Rows) -> tuple[FloatArray, FloatArray]:
        """Share of each whitened row that its own fit takes up: (k, d) of the defects, (k + 1, m) of the sensors.

        One minus leverage, summed, is the number of rows left to judge the noise by.
        """
        defect, sensor = np.empty_like(rows.defect), np.empty_like(rows.sensor)
        before, after, seen = _plain(rows.defect_before), _plain(rows.defect_after), _plain(rows.sensor_state)
        _sysid.leverage(before, after, seen, self._diagonal, self._coupling, defect, sensor)
        return defect, sensor


def factored(diagonal: FloatArray, coupling: FloatArray) -> Factor:
    """Factor of a block-tridiagonal matrix.

    Raises:
        InputError: the matrix is singular, which happens when a stretch of the flight has no measurement.
    """
    own = np.array(diagonal, dtype=np.float64, order="C"), np.array(coupling, dtype=np.float64, order="C")
    _require_determined(_sysid.factor(*own))
    return Factor(*own)


def _require_determined(bad: int) -> None:
    if bad >= 0:
        raise InputError(f"the states of the flight are not determined from node {bad} on; are there pose samples?")


def _plain(array: FloatArray) -> FloatArray:
    return np.ascontiguousarray(array, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Eliminated:
    """One flight with its states eliminated: what is left speaks of the parameters alone."""

    factor: Factor
    """Of the states' block-tridiagonal normal matrix."""
    half: FloatArray
    """(n, s, p + 1) L^-1 [J^T J_border, gradient]: the elimination's way forward."""
    information: FloatArray
    """(p, p)."""
    gradient: FloatArray
    """(p,) of the cost, the states at their best."""

    def sensitivity(self) -> FloatArray:
        """(n, s, p) H^-1 J^T J_border: the best states move by minus this times the parameters' step."""
        return self.factor.solve_back(self.half[:, :, :-1])

    def states(self, step: FloatArray) -> FloatArray:
        """(n, s) step to the best states when the parameters take a step (p,)."""
        return -self.factor.solve_back(self.half @ np.append(step, 1.0)[:, None])[:, :, 0]

    def promised(self, step: FloatArray) -> float:
        """Fall of the cost that the rows expect of a step (p,) of the parameters, the states at their best."""
        by_states = 0.5 * float((self.half[:, :, -1] ** 2).sum())
        return by_states - float(self.gradient @ step + 0.5 * step @ self.information @ step)


def eliminate(rows: Rows) -> Eliminated:
    """Schur complement of the states of one flight.

    Raises:
        InputError: the states are not determined.
    """
    nodes, _, size = rows.sensor_state.shape
    p = rows.sensor_border.shape[2]
    diagonal, coupling = np.empty((nodes, size, size)), np.empty((nodes - 1, size, size))
    half, reduced = np.empty((nodes, size, p + 1)), np.empty((p + 1, p + 1))
    bad = _sysid.eliminate(
        _plain(rows.defect_before),
        _plain(rows.defect_after),
        _plain(rows.defect_border),
        _plain(rows.defect),
        _plain(rows.sensor_state),
        _plain(rows.sensor_border),
        _plain(rows.sensor),
        diagonal,
        coupling,
        half,
        reduced,
    )
    _require_determined(bad)
    return Eliminated(Factor(diagonal, coupling), half, reduced[:-1, :-1], reduced[:-1, -1])
