"""How likely something is missing from a map near a path, stretch by stretch, from what the map states voxel by voxel.

Voxels are not independent: a thing that comes near a path fills a row of them. So the expected number of things is that
of the voxels which hold something, over those that a straight rod fills within reach of the path.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray
from mapping.dense.occupancy import FREE_BY_LOOKS

LEAST_STRETCH, LEAST_WHOLE = 0.01, 0.05
"""Probabilities from which a stretch is worth a look, and all the rest of the path together."""
UNSTATED = FREE_BY_LOOKS[0][1]
"""Of free voxels of which the map states nothing: that of those at which no image looked from nearby."""


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """Free voxels within reach of a path in which something could hide."""

    nearest: NDArray[np.int64]
    """(m,) the path's position that each is nearest to."""
    probability: FloatArray
    """(m,) that it holds something; NaN where that is not stated."""


@dataclass(frozen=True, slots=True)
class Part:
    """A stretch of a path."""

    first: int
    """Position of the path where it begins, and where it ends."""
    last: int
    probability: float
    place: int
    """The voxel that most likely holds something."""


def expected(near: Near, reach_m: float, voxel_m: float) -> FloatArray:
    """(m,) how many things each voxel adds to those that are expected within reach.

    A straight rod at right angles to the path fills pi/2 radii of the tube about it on average, if it crosses that
    anywhere as likely.
    """
    filled = max(1.0, 0.5 * np.pi * reach_m / voxel_m)
    return _stated(near) / filled


def probability(near: Near, things: FloatArray) -> float:
    """That there is something in one of the voxels: of the expected number of things, but at least of one voxel."""
    return float(np.max(_stated(near), initial=-np.expm1(-things.sum())))


def _stated(near: Near) -> FloatArray:
    return np.where(np.isnan(near.probability), UNSTATED, near.probability)


def parts(near: Near, things: FloatArray, path_world_m: FloatArray, reach_m: float) -> list[Part]:
    """The stretches that are worth a look, the likeliest first.

    Args:
        things: (m,) of `expected`.
        path_world_m: (n, 3) equally spaced.
    """
    length_m = float(np.linalg.norm(np.diff(path_world_m, axis=0), axis=1).sum())
    count = max(1, int(length_m / reach_m))
    of_path = np.minimum(np.arange(len(path_world_m)) * count // len(path_world_m), count - 1)
    of_voxel = of_path[near.nearest]
    sums = np.bincount(of_voxel, things, count)
    single = np.zeros(count)
    np.maximum.at(single, of_voxel, _stated(near))
    likely = np.maximum(-np.expm1(-sums), single) >= LEAST_STRETCH
    rest_too = -np.expm1(-sums[~likely].sum()) >= LEAST_WHOLE
    edges = [0, *(np.flatnonzero(np.diff(likely)) + 1).tolist(), count]
    runs = [(a, b) for a, b in itertools.pairwise(edges) if likely[a] or rest_too]
    found = [_part(a, b, of_path, of_voxel, near, things) for a, b in runs if sums[a:b].any()]
    return sorted(found, key=lambda part: -part.probability)


def _part(
    begin: int, end: int, of_path: NDArray[np.int64], of_voxel: NDArray[np.int64], near: Near, things: FloatArray
) -> Part:
    """Of the pieces from `begin` to before `end`."""
    on_path = np.flatnonzero((of_path >= begin) & (of_path < end))
    voxels = np.flatnonzero((of_voxel >= begin) & (of_voxel < end))
    place = int(voxels[np.argmax(things[voxels])])
    mine = Near(near.nearest[voxels], near.probability[voxels])
    return Part(int(on_path[0]), int(on_path[-1]), probability(mine, things[voxels]), place)
