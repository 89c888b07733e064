"""What is worth another look: unknown space beside the free space of a map, cell by cell.

1. The frontier: unknown voxels beside free ones (Yamauchi, 1997). Those that several images looked at in vain are left
   out, and taken as opaque: a blank wall stays unknown however often it is seen.
2. The targets: unknown space not farther than `depth_m` from the frontier.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Field, Grid
from esdf.visibility import line_of_sight
from flight import FloatArray, InputError, Progress, silent
from mapping.camera.rig import Rig

IN_VAIN = 6
"""Images that looked at a place of the frontier without its becoming known, twice what free space asks for: more looks
would be as vain. Not if all were taken at one place, without parallax."""
APART_M = 0.3
"""What was looked at from places closer together was looked at from one."""
_CELL_M = 0.2
"""Edge of a cell, whose part of the unknown space counts as seen if one voxel of it is."""
_MOST_CELLS = 4000
"""Larger maps get larger cells."""


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Unknown space that is worth another look."""

    middle_world_m: FloatArray
    """(n, 3) of each cell the centre of the unknown voxel nearest to the middle of all of the cell's."""
    volume_m3: FloatArray
    """(n,) unknown space in each."""
    state: NDArray[np.uint8]
    """The map's, where what was looked at in vain is occupied."""
    in_vain_m3: float
    """Frontier that `IN_VAIN` images or more looked at, not all from one place, and that stayed unknown."""


def targets(
    field: Field,
    rig: Rig,
    T_world_body: FloatArray,
    *,
    farthest_m: float,
    depth_m: float,
    least_m3: float,
    near_world_m: FloatArray | None = None,
    within_m: float = np.inf,
    progress: Progress = silent,
) -> Targets:
    """The unknown space behind the frontier, without what was looked at in vain.

    Args:
        field: the map's; occupied voxels hide what is behind them.
        rig: that took the map's images.
        T_world_body: (n, 4, 4) of them.
        farthest_m: range beyond which an image is not expected to show whether space is free.
        depth_m: how far behind the frontier unknown space counts.
        least_m3: smaller pieces are left out.
        near_world_m: (m, 3) path; only frontier within `within_m` of it counts. All of the map without.

    Raises:
        InputError: all of the path's points are outside the map.
    """
    grid = field.grid
    if near_world_m is not None and not grid.contains(near_world_m).any():
        raise InputError("no waypoint of the flight to look near to is inside the map; is it of another map?")
    progress("frontier", 0.0)
    frontier = _frontier(field.state)
    if near_world_m is not None:
        frontier &= _near(grid, frontier, near_world_m, within_m)
    vain = _looked_at_in_vain(field.state, grid, frontier, rig, T_world_body, farthest_m, progress)
    state = np.where(vain, np.uint8(OCCUPIED), field.state)
    middle_world_m, volume_m3 = _cells(state, grid, frontier & ~vain, depth_m, least_m3)
    return Targets(middle_world_m, volume_m3, state, float(vain.sum()) * float(np.prod(grid.voxel_m)))


def _frontier(state: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Unknown voxels with a free one beside a face."""
    from scipy import ndimage

    return ndimage.binary_dilation(state == FREE) & (state == UNKNOWN)


def _near(grid: Grid, marked: NDArray[np.bool_], path_world_m: FloatArray, within_m: float) -> NDArray[np.bool_]:
    """Of the voxels that are marked, those near the straight lines between the points."""
    cells = np.argwhere(marked)
    for a, b in pairwise(path_world_m[[0, *range(len(path_world_m))]]):  # a single point is a line of no length
        offset, way = grid.centre(cells) - a, b - a
        share = np.clip(offset @ way / max(way @ way, 1e-12), 0.0, 1.0)
        cells = cells[np.linalg.norm(offset - share[:, None] * way, axis=1) > within_m]
    far = np.zeros_like(marked)
    far[tuple(cells.T)] = True
    return marked & ~far


def _looked_at_in_vain(
    state: NDArray[np.uint8],
    grid: Grid,
    frontier: NDArray[np.bool_],
    rig: Rig,
    T_world_body: FloatArray,
    farthest_m: float,
    progress: Progress,
) -> NDArray[np.bool_]:
    """Voxels of the frontier that `IN_VAIN` images, not all from one place, had in view through free space alone."""
    cells = np.argwhere(frontier)
    middle = grid.centre(cells)
    opaque = np.where(state == FREE, np.uint8(FREE), np.uint8(OCCUPIED))
    looks = np.zeros(len(cells), np.int64)
    first_place = np.full((len(cells), 3), np.nan)
    elsewhere = np.zeros(len(cells), bool)
    for number, T in enumerate(T_world_body, start=1):
        for camera in rig:
            eye = T @ camera.T_body_camera
            offset = middle - eye[:3, 3]
            decided = (looks >= IN_VAIN) & elsewhere
            asked = np.flatnonzero((np.einsum("ij,ij->i", offset, offset) <= farthest_m**2) & ~decided)
            asked = asked[camera.contains(camera.project(offset[asked] @ eye[:3, :3]))]
            looked = asked[line_of_sight(opaque, grid, eye[:3, 3], middle[asked])]
            first_place[looked[looks[looked] == 0]] = T[:3, 3]
            elsewhere[looked] |= np.linalg.norm(T[:3, 3] - first_place[looked], axis=1) >= APART_M
            looks[looked] += 1
        progress("what was looked at", number / len(T_world_body))
    vain = np.zeros_like(frontier)
    vain[tuple(cells[(looks >= IN_VAIN) & elsewhere].T)] = True
    return vain


def _cells(
    state: NDArray[np.uint8], grid: Grid, seeds: NDArray[np.bool_], depth_m: float, least_m3: float
) -> tuple[FloatArray, FloatArray]:
    """Unknown space behind the seeds, without the smaller pieces: middles (n, 3) and volumes (n,), as in `Targets`."""
    from scipy import ndimage

    unknown = state == UNKNOWN
    steps = round(depth_m / min(grid.voxel_m))
    behind = ndimage.binary_dilation(seeds, mask=unknown, iterations=steps) if steps and seeds.any() else seeds
    voxel_m3 = float(np.prod(grid.voxel_m))
    pieces = np.zeros(grid.shape, np.int32)
    ndimage.label(behind, np.ones((3, 3, 3)), output=pieces)
    large = np.bincount(pieces.ravel()) * voxel_m3 >= least_m3
    large[0] = False
    voxels = np.argwhere(large[pieces])
    if not len(voxels):
        return np.zeros((0, 3)), np.zeros(0)
    edge = max(1, round(_CELL_M / min(grid.voxel_m)))
    cell, count = _gathered(voxels // edge)
    while len(count) > _MOST_CELLS:
        edge += 1
        cell, count = _gathered(voxels // edge)
    mean = np.stack([np.bincount(cell, voxels[:, axis]) for axis in range(3)], axis=1) / count[:, None]
    apart = np.linalg.norm(voxels - mean[cell], axis=1)
    order = np.lexsort((apart, cell))
    nearest = order[np.searchsorted(cell[order], np.arange(len(count)))]
    return grid.centre(voxels[nearest]), voxel_m3 * count.astype(np.float64)


def _gathered(blocks: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number of the cell of each block (n, 3), from 0, and how many each cell has."""
    flat = np.ravel_multi_index(tuple(blocks.T), tuple(blocks.max(axis=0) + 1))
    _, cell, count = np.unique(flat, return_inverse=True, return_counts=True)
    return cell, count
