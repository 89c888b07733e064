"""The thinnest object that the images of a map resolve, voxel by voxel; see `esdf.visibility`."""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, Field, Grid
from esdf.grid import Region
from esdf.visibility import View, Visibility, look
from flight import FloatArray, frames
from mapping.camera.rig import Camera

RESOLVED_PX = 8.0
"""How many pixels wide an obstacle must be in the nearest image to be kept out of free space.

Of twenty painted rods of 6 to 60 mm in the rendered room, by depth images alone, none was marked free where an image
showed it wider than 6 pixels; of their length that was 5 to 6 pixels wide 2 % was, of 3 to 4 pixels 5 %. `lines` finds
most of those, as they are straight (`benchmarks/mapping_hazards.py`). An obstacle of exactly the colour of what lies
behind it is not seen at any width.
"""

_COARSER = 4
"""Voxels of a map along one of its visibility mask."""


def visibility(
    state: NDArray[np.uint8],
    grid: Grid,
    cameras: Iterable[tuple[Camera, FloatArray]],
    *,
    pixels: float = RESOLVED_PX,
) -> Visibility:
    """From the lenses and places (4, 4) T_world_camera of the images.

    The cone of a view ends at the nearer edge of the image, so nothing counts as seen that was not.
    """
    views = []
    for camera, T_world_camera in cameras:
        focal_px = min(camera.focal_px)
        edge = 0.5 * min(camera.width, camera.height) / focal_px
        half = edge if "FISHEYE" in camera.model else float(np.arctan(edge))
        centre, axis = T_world_camera[:3, 3].tolist(), T_world_camera[:3, 2].tolist()
        views.append(View(tuple(centre), tuple(axis), min(half, 0.5 * camera.field_of_view_rad), 1.0 / focal_px))
    return look(state, grid, views, pixels=pixels, coarser=_COARSER)


def finest_of_voxels(seen: Visibility, grid: Grid) -> NDArray[np.float32]:
    """(nx, ny, nz) thickness in metres of the thinnest object that is resolved, for each voxel of a map's grid."""
    finest = seen.finest_m
    for axis, (fine_m, coarse_m) in enumerate(zip(grid.voxel_m, seen.grid.voxel_m, strict=True)):
        finest = np.repeat(finest, round(coarse_m / fine_m), axis=axis)
    return finest[: grid.shape[0], : grid.shape[1], : grid.shape[2]]


def fits(seen: Visibility, grid: Grid) -> bool:
    """Whether the voxels of what is resolved are whole numbers of a grid's, from the same corner, and cover it."""
    ratio = np.array(seen.grid.voxel_m) / np.array(grid.voxel_m)
    whole = np.round(ratio)
    same = np.allclose(ratio, whole, rtol=0.0, atol=1e-6) and bool((whole >= 1.0).all())
    corner = np.allclose(seen.grid.low_world_m, grid.low_world_m, rtol=0.0, atol=1e-6)
    return same and corner and bool((whole * seen.grid.shape >= grid.shape).all())


def whole_cells(region: Region) -> Region:
    """The region from the corner of a cell of the mask on: the mask of that part of a map is a part of the map's."""
    x, y, z = (n - n % _COARSER for n in region.low)
    return Region((x, y, z), region.high)


def could_hide(
    state: NDArray[np.uint8], grid: Grid, seen: Visibility, thickness_m: float, *, empty: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(nx, ny, nz) FREE voxels where an obstacle this thick could be missing from the map.

    Args:
        empty: (nx, ny, nz) voxels that are known to be empty whatever the images resolve, as something was there.
    """
    return (state == FREE) & ~empty & (finest_of_voxels(seen, grid) > thickness_m)


def thickness_quantiles_m(seen: Visibility, grid: Grid, free: NDArray[np.bool_]) -> dict[str, float]:
    """Thickness of the thinnest object that is resolved in half, and in nine tenths, of the free voxels.

    One of them is missing where no thickness is resolved in so many: the vehicle's path is free even unseen.
    """
    finest = np.sort(finest_of_voxels(seen, grid)[free])
    shares = {"half of the free space": 0.5, "nine tenths of the free space": 0.9}
    found = {name: float(finest[int(share * len(finest))]) for name, share in shares.items() if len(finest)}
    return {name: thickness_m for name, thickness_m in found.items() if np.isfinite(thickness_m)}


def moved(seen: Visibility, T_new_old: FloatArray, grid: Grid) -> Visibility:
    """The mask in another frame, for a map of that grid.

    A new place counts as seen if the old place that its middle lies in does, as in `look`; its thickness is the worst
    of the seen old places that it overlaps.
    """
    voxel_m = _COARSER * np.array(grid.voxel_m)
    shape = tuple(-(-n // _COARSER) for n in grid.shape)
    new = Grid(grid.origin_world_m, tuple(voxel_m), shape)  # pyright: ignore[reportArgumentType]
    T_old_new = frames.invert(T_new_old)
    half_m = np.abs(T_old_new[:3, :3]) @ (0.5 * voxel_m)
    centres = frames.apply(T_old_new, new.centres().reshape(-1, 3)) - seen.grid.low_world_m
    low = np.floor((centres - half_m) / seen.grid.voxel_m + 1e-6).astype(np.int64)
    high = np.ceil((centres + half_m) / seen.grid.voxel_m - 1e-6).astype(np.int64) - 1
    last = np.array(seen.grid.shape) - 1
    low, high = np.clip(low, 0, last), np.clip(high, 0, last)
    finest = seen.finest(frames.apply(T_old_new, new.centres().reshape(-1, 3))).astype(np.float32)
    for step in itertools.product(*(range(n) for n in (high - low).max(axis=0) + 1)):
        other = seen.finest_m[tuple(np.minimum(low + step, high).T)]
        finest = np.where(np.isfinite(other), np.maximum(finest, other), finest)
    return Visibility(new, finest.reshape(shape))


def joined(both: Field, parts: Sequence[tuple[Visibility, Field]]) -> Visibility:
    """The mask of two maps in one, from that of each and its field, in the same frame and voxels.

    What the images of one map resolve counts where that map itself saw free space; where the free space of a place is
    of several maps, that of the worst.
    """
    free = both.state == FREE
    best, worst = np.float32(np.inf), np.float32(0.0)
    for seen, field in parts:
        finest = moved(seen, np.eye(4), both.grid).finest_m
        own = np.zeros(free.shape, bool)
        first = np.rint((field.grid.low_world_m - both.grid.low_world_m) / np.array(both.grid.voxel_m)).astype(int)
        own[tuple(slice(a, a + n) for a, n in zip(first, field.grid.shape, strict=True))] = field.state == FREE
        best = np.minimum(best, np.where(_any_in_cells(free & ~own), np.float32(np.inf), finest))
        worst = np.maximum(worst, finest)
    coarse = moved(parts[0][0], np.eye(4), both.grid).grid
    return Visibility(coarse, np.where(np.isfinite(best), best, worst).astype(np.float32))


def _any_in_cells(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether a voxel of each cell of the mask is marked."""
    for axis in range(3):
        marked = np.logical_or.reduceat(marked, np.arange(0, marked.shape[axis], _COARSER), axis=axis)
    return marked
