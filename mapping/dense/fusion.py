"""From depth images to a TSDF volume: surfaces, observed free space, and unknown space."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import FloatArray, InputError, MapError, frames
from mapping import _mapping
from mapping.dense import confidence
from mapping.dense.confidence import SurfaceConfidence
from mapping.dense.views import THREADS, ImageView, lens_row

Value = TypeVar("Value", bound=np.generic)

MOST_VOXELS, MOST_BRICK_BYTES = 350_000_000, 2_600_000_000
"""Larger volumes take more than 4 GiB: 3 bytes a voxel while the bricks are in memory, which take a quarter more than
their arrays then, and up to 12 afterwards, with the distance field. The error names a voxel size that fits."""
MOST_COUNTED = 255
"""Images that are counted for one voxel, in a byte."""
BRICK = _mapping.BRICK_SIZE
"""Voxels along each side of a brick."""


@dataclass(frozen=True, slots=True, eq=False)
class Volume:
    """Truncated signed distance at the centres of the voxels near measured surfaces.

    They are kept in bricks, cubes of `BRICK` voxels along each side that divide the grid from its lower corner on. In
    other bricks no measured distance is below a voxel: no surface passes there, and nothing is occupied.
    """

    grid: Grid
    """Of cubes."""
    truncation_m: float
    """Distances are known within this much of a surface."""
    bricks: NDArray[np.int32]
    """(n, 3) which bricks are kept, in the order of the grid; those at its upper faces may reach beyond it."""
    distance: NDArray[np.float32]
    """(n, BRICK, BRICK, BRICK) metres, positive in front of the surface."""
    weight: NDArray[np.float32]
    """(n, BRICK, BRICK, BRICK) sum of the measurements' weights; 0 where never observed."""
    scatter: NDArray[np.float32]
    """(n, BRICK, BRICK, BRICK) m2, weighted sum of the squared differences of the measurements from `distance`."""
    images: NDArray[np.uint8]
    """(n, BRICK, BRICK, BRICK) how many images measured a surface within the truncation, at most `MOST_COUNTED`."""
    colour: NDArray[np.float32]
    """(n, BRICK, BRICK, BRICK, channels) 0 to 255."""
    colour_weight: NDArray[np.float32]
    """(n, BRICK, BRICK, BRICK)."""
    seen_through: NDArray[np.uint8]
    """(nx, ny, nz) how many images saw through the voxel, over its whole width, to what must be farther away; not more
    than `carve` was asked to count."""

    @property
    def voxel_m(self) -> float:
        return self.grid.voxel_m[0]

    def _arrays(self):
        """The grid and the bricks, as the kernels take them."""
        grid, measured = self.grid, (self.distance, self.weight, self.scatter, self.images)
        return grid.low_world_m, self.voxel_m, grid.shape, self.bricks, *measured, self.colour, self.colour_weight

    def integrate(
        self,
        view: ImageView,
        inverse_range: NDArray[np.float32],
        deviation: NDArray[np.float32],
        facing: NDArray[np.float32],
        *,
        farthest_m: float,
    ) -> None:
        """Add one depth image. `inverse_range` (h, w), 1/m along the ray, may be smaller than the image."""
        height, width = inverse_range.shape
        channels = self.colour.shape[4]
        _mapping.integrate(
            *self._arrays(),
            np.ascontiguousarray(inverse_range, dtype=np.float32),
            np.ascontiguousarray(deviation, dtype=np.float32),
            np.ascontiguousarray(facing, dtype=np.float32),
            _resized(view.grey if channels == 1 else view.pixels, width, height, channels),
            lens_row(view.camera, width / view.camera.width),
            frames.invert(view.T_world_camera),
            self.truncation_m,
            farthest_m,
            THREADS,
        )

    def carve(
        self, view: ImageView, bound: NDArray[np.float32], *, margin_m: float, farthest_m: float, enough: int
    ) -> None:
        """Count the voxels one image saw through: on every ray that meets the voxel, anything is farther away.

        Args:
            bound: (h, w), 1/m: nothing on the ray has a larger inverse range; 0 where that is not known.
            margin_m: how much farther away.
            enough: voxels that so many images saw through, 1 to `MOST_COUNTED`, are not examined any more.
        """
        _mapping.carve(
            self.grid.low_world_m,
            self.voxel_m,
            self.seen_through,
            np.ascontiguousarray(bound, dtype=np.float32),
            lens_row(view.camera, bound.shape[1] / view.camera.width),
            frames.invert(view.T_world_camera),
            margin_m,
            farthest_m,
            enough,
            THREADS,
        )

    def surface(
        self, *, least_weight: float
    ) -> tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8], SurfaceConfidence]:
        """Marching cubes where all eight corners were seen: vertices (n, 3), faces (m, 3), colours (n, 3), and how well
        each vertex is known."""
        vertices, faces, colours, weight, scatter, images = _mapping.marching_cubes(
            *self._arrays(),
            least_weight,
        )
        shades = np.clip(np.round(colours), 0, 255).astype(np.uint8)
        colours = np.repeat(shades, 3, axis=1) if shades.shape[1] == 1 else shades
        return vertices, faces, colours, confidence.of_fused(weight, scatter, images, self.voxel_m)

    def occupancy(self, *, least_seen_through: int, skin_voxels: float) -> NDArray[np.uint8]:
        """(nx, ny, nz) UNKNOWN, FREE or OCCUPIED.

        A voxel whose centre is less than `skin_voxels`, at most 1, in front of the surface counts as occupied. With
        sqrt(3) / 2 every voxel that the surface passes through does, however it cuts it: walls have no holes. Any trace
        of a surface outweighs any number of images that saw through; and a voxel through which too few of them saw is
        not free, whatever lies behind it.
        """
        state = np.full(self.grid.shape, UNKNOWN, dtype=np.uint8)
        state[self.seen_through >= least_seen_through] = FREE
        state[self.in_grid((self.distance < skin_voxels * self.voxel_m) & (self.weight > 0.0))] = OCCUPIED
        return state

    def in_grid(self, values: NDArray[Value]) -> NDArray[Value]:
        """(nx, ny, nz) of what is known of the voxels in bricks (n, BRICK, BRICK, BRICK), 0 elsewhere."""
        whole = np.zeros(BRICK * bricks_of(self.grid), values.dtype)
        for (x, y, z), brick in zip(BRICK * self.bricks, values, strict=True):
            whole[x : x + BRICK, y : y + BRICK, z : z + BRICK] = brick
        return whole[tuple(map(slice, self.grid.shape))]


