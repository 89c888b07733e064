"""Solids, edits and fields carried into another frame by `T_new_old`, a rotation and a translation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from esdf import solids
from esdf.build import build
from esdf.edits import Edit
from esdf.field import Field
from esdf.grid import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.solids import Box, Capsule, Cylinder, OrientedBox, Prism, Room, Solid, Sphere, Stroke
from flight import FloatArray, InputError, frames, rotations

_STILL = 1e-9
"""Largest element of a rotation's difference to none that is taken for rounding."""
_WALL_M = 1e4
"""Thickness of the walls that a turned room is made of."""


def moved_solid(solid: Solid, T_new_old: FloatArray) -> tuple[Solid, ...]:
    """The same body in the new frame: one solid, or for a turned `Room` its six walls.

    Raises:
        InputError: an upright solid would lean.
    """
    R, t = T_new_old[:3, :3], T_new_old[:3, 3]
    turns, leans = not _same(R, np.eye(3)), not _same(R[:, 2], np.array([0.0, 0.0, 1.0]))

    def point(old: Sequence[float]) -> tuple[float, float, float]:
        x, y, z = (R @ np.asarray(old) + t).tolist()
        return x, y, z

    if leans and isinstance(solid, Cylinder | Prism):
        raise InputError(f"an upright {type(solid).__name__.lower()} cannot lean")
    match solid:
        case Sphere():
            return (replace(solid, centre_world_m=point(solid.centre_world_m)),)
        case Cylinder():
            return (replace(solid, centre_world_m=point(solid.centre_world_m)),)
        case Capsule():
            return (replace(solid, start_world_m=point(solid.start_world_m), end_world_m=point(solid.end_world_m)),)
        case Stroke():
            return (replace(solid, points_world_m=tuple(point(p) for p in solid.points_world_m)),)
        case Prism():
            corners = tuple(point((x, y, 0.0))[:2] for x, y in solid.polygon_world_m)
            return (Prism(corners, solid.z_low_m + float(t[2]), solid.z_high_m + float(t[2])),)
        case OrientedBox():
            return (_oriented(T_new_old, solid),)
        case Box() | Room() if not turns:
            low, high = point(solid.low_world_m), point(solid.high_world_m)
            return (type(solid)(low, high),)
        case Box():
            low, high = np.array(solid.low_world_m), np.array(solid.high_world_m)
            return (_oriented(T_new_old, _box(0.5 * (low + high), 0.5 * (high - low))),)
        case Room():
            return tuple(_oriented(T_new_old, wall) for wall in _walls(solid))
        case _:
            raise InputError(f"a {type(solid).__name__} cannot be moved")


def moved_edits(edits: Sequence[Edit], T_new_old: FloatArray, grid: Grid) -> tuple[Edit, ...]:
    """Edits in the new frame, without those that reach no voxel of the new grid.

    Raises:
        InputError: an upright shape would lean; the message names the edit.
    """
    result: list[Edit] = []
    for number, edit in enumerate(edits, start=1):
        try:
            parts = moved_solid(edit.solid, T_new_old)
        except InputError as error:
            raise InputError(
                f"edit {number} ({edit.action} {edit.name}): {error}; remove it from the map and draw it in the new one"
            ) from error
        for k, part in enumerate(parts, start=1):
            name = f"{edit.name} {k}" if len(parts) > 1 and edit.name else edit.name
            if not solids.covered_region(part, grid).empty:
                result.append(Edit(edit.action, part, name))
    return tuple(result)


