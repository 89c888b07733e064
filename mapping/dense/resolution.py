"""The thinnest object that the images of a map resolve, voxel by voxel; see `esdf.visibility`."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, Grid
from esdf.visibility import View, Visibility, look
from flight import FloatArray
from mapping.camera.rig import Camera

RESOLVED_PX = 8.0
"""How many pixels wide an obstacle must be in the nearest image to be kept out of free space.

Of twenty painted rods of 6 to 60 mm in the rendered room, none was marked free where an image showed it wider than 8
pixels; of their length that was 6 to 8 pixels wide 2 % was, of 3 to 4 pixels 11 % (`benchmarks/mapping_hazards.py`). An
obstacle of exactly the colour of what lies behind it is not seen at any width.
"""


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
    return look(state, grid, views, pixels=pixels)


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
