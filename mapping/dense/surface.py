"""From images with known poses to a surface mesh and a grid of free, occupied and unknown space.

depth of each image (`stereo`)  ->  one truncated distance volume (`fusion`)  ->  mesh and state grid
straight edges of the images (`lines`)  ->  thin obstacles in the state grid
what images do not explain by the surface (`contradiction`)  ->  space that is not free
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.visibility import Visibility
from flight import FloatArray, InputError, MapError, Progress, silent
from mapping import workers
from mapping.dense import contradiction, fusion, lines, planes, resolution, stereo
from mapping.dense.confidence import SurfaceConfidence
from mapping.dense.contradiction import Looks
from mapping.dense.fusion import Volume
from mapping.dense.stereo import DepthImage, StereoOptions, depth_from_sensor
from mapping.dense.views import THREADS, ImageView

__all__ = [
    "DenseOptions",
    "DepthStatistics",
    "ImageView",
    "Reconstruction",
    "StereoOptions",
    "depth_from_sensor",
    "reconstruct",
]

LARGEST_CARRIER_M = 2.0
"""A larger radius is a wrong unit."""
LONGEST_GAP_M = 0.4
"""Between images that the carrier's path joins by a straight line: a turn of 1 m radius departs from it by 2 cm."""


@dataclass(frozen=True, slots=True)
class DenseOptions:
    """Resolution and thresholds of dense reconstruction."""

    voxel_m: float = 0.05
    """Edge of a voxel of the volume, the mesh and the state grid."""
    truncation_voxels: float = 2.5
    """How far from a surface distances are kept."""
    stereo: StereoOptions = field(default_factory=StereoOptions)
    """How images are matched."""
    farthest_m: float = 8.0
    """Depths beyond this do not enter the volume."""
    least_weight: float = 0.6
    """Least weight of a voxel that the mesh passes through: a measurement good to one voxel has weight 1, a precise
    near one up to 25."""
    least_seen_through: int = 3
    """Images that must have seen through a voxel, over its whole width, before it is free."""
    thinnest_m: float = 0.0
    """Space is not free where an obstacle this thick could be missing (`resolution`); with 0 that is not asked."""
    contradicted: bool = True
    """Whether space that several images contradict is unknown (`contradiction`)."""
    skin_voxels: float = 0.87
    """Voxels this close in front of a surface are occupied; with sqrt(3) / 2 no wall has a hole."""
    carrier_radius_m: float = 0.20
    """What carried the cameras filled or swept a ball of this radius about each of them: voxels wholly in it are free,
    except where the images show a surface. So is the straight way between two consecutive images less than
    `LONGEST_GAP_M` apart that meets none; between others there may have been a detour."""
    least_component_faces: int = 60
    """Smaller connected components of the mesh are dropped."""

    def __post_init__(self) -> None:
        if not self.carrier_radius_m <= LARGEST_CARRIER_M:
            raise InputError(f"carrier_radius_m {self.carrier_radius_m:g} must be at most {LARGEST_CARRIER_M:g} m")
        if not 0.0 <= self.thinnest_m < np.inf:
            raise InputError(f"thinnest_m {self.thinnest_m:g} must be finite and not below 0")
        if not 1 <= self.least_seen_through <= fusion.MOST_COUNTED:
            raise InputError(f"least_seen_through {self.least_seen_through} must be 1 to {fusion.MOST_COUNTED}")
        if not 0.0 <= self.skin_voxels <= 1.0:  # `lines.occupied` looks no farther
            raise InputError(f"skin_voxels {self.skin_voxels:g} must be from 0 to 1")
        coarsest_m = self.carrier_radius_m / np.sqrt(3.0)
        if not 0.0 < self.voxel_m <= coarsest_m:  # else the path may lie in no free voxel, and nothing is reached
            raise InputError(
                f"voxel_m {self.voxel_m:g} must be positive and at most {coarsest_m:.3f}, so that a ball of "
                f"carrier_radius_m {self.carrier_radius_m:g} fills the voxel that its centre lies in"
            )


