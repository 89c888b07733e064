"""Accuracy, completeness and safety of a map of the rendered world, against ground truth.

Accuracy: the mesh lies on true surfaces. Completeness: the surfaces that the cameras saw are in the mesh (a map can be
accurate by showing little, or complete with duplicate surfaces, so both are scored). Safety: no matter is marked free.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, Grid
from flight import FloatArray, InputError, frames
from goshawk.rendered.scene import RenderedScene
from goshawk.rendered.world import cast_rays
from mapping.camera.rig import Camera

WITHIN_M = 0.05
CELL_M = 0.04
HOLE_M = 0.10


@dataclass(frozen=True, slots=True)
class MapAccuracy:
    """Scores of a map against ground truth."""

    median_error_m: float
    """Median distance of the mesh's vertices from the true surface."""
    share_within_5cm: float
    """Share of the mesh's vertices that lie within 5 cm of the true surface."""
    seen_share_within_5cm: float
    """Share of the surface that the cameras saw with a vertex of the mesh within 5 cm."""
    seen_share_within_10cm: float
    """The same within 10 cm."""
    seen_share_free: float
    """Share of the seen surface points with free voxels on all sides, 5 mm away (half a voxel of error is enough)."""
    seen_share_in_holes: float
    """Share of the seen surface points around which everything within 10 cm is marked free: holes in walls."""
    free_share_in_matter: float
    """Share of the voxels marked free whose centre lies inside matter."""


def seen_surface(
    scene: RenderedScene,
    cameras: Sequence[tuple[Camera, FloatArray]],
    *,
    rays_per_image: int = 3000,
    rng: np.random.Generator,
) -> FloatArray:
    """(n, 3) points of the surface that the cameras (lens, T_world_camera) saw, about one for each 4 cm cell."""
    points = []
    for camera, T_world_camera in cameras:
        pixels = rng.uniform([0.0, 0.0], [camera.width, camera.height], (rays_per_image, 2))
        rays = camera.unproject(pixels)
        rays = rays[np.isfinite(rays[:, 2])] @ T_world_camera[:3, :3].T
        origin = T_world_camera[:3, 3]
        ranges = cast_rays(scene, origin, rays)
        met = np.isfinite(ranges)
        points.append(origin + ranges[met, None] * rays[met])
    if not points:
        raise InputError("at least one camera is needed; none was given")
    cloud = np.concatenate(points)
    _, first = np.unique(np.floor(cloud / CELL_M).astype(np.int64), axis=0, return_index=True)
    return cloud[first]


def compare(
    scene: RenderedScene,
    seen_world_m: FloatArray,
    vertices_map_m: FloatArray,
    state: NDArray[np.uint8],
    grid: Grid,
    *,
    T_world_map: FloatArray | None = None,
) -> MapAccuracy:
    """Score a map (mesh and state grid) against the scene.

    Args:
        seen_world_m: from `seen_surface`.
        T_world_map: where the map's frame lies in the scene's, if they differ.
    """
    from scipy.ndimage import distance_transform_edt
    from scipy.spatial import KDTree

    T_world_map = np.eye(4) if T_world_map is None else T_world_map
    seen_map_m = frames.apply(frames.invert(T_world_map), seen_world_m)
    error_m = np.abs(scene.distance(frames.apply(T_world_map, vertices_map_m)))
    gap_m, _ = KDTree(vertices_map_m).query(seen_map_m, distance_upper_bound=HOLE_M)
    is_free = state == FREE
    to_matter_m = np.asarray(distance_transform_edt(is_free, sampling=grid.voxel_m))
    free_centres = frames.apply(T_world_map, grid.centre(np.argwhere(is_free)))
    return MapAccuracy(
        median_error_m=float(np.median(error_m)),
        share_within_5cm=float((error_m < WITHIN_M).mean()),
        seen_share_within_5cm=float((gap_m < WITHIN_M).mean()),
        seen_share_within_10cm=float((gap_m < HOLE_M).mean()),
        seen_share_free=float(_all_sides(is_free, grid, seen_map_m).mean()),
        seen_share_in_holes=float(_all_sides(to_matter_m > HOLE_M, grid, seen_map_m).mean()),
        free_share_in_matter=float((scene.distance(free_centres) < 0.0).mean()),
    )


def _all_sides(marked: NDArray[np.bool_], grid: Grid, points_m: FloatArray) -> NDArray[np.bool_]:
    """Whether the voxels 5 mm to each side of each point are all marked; outside the grid nothing is."""
    result = np.ones(len(points_m), bool)
    for shift_m in 0.005 * np.concatenate([np.eye(3), -np.eye(3)]):
        cells = grid.index(points_m + shift_m)
        inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
        result &= inside
        result[inside] &= marked[tuple(cells[inside].T)]
    return result
