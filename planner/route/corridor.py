"""A corridor of boxes round a free polyline, each proved to be free of obstacles."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from flight import FloatArray, portable
from planner.request import space

CLEARANCE_PRICE = 3000.0
"""Of `Weights.clearance` in a `Tube`, whose value has kinks: at 1e4, the price among obstacles, the descent stalls at
them (a flight through rooms took 20.1 s, not 17.1); at 300 some walks leave the boxes for good."""
_SMALLEST_M = 0.06
"""Half the diagonal of the smallest piece of a box that is looked at; it counts as not free if it is not proved."""
_STEP_M = 0.3
"""How far a face is pushed out at once; halved where that is not free, down to `_FINEST_M`."""
_FINEST_M = 0.08
_WIDEST_M = 1.5
"""How far a face is pushed out in all."""


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An oriented box: the points with normals @ point <= offsets."""

    normals: FloatArray
    """(6, 3) outward: minus and plus along the leg, then across it (two horizontal-most, two others)."""
    offsets_m: FloatArray
    """(6,)."""

    def lowest(self, points: FloatArray) -> FloatArray:
        """How deep points (n, 3) lie inside, (n,); negative outside."""
        return (self.offsets_m - portable.product(points, self.normals.T)).min(axis=1)


class Tube:
    """The union of boxes as a distance field: what is inside by d keeps at least the required clearance plus d.

    A point's value is its depth in the box that holds it deepest, which is 1-Lipschitz, plus `required_m`; the
    optimiser and the proof along a curve then need not know that it is not a map.
    """

    def __init__(self, boxes: list[Box], required_m: float) -> None:
        self.required_m = required_m
        self._axes = np.stack([box.normals[3:] for box in boxes]).transpose(1, 2, 0)  # (axis, xyz, box)
        low, high = np.stack([(-box.offsets_m[:3], box.offsets_m[3:]) for box in boxes]).transpose(1, 2, 0)
        self._middle, self._half = 0.5 * (low + high)[:, None], 0.5 * (high - low)[:, None]

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray:
        """(n,) metres: `required_m` on the surface of the union, less outside."""
        depths = self._half - np.abs(self._off(np.asarray(points_world_m, dtype=np.float64)))
        return self.required_m + depths.min(axis=0).max(axis=1)

    def distance_and_gradient(self, points_world_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,), and its gradient (n, 3): the normal of the nearest face of the deepest box, inwards."""
        off = self._off(points_world_m)
        depths = self._half - np.abs(off)
        box, point = depths.min(axis=0).argmax(axis=1), np.arange(len(points_world_m))
        axis = depths[:, point, box].argmin(axis=0)
        inwards = -np.sign(off[axis, point, box])[:, None] * self._axes[axis, :, box]
        return self.required_m + depths[axis, point, box], inwards

    def _off(self, points: FloatArray) -> FloatArray:
        """(3, n, boxes) how far from each box's middle, along its axes."""
        return portable.product(points, self._axes) - self._middle


def boxes(field: space.DistanceField, points: FloatArray, required_m: float) -> list[Box]:
    """One box for each leg of the polyline `points` (n, 3), which must itself keep `required_m`.

    Each starts as the bare leg and its six faces are pushed out in turn, as long as the field proves the new slab; all
    boxes grow together, so that the field is asked about many points at once.
    """
    axes = np.array([_leg_axes(b - a) for a, b in pairwise(points)])
    starts, ends = (np.einsum("nij,nj->ni", axes, side) for side in (points[:-1], points[1:]))
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    grown, step = np.zeros((len(axes), 6)), np.full((len(axes), 6), _STEP_M)
    while (step > 0.0).any():
        for axis in range(3):  # its two faces at once
            size = step[:, [axis, axis + 3]].T
            slabs_low, slabs_high = np.stack([low, low]), np.stack([high, high])
            slabs_low[0, :, axis], slabs_high[0, :, axis] = low[:, axis] - size[0], low[:, axis]
            slabs_low[1, :, axis], slabs_high[1, :, axis] = high[:, axis], high[:, axis] + size[1]
            free = (size > 0.0) & (grown[:, [axis, axis + 3]].T + size <= _WIDEST_M)
            both = np.broadcast_to(axes, (2, *axes.shape))
            free[free] = proved(field, both[free], slabs_low[free], slabs_high[free], required_m)
            out = np.where(free, size, 0.0)
            grown[:, [axis, axis + 3]] += out.T
            low[:, axis] -= out[0]
            high[:, axis] += out[1]
            step[:, [axis, axis + 3]] = np.where(free, size, np.where(size > _FINEST_M, 0.5 * size, 0.0)).T
    return [Box(np.concatenate([-R, R]), np.concatenate([-a, b])) for R, a, b in zip(axes, low, high, strict=True)]


def _leg_axes(along: FloatArray) -> FloatArray:
    """Rows: along the leg, horizontally across it, and across both."""
    size = portable.length(along)
    forward = along / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    across = np.cross([0.0, 0.0, 1.0], forward)
    if portable.length(across) < 1e-3:
        across = np.cross([0.0, 1.0, 0.0], forward)
    across /= portable.length(across)
    return np.stack([forward, across, np.cross(forward, across)])


def proved(
    field: space.DistanceField, axes: FloatArray, low: FloatArray, high: FloatArray, required_m: float
) -> np.ndarray:
    """Whether every point of each box keeps `required_m`, (n,) bool.

    A distance d at the centre of a piece proves d - (half its diagonal) everywhere in it; pieces not proved are halved
    across their longest edge, until they are too small to matter.

    Args:
        axes: (n, 3, 3) rows are the axes of each box.
        low, high: (n, 3) corners in the frame of those axes.
    """
    free, box = np.ones(len(axes), dtype=bool), np.arange(len(axes))
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    while len(box):
        d = space.distance(field, np.einsum("nij,ni->nj", axes[box], centre))
        reach = np.linalg.norm(half, axis=1)
        unproved = d - reach < required_m
        free[box[(d < required_m) | (unproved & (reach < _SMALLEST_M))]] = False
        kept = unproved & free[box]
        box, centre, half = (
            np.repeat(box[kept], 2),
            np.repeat(centre[kept], 2, axis=0),
            np.repeat(half[kept], 2, axis=0),
        )
        piece = np.arange(len(box))
        longest = half.argmax(axis=1)
        half[piece, longest] *= 0.5
        centre[piece, longest] += np.where(piece % 2 == 0, -1.0, 1.0) * half[piece, longest]
    return free