def covering(lower_world_m: FloatArray, upper_world_m: FloatArray, voxel_m: float) -> Grid:
    """The voxels of a volume.

    Raises:
        InputError: the voxel size is not positive.
        MapError: they would not fit in memory.
    """
    grid = Grid.covering(lower_world_m, upper_world_m, voxel_m)
    if grid.voxels > MOST_VOXELS:
        raise _too_large("the volume", grid, (grid.voxels / MOST_VOXELS) ** (1 / 3))
    return grid


def require_room(what: str, places_m: FloatArray, voxel_m: float) -> None:
    """Check, before any work, that a map through some places (n, 3), NaN where unknown, would fit in memory.

    Its box holds their convex hull, however its frame lies to theirs; how much more it holds is not known yet.

    Raises:
        InputError: it would not.
    """
    from scipy import spatial

    known = places_m[np.isfinite(places_m).all(axis=1)]
    try:
        voxels = float(spatial.ConvexHull(known).volume) / voxel_m**3 if len(known) > 3 else 0.0
    except spatial.QhullError:  # all in a plane
        return
    if voxels > MOST_VOXELS:
        fitting_m = 1.05 * voxel_m * (voxels / MOST_VOXELS) ** (1 / 3)
        raise InputError(
            f"what lies between the {what} has {voxels / 1e6:,.0f} million voxels of {voxel_m:g} m, at most "
            f"{MOST_VOXELS / 1e6:g} million fit: take --voxel {fitting_m:.2g}, or make several maps"
        )


def _too_large(what: str, grid: Grid, coarser: float) -> MapError:
    voxel_m = grid.voxel_m[0]
    size = " x ".join(f"{n * voxel_m:.0f}" for n in grid.shape)
    return MapError(
        f"{what} of {size} m in voxels of {voxel_m:g} m does not fit in memory; voxel_m >= {voxel_m * coarser:.3f} does"
    )