@dataclass(frozen=True, slots=True)
class DepthStatistics:
    """Statistics of the depth images."""

    images_used: int
    """Images that had enough partners."""
    images_skipped: int
    """Images that had not."""
    share_with_depth: float
    """Share of the pixels of the used images that got a depth."""
    median_relative_std: float
    """Median of the expected error over the depth."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What the depth images show: all that is needed of a volume, which takes most of the memory."""

    vertices_world_m: FloatArray
    """(n, 3)."""
    faces: NDArray[np.int32]
    """(m, 3) counter-clockwise seen from free space."""
    colours: NDArray[np.uint8]
    """(n, 3) RGB of each vertex."""
    confidence: SurfaceConfidence
    """Of each vertex."""
    state: NDArray[np.uint8]
    """(nx, ny, nz) `esdf.UNKNOWN`, `FREE` or `OCCUPIED`."""
    grid: Grid
    """Where the voxels of `state` are."""


@dataclass(frozen=True, slots=True, eq=False)
class Reconstruction(Measured):
    """The mesh and the grid of voxel states."""

    seen: Visibility
    """The thinnest object that the images resolve."""
    swept_occupied_m3: float
    """Space within the carrier's radius that stays occupied, because the images show a surface there."""
    inferred: NDArray[np.bool_]
    """(nx, ny, nz) unknown voxels that a plain surface must pass through, by the planes round it; see `planes`."""
    looks: Looks | None
    """How many images tested each voxel that is free by the depth images, and contradict it; None if not asked."""
    statistics: DepthStatistics
    """Of the depth images."""


def reconstruct(
    images: Sequence[ImageView],
    options: DenseOptions | None = None,
    *,
    depths: Sequence[DepthImage | None] | None = None,
    progress: Progress = silent,
) -> Reconstruction:
    """Mesh and state grid from images with known poses.

    Args:
        depths: one for each image if a depth camera measured them (`depth_from_sensor`); otherwise they are found
            by matching the images with each other.

    Raises:
        MapError: too few images observe the same surfaces from different places, or the volume does not fit in memory.
    """
    options = options or DenseOptions()
    if depths is None:
        depths = list(depth_images(images, options.stereo, progress=progress))
    shown = measured(fuse(images, depths, options, progress=progress), options)
    return extract(shown, images, depths, options)


def depth_images(
    images: Sequence[ImageView], options: StereoOptions, *, progress: Progress = silent
) -> Iterator[DepthImage | None]:
    """Depth of each image, one after the other; None for those with too few partners.

    Raises:
        MapError: after the last one, if none of them has any depth.
    """
    depths = workers.in_order(
        lambda index: stereo.depth_image(images, index, options), range(len(images)), threads=THREADS
    )
    found: list[bool] = []
    for done, depth in enumerate(depths, start=1):
        found.append(depth is not None and bool(depth.inverse_range.any()))
        yield depth
        progress("dense depth", done / len(images))
    stereo.require_depth(found, options)


def fuse(
    images: Sequence[ImageView],
    depths: Sequence[DepthImage | None],
    options: DenseOptions,
    *,
    progress: Progress = silent,
) -> Volume:
    """All depth images in one volume, just large enough to hold what they observed, with bricks where surfaces are."""
    truncation_m = options.truncation_voxels * options.voxel_m
    lower, upper = _bounds(images, depths, options.farthest_m)
    grid = fusion.covering(lower - 2 * truncation_m, upper + 2 * truncation_m, options.voxel_m)
    near = _bricks_near_surfaces(images, depths, grid, truncation_m=truncation_m, farthest_m=options.farthest_m)
    channels = 3 if all(view.pixels.ndim == 3 for view in images) else 1
    volume = fusion.empty_volume(grid, near, truncation_m=truncation_m, channels=channels)
    margin_m = options.skin_voxels * options.voxel_m
    for number, (view, depth) in enumerate(zip(images, depths, strict=True)):
        if depth is not None:
            volume.integrate(view, depth.inverse_range, depth.deviation, depth.facing, farthest_m=options.farthest_m)
            volume.carve(
                view,
                depth.bound,
                margin_m=margin_m,
                farthest_m=options.farthest_m,
                enough=options.least_seen_through,
            )
        progress("fuse depth", (number + 1) / len(images))
    return volume


