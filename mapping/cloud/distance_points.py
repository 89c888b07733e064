"""Distances at the middles of voxels as points (`.ply`): the ESDF layers and slices of nvblox, and our own."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import FloatArray, InputError
from mapping import imported, reach
from mapping.cloud import point_file
from mapping.imported import MOST_TRACED, Space
from mapping.map_server import Floor

_COLUMNS = ("x", "y", "z", "intensity")
_OWN = "distance"
"""The last one's name in files of `esdf.exchange`."""
_LOOKED_AT = 200_000
"""Points from which a layer is told from a scan; nvblox writes block by block, so that they are neighbours."""
_APART_M = 1e-3
"""Of numbers that are of one voxel; nvblox writes six digits."""
_OFF_LATTICE, _OFF_SQUARE = 0.03, 0.05
"""How far, in voxels and in squared voxels, a place and a distance of a layer may be from a whole number."""
_SHARE = 0.95
"""Of distances whose squares in voxels are whole numbers, as nvblox counts them, those at its cap apart: of other
numbers a tenth are. And of neighbours that differ by no more than they are apart."""


def is_layer(path: Path) -> bool:
    """Whether a PLY file of points holds distances at voxels, and no measured points.

    Raises:
        InputError, FormatError: it cannot be read; or it is a layer of nvblox of another kind, with distances below 0.
    """
    layout = point_file.layout(path)
    if layout.is_distances:
        return True
    if tuple(name for name, _ in layout.types) != _COLUMNS:
        return False
    columns = point_file.read(path, at_most=_LOOKED_AT)
    places, distance = _numbers(columns)
    edge = _edge(places)
    if not np.isfinite(distance).all() or edge is None or np.abs(_off(places, edge)).max() > _OFF_LATTICE:
        return False
    square = (distance / edge) ** 2
    is_whole = np.abs(square - np.rint(square)) < _OFF_SQUARE
    steps = _steps(places, distance, edge)
    if is_whole.mean() >= _SHARE and distance.max() > edge and len(steps) and (steps <= 1.05).mean() >= _SHARE:
        return True
    if distance.min() < 0.0:
        raise InputError(
            f"{path} looks like a layer of distances along rays (nvblox' TSDF): import its ESDF or its mesh instead"
        )
    return False


def read(path: Path, heights_m: tuple[float, float] | None = None) -> Space:
    """The voxels of a layer, in metres with z up; where it has no point nothing is known.

    Voxels of nvblox are occupied within half their diagonal of the middle of one that a surface passes; those of
    Goshawk from 0 on, which gives a map its states again.

    Args:
        heights_m: between which a slice, a layer of one voxel's height, holds.

    Raises:
        InputError: it is no layer, a slice without heights or a layer with them, too large or too far away.
        FormatError: it is damaged.
    """
    is_own = point_file.layout(path).is_distances
    places, distance = _numbers(point_file.read(path))
    edge = _edge(places)
    if edge is None or np.abs(_off(places, edge)).max() > _OFF_LATTICE or not np.isfinite(distance).all():
        raise InputError(f"{path}: its points are on no lattice of voxels, or not finite: import the mesh instead")
    reach.require_near_origin(places, str(path))
    low = places.min(axis=0)
    shape = tuple((np.rint((places.max(axis=0) - low) / edge).astype(int) + 1).tolist())
    if math.prod(shape) > MOST_TRACED:
        raise InputError(
            f"{path} spans {math.prod(shape) / 1e6:,.0f} million voxels, at most {MOST_TRACED / 1e6:g} million are "
            "read: cut the map, or import its mesh"
        )
    grid = Grid(tuple(low - 0.5 * edge), (edge, edge, edge), shape)
    imported.require_few(grid, "cut the map, or import its mesh", at_most=MOST_TRACED)
    state = _states(places, distance, grid, 0.0 if is_own else grid.half_diagonal_m)
    if heights_m is None and shape[2] > 1:
        return Space(grid, state)
    if heights_m is None or shape[2] > 1:
        raise InputError(
            f"{path} has {shape[2]} layers of voxels; --heights LOW,HIGH goes with one layer, a slice, and is needed "
            "then: it says between which heights that one holds"
        )
    corner = (float(low[0]) - 0.5 * edge, float(low[1]) - 0.5 * edge)
    return imported.columns(Floor(state[:, :, 0], edge, corner), *heights_m)


def _states(places: FloatArray, distance: FloatArray, grid: Grid, most_m: float) -> NDArray[np.uint8]:
    """(nx, ny, nz); of several points in one voxel the nearest to a surface counts."""
    state = np.full(grid.shape, UNKNOWN, np.uint8)
    index = np.rint((places - places.min(axis=0)) / grid.voxel_m[0]).astype(np.int64)
    for which, here in ((FREE, distance > most_m), (OCCUPIED, distance <= most_m)):
        state[tuple(index[here].T)] = which
    return state


def _numbers(columns: Mapping[str, NDArray[np.generic]]) -> tuple[FloatArray, FloatArray]:
    """Places (n, 3) and distances (n,)."""
    places = np.stack([np.asarray(columns[name], np.float64) for name in "xyz"], axis=1)
    return places, np.asarray(columns[_OWN if _OWN in columns else _COLUMNS[3]], np.float64)


def _edge(places: FloatArray) -> float | None:
    """The edge of cubes in whose middles all places are; None: there is none, or but one place."""
    edges, spans = [], []
    for axis in places.T if np.isfinite(places).all() else ():
        steps: FloatArray = np.diff(np.unique(axis)).astype(np.float64)
        steps = steps[steps > _APART_M]
        if len(steps):
            edges.append(float(np.median(steps)))
            spans.append(float(np.ptp(axis)))
    if not edges or max(edges) > 1.05 * min(edges):
        return None
    longest = max(spans)  # along which rounding matters least
    return longest / max(1.0, round(longest / edges[int(np.argmax(spans))]))


def _steps(places: FloatArray, distance: FloatArray, edge: float) -> FloatArray:
    """By how much distances of neighbours along the axes differ, in voxels, where they do.

    Labels, one number over large parts, differ by much wherever they do. None where voxels are too many to count.
    """
    index = np.rint((places - places.min(axis=0)) / edge).astype(np.int64)
    nx, ny, nz = (int(axis.max()) + 2 for axis in index.T)
    if nx * ny * nz > np.iinfo(np.int64).max:
        return np.zeros(0)
    key = np.ravel_multi_index(tuple(index.T), (nx, ny, nz))
    order = np.argsort(key)
    key, sorted_m = np.asarray(key)[order], distance[order]
    found: list[FloatArray] = []
    for stride in (1, nz, ny * nz):
        at = np.minimum(np.searchsorted(key, key + stride), len(key) - 1)
        found.append(np.abs(sorted_m[at] - sorted_m)[key[at] == key + stride] / edge)
    steps = np.concatenate(found)
    return steps[steps > _OFF_LATTICE]


def _off(places: FloatArray, edge: float) -> FloatArray:
    """(n, 3) how far each is from the lattice of the first, in voxels."""
    steps = (places - places[0]) / edge
    return steps - np.rint(steps)
