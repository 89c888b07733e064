"""A corridor of boxes round a free polyline, each proved to be free of obstacles."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flight import FloatArray
from planner import space

_DEPTH = 4
"""How often a piece of a box may be halved in every direction before it counts as not proved."""


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An oriented box: the points with normals @ point <= offsets."""

    normals: FloatArray
    """(6, 3) outward: minus and plus along the leg, then across it (two horizontal-most, two others)."""
    offsets_m: FloatArray
    """(6,)."""

    def lowest(self, points: FloatArray) -> FloatArray:
        """How deep points (n, 3) lie inside, (n,); negative outside."""
        return (self.offsets_m - points @ self.normals.T).min(axis=1)


def boxes(field: space.DistanceField, points: FloatArray, required_m: float, *, widest_m: float = 1.5) -> list[Box]:
    """One box for each leg of the polyline `points` (n, 3), which must itself keep `required_m`.

    Each starts as the bare leg and its six faces are pushed out in turn, as long as the field proves the new slab.
    """
    return [_grow(field, a, b, required_m, widest_m) for a, b in pairwise(points)]


def _grow(field: space.DistanceField, start: FloatArray, end: FloatArray, required_m: float, widest_m: float) -> Box:
    axes = _leg_axes(end - start)
    low, high = np.minimum(axes @ start, axes @ end), np.maximum(axes @ start, axes @ end)
    grown = np.zeros(6)
    step = np.full(6, 0.4)
    while (step > 0.0).any():
        for face in range(6):
            if step[face] <= 0.0:
                continue
            axis, up = face % 3, face >= 3
            slab_low, slab_high = low.copy(), high.copy()
            if up:
                slab_low[axis], slab_high[axis] = high[axis], high[axis] + step[face]
            else:
                slab_low[axis], slab_high[axis] = low[axis] - step[face], low[axis]
            if grown[face] + step[face] <= widest_m and proved(field, axes, slab_low, slab_high, required_m):
                grown[face] += step[face]
                (high if up else low)[axis] += step[face] if up else -step[face]
            else:
                step[face] = 0.5 * step[face] if step[face] > 0.03 else 0.0
    return Box(np.concatenate([-axes, axes]), np.concatenate([-low, high]))


def _leg_axes(along: FloatArray) -> FloatArray:
    """Rows: along the leg, horizontally across it, and across both."""
    size = np.linalg.norm(along)
    forward = along / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    across = np.cross([0.0, 0.0, 1.0], forward)
    if np.linalg.norm(across) < 1e-3:
        across = np.cross([0.0, 1.0, 0.0], forward)
    across /= np.linalg.norm(across)
    return np.stack([forward, across, np.cross(forward, across)])


def proved(field: space.DistanceField, axes: FloatArray, low: FloatArray, high: FloatArray, required_m: float) -> bool:
    """Whether every point of the box low..high (in the frame of `axes`) keeps `required_m`.

    A distance d at the centre of a piece proves d - (half its diagonal) everywhere in it; pieces not proved are halved.
    """
    pieces = np.maximum(np.ceil((high - low) / 0.4).astype(int), 1)
    half = (high - low) / pieces / 2.0
    steps = [low[i] + half[i] * (2 * np.arange(pieces[i]) + 1) for i in range(3)]
    centres = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    for _ in range(_DEPTH):
        d = space.distance(field, centres @ axes)
        if (d < required_m).any():
            return False
        centres = centres[d - np.linalg.norm(half) < required_m]
        if not len(centres):
            return True
        # Halve along the longer edges only; thin slabs stay thin.
        split = half > 0.5 * half.max()
        half = np.where(split, 0.5 * half, half)
        shifts = np.stack(np.meshgrid(*[[-h, h] if s else [0.0] for h, s in zip(half, split, strict=True)]), axis=-1)
        centres = (centres[:, None] + shifts.reshape(-1, 3)).reshape(-1, 3)
    return False
