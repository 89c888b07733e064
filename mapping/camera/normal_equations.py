"""Normal equations of a bundle adjustment in blocks: points, poses and calibration eliminated in turn."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray
from mapping.camera.errors import Candidate
from mapping.camera.rig import Rig

if TYPE_CHECKING:
    from scipy import sparse as sp

CELLS = (6, 4)
"""Columns and rows of an image within which matches may share an error in all images: patches of surface seen at one
angle, what a lens model cannot say. Finer cells would take a pattern wider than they are for independent."""
_HUBER = 1.345
_RIDGE = 1e-9
_POSE_RIDGE = 1e-10
"""Holds what moves the whole map; 1e-7 also held the bending of a path of 400 instants, and 3 m of error with it."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Residuals (true less predicted) of the observations in use, and their derivatives."""

    used: np.ndarray
    """(o,) indices of the observations."""
    residual: FloatArray
    """(o, 2) px."""
    pose: FloatArray
    """(o, 2, 6): turn (rad) and motion (m) of the body, in its frame."""
    point: FloatArray
    """(o, 2, 3)."""
    calibration: FloatArray
    """(o, 2, p) for all candidates, in order."""


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """Normal equations in poses and calibration, the points eliminated."""

    matrix: "sp.csr_matrix"
    """(6 instants + p, 6 instants + p)."""
    scores: "sp.csr_matrix"
    """(6 instants + p, images): the gradient, apart for the matches of each image."""
    fields: "sp.csr_matrix"
    """(6 instants + p, cells): the same, apart for the matches in each cell of a camera's image, see `cells`."""

    @property
    def gradient(self) -> FloatArray:
        """(6 instants + p,)."""
        return np.asarray(self.scores.sum(axis=1), dtype=np.float64).ravel()

    def __add__(self, other: "Sums") -> "Sums":
        return Sums(self.matrix + other.matrix, self.scores + other.scores, self.fields + other.fields)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """How the points of one block follow from poses and calibration."""

    numbers: np.ndarray
    """(points,)."""
    inverse: "sp.csr_matrix"
    """Of the curvature in each point, a block of 3 rows for each."""
    coupling: "sp.csr_matrix"
    """(3 points, 6 instants + p)."""
    gradient: FloatArray
    """(3 points,)."""

    def step(self, shared: FloatArray, share: float) -> FloatArray:
        """(points, 3) motion of the points in a share of a step that moves poses and calibration by `shared`."""
        return (self.inverse @ (share * self.gradient - self.coupling @ shared)).reshape(-1, 3)


def eliminate_points(
    rows: Rows,
    index: np.ndarray,
    points: np.ndarray,
    placed: np.ndarray,
    whitening: FloatArray,
    of_rig: tuple[int, int],
    cell: np.ndarray,
) -> tuple[Points, Sums]:
    """The normal equations that one block of points gives.

    Args:
        index: (o, 3) point, instant and camera of each row in use; points: all numbers of the block's points, in order.
        placed: instants with a pose; whitening: (o,) of each row in use: root of its weight over the noise.
        of_rig: how many instants and cameras there are; cell: (o,) of each row in use, see `cells`.
    """
    from scipy import sparse as sp

    point = np.searchsorted(points, index[:, 0])
    instant = np.searchsorted(placed, index[:, 1])
    by_point = rows.point * whitening[:, None, None]
    residual = (rows.residual * whitening[:, None]).ravel()
    of_pose = _blocks(rows.pose * whitening[:, None, None], instant, len(placed))
    shared = sp.csr_matrix(sp.hstack([of_pose, _columns(rows.calibration * whitening[:, None, None])]))
    own = _blocks(by_point, point, len(points))
    curvature = np.zeros((len(points), 3, 3))
    np.add.at(curvature, point, np.einsum("oki,okj->oij", by_point, by_point))
    scale = np.trace(curvature, axis1=1, axis2=2)[:, None, None]
    inverse = _block_diagonal(np.linalg.inv(curvature + (_RIDGE * scale + 1e-12) * np.eye(3)))
    coupling = sp.csr_matrix(own.T @ shared)
    eliminated = sp.csr_matrix(inverse @ coupling)
    matrix = sp.csr_matrix(shared.T @ shared - coupling.T @ eliminated)
    instants, cameras = of_rig
    by_image, by_cell = (
        sp.csr_matrix(shared.T @ group - eliminated.T @ sp.csr_matrix(own.T @ group))
        for group in (
            _by_group(residual, index[:, 1] * cameras + index[:, 2], instants * cameras),
            _by_group(residual, cell, cameras * CELLS[0] * CELLS[1]),
        )
    )
    return Points(points, inverse, coupling, own.T @ residual), Sums(matrix, by_image, by_cell)


def cells(number: np.ndarray, pixels: FloatArray, sizes_px: FloatArray) -> np.ndarray:
    """(o,) the cell of its camera's image in which each observation lies, counted over all cameras.

    Args:
        number: (o,) of the camera; pixels: (o, 2); sizes_px: (cameras, 2) width and height of their images.
    """
    column, row = np.clip(pixels / sizes_px[number] * CELLS, 0, np.array(CELLS) - 1).astype(np.int64).T
    return np.asarray((number * CELLS[1] + row) * CELLS[0] + column)