def bricks_of(grid: Grid) -> NDArray[np.int64]:
    """(3,) how many bricks cover a grid along each axis."""
    return -(-np.array(grid.shape) // BRICK)


def no_bricks(grid: Grid) -> NDArray[np.uint8]:
    """(bricks along x, y, z) of 0, for `mark_near_surface`."""
    return np.zeros(bricks_of(grid), np.uint8)


def mark_near_surface(
    near: NDArray[np.uint8],
    grid: Grid,
    view: ImageView,
    rays_camera: FloatArray,
    inverse_range: NDArray[np.float32],
    facing: NDArray[np.float32],
    *,
    truncation_m: float,
    farthest_m: float,
) -> None:
    """Mark as 1, in place, the bricks that one depth image brings a surface into; and those with a voxel beside it.

    All in which `Volume.integrate` adds a distance of less than a voxel, by the segment of each pixel's ray near to
    what it shows; and a few more.

    Args:
        near: (bricks along x, y, z).
        rays_camera: (h, w, 3) unit rays of the pixels.
        inverse_range: (h, w) 1/m along the ray.
    """
    _mapping.mark_near_surface(
        grid.low_world_m,
        grid.voxel_m[0],
        grid.shape,
        near,
        np.ascontiguousarray(inverse_range, dtype=np.float32),
        np.ascontiguousarray(facing, dtype=np.float32),
        lens_row(view.camera, inverse_range.shape[1] / view.camera.width),
        rays_camera,
        view.T_world_camera,
        truncation_m,
        farthest_m,
    )


def empty_volume(grid: Grid, near: NDArray[np.uint8], *, truncation_m: float, channels: int) -> Volume:
    """A volume without measurements.

    Args:
        near: (bricks along x, y, z) which bricks are kept.

    Raises:
        InputError: the truncation is under one voxel.
        MapError: it would not fit in memory.
    """
    if truncation_m < grid.voxel_m[0]:
        raise InputError(f"truncation_m {truncation_m:g} must be at least the voxel size, {grid.voxel_m[0]:g}")
    bricks = np.argwhere(near).astype(np.int32)
    arrays_bytes = (4 * (4 + channels) + 1) * BRICK**3 * len(bricks)
    if arrays_bytes > MOST_BRICK_BYTES:
        raise _too_large("the surface", grid, (arrays_bytes / MOST_BRICK_BYTES) ** (1 / 2))

    def empty(*more: int) -> NDArray[np.float32]:
        return np.zeros((len(bricks), BRICK, BRICK, BRICK, *more), np.float32)

    seen_through = np.zeros(grid.shape, np.uint8)
    images = np.zeros((len(bricks), BRICK, BRICK, BRICK), np.uint8)
    return Volume(grid, truncation_m, bricks, empty(), empty(), empty(), images, empty(channels), empty(), seen_through)


def unreached_is_unknown(state: NDArray[np.uint8], grid: Grid, path_world_m: FloatArray) -> None:
    """Mark as UNKNOWN, in place, FREE space that is not connected to the points (n, 3) where the vehicle was.

    Free space that a false match shows behind a wall is removed so; the vehicle could not get there anyway.
    """
    from scipy import ndimage

    free, start = state == FREE, np.zeros(state.shape, bool)
    cells = grid.index(path_world_m)
    inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
    start[tuple(cells[inside].T)] = True
    start &= free
    reached = np.asarray(ndimage.binary_propagation(start, mask=free), bool)
    free &= ~reached
    state[free] = UNKNOWN


def within(grid: Grid, path_world_m: FloatArray, radius_m: float) -> NDArray[np.bool_]:
    """(nx, ny, nz) which voxels lie wholly within `radius_m` of one of the points (n, 3)."""
    near = np.zeros(grid.shape, bool)
    half_m = 0.5 * np.array(grid.voxel_m)
    reach = int(np.ceil(radius_m / min(grid.voxel_m)))
    steps = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for point in path_world_m:
        cells = grid.index(point) + steps
        inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
        inside &= np.linalg.norm(np.abs(grid.centre(cells) - point) + half_m, axis=1) <= radius_m  # its farthest corner
        near[tuple(cells[inside].T)] = True
    return near


def _resized(pixels: NDArray[np.uint8], width: int, height: int, channels: int) -> NDArray[np.uint8]:
    import cv2

    if pixels.shape[:2] != (height, width):
        pixels = np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return np.ascontiguousarray(pixels.reshape(height, width, channels))
