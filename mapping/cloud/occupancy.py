"""The voxels of a point cloud: occupied where points are; free where a ray passed, or where somebody says so."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Grid, observe
from flight import FloatArray, InputError, Progress, silent
from mapping import imported
from mapping.cloud.point_cloud import PointCloud
from mapping.imported import Space

MOST_SIDES = 2_000_000
"""Of the surface for the eye, two triangles each."""
MOST_STOPPED = 0.5
"""Share of rays that something occupied stops, above which the sensor was elsewhere."""
_GRAZING, _GRAZING_VOXELS = 0.1, 3.0
"""Of a ray's length, and voxels: a ray that something stops so shortly before its point only grazes the surface."""
_RAYS = 500_000
"""At a time, which bounds memory to 100 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Carved:
    """A cloud's voxels, and what its rays did."""

    space: Space
    rays: int
    """Points of which it is known from where they were measured."""
    stopped: int
    """Rays that something occupied stopped well before their point."""


def carve(
    cloud: PointCloud,
    voxel_m: float,
    *,
    least_points: int = 1,
    observed_world_m: FloatArray,
    gap_m: float,
    progress: Progress = silent,
) -> Carved:
    """Voxels that hold points are occupied; those are free which a ray passed, or which are connected with a place.

    A ray leads from the sensor to the voxel of its point, which it does not free, and not past what is occupied. What
    is connected with a place lies `gap_m / 2` from every occupied voxel: holes between points up to `gap_m` wide let
    nothing through. All other voxels stay unknown.

    Args:
        least_points: in a voxel that is occupied. One with fewer is as if it held none.
        observed_world_m: (n, 3) places that are known to be free; n may be 0.
        gap_m: the widest hole between a surface's points.

    Raises:
        InputError: too many voxels, no voxel holds enough points, most rays are stopped, or a place is outside the box
            or too near to points.
    """
    points, origins, known = cloud.points_world_m, cloud.origins_world_m, np.zeros(0, np.int64)
    low, high = points.min(axis=0), points.max(axis=0)
    if origins is not None:
        known = np.flatnonzero(np.isfinite(origins[:, 0]))
        low, high = np.fmin(low, np.nanmin(origins, axis=0)), np.fmax(high, np.nanmax(origins, axis=0))
    grid = Grid.covering(low - voxel_m, high + voxel_m, voxel_m)
    imported.require_few(grid, "cut the cloud", coarser=True, at_most=imported.MOST_TRACED)
    state = _occupied(points, grid, least_points)
    stopped = 0
    for begin in range(0, len(known) if origins is not None else 0, _RAYS):
        progress("free space along the rays", begin / len(known))
        some = known[begin : begin + _RAYS]
        stopped += _free(state, points[some], origins[some], grid)  # pyright: ignore[reportOptionalSubscript]
    if stopped > MOST_STOPPED * len(known):
        raise InputError(
            f"{stopped / len(known):.0%} of the rays meet something occupied well before their point, at most "
            f"{MOST_STOPPED:.0%} may: the sensor was elsewhere, or its positions are in another unit or frame"
        )
    if len(observed_world_m):
        progress("free space about the places", 0.0)
        closed = _closed(state, grid, 0.5 * gap_m)
        remedy = f"is within {0.5 * gap_m:g} m of points, half of --gap; name a place that is farther from them"
        state[imported.connected(closed, grid, observed_world_m, "cloud", remedy) & (state != OCCUPIED)] = FREE
    return Carved(Space(grid, state), len(known), stopped)


def _occupied(points_world_m: FloatArray, grid: Grid, least_points: int) -> NDArray[np.uint8]:
    """(nx, ny, nz) occupied or unknown."""
    counts = np.zeros(grid.voxels, np.uint32)
    for begin in range(0, len(points_world_m), _RAYS):
        cells = grid.index(points_world_m[begin : begin + _RAYS])
        which, more = np.unique(np.ravel_multi_index(tuple(cells.T), grid.shape), return_counts=True)
        counts[which] += more.astype(np.uint32)
    if counts.max() < least_points:
        raise InputError(f"no voxel holds {least_points} points, the most are {counts.max()}: lower --least-points")
    return np.where(counts >= least_points, np.uint8(OCCUPIED), np.uint8(UNKNOWN)).reshape(grid.shape)


def _free(state: NDArray[np.uint8], points: FloatArray, origins: FloatArray, grid: Grid) -> int:
    """Free what rays pass, in place; returns how many are stopped well before their point."""
    reached_m = observe.free_visible(state, points, origins, grid)
    length_m = np.linalg.norm(points - origins, axis=1)
    return int((reached_m < (1.0 - _GRAZING) * length_m - _GRAZING_VOXELS * grid.voxel_m[0]).sum())


def _closed(state: NDArray[np.uint8], grid: Grid, distance_m: float) -> NDArray[np.bool_]:
    """Voxels, a point of which may be within a distance of what is occupied."""
    within_m = distance_m + grid.half_diagonal_m
    solid = np.where(state == OCCUPIED, np.uint8(OCCUPIED), np.uint8(FREE))
    return esdf.build(solid, grid, cap_m=within_m + grid.voxel_m[0], unknown="nan").values_m <= within_m


def surface(space: Space) -> tuple[FloatArray, NDArray[np.int32], float]:
    """The sides of what is occupied, for the eye: vertices (v, 3), faces (f, 3), and the edge of its cubes in metres.

    The cubes are as many voxels wide as it takes for few enough sides.
    """
    solid, cube_m = space.state == OCCUPIED, space.grid.voxel_m[0]
    while sum(int(np.count_nonzero(np.diff(np.pad(solid, 1), axis=axis))) for axis in range(3)) > MOST_SIDES:
        solid, cube_m = _halved(solid), 2.0 * cube_m
    corners = np.concatenate([_sides(solid, axis, sign) for axis in range(3) for sign in (1, -1)])
    size = tuple(n + 1 for n in solid.shape)
    used, named = np.unique(np.ravel_multi_index(tuple(np.moveaxis(corners, 2, 0)), size), return_inverse=True)
    quads = named.reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    lattice = np.stack(np.unravel_index(used, size), axis=1)
    return space.grid.low_world_m + cube_m * lattice, faces, cube_m


def _halved(solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cubes of two voxels a side, solid where one of the eight is."""
    solid = np.pad(solid, [(0, n % 2) for n in solid.shape])
    nx, ny, nz = (n // 2 for n in solid.shape)
    return np.logical_or.reduce(solid.reshape(nx, 2, ny, 2, nz, 2), axis=(1, 3, 5))


def _sides(solid: NDArray[np.bool_], axis: int, sign: int) -> NDArray[np.int64]:
    """(s, 4, 3) corners of the sides that face along an axis, counter-clockwise seen from outside."""
    padded = np.pad(solid, 1).astype(np.int8)
    # Where -diff is the sign, the lower of both voxels is solid and the side faces up the axis.
    cells = np.argwhere(np.diff(padded, axis=axis) == -sign)
    cells -= np.where(np.arange(3) == axis, 0, 1)  # of the padded array; a side lies at the end of the lower voxel
    u, v = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
    corners = np.stack([0 * u, u, u + v, v] if sign == 1 else [0 * u, v, u + v, u])
    return cells[:, None] + corners