def robust(residual: FloatArray, redundancy: float) -> tuple[float, float, FloatArray]:
    """Standard deviation of a match in each coordinate, Huber's limit (px), and his weight of each observation.

    The first is that of the residuals, from the median of their lengths, over the root of `redundancy`, the share of
    the coordinates that no unknown was fitted to: a point that two images see leaves one of its four coordinates.
    """
    length = np.linalg.norm(residual, axis=1)
    left_px = max(float(np.median(length)) / 1.1774, 1e-6)  # Rayleigh: median 1.1774 sigma
    limit_px = 2.0 * _HUBER * left_px
    weight = np.minimum(1.0, limit_px / np.maximum(length, 1e-12))
    return left_px / np.sqrt(redundancy), limit_px, weight


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """What else than matches holds the poses: priors of turn (rad) and motion (m) of the body, in its frame."""

    weight: FloatArray
    """(placed, 6) inverse variances."""
    off: FloatArray
    """(placed, 6) of the poses from the priors."""
    shared: FloatArray
    """(placed, 6, q) derivatives of `off` in what all priors share and nobody knows: frame, scale, clock ..."""
    shared_std: FloatArray
    """(q,) of what is known of that beforehand."""


class Shifts:
    """For each candidate (n, n): the mean square shift per unit of its parameters, over the camera's observations."""

    def __init__(self, tried: Sequence[Candidate], rig: Rig) -> None:
        self._names = [camera.name for camera in rig]
        self._sums = {c: np.zeros((len(c.kind.units),) * 2) for c in tried}
        self._counts = dict.fromkeys(self._names, 0)

    def add(self, rows: Rows, number: np.ndarray) -> None:
        for k, name in enumerate(self._names):
            self._counts[name] += int((number == k).sum())
        start = 0
        for c, total in self._sums.items():
            stop = start + len(c.kind.units)
            own = rows.calibration[number == self._names.index(c.camera), :, start:stop]
            total += np.einsum("oki,okj->ij", own, own)
            start = stop

    def mean(self) -> dict[Candidate, FloatArray]:
        return {c: total / max(self._counts[c.camera], 1) for c, total in self._sums.items()}


@dataclass(frozen=True, slots=True, eq=False)
class Marginal:
    """Normal equations in the calibration alone, the poses eliminated."""

    matrix: FloatArray
    """(p, p)."""
    gradient: FloatArray
    """(p,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """The normal equations with the poses eliminated, and how these follow."""

    marginal: Marginal
    factor: Any
    """Of the poses' part."""
    poses: FloatArray
    """(6 instants,) the step of the poses if the calibration stays."""
    poses_by_calibration: FloatArray
    """(6 instants, p) by which that step falls per unit of the calibration."""

    @staticmethod
    def of(matrix: "sp.csr_matrix", gradient: FloatArray, n: int) -> "Reduced":
        """Eliminate the first n unknowns; the six directions that move the whole map are held by a small ridge."""
        from scipy import sparse as sp
        from scipy.sparse.linalg import splu

        pose = sp.csc_matrix(matrix[:n, :n])
        ridge = _POSE_RIDGE * float(pose.diagonal().mean()) + _RIDGE
        options = {"SymmetricMode": True}
        factor = splu(
            pose + ridge * sp.identity(n, format="csc"), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
        )
        coupling, calibration = matrix[:n, n:].toarray(), matrix[n:, n:].toarray()
        solved = factor.solve(np.column_stack([coupling, gradient[:n]]))
        poses_by, poses = solved[:, :-1], solved[:, -1]
        marginal = Marginal(calibration - coupling.T @ poses_by, gradient[n:] - coupling.T @ poses)
        return Reduced(marginal, factor, poses, poses_by)


def _blocks(values: FloatArray, column: np.ndarray, count: int) -> "sp.csr_matrix":
    """(o, 2, w) blocks as rows (2o) of a sparse matrix with `count` blocks of w columns."""
    from scipy import sparse as sp

    rows, height, width = values.shape
    columns = np.repeat(column[:, None] * width + np.arange(width), height, axis=0)
    starts = np.arange(0, rows * height * width + 1, width)
    return sp.csr_matrix((values.reshape(-1), columns.reshape(-1), starts), shape=(rows * height, count * width))


def _columns(values: FloatArray) -> "sp.csr_matrix":
    from scipy import sparse as sp

    rows, height, width = values.shape
    return sp.csr_matrix(values.reshape(rows * height, width))


def _by_group(residual: FloatArray, group: np.ndarray, count: int) -> "sp.csr_matrix":
    """Residuals (2o,), each in the column of its observation's group (o,): (2o, count)."""
    from scipy import sparse as sp

    return sp.csr_matrix((residual, np.repeat(group, 2), np.arange(len(residual) + 1)), shape=(len(residual), count))


def _block_diagonal(blocks: FloatArray) -> "sp.csr_matrix":
    from scipy import sparse as sp

    count, size, _ = blocks.shape
    columns = (np.arange(count)[:, None, None] * size + np.arange(size)).repeat(size, axis=1)
    starts = np.arange(0, count * size * size + 1, size)
    return sp.csr_matrix((blocks.reshape(-1), columns.reshape(-1), starts), shape=(count * size,) * 2)
