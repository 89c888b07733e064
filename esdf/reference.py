"""NumPy reference of the compiled transform: the same minimum, axis by axis. Slow, and short enough to verify."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from esdf.build import Recipe
from esdf.grid import FREE, OCCUPIED, UNKNOWN, StateArray


def transform(recipe: Recipe, state: StateArray) -> NDArray[np.float32]:
    """Signed distances in metres of a whole map, bit-equal to the kernel's."""
    solid = state != FREE if recipe.unknown == "obstacle" else state == OCCUPIED
    outside_is_solid = recipe.unknown == "obstacle"
    to_solid = _metres(recipe, _squared(recipe, solid, outside_is_solid))
    to_free = _metres(recipe, _squared(recipe, ~solid, False))
    values = np.where(solid, -to_free, to_solid)
    if recipe.unknown == "nan":
        values[state == UNKNOWN] = np.nan
    return values


def _squared(recipe: Recipe, sites: NDArray[np.bool_], outside_is_site: bool) -> NDArray[Any]:
    """Squared distance of every voxel to the nearest site, in the recipe's unit: one axis after the other, z first."""
    kind = np.float32 if recipe.tables[0].dtype == np.float32 else np.int64
    best = np.where(sites, kind(0), kind(recipe.cap))
    for axis in (2, 1, 0):
        table = recipe.tables[axis].astype(kind)
        before = np.moveaxis(best, axis, 0)
        after = before.copy()
        n = len(before)
        for k in range(1, n):
            after[k:] = np.minimum(after[k:], before[:-k] + table[k])
            after[:-k] = np.minimum(after[:-k], before[k:] + table[k])
        if outside_is_site:
            to_face = table[np.minimum(np.arange(n), np.arange(n)[::-1]) + 1]
            after = np.minimum(after, to_face.reshape(-1, 1, 1))
        best = np.moveaxis(after, 0, axis)
    return np.minimum(best, kind(recipe.cap))


def _metres(recipe: Recipe, squared: NDArray[Any]) -> NDArray[np.float32]:
    kind = np.float64 if recipe.tables[0].dtype == np.int32 else np.float32
    exact = np.sqrt(squared.astype(kind)).astype(np.float32) * np.float32(recipe.scale)
    return np.where(squared < recipe.cap, np.minimum(exact, np.float32(recipe.cap_m)), np.float32(recipe.cap_m))
