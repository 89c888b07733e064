"""From occupancy grids, TSDFs, meshes and points to a map's voxel states: unknown, free, occupied."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esdf import _esdf
from esdf.field import checked_points
from esdf.grid import FREE, OCCUPIED, UNKNOWN, Grid, StateArray, checked_state
from flight import FloatArray, InputError


def state_from_occupancy(
    probability: ArrayLike, grid: Grid, *, free_below: float = 0.3, occupied_above: float = 0.6
) -> StateArray:
    """States from occupancy probabilities (nx, ny, nz); NaN and values between the thresholds become unknown."""
    p = np.asarray(probability, dtype=np.float64)
    if p.shape != grid.shape:
        raise InputError(f"the occupancy has shape {p.shape}, the grid {grid.shape}")
    if not 0.0 <= free_below <= occupied_above <= 1.0:
        raise InputError(f"thresholds {free_below:g} and {occupied_above:g} must be ordered and between 0 and 1")
    state = np.full(grid.shape, UNKNOWN, np.uint8)
    state[p < free_below] = FREE
    state[p > occupied_above] = OCCUPIED
    return state


def state_from_tsdf(
    distance_m: ArrayLike, weight: ArrayLike, grid: Grid, *, min_weight: float = 1e-6, margin_m: float | None = None
) -> StateArray:
    """States from a truncated signed distance (nx, ny, nz), positive in front of the surface.

    Args:
        weight: (nx, ny, nz) how often each voxel was seen; below `min_weight` it is unknown.
        margin_m: A voxel is occupied if its distance is at most this. The default, half a voxel's diagonal, marks every
            voxel the surface passes through, so the field never overestimates; 0 marks those with the centre behind it.
    """
    distance, seen = np.asarray(distance_m), np.asarray(weight)
    if distance.shape != grid.shape or seen.shape != grid.shape:
        raise InputError(f"the TSDF has shapes {distance.shape} and {seen.shape}, the grid {grid.shape}")
    margin = grid.half_diagonal_m if margin_m is None else margin_m
    state = np.where(distance <= margin, OCCUPIED, FREE).astype(np.uint8)
    state[~(seen >= min_weight) | ~np.isfinite(distance)] = UNKNOWN
    return state


def state_from_mesh(
    vertices_world_m: ArrayLike, faces: ArrayLike, grid: Grid, *, observed: StateArray | None = None
) -> StateArray:
    """States from a triangle mesh: every voxel a triangle touches is occupied, on top of `observed`.

    A scanned mesh has no inside, so free space must come from what was observed; without `observed` everything else is
    unknown.

    Raises:
        InputError: vertices are not finite, faces name vertices that do not exist, or there is no face.
    """
    vertices = checked_points(vertices_world_m)
    triangles = np.ascontiguousarray(faces, dtype=np.int64)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
        raise InputError(f"the mesh's faces: expected shape (m, 3) with m >= 1, got {triangles.shape}")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"a face names vertex {triangles.max()}, but there are {len(vertices)}")
    state = np.full(grid.shape, UNKNOWN, np.uint8) if observed is None else checked_state(observed, grid).copy()
    _esdf.mark_triangles(state, _in_voxels(vertices, grid, "a vertex"), triangles, OCCUPIED)
    return state


def state_from_points(
    points_world_m: ArrayLike,
    origins_world_m: ArrayLike,
    grid: Grid,
    *,
    range_m: float = np.inf,
    state: StateArray | None = None,
) -> StateArray:
    """States from measured points and where each was measured from.

    The voxel of a point is occupied, those between it and its origin are free, the rest is unknown. A voxel that one
    ray passes and another ends in is occupied.

    Args:
        origins_world_m: (n, 3), or (3,) if all were measured from one place.
        range_m: Farther points are not trusted; their rays free voxels up to here.
        state: An earlier map that the points are added to; it is not changed.
    """
    points = checked_points(points_world_m)
    origins = checked_points(np.broadcast_to(np.asarray(origins_world_m, dtype=np.float64), points.shape).copy())
    out = np.full(grid.shape, UNKNOWN, np.uint8) if state is None else checked_state(state, grid).copy()
    ends, starts = _in_voxels(points, grid, "a point"), _in_voxels(origins, grid, "an origin")
    length = np.linalg.norm(points - origins, axis=1)
    trusted = length <= range_m
    voxel = np.floor(ends).astype(np.int64)
    hit = voxel[trusted & ((voxel >= 0) & (voxel < np.array(grid.shape))).all(axis=1)]
    out[tuple(hit.T)] = OCCUPIED
    shortened = np.where(trusted, 1.0, range_m / np.maximum(length, np.finfo(float).tiny))
    _esdf.carve(out, starts, starts + shortened[:, None] * (ends - starts), FREE)
    return out


def free_visible(state: StateArray, points_world_m: ArrayLike, origins_world_m: ArrayLike, grid: Grid) -> FloatArray:
    """Free, in place, the voxels from each origin to its measured point, up to the first one that is occupied.

    The voxel of the point itself stays as it is. Unlike the rays of `state_from_points`, none passes what is occupied:
    where an origin is wrong, nothing behind a surface becomes free.

    Args:
        state: (nx, ny, nz), in which what is occupied is marked already.
        points_world_m: (n, 3); origins_world_m: (n, 3).

    Returns:
        (n,) metres from the origin to the voxel that ended the ray; infinite where none did before its point.
    """
    points, origins = checked_points(points_world_m), checked_points(origins_world_m)
    if points.shape != origins.shape:
        raise InputError(f"the origins have shape {origins.shape}, the points {points.shape}")
    if len(set(grid.voxel_m)) != 1:
        raise InputError(f"the voxels are {grid.voxel_m} m wide; rays want cubes")
    if checked_state(state, grid) is not state:
        raise InputError("the state array must be contiguous uint8, as it is changed in place")
    reached = np.empty(len(points))
    starts, ends = _in_voxels(origins, grid, "an origin"), _in_voxels(points, grid, "a point")
    _esdf.carve_visible(state, starts, ends, FREE, reached)
    return reached * grid.voxel_m[0]


def _in_voxels(points_world_m: FloatArray, grid: Grid, what: str) -> NDArray[np.float64]:
    if not np.isfinite(points_world_m).all():
        raise InputError(f"{what} is not finite")
    return np.ascontiguousarray((points_world_m - grid.low_world_m) / np.array(grid.voxel_m))
