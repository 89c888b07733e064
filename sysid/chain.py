"""Linear algebra of a chain with a border: states coupled to their neighbours in time, a few parameters to all.

One flight is a chain of nodes with s unknowns each (12, or 18 with disturbances), so the normal matrix is block
tridiagonal; the parameters are its border. `Factor` eliminates the states (compiled kernel), the caller adds up what
is left for the border.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from flight import InputError
from flight.rotations import FloatArray
from sysid import _sysid


@dataclass(frozen=True, slots=True)
class Rows:
    """Whitened residuals of one flight and their derivatives; a row is r + d r/d x dx + d r/d parameter dp."""

    defect: FloatArray
    """(k, d) model defect of each interval between nodes: the motion's 12, the disturbance's 6, the accelerometer's."""
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
        defect = self.defect_before @ states[:-1] + self.defect_after @ states[1:] + self.defect_border @ border
        return defect, self.sensor_state @ states + self.sensor_border @ border


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal equations of one flight."""

    diagonal: FloatArray
    """(k + 1, s, s)."""
    coupling: FloatArray
    """(k, s, s), rows of the later node, columns of the earlier."""
    border: FloatArray
    """(k + 1, s, p)."""
    gradient: FloatArray
    """(k + 1, s)."""
    border_hessian: FloatArray
    """(p, p)."""
    border_gradient: FloatArray
    """(p,)."""


def normal_equations(rows: Rows) -> Normal:
    """J^T J and J^T r in blocks."""
    before_t = np.swapaxes(rows.defect_before, 1, 2)
    after_t = np.swapaxes(rows.defect_after, 1, 2)
    sensor_t = np.swapaxes(rows.sensor_state, 1, 2)
    right = np.concatenate([rows.defect_border, rows.defect[:, :, None]], axis=2)
    columns = sensor_t @ np.concatenate([rows.sensor_border, rows.sensor[:, :, None]], axis=2)
    columns[:-1] += before_t @ right
    columns[1:] += after_t @ right
    diagonal = sensor_t @ rows.sensor_state
    diagonal[:-1] += before_t @ rows.defect_before
    diagonal[1:] += after_t @ rows.defect_after
    flat = np.concatenate([right.reshape(-1, right.shape[2]), _with_residual(rows)])
    square = flat.T @ flat
    return Normal(
        diagonal=diagonal,
        coupling=after_t @ rows.defect_before,
        border=columns[:, :, :-1],
        gradient=columns[:, :, -1],
        border_hessian=square[:-1, :-1],
        border_gradient=square[:-1, -1],
    )


def _with_residual(rows: Rows) -> FloatArray:
    both = np.concatenate([rows.sensor_border, rows.sensor[:, :, None]], axis=2)
    return both.reshape(-1, both.shape[2])


class Factor:
    """Cholesky factor of a block-tridiagonal matrix, ready to solve with.

    Raises:
        InputError: the matrix is singular, which happens when a stretch of the flight has no measurement.
    """

    def __init__(self, diagonal: FloatArray, coupling: FloatArray) -> None:
        self._diagonal = np.array(diagonal, dtype=np.float64, order="C")
        self._coupling = np.array(coupling, dtype=np.float64, order="C")
        bad = _sysid.factor(self._diagonal, self._coupling)
        if bad >= 0:
            raise InputError(f"the states of the flight are not determined from node {bad} on; are there pose samples?")

    def solve(self, columns: FloatArray) -> FloatArray:
        """H^-1 columns for (nodes, s, c)."""
        result = np.array(columns, dtype=np.float64, order="C")
        _sysid.solve(self._diagonal, self._coupling, result)
        return result

    def covariance(self) -> tuple[FloatArray, FloatArray]:
        """Blocks (i, i) and (i, i + 1) of the inverse: (nodes, s, s) and (nodes - 1, s, s)."""
        diagonal = np.empty_like(self._diagonal)
        off_diagonal = np.empty_like(self._coupling)
        _sysid.inverse_blocks(self._diagonal, self._coupling, diagonal, off_diagonal)
        return diagonal, off_diagonal


def solve_numpy(diagonal: FloatArray, coupling: FloatArray, columns: FloatArray) -> FloatArray:
    """The plain twin of `Factor(...).solve`, by LAPACK's banded Cholesky."""
    nodes, size = diagonal.shape[:2]
    tall = np.zeros((nodes, 2 * size, size))
    tall[:, :size] = diagonal
    tall[:-1, size:] = coupling
    band = np.zeros((2 * size, nodes, size))
    for c in range(size):
        band[: 2 * size - c, :, c] = tall[:, c:, c].T
    flat = columns.reshape(nodes * size, -1)
    return solveh_banded(band.reshape(2 * size, -1), flat, lower=True).reshape(columns.shape)


def leverage(rows: Rows, covariance: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Share of each whitened row that its own fit takes up: (k, d) of the defects, (k + 1, m) of the sensors.

    One minus leverage, summed, is the number of rows left to judge the noise by.
    """
    diagonal, off_diagonal = covariance
    before, after = rows.defect_before, rows.defect_after
    defect = np.einsum("kij,kij->ki", before @ diagonal[:-1], before)
    defect += np.einsum("kij,kij->ki", after @ diagonal[1:], after)
    defect += 2.0 * np.einsum("kij,kij->ki", before @ off_diagonal, after)
    return defect, np.einsum("kij,kij->ki", rows.sensor_state @ diagonal, rows.sensor_state)
