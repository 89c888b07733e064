"""The same map on another lattice: a part of it, two maps in one, larger voxels. Each is rebuilt, so exact."""

import numpy as np
from numpy.typing import NDArray

from esdf.build import build
from esdf.field import Field
from esdf.grid import FREE, OCCUPIED, UNKNOWN, Grid, Region, StateArray
from flight import InputError


def crop(field: Field, region: Region) -> Field:
    """A part of a map as a map of its own. Outside of the part it is unknown (solid under the policy "obstacle")."""
    inside = region.common(field.grid.everything)
    if inside.empty:
        raise InputError(f"the part from {region.low} to {region.high} holds no voxel of the map")
    part = field.grid.part(inside)
    return build(field.state[inside.slices], part, cap_m=field.cap_m, unknown=field.unknown)


def merge(first: Field, second: Field) -> Field:
    """Union of two maps of one lattice: a voxel that either observed is known, one occupied in either is occupied.

    Raises:
        InputError: voxel sizes, caps or policies differ, or the lattices are shifted by a fraction of a voxel.
    """
    if first.grid.voxel_m != second.grid.voxel_m:
        raise InputError(f"voxels of {first.grid.voxel_m} and {second.grid.voxel_m} m do not merge; resample one")
    if (first.cap_m, first.unknown) != (second.cap_m, second.unknown):
        raise InputError(f"maps made with {first.cap_m, first.unknown} and {second.cap_m, second.unknown} do not merge")
    shift = (second.grid.low_world_m - first.grid.low_world_m) / np.array(first.grid.voxel_m)
    steps = np.rint(shift).astype(int)
    if np.abs(shift - steps).max() > 1e-6:
        raise InputError(f"the lattices are shifted by {shift.tolist()} voxels, not a whole number; resample one")
    low = np.minimum(0, steps)
    high = np.maximum(first.grid.shape, steps + np.array(second.grid.shape))
    origin = first.grid.low_world_m + low * np.array(first.grid.voxel_m)
    grid = Grid(tuple(origin), first.grid.voxel_m, tuple(high - low))
    state = np.full(grid.shape, UNKNOWN, np.uint8)
    for at, part in ((-low, first.state), (steps - low, second.state)):
        place = tuple(slice(a, a + n) for a, n in zip(at, part.shape, strict=True))
        state[place] = np.maximum(state[place], part)  # unknown < free < occupied
    return build(state, grid, cap_m=first.cap_m, unknown=first.unknown)


def resample(field: Field, grid: Grid) -> Field:
    """The map on another lattice, never more permissive than it was.

    A new voxel is occupied if it overlaps an occupied one, else unknown if it overlaps an unknown one or leaves the
    map, else free.
    """
    axes = [_overlaps(field.grid, grid, axis) for axis in range(3)]
    state = np.full(grid.shape, FREE, np.uint8)
    state[_any_of(field.state == UNKNOWN, axes, beyond=True)] = UNKNOWN
    state[_any_of(field.state == OCCUPIED, axes, beyond=False)] = OCCUPIED
    return build(state, grid, cap_m=field.cap_m, unknown=field.unknown)


def _overlaps(old: Grid, new: Grid, axis: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Per new voxel of an axis: the first and one past the last old voxel it overlaps."""
    edges = new.origin_world_m[axis] + np.arange(new.shape[axis] + 1) * new.voxel_m[axis]
    old_edges = (edges - old.origin_world_m[axis]) / old.voxel_m[axis]
    return np.floor(old_edges[:-1] + 1e-6).astype(np.int64), np.ceil(old_edges[1:] - 1e-6).astype(np.int64)


def _any_of(
    mask: NDArray[np.bool_], axes: list[tuple[NDArray[np.int64], NDArray[np.int64]]], *, beyond: bool
) -> NDArray[np.bool_]:
    """Whether any old voxel in each new voxel's box is in the mask; voxels outside of the old map count as `beyond`."""
    for axis, (low, high) in enumerate(axes):
        along = np.moveaxis(mask, axis, 0)
        n = len(along)
        counts = np.concatenate([np.zeros((1, *along.shape[1:]), np.int32), np.cumsum(along, axis=0, dtype=np.int32)])
        some = counts[np.clip(high, 0, n)] > counts[np.clip(low, 0, n)]
        if beyond:
            some[(low < 0) | (high > n)] = True
        mask = np.moveaxis(some, 0, axis)
    return mask


def coarser_state(state: StateArray, factor: int) -> StateArray:
    """States on voxels `factor` times as long (level of detail for display): occupied wins, then free, then unknown."""
    if factor < 1:
        raise InputError(f"the level of detail is {factor}; it must be at least 1")
    nx, ny, nz = (-(-n // factor) for n in state.shape)
    blocks = np.full((nx * factor, ny * factor, nz * factor), UNKNOWN, np.uint8)
    blocks[: state.shape[0], : state.shape[1], : state.shape[2]] = state
    return blocks.reshape(nx, factor, ny, factor, nz, factor).max(axis=(1, 3, 5))
