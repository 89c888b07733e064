"""Layers of voxblox (`.vxblx`) as voxels: occupied, free and unknown by their distances or occupancies."""

from pathlib import Path

import numpy as np

from esdf import UNKNOWN, observe
from esdf.exchange_voxblox import Layer, import_layer
from esdf.grid import StateArray
from flight import FormatError, InputError, errors
from mapping import imported, reach
from mapping.imported import MOST_TRACED, Space

SUFFIX = ".vxblx"
_MOST_BYTES = 2_000_000_000
_BYTES_EACH = 32
"""Of memory at most, a voxel of the box about all blocks, while a TSDF is read: 31 were measured, 17 of an ESDF."""


def read(path: Path) -> Space:
    """The voxels of a layer, in metres with z up; what it did not observe is unknown.

    Voxels of a TSDF or ESDF are occupied up to half their diagonal from a surface, which may pass through those. So
    what is not free in a map that was exported has grown by the voxels about it: its distances are to the unknown too.

    Raises:
        InputError: there is no such file, it is too large, or lies too far from the origin.
        FormatError: it is damaged or of another kind, or holds nothing.
    """
    if not path.is_file():
        raise errors.missing(path)
    if (size := path.stat().st_size) > _MOST_BYTES:
        raise InputError(f"{path} has {size / 1e9:.1f} GB, at most {_MOST_BYTES / 1e9:g} GB are read: cut the map")
    free_bytes = imported.free_memory_bytes()
    if 3 * size > free_bytes:  # the file, and its words apart
        raise InputError(
            f"{path} takes {3 * size / 1e9:.1f} GB of memory; {free_bytes / 1e9:.1f} GB are free here: cut the map"
        )
    layer = import_layer(path, at_most=min(MOST_TRACED, free_bytes // _BYTES_EACH))
    reach.require_near_origin(np.stack([layer.grid.low_world_m, layer.grid.high_world_m]), str(path))
    state = _states(layer)
    if (state == UNKNOWN).all():
        raise FormatError(f"{path} holds neither free nor occupied space")
    of = layer.kind if layer.layers == 1 else f"{layer.kind}, the first of {layer.layers} layers"
    return Space(layer.grid, state, of)


def _states(layer: Layer) -> StateArray:
    if layer.kind == "occupancy":
        from scipy import special

        return observe.state_from_occupancy(special.expit(layer.value.astype(np.float64)), layer.grid)
    return observe.state_from_tsdf(layer.value, layer.weight, layer.grid)
