"""Plain walls: where a surface without texture must go on between the measured parts of one plane.

measured surface -> upright and level planes -> unknown cells of a plane with measured surface on all sides
-> those where images look and see nothing but a plain region that no stronger plane shows: inferred, not measured

Stereo finds the edges of a plain wall, a poster on it and the frames of its windows, and nothing between. Planes fill
such holes (Gallup, Frahm and Pollefeys, "Piecewise planar and non-planar stereo for urban scene reconstruction", 2010).
Walls stand upright and floors lie level (Schindler and Dellaert, "Atlanta world", 2004): a plane through a few scraps
of surface would lean otherwise. Free and occupied space stays what it is; only unknown voxels are marked.
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

WITHIN_VOXELS, TILT_RAD = 1.5, np.radians(45.0)
"""Measured surface is of a plane if it is this near to it and its normal, which is noisy, differs by less."""
PATCH_RAD = np.radians(5.0)
"""Mean normals of a plane's connected patches differ by less: else it cuts through surfaces that only lie near it."""
LEAST_PATCH_M2, LEAST_AREA_M2 = 0.05, 0.4
"""Of one such patch, and of all of a plane's."""
TRIALS, SAMPLE, MOST_TRIED = 600, 4000, 80
"""Planes compared at a time, points that each is compared on, and planes of which the patches are examined."""
REACH_M = 6.0
"""Along the plane, how far measured surface may be from what is inferred."""
BLOCK_PX, PLAIN_GREY_LEVELS = 9, 4.0
"""Where the standard deviation in a block of the image is below this, block matching has nothing to go by."""
LEAST_LOOKS, MOST_AGAINST = 3, 0.25
"""Images that must look at a plain cell, and of those that rule it out over them: a few are false matches."""
CONFIRMED_VOXELS, SLACK_VOXELS = 1.5, 2.5
"""A depth confirms a plane if it is this near, and rules it out if nothing is possible within so many before it. Two
cells on one ray, of two planes, are one place if they are as near."""
LEAST_COSINE = 0.1
"""Between a ray and the normal of the plane that it looks at."""
_DIRECTIONS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Round a cell, in order."""


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane of measured surface, divided into cells of one voxel's edge."""

    T_world_plane: FloatArray
    """(4, 4), upright or level: origin in the corner of the first cell, z the normal towards the side that was seen."""
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

    @property
    def normal(self) -> FloatArray:
        """(3,) in the world."""
        return self.T_world_plane[:3, 2]

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
    found = _strongest_first(planes(vertices_world_m, _vertex_normals(vertices_world_m, faces), grid.voxel_m[0]))
    enclosed = [enclosed_cells(plane, _states(plane, state, grid)) for plane in found]
    marked = np.zeros(state.shape, bool)
    if not any(cells.any() for cells in enclosed):
        return marked
    for plane, cells in zip(found, _seen_plain(found, enclosed, images, depths, farthest_m), strict=True):
        _mark(marked, plane, cells, grid, skin_voxels * grid.voxel_m[0])
    return marked & (state == UNKNOWN)


def planes(points_world_m: FloatArray, normals: FloatArray, voxel_m: float) -> list[Plane]:
    """Upright and level planes of measured surface (n, 3), z up, with its unit normals (n, 3).

    By consensus: of random points, the upright or level plane, as their normals are, that most others are of, again
    and again.
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
        normal = _upright_or_level(directions[seed : seed + 1])[0]
        centre, normal = _refined(points[left], directions[left], points[seed], normal, within_m)
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
    """The point whose upright or level plane has the most others on it, of some untried ones."""
    seeds, others = np.flatnonzero(untried), np.flatnonzero(left)
    seeds = rng.choice(seeds, min(TRIALS, len(seeds)), replace=False)
    others = rng.choice(others, min(SAMPLE, len(others)), replace=False)
    directions = _upright_or_level(normals[seeds]).T
    apart_m = points[others] @ directions - np.einsum("ij,ji->i", points[seeds], directions)
    votes = ((np.abs(apart_m) < within_m) & (normals[others] @ directions > np.cos(TILT_RAD))).sum(axis=0)
    return int(seeds[votes.argmax()])


def _refined(
    points: FloatArray, normals: FloatArray, centre: FloatArray, normal: FloatArray, within_m: float
) -> tuple[FloatArray, FloatArray]:
    """A point of the plane and its normal, least squares over what is on it; an upright plane turns, no plane leans."""
    for _ in range(3):
        on = points[_is_on(points, normals, centre, normal, within_m)]
        if len(on) < 3:
            break
        centre = on.mean(axis=0)
        if not _is_level(normal):
            level = (on - centre)[:, :2]
            across = np.append(np.linalg.eigh(level.T @ level)[1][:, 0], 0.0)
            normal = across if across @ normal > 0.0 else -across
    return centre, normal


def _upright_or_level(normals: FloatArray) -> FloatArray:
    """(n, 3) of the upright or level plane that is nearest to the one of each unit normal (n, 3)."""
    upright = normals * [1.0, 1.0, 0.0]
    upright /= np.maximum(np.linalg.norm(upright, axis=1, keepdims=True), 1e-12)
    return np.where(_is_level(normals)[:, None], np.sign(normals) * [0.0, 0.0, 1.0], upright)


def _is_level(normals: FloatArray) -> Mask:
    """(...) whether a plane with such a unit normal (..., 3) is nearer to level than to upright."""
    return np.abs(normals[..., 2]) > np.sqrt(0.5)


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

    In eight directions along the plane: less than 180 degrees between two in which surface is met, and at most 270
    between two in which that is surface of the plane. So nothing is marked beyond a free corner of the plane.
    """
    passable, surface = state != FREE, plane.support | (state == OCCUPIED)
    steps = int(REACH_M / plane.cell_m)
    any_met = np.array([_meets(surface, passable, step, steps) for step in _DIRECTIONS])
    own_met = np.array([_meets(plane.support, passable, step, steps) for step in _DIRECTIONS])
    return _in_each(any_met, 3) & _in_each(own_met, 6) & (state == UNKNOWN)


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