def moved_field(field: Field, T_new_old: FloatArray, *, lattice: Grid | None = None, uncertain_m: float = 0.0) -> Field:
    """A mapped field in the new frame, never more permissive than it was.

    Without a rotation, a lattice and an uncertainty the voxels stay what they are. Else a new voxel is occupied if the
    box round it, along the old axes, overlaps an occupied voxel, else unknown if it overlaps an unknown one or leaves
    the map, else free: surfaces grow by up to a voxel.

    Args:
        lattice: the new voxels are multiples of this grid's away from its own; its size is used, too.
        uncertain_m: how far from its place each point may lie: the boxes round new voxels are so much larger.
    """
    R, t = T_new_old[:3, :3], T_new_old[:3, 3]
    if lattice is None and _same(R, np.eye(3)) and not uncertain_m > 0.0:
        origin = tuple((field.grid.low_world_m + t).tolist())
        return replace(field, grid=Grid(origin, field.grid.voxel_m, field.grid.shape))
    grid = _covering(field.grid, T_new_old, lattice)
    T_old_new = frames.invert(T_new_old)
    # voxels of the old grid that the box round a new voxel spans, by sums over all voxels up to a corner
    half_m = np.abs(T_old_new[:3, :3]) @ (0.5 * np.array(grid.voxel_m)) + uncertain_m
    occupied, unknown = (_sums(field.state == which) for which in (OCCUPIED, UNKNOWN))
    state = np.empty(grid.shape, np.uint8)
    for slab in solids.slabs(grid.everything):
        centres = frames.apply(T_old_new, grid.centres(slab).reshape(-1, 3)) - field.grid.low_world_m
        low = np.floor((centres - half_m) / field.grid.voxel_m + 1e-6).astype(np.int64)
        high = np.ceil((centres + half_m) / field.grid.voxel_m - 1e-6).astype(np.int64)
        beyond = ((low < 0) | (high > field.grid.shape)).any(axis=1)
        low, high = (np.clip(corner, 0, field.grid.shape) for corner in (low, high))
        part = np.full(len(centres), FREE, np.uint8)
        part[beyond | (_within(unknown, low, high) > 0)] = UNKNOWN
        part[_within(occupied, low, high) > 0] = OCCUPIED
        state[slab.slices] = part.reshape(slab.shape)
    return build(state, grid, cap_m=field.cap_m, unknown=field.unknown)


def _same(a: FloatArray, b: FloatArray) -> bool:
    return bool(np.abs(a - b).max() < _STILL)


def _oriented(T_new_old: FloatArray, box: OrientedBox) -> OrientedBox:
    x, y, z = frames.apply(T_new_old, np.array([box.centre_world_m]))[0].tolist()
    q = rotations.multiply(rotations.from_matrix(T_new_old[:3, :3]), rotations.normalise(box.q_world_box))
    return OrientedBox((x, y, z), box.half_extents_m, tuple(q.tolist()))


def _box(centre: FloatArray, half: FloatArray) -> OrientedBox:
    return OrientedBox(tuple(centre.tolist()), tuple(half.tolist()), (1.0, 0.0, 0.0, 0.0))


def _walls(room: Room) -> list[OrientedBox]:
    """Six boxes that fill what is outside of a room."""
    low, high = np.array(room.low_world_m), np.array(room.high_world_m)
    walls = []
    for axis in range(3):
        for side, face in ((-1.0, low), (1.0, high)):
            centre, half = 0.5 * (low + high), 0.5 * (high - low) + _WALL_M
            centre[axis] = face[axis] + side * 0.5 * _WALL_M
            half[axis] = 0.5 * _WALL_M
            walls.append(_box(centre, half))
    return walls


def _covering(old: Grid, T_new_old: FloatArray, lattice: Grid | None) -> Grid:
    """The smallest grid of the lattice round the turned one."""
    ends = np.array([old.low_world_m, old.high_world_m])
    corners = frames.apply(T_new_old, np.array([ends[list(k), range(3)] for k in np.ndindex(2, 2, 2)]))
    if lattice is None:
        lattice = Grid((0.0, 0.0, 0.0), old.voxel_m, (1, 1, 1))
    voxel_m = np.array(lattice.voxel_m)
    first = np.floor((corners.min(axis=0) - lattice.low_world_m) / voxel_m + 1e-6)
    last = np.ceil((corners.max(axis=0) - lattice.low_world_m) / voxel_m - 1e-6)
    origin = lattice.low_world_m + first * voxel_m
    return Grid(tuple(origin.tolist()), lattice.voxel_m, tuple((last - first).astype(int).tolist()))


def _sums(mask: np.ndarray) -> np.ndarray:
    """(nx + 1, ny + 1, nz + 1): how many voxels below each corner are in the mask."""
    sums = np.zeros(tuple(n + 1 for n in mask.shape), np.int32)
    sums[1:, 1:, 1:] = mask.cumsum(0, dtype=np.int32).cumsum(1, dtype=np.int32).cumsum(2, dtype=np.int32)
    return sums


def _within(sums: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) number of voxels of the mask in the boxes from `low` to `high` (n, 3)."""
    total = np.zeros(len(low), np.int32)
    for corner in np.ndindex(2, 2, 2):
        at = np.where(corner, high, low)
        total += (-1) ** (3 - sum(corner)) * sums[at[:, 0], at[:, 1], at[:, 2]]
    return total