def _bricks_near_surfaces(
    images: Sequence[ImageView],
    depths: Sequence[DepthImage | None],
    grid: Grid,
    *,
    truncation_m: float,
    farthest_m: float,
) -> NDArray[np.uint8]:
    """(bricks along x, y, z) 1 where a depth image shows a surface."""
    near = fusion.no_bricks(grid)
    for view, depth in zip(images, depths, strict=True):
        if depth is not None:
            rays = stereo.depth_rays(view, depth.scale)
            fusion.mark_near_surface(
                near,
                grid,
                view,
                rays,
                depth.inverse_range,
                depth.facing,
                truncation_m=truncation_m,
                farthest_m=farthest_m,
            )
    return near


def measured(volume: Volume, options: DenseOptions) -> Measured:
    """Surface and state of the voxels by a filled volume."""
    state = volume.occupancy(least_seen_through=options.least_seen_through, skin_voxels=options.skin_voxels)
    return Measured(*volume.surface(least_weight=options.least_weight), state, volume.grid)


def extract(
    shown: Measured, images: Sequence[ImageView], depths: Sequence[DepthImage | None], options: DenseOptions
) -> Reconstruction:
    """Mesh and state grid of what the depth images show, with all that is known otherwise. Changes `shown.state`."""
    state, grid = shown.state, shown.grid
    vertices, faces, colours, known = without_small_components(
        shown.vertices_world_m,
        shown.faces,
        shown.colours,
        shown.confidence,
        least_faces=options.least_component_faces,
    )
    if not len(faces):
        raise MapError(_no_surface(images, depths))
    edges = lines.sweep(images, options.stereo, farthest_m=options.farthest_m)
    state[lines.occupied(edges, state, grid, skin_voxels=options.skin_voxels)] = OCCUPIED
    seen = resolution.visibility(state, grid, [(view.camera, view.T_world_camera) for view in images])
    path = carried_path(images, 0.5 * options.voxel_m, grid, state == OCCUPIED)
    swept = fusion.within(grid, path, options.carrier_radius_m)
    carved = np.where(swept & (state == UNKNOWN), np.uint8(FREE), state)  # no wall, though it may count as unknown
    looks = None
    if options.contradicted:
        looks = contradiction.find(
            images, vertices, faces, state, grid, options=options.stereo, farthest_m=options.farthest_m
        )
        state[looks.contradicted] = UNKNOWN
    if options.thinnest_m > 0.0:
        state[resolution.could_hide(state, grid, seen, options.thinnest_m, empty=swept)] = UNKNOWN
    state[swept & (state == UNKNOWN)] = FREE
    swept_occupied_m3 = float((swept & (state == OCCUPIED)).sum()) * options.voxel_m**3
    fusion.unreached_is_unknown(state, grid, path)
    inferred = planes.inferred(
        carved,
        grid,
        vertices,
        faces,
        images,
        depths,
        skin_voxels=options.skin_voxels,
        farthest_m=options.farthest_m,
    )
    return Reconstruction(
        vertices,
        faces,
        colours,
        known,
        state,
        grid,
        seen,
        swept_occupied_m3,
        inferred,
        looks,
        depth_statistics(depths),
    )


def _no_surface(images: Sequence[ImageView], depths: Sequence[DepthImage | None]) -> str:
    """Why there may be none, and what to do."""
    found = depth_statistics(depths)
    reach_m = float(np.linalg.norm(np.ptp([view.position_world_m for view in images], axis=0)))
    return (
        f"no surface: {found.images_used} of {len(images)} images have depth, in {found.share_with_depth:.0%} of their "
        f"pixels, which agrees nowhere. They were taken within {reach_m:.2g} m of each other: if that is little "
        "beside what they show, take some farther apart; else their poses or the camera file are wrong"
    )


