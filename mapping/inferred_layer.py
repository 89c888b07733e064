"""The layer of a map that marks inferred surface: plain walls that no image measured, see `mapping.dense.planes`.

The voxels stay unknown in the distance field, which is an obstacle to the planner already. So nothing is free because
of a plane, an edit that clears measured surface does not open an inferred one, and what another map saw free is free.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from esdf import UNKNOWN, Field
from esdf.solids import slabs
from flight import FloatArray, FormatError, file_format, frames

Mask = NDArray[np.bool_]

VERSION = 1


def save(path: Path, inferred: Mask) -> None:
    """Write the mask (nx, ny, nz) as a compressed `.npz`."""
    file_format.write_arrays(path, version=VERSION, inferred=inferred)


def load(path: Path, shape: tuple[int, int, int]) -> Mask:
    """Read what `save` wrote, for a field of that shape; nothing is inferred where there is no file (earlier maps).

    Raises:
        FormatError: the file is damaged, newer, or of another field.
    """
    if not path.is_file():
        return np.zeros(shape, bool)
    fault = "a damaged layer of inferred surface"
    [inferred] = file_format.read_arrays(path, "inferred", version=VERSION, fault=fault, remedy="build the map again")
    if inferred.dtype != bool or inferred.shape != shape:
        raise FormatError(
            f"{path} holds {inferred.dtype} of shape {inferred.shape}, the field bool of {shape}; build the map again"
        )
    return inferred


def moved(inferred: Mask, field: Field, T_new_old: FloatArray, new: Field) -> Mask:
    """The mask in another frame: the unknown voxels of the new field whose centre lay in a marked one."""
    T_old_new, result = frames.invert(T_new_old), np.zeros(new.state.shape, bool)
    for slab in slabs(new.grid.everything):
        cells = np.argwhere(new.state[slab.slices] == UNKNOWN) + slab.low
        points = frames.apply(T_old_new, new.grid.centre(cells))
        inside = field.grid.contains(points)
        found = np.minimum(field.grid.index(points[inside]), np.array(field.grid.shape) - 1)
        result[tuple(cells[inside].T)] = inferred[tuple(np.maximum(found, 0).T)]
    return result


def joined(both: Field, parts: Sequence[tuple[Mask, Field]]) -> Mask:
    """The mask of maps in one, in the same frame and voxels: what one of them marks and none of them saw."""
    result = np.zeros(both.state.shape, bool)
    for inferred, field in parts:
        first = np.rint((field.grid.low_world_m - both.grid.low_world_m) / np.array(both.grid.voxel_m)).astype(int)
        result[tuple(slice(a, a + n) for a, n in zip(first, inferred.shape, strict=True))] |= inferred
    return result & (both.state == UNKNOWN)
