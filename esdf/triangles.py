"""Which voxels a triangle mesh touches, by separating axes: Akenine-Möller, "Fast 3D triangle-box overlap" (2001)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from esdf.grid import Grid
from flight import FloatArray

_LONGEST_EDGE = 8.0
"""Voxels. Longer triangles are halved first: the box about a large slanted one holds many voxels that it misses."""
_PAIRS = 500_000
"""Triangles times voxels tested at a time, which bounds memory to 100 MB."""
_ROUNDING = 1e-6
"""Of a voxel: a surface on the boundary between two touches both."""


def touched(vertices_world_m: FloatArray, faces: NDArray[np.int32], grid: Grid) -> NDArray[np.bool_]:
    """Which voxels a mesh touches; none that it touches is left out, so no path through the others crosses it.

    Args:
        vertices_world_m: (v, 3) finite.
        faces: (f, 3) vertices; triangles without area count as lines and points.

    Returns:
        (nx, ny, nz) of the grid; what lies outside of it is left out.
    """
    hit = np.zeros(grid.shape, bool)
    triangles = (vertices_world_m - grid.low_world_m)[faces] / np.array(grid.voxel_m)
    for corners in _small(triangles.reshape(-1, 3, 3)):
        low = np.clip(np.floor(corners.min(axis=1) - _ROUNDING).astype(np.int64), 0, grid.shape)
        high = np.clip(np.floor(corners.max(axis=1) + _ROUNDING).astype(np.int64) + 1, low, grid.shape)
        for which, voxels in _candidates(low, high):
            overlap = _overlap(corners[which] - (voxels[:, None] + 0.5))
            hit[tuple(voxels[overlap].T)] = True
    return hit


def _small(triangles: FloatArray) -> Iterator[FloatArray]:
    """The same surface (n, 3, 3), in triangles without long edges."""
    while len(triangles):
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        long = edges.max(axis=1) > _LONGEST_EDGE
        yield triangles[~long]
        triangles, first = triangles[long], edges[long].argmax(axis=1)
        n = np.arange(len(triangles))
        a, b, c = (triangles[n, (first + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _candidates(low: NDArray[np.int64], high: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], ...]]:
    """Pairs of a triangle (n,) and a voxel (n, 3) of the box about it."""
    size = high - low
    ends = np.cumsum(size.prod(axis=1))
    begin = 0
    while begin < len(ends):
        before = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, before + _PAIRS, side="right")))
        which = np.repeat(np.arange(begin, end), np.diff(ends[begin:end], prepend=before))
        number = np.arange(len(which)) + before - (ends - size.prod(axis=1))[which]
        _, ny, nz = size[which].T
        yield which, low[which] + np.stack([number // (ny * nz), number // nz % ny, number % nz], axis=1)
        begin = end


def _overlap(corners: FloatArray) -> NDArray[np.bool_]:
    """Which triangles (n, 3, 3) touch the unit cube about the origin, those whose bounding boxes do being given."""
    edges = np.roll(corners, -1, axis=1) - corners
    axes = [np.cross(edges[:, 0], edges[:, 1])]
    axes += [np.cross(np.eye(3)[a], edges[:, e]) for a in range(3) for e in range(3)]
    together = np.ones(len(corners), bool)
    for axis in axes:
        along = np.einsum("nkd,nd->nk", corners, axis)
        reach = (0.5 + _ROUNDING) * np.abs(axis).sum(axis=1)
        together &= (along.min(axis=1) <= reach) & (along.max(axis=1) >= -reach)
    return together
