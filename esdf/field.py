"""A distance field and the questions it answers at a point."""

import hashlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esdf import _esdf
from esdf.grid import UNKNOWN, Grid, StateArray
from flight import FloatArray, InputError

Policy = Literal["obstacle", "nan"]

KNOWN, UNMAPPED, OUTSIDE = 0, 1, 2
"""Values of `Field.status`: the point is in an observed voxel, in an unknown one, or outside of the grid."""


class SampledField(ABC):
    """The queries that every field answers, however it stores its values.

    Between centres the value is trilinear. The exact distance d(p) to the solid voxels and the value f(p) obey
    |f - d| <= half a voxel's diagonal, and, where f > 0, d >= sqrt(f^2 - half_diagonal^2):
    at 0.5 m from a wall in 5 cm voxels that is 2 mm (docs/explain/distance_field.md).
    """

    grid: Grid
    cap_m: float
    unknown: Policy

    @abstractmethod
    def _query(self, points: FloatArray, out: FloatArray, gradient: FloatArray | None) -> None:
        """Value and, unless `gradient` is None, gradient at checked points; NaN where there is none."""

    @abstractmethod
    def _states_at(self, index: NDArray[np.int64]) -> StateArray:
        """States (n,) of the voxels (n, 3)."""

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        """Signed distance from each point (n, 3) to the nearest surface.

        Returns:
            (n,) in metres, negative inside obstacles; NaN outside the grid and, under the policy "nan", where one of
            the eight voxels round the point is unknown.

        Raises:
            InputError: the shape is not (n, 3), or a coordinate is not finite.
        """
        points = checked_points(points_world_m)
        out = np.empty(len(points))
        self._query(points, out, None)
        return _finite_or_refused(points, out)

    def gradient(self, points_world_m: ArrayLike) -> FloatArray:
        """World gradient (n, 3) of `distance`: uphill, away from obstacles. NaN where `distance` is."""
        return self.distance_and_gradient(points_world_m)[1]

    def distance_and_gradient(self, points_world_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """`distance` (n,) and `gradient` (n, 3) at once; this costs little more than either alone."""
        points = checked_points(points_world_m)
        out, gradient = np.empty(len(points)), np.empty((len(points), 3))
        self._query(points, out, gradient)
        return _finite_or_refused(points, out), gradient

    def hessian(self, points_world_m: ArrayLike) -> NDArray[np.float64]:
        """Second derivatives (n, 3, 3) in 1/m, symmetric; NaN where a neighbour half a voxel away has no distance.

        Within a cell the interpolation has no curvature along the axes, so these are differences of the gradient over
        one voxel: the curvature of the map at its own resolution.
        """
        points = checked_points(points_world_m)
        columns = []
        for axis, voxel in enumerate(self.grid.voxel_m):
            half = 0.5 * voxel * np.eye(3)[axis]
            columns.append((self.gradient(points + half) - self.gradient(points - half)) / voxel)
        jacobian = np.stack(columns, axis=2)
        return 0.5 * (jacobian + jacobian.transpose(0, 2, 1))

    def status(self, points_world_m: ArrayLike) -> NDArray[np.uint8]:
        """KNOWN, UNMAPPED or OUTSIDE for each point (n, 3), by the voxel it lies in."""
        points = checked_points(points_world_m)
        _refuse_infinite(points)
        inside = self.grid.contains(points)
        known_place = np.where(inside[:, None], points, self.grid.low_world_m)
        index = np.clip(self.grid.index(known_place), 0, np.array(self.grid.shape) - 1)
        unknown = self._states_at(index) == UNKNOWN
        return np.where(inside, np.where(unknown, UNMAPPED, KNOWN), OUTSIDE).astype(np.uint8)

    def proven_distance(self, points_world_m: ArrayLike) -> FloatArray:
        """A lower bound on the exact distance from each point to the solid voxels (at most `cap_m`), (n,).

        Squared distance minus |p|^2 is concave (a minimum of affine functions), so interpolation never overestimates
        it; what that costs is at most a quarter of the voxel's squared diagonal. See docs/explain/distance_field.md.
        """
        points = checked_points(points_world_m)
        return self.proven_from_value(points, self.distance(points))

    def proven_from_value(self, points_world_m: FloatArray, value_m: FloatArray) -> FloatArray:
        """`proven_distance`, given what `distance` returned at these points."""
        slack = self.grid.half_diagonal_m
        # Below a voxel's half diagonal only the Lipschitz bound holds; above it the other one is never lower.
        # 1e-6: single precision in values and interpolation.
        concave = np.sqrt(np.maximum(value_m * value_m - slack * slack, 0.0))
        bound = np.where(value_m > slack, concave, value_m - slack) - 1e-6 * (1.0 + np.abs(value_m))
        half = 0.5 * np.array(self.grid.voxel_m)
        low, high = self.grid.low_world_m + half, self.grid.high_world_m - half
        if not len(points_world_m) or ((points_world_m >= low) & (points_world_m <= high)).all():
            return bound
        overhang = np.linalg.norm(points_world_m - np.clip(points_world_m, low, high), axis=1)
        return bound - overhang


@dataclass(frozen=True, eq=False)
class Field(SampledField):
    """Signed distance to the nearest surface, sampled at voxel centres; treat its arrays as read-only."""

    grid: Grid
    state: StateArray = field(repr=False)
    """(nx, ny, nz) UNKNOWN, FREE or OCCUPIED."""
    values_m: NDArray[np.float32] = field(repr=False)
    """(nx, ny, nz) distance at each voxel's centre; NaN in unknown voxels under the policy "nan"."""
    cap_m: float
    """Values are exact up to here; what is farther has this value."""
    unknown: Policy
    """Policy for unknown voxels: see `build`."""
    _hash: list[str] = field(default_factory=list, init=False, repr=False)

    def _query(self, points: FloatArray, out: FloatArray, gradient: FloatArray | None) -> None:
        _esdf.query_dense(self.values_m, self.grid.origin_world_m, self.grid.voxel_m, points, out, gradient, "best")

    def _states_at(self, index: NDArray[np.int64]) -> StateArray:
        return self.state[tuple(index.T)]

    @property
    def hash(self) -> str:
        """SHA-256 of everything that determines the values: lattice, states, cap and policy. The map's identity."""
        if not self._hash:
            recipe = (self.grid.origin_world_m, self.grid.voxel_m, self.grid.shape, self.cap_m, self.unknown)
            digest = hashlib.sha256(repr(recipe).encode())
            digest.update(self.state.data)
            self._hash.append(digest.hexdigest())
        return self._hash[0]


def checked_points(points_world_m: ArrayLike) -> FloatArray:
    """Points as contiguous float64 (n, 3), or an `InputError`."""
    try:
        points = np.ascontiguousarray(points_world_m, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"points must be an (n, 3) array of numbers ({error})") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points: expected shape (n, 3), got {points.shape}")
    return points


def _finite_or_refused(points: FloatArray, out: FloatArray) -> FloatArray:
    # A point that is not finite comes back as NaN from the kernel; only then is it worth looking for.
    if np.isnan(out.sum()):
        _refuse_infinite(points)
    return out


def _refuse_infinite(points: FloatArray) -> None:
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        row = int(np.flatnonzero(~finite)[0])
        raise InputError(f"point {row} is not finite: {points[row].tolist()}")
