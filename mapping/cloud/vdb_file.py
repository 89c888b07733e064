"""OpenVDB volumes (`.vdb`) of distances as voxels: occupied where a surface may pass; free by what states it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.exchange_vdb import CREATOR
from flight import FloatArray, FormatError, InputError, errors
from mapping import foreign_mesh, imported, reach
from mapping.cloud import vdb_tree
from mapping.cloud.vdb_tree import Volume
from mapping.imported import MOST_TRACED, Space

SUFFIX = ".vdb"
_MOST_BYTES = 2_000_000_000
_BYTES_EACH = 16
"""Of memory at most, a voxel of the box about all active ones, besides the file."""
_FOG = "fog volume"
_ALIKE = 1e-6
"""By how much edges of voxels may differ, relatively, and still be cubes."""


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """A volume in a map's frame."""

    grid: Grid
    state: NDArray[np.uint8]
    """(nx, ny, nz): what is occupied; free only where a map of Goshawk states it."""
    unit: str
    """Of `foreign_mesh.UNITS_M`, and why."""
    up: str
    stated: bool
    """Whether it is of Goshawk, and states which space is free."""


def read(path: Path, *, unit: str | None = None, up: str | None = None, origin: FloatArray | None = None) -> Distances:
    """The voxels of a volume of signed distances, negative inside.

    Voxels up to half their diagonal from a surface are occupied, and all that is inside. Nothing else is known of a
    volume of another program, which is a shape and no record of what was seen. Of one that Goshawk wrote every active
    voxel is known, and has its state again.

    Args: unit, up, origin: as of `foreign_mesh.read`; `up` is an axis.

    Raises:
        InputError: there is no such file, it is too large, of densities, not of cubes, or of a kind that is not read.
        FormatError: it is damaged or cut off, or has nothing occupied.
    """
    if not path.is_file():
        raise errors.missing(path)
    size, free_bytes = path.stat().st_size, imported.free_memory_bytes()
    if size > min(_MOST_BYTES, free_bytes // 2):
        most = min(_MOST_BYTES, free_bytes // 2)
        raise InputError(f"{path} has {size / 1e9:.1f} GB, at most {most / 1e9:.1f} GB are read here: cut the volume")
    volume = vdb_tree.read(path, at_most=min(MOST_TRACED, (free_bytes - size) // _BYTES_EACH))
    if volume.kind == _FOG:
        raise InputError(
            f"{path}: {volume.name or 'its grid'} is a fog volume, of densities; make it a level set of distances "
            "(Houdini's Convert VDB), or a mesh (Blender's Volume to Mesh)"
        )
    if not np.isfinite(volume.value[volume.active]).all():
        raise FormatError(f"{path}: not all its active voxels are finite numbers; export it again")
    own = volume.creator == CREATOR
    grid, state, unit, up = _placed(path, volume.grid, _states(volume, own=own), unit, up, origin, own=own)
    reach.require_near_origin(np.stack([grid.low_world_m, grid.high_world_m]), str(path))
    return Distances(grid, state, unit, up, own)


def space(found: Distances, observed_world_m: FloatArray) -> Space:
    """The voxels; besides, those are free that a path connects with an observed place, as `imported.space` has it.

    Raises:
        InputError: a place is outside of the box or occupied, or the volume states itself what is free.
    """
    if not len(observed_world_m):
        return Space(found.grid, found.state)
    if found.stated:
        raise InputError("a volume that Goshawk wrote states what is free; --observed is for those of other programs")
    closed = found.state == OCCUPIED
    remedy = "lies in a voxel that is occupied, or touches a surface; name a place that is free"
    state = found.state.copy()
    state[imported.connected(closed, found.grid, observed_world_m, "volume", remedy)] = FREE
    return Space(found.grid, state)


def _states(volume: Volume, *, own: bool) -> NDArray[np.uint8]:
    if own:
        state = np.where(volume.value > 0.0, np.uint8(FREE), np.uint8(OCCUPIED))
        state[~volume.active] = UNKNOWN
        return state
    return np.where(volume.value <= volume.grid.half_diagonal_m, np.uint8(OCCUPIED), np.uint8(UNKNOWN))


def _placed(
    path: Path,
    grid: Grid,
    state: NDArray[np.uint8],
    unit: str | None,
    up: str | None,
    origin: FloatArray | None,
    *,
    own: bool,
) -> tuple[Grid, NDArray[np.uint8], str, str]:
    """Grid and states in the map's frame, with the words for unit and up."""
    edges = np.array(grid.voxel_m)
    if np.ptp(edges) > _ALIKE * edges.max():
        raise InputError(f"{path}: its voxels are {grid.voxel_m} wide; resample it with cubes")
    rule = "Goshawk's rule" if own and unit is None else "as given"
    extent = float((edges * grid.shape).max())
    unit_m, unit_words = foreign_mesh.scale(path, extent, "m" if own and unit is None else unit, given=rule)
    R, up_words = (np.eye(3), f"z ({rule})") if own and up is None else foreign_mesh.rotation(path, up)
    axes = np.abs(R).argmax(axis=1)
    if not np.array_equal(np.abs(R), np.eye(3)[axes]):
        raise InputError(f"--up {up} turns the voxels; of a volume give one of x, y, z, -x, -y, -z")
    low, high = grid.low_world_m, grid.high_world_m
    corners = unit_m * (np.stack([low, high]) - (0.0 if origin is None else origin)) @ R.T
    turned = np.flip(state.transpose(axes), tuple(k for k in range(3) if R[k, axes[k]] < 0.0))
    edge_m = float(unit_m * edges[0])
    placed = Grid(tuple(corners.min(axis=0)), (edge_m, edge_m, edge_m), turned.shape)
    return placed, np.ascontiguousarray(turned), unit_words, up_words
