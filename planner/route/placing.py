"""Where in a map a given path fits: the place and the heading with most room, and how large a box is free at all."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from esdf import Grid
from esdf.field import SampledField
from flight import FloatArray, InfeasibleError, Trajectory, portable, rotations

HEADINGS = 12
"""Headings that are tried first, evenly over the circle."""
_PLACES = 3_000
"""Places that are tried first; the grid of a large map is coarser."""
_REFINED = 3
"""Placements with most room that are moved and turned further, by steps that are halved `_HALVINGS` times."""
_HALVINGS = 4
_COARSE_M, _FINE_M = 0.2, 0.03
"""Spacing of the points of a path, on the grid of placements and where they are improved."""
_CELLS = 48
"""Cells along the longest side of a map, to find its largest free box."""


@dataclass(frozen=True, slots=True)
class Placement:
    """A path moved and turned about the vertical."""

    middle_world_m: tuple[float, float, float]
    """Where the middle of its bounding box, as designed, comes to lie."""
    heading_rad: float
    """By how much it is turned."""
    distance_m: float
    """Least interpolated distance to an obstacle at the points of the path."""

    def apply(self, trajectory: Trajectory, middle_m: FloatArray) -> Trajectory:
        """The trajectory there. `middle_m`: (3,) of its path as designed."""
        turn = _turn(np.array([self.heading_rad]))[0]
        coefficients = trajectory.coefficients.copy()
        coefficients[:, :3, 0] -= middle_m
        coefficients[:, :3] = np.einsum("ij,kjc->kic", turn, coefficients[:, :3])
        coefficients[:, :3, 0] += self.middle_world_m
        coefficients[:, 3, 0] += self.heading_rad
        return Trajectory(trajectory.durations_s, coefficients)


def middle_of(path_m: FloatArray) -> FloatArray:
    """(3,) middle of the bounding box of a path (n, 3)."""
    return 0.5 * (path_m.min(axis=0) + path_m.max(axis=0))


def place(path_m: FloatArray, field: SampledField, distance_m: float) -> Placement | None:
    """The placement of a path (n, 3) with most room, or None if none was found with `distance_m` at all its points.

    Distances are 1-Lipschitz in place: on a grid of places and headings those that come short by no more than its
    spacing are kept, and the best of them are improved by a pattern search.
    """
    coarse, fine = (_thinned(path_m - middle_of(path_m), spacing_m) for spacing_m in (_COARSE_M, _FINE_M))
    low, high = _bounds(field.grid)
    span = high - low
    step = max(min(field.grid.voxel_m), float(np.prod(span) / _PLACES) ** (1.0 / 3.0))
    axes = [np.arange(a + 0.5 * min(step, b - a), b, step) for a, b in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    headings = np.linspace(0.0, 2.0 * pi, HEADINGS, endpoint=False, dtype=np.float64)
    middles, turned = np.repeat(places, HEADINGS, axis=0), np.tile(headings, len(places))
    room = _room(coarse, field, middles, turned, distance_m - step)
    best: Placement | None = None
    for i in np.argsort(-room, kind="stable")[:_REFINED]:
        if np.isfinite(room[i]):
            found = _refined(fine, field, middles[i], float(turned[i]), step)
            if best is None or found.distance_m > best.distance_m:
                best = found
    return best if best is not None and best.distance_m >= distance_m else None


def _thinned(shape: FloatArray, spacing_m: float) -> FloatArray:
    """One point for each cube of that edge; those farthest out first: they rule most placements out."""
    _, kept = np.unique(np.floor(shape / spacing_m), axis=0, return_index=True)
    chosen = shape[kept]
    return chosen[np.argsort(-np.linalg.norm(chosen, axis=1), kind="stable")]


def _refined(shape: FloatArray, field: SampledField, middle: FloatArray, heading: float, step: float) -> Placement:
    """A placement with more room near a given one."""
    here = np.append(middle, heading)
    room = float(_room(shape, field, here[None, :3], here[3:], -np.inf)[0])
    move = np.array([0.5 * step] * 3 + [pi / HEADINGS])
    for _ in range(_HALVINGS):
        while True:
            tried = here + np.concatenate([np.diag(move), -np.diag(move)])
            found = _room(shape, field, tried[:, :3], tried[:, 3], room)
            best = int(np.argmax(found))
            if found[best] <= room + 1e-6:
                break
            here, room = tried[best], float(found[best])
        move = 0.5 * move
    x, y, z, turn = here.tolist()
    return Placement((x, y, z), float(rotations.wrapped(turn)), room)


def _room(
    shape: FloatArray, field: SampledField, middles: FloatArray, headings_rad: FloatArray, least_m: float
) -> FloatArray:
    """(p,) least distance along the path by placement; minus infinity once it is below `least_m`, or unknown."""
    room = np.full(len(middles), np.inf)
    turns = _turn(headings_rad)
    alive, at, count = np.arange(len(middles)), 0, 1
    while at < len(shape) and len(alive):
        points = middles[alive, None] + np.einsum("pij,nj->pni", turns[alive], shape[at : at + count])
        found = np.nan_to_num(field.distance(points.reshape(-1, 3)), nan=-np.inf).reshape(len(alive), -1)
        room[alive] = np.minimum(room[alive], found.min(axis=1))
        room[alive[room[alive] < least_m]] = -np.inf
        alive = alive[np.isfinite(room[alive])]
        at += count
        count = max(1, min(2 * count, 200_000 // max(len(alive), 1)))
    return room


def _turn(headings_rad: FloatArray) -> FloatArray:
    """(n, 3, 3) rotations about the vertical."""
    turns = np.zeros((len(headings_rad), 3, 3))
    sine, cosine = portable.sine_cosine(headings_rad)
    turns[:, 0, 0] = turns[:, 1, 1] = cosine
    turns[:, 1, 0] = sine
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns


def _bounds(grid: Grid) -> tuple[FloatArray, FloatArray]:
    low = np.array(grid.origin_world_m)
    return low, low + np.array(grid.voxel_m) * np.array(grid.shape)


@dataclass(frozen=True, slots=True)
class FreeBox:
    """An axis-aligned box without obstacles or unknown space."""

    size_m: tuple[float, float, float]
    middle_world_m: tuple[float, float, float]
    cell_m: float
    """Edge of the cells it is made of: next to walls up to two of them are lost."""


def largest_free_box(field: SampledField) -> FreeBox:
    """The box of most volume that is made of cells which lie in free space with all of their volume.

    Raises:
        InfeasibleError: there is no such cell.
    """
    low, high = _bounds(field.grid)
    cell = max(min(field.grid.voxel_m), float((high - low).max()) / _CELLS)
    axes = [a + cell * (0.5 + np.arange(max(int((b - a) / cell), 1))) for a, b in zip(low, high, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distance = np.nan_to_num(field.distance(centres.reshape(-1, 3)), nan=-np.inf)
    free = (distance >= 0.5 * sqrt(3.0) * cell).reshape([len(axis) for axis in axes])
    best, volume = None, 0
    layers = len(axes[2])
    for floor in range(layers):
        layer = free[:, :, floor]
        for top in range(floor, layers):
            layer = layer & free[:, :, top]
            height = top - floor + 1
            if int(layer.sum()) * height <= volume:
                continue
            area, corners = _largest_rectangle(layer)
            if area * height > volume:
                volume, best = area * height, (*corners, floor, top + 1)
    if best is None:
        raise InfeasibleError(f"the map has no free space that holds a box of {cell:.2f} m")
    x0, x1, y0, y1, z0, z1 = best
    first, last = np.array([x0, y0, z0]), np.array([x1, y1, z1])
    x, y, z = (cell * (last - first)).tolist()
    mx, my, mz = (low + 0.5 * cell * (first + last)).tolist()
    return FreeBox((x, y, z), (mx, my, mz), cell)


def _largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, tuple[int, int, int, int]]:
    """Area and bounds (x0, x1, y0, y1) of the largest rectangle of true cells: the histogram's, row by row."""
    best, bounds = 0, (0, 0, 0, 0)
    heights = [0] * mask.shape[1]
    for x, row in enumerate(mask.tolist()):
        heights = [h + 1 if free else 0 for h, free in zip(heights, row, strict=True)]
        starts: list[tuple[int, int]] = []
        for y, h in enumerate([*heights, 0]):
            begin = y
            while starts and starts[-1][1] >= h:
                begin, tall = starts.pop()
                if tall * (y - begin) > best:
                    best, bounds = tall * (y - begin), (x + 1 - tall, x + 1, begin, y)
            starts.append((begin, h))
    return best, bounds