def _strongest_first(found: Sequence[Plane]) -> list[Plane]:
    """Walls before floors, which they hide; of either, what is measured most first."""
    return sorted(found, key=lambda plane: (_is_level(plane.normal), -plane.support.sum()))


def _seen_plain(
    found: Sequence[Plane],
    enclosed: Sequence[Mask],
    images: Sequence[ImageView],
    depths: Sequence[DepthImage | None],
    farthest_m: float,
) -> list[Mask]:
    """Of each plane's enclosed cells (nx, ny), those that enough images show, plain or measured, and few rule out.

    A plain region is shown once: it is no sight of a cell where its ray meets an inferred cell of a plane earlier in
    the list. If that one lies behind, the image sees through the cell and rules it out.
    """
    points = np.concatenate([plane.centres()[cells] for plane, cells in zip(found, enclosed, strict=True)])
    plane_of = np.repeat(np.arange(len(found)), [cells.sum() for cells in enclosed])
    normals = np.array([plane.normal for plane in found])[plane_of]
    looking, against = np.zeros(len(points), int), np.zeros(len(points), int)
    plain_seen, centres = [], np.array([view.position_world_m for view in images])
    for number, (view, depth) in enumerate(zip(images, depths, strict=True)):
        if depth is None:
            continue
        confirmed, plain, ruled_out = _look(points, normals, view, depth, found[0].cell_m, farthest_m)
        looking[confirmed] += 1
        against[ruled_out] += 1
        plain_seen.append(np.stack([plain, np.full(len(plain), number)]).astype(np.int32))
    point, image = np.concatenate([np.empty((2, 0), np.int32), *plain_seen], axis=1)
    kept: list[Mask] = []
    for number, cells in enumerate(enclosed):
        own = plane_of[point] == number
        seen = point[own]
        instead, behind = _shown_instead(points[seen], centres[image[own]], found, kept)
        looking += np.bincount(seen[~instead], minlength=len(points))
        against += np.bincount(seen[behind], minlength=len(points))
        good = (looking >= LEAST_LOOKS) & (against <= MOST_AGAINST * looking)
        inferred = cells.copy()
        inferred[cells] = good[plane_of == number]
        kept.append(inferred)
    return kept


def _look(
    points: FloatArray, normals: FloatArray, view: ImageView, depth: DepthImage, voxel_m: float, farthest_m: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Which points an image confirms by a depth, which it may show as a plain region, and which it rules out."""
    away = view.position_world_m - points
    range_m = np.linalg.norm(away, axis=1)
    near = np.flatnonzero((range_m < farthest_m) & ((away * normals).sum(axis=1) > LEAST_COSINE * range_m))
    pixels = view.camera.project(frames.apply(frames.invert(view.T_world_camera), points[near]))
    inside = view.camera.contains(pixels)
    near, pixels = near[inside], pixels[inside]
    value, bound = (_at(image, pixels, view) for image in (depth.inverse_range, depth.bound))
    nearer, voxel = value - 1.0 / range_m[near], voxel_m / range_m[near] ** 2
    measured = value > 0.0
    ruled_out = measured & (bound < 1.0 / range_m[near] - SLACK_VOXELS * voxel)
    plain = ~ruled_out & (~measured | (nearer < -SLACK_VOXELS * voxel))
    plain &= _at(_contrast(view), pixels, view) < PLAIN_GREY_LEVELS
    if view.used is not None:  # what is masked is in front of the scene, however plain
        plain &= _at(view.used, pixels, view)
    return near[np.abs(nearer) <= CONFIRMED_VOXELS * voxel], near[plain], near[ruled_out]


def _shown_instead(
    points: FloatArray, centres: FloatArray, planes: Sequence[Plane], inferred: Sequence[Mask]
) -> tuple[Mask, Mask]:
    """Whether each ray, from an image's centre (n, 3) to a point (n, 3), meets an inferred cell, and one behind it."""
    rays = points - centres
    instead, behind = np.zeros(len(points), bool), np.zeros(len(points), bool)
    for plane, cells in zip(planes, inferred, strict=False):  # of the first planes
        from_m, speed = (centres - plane.T_world_plane[:3, 3]) @ plane.normal, -rays @ plane.normal
        front = np.flatnonzero((from_m > 0.0) & (speed > 0.0))
        share = from_m[front] / speed[front]
        apart = np.abs(share - 1.0) * np.linalg.norm(rays[front], axis=1) > SLACK_VOXELS * plane.cell_m
        front, share = front[apart], share[apart]
        cell, _ = plane.cells(centres[front] + share[:, None] * rays[front])
        met: Mask = np.all((cell >= 0) & (cell < cells.shape), axis=1)
        met[met] = cells[tuple(cell[met].T)]
        instead[front[met]] = True
        behind[front[met & (share > 1.0)]] = True
    return instead, behind


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
    last = np.array(grid.shape) - 1  # a point on the outer face belongs to the last voxel
    found[inside] = state[tuple(np.minimum(grid.index(points[inside]), last).T)]
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