def carried_path(images: Sequence[ImageView], step_m: float, grid: Grid, occupied: NDArray[np.bool_]) -> FloatArray:
    """(n, 3) points along the way of each camera, in the order of the images.

    The straight line is no evidence of the way where it is long, where images between are missing, or where it meets
    a surface (there was a detour, or a pose is wrong): those gaps are not bridged.
    """
    points = [view.position_world_m for view in images]
    last: dict[str, ImageView] = {}
    for view in images:
        before = last.get(view.camera.name)
        last[view.camera.name] = view
        if before is None or not _follows(view, before):
            continue
        start, step = before.position_world_m, view.position_world_m - before.position_world_m
        gap_m = float(np.linalg.norm(step))
        if gap_m <= LONGEST_GAP_M:
            share = np.linspace(0.0, 1.0, 1 + int(np.ceil(gap_m / step_m)))[:, None]
            line = start + share * step
            if not _meets(line, grid, occupied):
                points.extend(line)
    return np.array(points)


def _follows(view: ImageView, before: ImageView) -> bool:
    return view.instant is None or before.instant is None or view.instant == before.instant + 1


def _meets(points_world_m: FloatArray, grid: Grid, marked: NDArray[np.bool_]) -> bool:
    """Whether one of the points (n, 3) lies in a voxel that is marked."""
    cells = grid.index(points_world_m)
    inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
    return bool(marked[tuple(cells[inside].T)].any())


def without_small_components(
    vertices: FloatArray,
    faces: NDArray[np.int32],
    colours: NDArray[np.uint8],
    confidence: SurfaceConfidence,
    *,
    least_faces: int,
) -> tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8], SurfaceConfidence]:
    """The mesh without connected components of fewer than `least_faces` faces, and without unused vertices."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    links = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(links), np.int8), links.T), shape=(len(vertices),) * 2)
    _, piece = connected_components(graph, directed=False)
    sizes = np.bincount(piece[faces[:, 0]], minlength=len(vertices) + 1)
    kept = faces[sizes[piece[faces[:, 0]]] >= least_faces]
    used = np.zeros(len(vertices), bool)
    used[kept] = True
    number = np.cumsum(used, dtype=np.int32) - 1
    return vertices[used], number[kept].astype(np.int32), colours[used], confidence.part(used)


def depth_statistics(depths: Sequence[DepthImage | None]) -> DepthStatistics:
    used = [depth for depth in depths if depth is not None]
    shares = [float((depth.inverse_range > 0).mean()) for depth in used]
    relative = [
        depth.deviation[known] / depth.inverse_range[known]
        for depth in used
        if (known := depth.inverse_range > 0).any()
    ]
    return DepthStatistics(
        images_used=len(used),
        images_skipped=len(depths) - len(used),
        share_with_depth=float(np.mean(shares)) if shares else 0.0,
        median_relative_std=float(np.median(np.concatenate(relative))) if relative else float("nan"),
    )


def _bounds(
    images: Sequence[ImageView], depths: Sequence[DepthImage | None], farthest_m: float
) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corner of what was seen, without the last half percent of stray depths on each side."""
    points = [np.array([view.position_world_m for view in images])]
    for view, depth in zip(images, depths, strict=True):
        if depth is None:
            continue
        inverse_range = depth.inverse_range[::4, ::4]
        rays = stereo.depth_rays(view, depth.scale)[::4, ::4]
        known = inverse_range * farthest_m > 1.0
        at_camera = rays[known] / inverse_range[known, None]
        points.append(at_camera @ view.T_world_camera[:3, :3].T + view.position_world_m)
    cloud, path = np.concatenate(points), points[0]
    lower, upper = np.quantile(cloud, 0.005, axis=0), np.quantile(cloud, 0.995, axis=0)
    return np.minimum(lower, path.min(axis=0)), np.maximum(upper, path.max(axis=0))
