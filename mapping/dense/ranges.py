"""Range images of the reconstructed surface, by one plane in each voxel that it passes through."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esdf import OCCUPIED, Grid
from flight import FloatArray
from mapping import _mapping, workers
from mapping.dense import fusion, stereo
from mapping.dense.views import ImageView

NOTHING, BLOCKED = -1, -2
"""Instead of the number of a plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """The surface, and what else may stand before it."""

    grid: Grid
    """Of cubes."""
    number: NDArray[np.int32]
    """(nx, ny, nz) of the plane in a voxel; `NOTHING` where there is none, `BLOCKED` where else it is occupied."""
    filled: NDArray[np.uint8]
    """(bricks along x, y, z), see `fusion`: 0 where `number` is `NOTHING` all over."""
    plane: FloatArray
    """(n, 6) a point and the unit normal of each."""


def of_surface(
    images: Sequence[ImageView],
    vertices_world_m: FloatArray,
    faces: NDArray[np.int32],
    state: NDArray[np.uint8],
    grid: Grid,
    *,
    scale: float,
    farthest_m: float,
    threads: int,
) -> list[NDArray[np.float32]]:
    """Metres along each ray of each image to the surface; 0 where it meets none, or first something else.

    Args:
        state: (nx, ny, nz) with all that is occupied.
        scale: size of the range images over that of the images.
    """
    planes = planes_in_voxels(vertices_world_m, faces, state, grid)

    def ranges(view: ImageView) -> NDArray[np.float32]:
        return of_planes(planes, stereo.depth_rays(view, scale), view.T_world_camera, farthest_m)

    return list(workers.in_order(ranges, images, threads=threads))


def planes_in_voxels(
    vertices_world_m: FloatArray, faces: NDArray[np.int32], state: NDArray[np.uint8], grid: Grid
) -> Planes:
    """The mean of the vertices and faces in each voxel, and of their normals."""
    from scipy import ndimage

    corners = vertices_world_m[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weights = np.repeat(normals, 3, axis=0)
    of_vertices = _sums(faces.ravel(), weights, len(vertices_world_m))
    points, normals = np.concatenate([vertices_world_m, corners.mean(axis=1)]), np.concatenate([of_vertices, normals])
    inside = grid.contains(points)
    points, normals = points[inside], normals[inside]
    voxels, of = np.unique(np.ravel_multi_index(tuple(grid.index(points).T), grid.shape), return_inverse=True)
    place = _sums(of, points, len(voxels)) / np.bincount(of, minlength=len(voxels))[:, None]
    normal = _sums(of, normals, len(voxels))
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    number = np.full(grid.shape, NOTHING, np.int32)
    number.ravel()[voxels] = np.where(length > 0.0, np.arange(len(voxels)), NOTHING)
    near = np.asarray(ndimage.binary_dilation(number >= 0, np.ones((3, 3, 3), bool), iterations=2), bool)
    number[(state == OCCUPIED) & ~near] = BLOCKED
    filled = fusion.no_bricks(grid)
    filled[tuple(np.argwhere(number != NOTHING).T // fusion.BRICK)] = 1
    return Planes(grid, number, filled, np.ascontiguousarray(np.concatenate([place, normal], axis=1)))


def of_planes(
    planes: Planes, rays_camera: FloatArray, T_world_camera: FloatArray, farthest_m: float
) -> NDArray[np.float32]:
    """(h, w) metres along the rays (h, w, 3) of one image."""
    return _mapping.surface_ranges(
        planes.grid.low_world_m,
        planes.grid.voxel_m[0],
        planes.number,
        planes.filled,
        planes.plane,
        rays_camera,
        T_world_camera,
        farthest_m,
    )


def without_jumps(range_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """The same without the pixels beside a jump, where a small error of pose or surface shows something else."""
    import cv2

    window = np.ones((3, 3), np.uint8)
    nearest = np.asarray(cv2.erode(np.where(range_m > 0.0, range_m, np.float32(1e9)), window))
    farthest = np.asarray(cv2.dilate(range_m, window))
    return np.where(farthest < stereo.LARGEST_STEP * nearest, range_m, np.float32(0.0))


def _sums(of: NDArray[np.integer], values: FloatArray, count: int) -> FloatArray:
    """(count, 3) sums of the values (n, 3), each of one place."""
    sums = [np.bincount(of, column, minlength=count) for column in values.T]
    return np.stack(sums, axis=1).astype(np.float64, copy=False)
