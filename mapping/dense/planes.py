"""Plain walls: where a surface without texture must go on between the measured parts of one plane.

measured surface -> planes -> unknown cells of a plane with measured surface on all sides
-> those where images look and see nothing but a plain region: inferred, not measured

Stereo finds the edges of a plain wall, a poster on it and the frames of its windows, and nothing between. Planes fill
such holes (Gallup, Frahm and Pollefeys, "Piecewise planar and non-planar stereo for urban scene reconstruction", 2010).
Free and occupied space stays what it is; only unknown voxels are marked.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import FloatArray, frames
from mapping.dense.stereo import DepthImage
from mapping.dense.views import ImageView

Mask = NDArray[np.bool_]
Value = TypeVar("Value", bound=np.generic)

WITHIN_VOXELS, TILT_RAD = 1.0, np.radians(45.0)
"""Measured surface is of a plane if it is this near to it and its normal, which is noisy, differs by less."""
PATCH_RAD = np.radians(5.0)
"""Mean normals of a plane's connected patches differ by less: else it cuts through surfaces that only lie near it."""
LEAST_PATCH_M2, LEAST_AREA_M2 = 0.05, 0.3
"""Of one such patch, and of all of a plane's."""
TRIALS, SAMPLE, MOST_TRIED = 300, 2000, 80
"""Planes compared at a time, points that each is compared on, and planes of which the patches are examined."""
REACH_M = 6.0
"""Along the plane, how far measured surface may be from what is inferred."""
BLOCK_PX, PLAIN_GREY_LEVELS = 9, 4.0
"""Where the standard deviation in a block of the image is below this, block matching has nothing to go by."""
LEAST_LOOKS, MOST_CONTRADICTING = 3, 0.25
"""Images that must look at a plain cell, and depths behind it over those images: a few are false matches."""
SLACK_DEVIATIONS, SLACK_VOXELS = 3.0, 2.5
"""How far a depth may be from the plane that it confirms."""
LEAST_COSINE = 0.1
"""Between a ray and the normal of the plane that it looks at."""
_DIRECTIONS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Round a cell, in order."""


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane of measured surface, divided into cells of one voxel's edge."""

    T_world_plane: FloatArray
    """(4, 4): origin in the corner of the first cell, z the normal towards the side that was seen."""
    support: Mask
    """(nx, ny) cells in which it was measured."""
    patches: Mask
    """(nx, ny) those of them in connected patches that lie along it."""
    cell_m: float
    """Edge of a cell."""

    def centres(self) -> FloatArray:
        """(nx, ny, 3) in the world."""
        at = self.cell_m * (np.moveaxis(np.indices(self.support.shape), 0, -1) + 0.5)
        return frames.apply(self.T_world_plane, np.dstack([at, np.zeros(self.support.shape)]))

    def cells(self, points_world_m: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
        """The cell (n, 2) that each point lies above, perhaps outside of all, and its height (n,) in metres."""
        at = frames.apply(frames.invert(self.T_world_plane), points_world_m)
        return np.floor(at[:, :2] / self.cell_m).astype(np.int64), at[:, 2]


def inferred(
    state: NDArray[np.uint8],
    grid: Grid,
    vertices_world_m: FloatArray,
    faces: NDArray[np.int32],
    images: Sequence[ImageView],
    depths: Sequence[DepthImage | None],
    *,
    skin_voxels: float,
    farthest_m: float,
) -> Mask:
    """Unknown voxels that a plain surface must pass through.

    Args:
        vertices_world_m: (n, 3) of the measured surface, with its `faces` (m, 3).
        skin_voxels: voxels whose centre is this near to the surface are marked, on both sides.
        farthest_m: images do not look farther.

    Returns: (nx, ny, nz), true only where `state` is UNKNOWN.
    """
    found = planes(vertices_world_m, _vertex_normals(vertices_world_m, faces), grid.voxel_m[0])
    enclosed = [enclosed_cells(plane, _states(plane, state, grid)) for plane in found]
    points = [plane.centres()[cells] for plane, cells in zip(found, enclosed, strict=True)]
    marked = np.zeros(state.shape, bool)
    if not any(map(len, points)):
        return marked
    counts = [len(some) for some in points]
    normals = np.repeat([plane.T_world_plane[:3, 2] for plane in found], counts, axis=0)
    slack_m = SLACK_VOXELS * grid.voxel_m[0]
    kept = _seen_plain(np.concatenate(points), normals, images, depths, slack_m, farthest_m)
    for plane, cells, part in zip(found, enclosed, np.split(kept, np.cumsum(counts)[:-1]), strict=True):
        cells[cells] = part
        _mark(marked, plane, cells, grid, skin_voxels * grid.voxel_m[0])
    return marked & (state == UNKNOWN)


def planes(points_world_m: FloatArray, normals: FloatArray, voxel_m: float) -> list[Plane]:
    """Planes of measured surface (n, 3) with its unit normals (n, 3), those of the most surface first.

    By consensus: of random points with their normals, the plane that most others are of, again and again.
    """
    rng = np.random.default_rng(0)
    # one point of each voxel, so that the density of the mesh plays no part
    _, first = np.unique(np.floor(points_world_m / voxel_m).astype(np.int64), axis=0, return_index=True)
    points, directions = points_world_m[first], normals[first]
    left, untried = np.ones(len(points), bool), np.ones(len(points), bool)
    within_m, least = WITHIN_VOXELS * voxel_m, LEAST_AREA_M2 / voxel_m**2
    found: list[Plane] = []
    for _ in range(MOST_TRIED):
        if left.sum() < least or not untried.any():
            break
        seed = _best_seed(points, directions, left, untried, within_m, rng)
        centre, normal = _refined(points[left], directions[left], points[seed], directions[seed], within_m)
        plane = _with_cells(points_world_m, normals, centre, normal, voxel_m)
        on = left & _is_on(points, directions, centre, normal, within_m)
        untried[on], untried[seed] = False, False
        if plane is None:
            continue
        cells = np.clip(plane.cells(points[on])[0], 0, np.array(plane.support.shape) - 1)  # one may be on the border
        own = np.flatnonzero(on)[plane.patches[tuple(cells.T)]]
        if len(own) >= least:
            found.append(plane)
            left[own] = False
    return found


def _best_seed(
    points: FloatArray, normals: FloatArray, left: Mask, untried: Mask, within_m: float, rng: np.random.Generator
) -> int:
    """The point whose plane has the most others on it, of some untried ones."""
    seeds, others = np.flatnonzero(untried), np.flatnonzero(left)
    seeds = rng.choice(seeds, min(TRIALS, len(seeds)), replace=False)
    others = rng.choice(others, min(SAMPLE, len(others)), replace=False)
    directions = normals[seeds].T
    apart_m = points[others] @ directions - np.einsum("ij,ij->i", points[seeds], normals[seeds])
    votes = ((np.abs(apart_m) < within_m) & (normals[others] @ directions > np.cos(TILT_RAD))).sum(axis=0)
    return int(seeds[votes.argmax()])


def _refined(
    points: FloatArray, normals: FloatArray, centre: FloatArray, normal: FloatArray, within_m: float
) -> tuple[FloatArray, FloatArray]:
    """A point of the plane and its normal, least squares over what is on it."""
    for _ in range(3):
        on = points[_is_on(points, normals, centre, normal, within_m)]
        if len(on) < 3:
            break
        centre = on.mean(axis=0)
        across = np.linalg.eigh((on - centre).T @ (on - centre))[1][:, 0]
        normal = across if across @ normal > 0.0 else -across
    return centre, normal


def _is_on(points: FloatArray, normals: FloatArray, centre: FloatArray, normal: FloatArray, within_m: float) -> Mask:
    return (np.abs((points - centre) @ normal) < within_m) & (normals @ normal > np.cos(TILT_RAD))


def _with_cells(
    points: FloatArray, normals: FloatArray, centre: FloatArray, normal: FloatArray, voxel_m: float
) -> Plane | None:
    """The plane with cells round all of its surface; None if it has none."""
    from scipy import ndimage

    on = _is_on(points, normals, centre, normal, WITHIN_VOXELS * voxel_m)
    if not on.any():
        return None
    x = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    x /= np.linalg.norm(x)
    axes = np.column_stack([x, np.cross(normal, x), normal])
    at = (points[on] - centre) @ axes
    low = np.array([*at[:, :2].min(axis=0), 0.0])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = axes, centre + axes @ low
    cells = tuple(np.floor((at - low)[:, :2] / voxel_m).astype(np.int64).T)
    support = np.zeros((cells[0].max() + 1, cells[1].max() + 1), bool)
    support[cells] = True
    label = np.zeros(support.shape, np.int32)
    ndimage.label(support, np.ones((3, 3)), output=label)
    size = np.bincount(label.ravel())
    mean = np.stack([np.bincount(label[cells], part, len(size)) for part in normals[on].T], axis=1)
    along = mean @ normal > np.cos(PATCH_RAD) * np.linalg.norm(mean, axis=1)
    good = along & (size * voxel_m**2 >= LEAST_PATCH_M2)
    return Plane(T, support, support & good[label], voxel_m)


def enclosed_cells(plane: Plane, state: NDArray[np.uint8]) -> Mask:
    """Unknown cells with measured surface on all sides, before any free one, by the voxels' states (nx, ny).

    In eight directions along the plane: less than 180 degrees between two in which surface is met, and at most 180
    between two in which that is surface of the plane. So nothing is marked beyond a free corner of the plane.
    """
    passable, surface = state != FREE, plane.support | (state == OCCUPIED)
    steps = int(REACH_M / plane.cell_m)
    any_met = np.array([_meets(surface, passable, step, steps) for step in _DIRECTIONS])
    own_met = np.array([_meets(plane.support, passable, step, steps) for step in _DIRECTIONS])
    return _in_each(any_met, 3) & _in_each(own_met, 4) & (state == UNKNOWN)


def _meets(wanted: Mask, passable: Mask, step: tuple[int, int], most: int) -> Mask:
    """(nx, ny) whether one meets a wanted cell within so many steps, without one that cannot be passed."""
    met = np.zeros_like(wanted)
    for _ in range(most):
        before, met = met, _ahead(wanted | (passable & met), step)
        if (met == before).all():
            break
    return met


def _ahead(cells: Mask, step: tuple[int, int]) -> Mask:
    """(nx, ny) what is one step ahead of each cell; nothing beyond the edge."""
    (x, y), (nx, ny) = step, cells.shape
    ahead = np.zeros_like(cells)
    ahead[max(-x, 0) : nx - max(x, 0), max(-y, 0) : ny - max(y, 0)] = cells[
        max(x, 0) : nx + min(x, 0), max(y, 0) : ny + min(y, 0)
    ]
    return ahead


def _in_each(met: Mask, consecutive: int) -> Mask:
    """(nx, ny) whether one of every so many consecutive directions of (8, nx, ny) is true."""
    return np.logical_or.reduce([np.roll(met, k, axis=0) for k in range(consecutive)]).all(axis=0)


def _seen_plain(
    points: FloatArray,
    normals: FloatArray,
    images: Sequence[ImageView],
    depths: Sequence[DepthImage | None],
    slack_m: float,
    farthest_m: float,
) -> Mask:
    """(n,) whether enough images look at each point (n, 3), seeing it or a plain region, and few see behind it."""
    looking, contradicting = np.zeros(len(points), int), np.zeros(len(points), int)
    for view, depth in zip(images, depths, strict=True):
        if depth is None:
            continue
        away = view.position_world_m - points
        range_m = np.linalg.norm(away, axis=1)
        near = np.flatnonzero((range_m < farthest_m) & ((away * normals).sum(axis=1) > LEAST_COSINE * range_m))
        pixels = view.camera.project(frames.apply(frames.invert(view.T_world_camera), points[near]))
        inside = view.camera.contains(pixels)
        near, pixels = near[inside], pixels[inside]
        value, deviation = (_at(image, pixels, view) for image in (depth.inverse_range, depth.deviation))
        nearer = value - 1.0 / range_m[near]
        slack = SLACK_DEVIATIONS * deviation + slack_m / range_m[near] ** 2
        measured = value > 0.0
        plain = _at(_contrast(view), pixels, view) < PLAIN_GREY_LEVELS
        if view.used is not None:  # what is masked is in front of the scene, however plain
            plain &= _at(view.used, pixels, view)
        looking[near] += np.where(measured, np.abs(nearer) <= slack, plain)
        contradicting[near] += measured & (nearer < -slack)
    return (looking >= LEAST_LOOKS) & (contradicting <= MOST_CONTRADICTING * looking)


def _at(image: NDArray[Value], pixels: FloatArray, view: ImageView) -> NDArray[Value]:
    """(n,) values of an image, perhaps a smaller one, at pixels (n, 2) of the view."""
    size = np.array(image.shape[::-1])
    column, row = np.minimum((pixels * size / [view.camera.width, view.camera.height]).astype(int), size - 1).T
    return image[row, column]


def _contrast(view: ImageView) -> NDArray[np.float32]:
    """(h, w) standard deviation of the grey levels in the block round each pixel."""
    import cv2

    grey, block = view.grey.astype(np.float32), (BLOCK_PX, BLOCK_PX)
    mean, square = (np.asarray(cv2.blur(image, block), np.float32) for image in (grey, grey * grey))
    return np.sqrt(np.maximum(square - mean * mean, np.float32(0.0)))


def _states(plane: Plane, state: NDArray[np.uint8], grid: Grid) -> NDArray[np.uint8]:
    """(nx, ny) of the voxel in which each cell lies; unknown outside of the grid."""
    points = plane.centres().reshape(-1, 3)
    found = np.full(len(points), UNKNOWN, np.uint8)
    inside = grid.contains(points)
    found[inside] = state[tuple(grid.index(points[inside]).T)]
    return found.reshape(plane.support.shape)


def _mark(marked: Mask, plane: Plane, cells: Mask, grid: Grid, skin_m: float) -> None:
    """Mark, in place, the voxels (nx, ny, nz) with their centre above or below one of the cells, at most so far.

    Only voxels beside the cells are examined: the box round a long wall that is turned against the grid is most of it.
    """
    beside = grid.index(plane.centres()[cells])
    reach = int(np.hypot(skin_m, np.sqrt(0.5) * plane.cell_m) / min(grid.voxel_m) + 0.5)
    for step in itertools.product(range(-reach, reach + 1), repeat=3):
        voxels = beside + step
        voxels = voxels[((voxels >= 0) & (voxels < grid.shape)).all(axis=1)]
        cell, height_m = plane.cells(grid.centre(voxels))
        near = (np.abs(height_m) <= skin_m) & ((cell >= 0) & (cell < cells.shape)).all(axis=1)
        near[near] = cells[tuple(cell[near].T)]
        marked[tuple(voxels[near].T)] = True


def _vertex_normals(vertices: FloatArray, faces: NDArray[np.int32]) -> FloatArray:
    """(n, 3) unit normals, the faces' weighted by their area."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.stack([np.bincount(faces.ravel(), np.repeat(part, 3), len(vertices)) for part in across.T], axis=1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
