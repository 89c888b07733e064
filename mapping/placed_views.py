"""The images of a sparse map as dense reconstruction takes them, with the depth that a sensor measured, and masks."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from flight import Progress
from mapping.dense import depth_files, fusion, surface
from mapping.dense.depth_files import DepthFiles
from mapping.dense.stereo import DepthImage, StereoOptions
from mapping.dense.views import ImageView
from mapping.input.images import ImageSet
from mapping.sparse.reconstruction import SparseMap
from mapping.stages import Work
from mapping.workers import Pool

DEPTH = "depth"
"""The stage of the depth images."""


def views(placed: SparseMap) -> list[ImageView]:
    """The placed images as dense reconstruction takes them, nearest and farthest range from the sparse points."""
    result: list[ImageView] = []
    for instant, camera in _placed_shots(placed):
        ranges = placed.ranges_m(instant, camera)
        near, far = np.percentile(ranges, [2.0, 98.0]) if len(ranges) >= 20 else (None, None)
        result.append(
            ImageView(
                placed.rig.cameras[camera],
                placed.T_world_camera(instant, camera),
                placed.images.pixels(instant, camera),
                near_m=None if near is None else 0.6 * float(near),
                far_m=None if far is None else 1.5 * float(far),
                instant=instant,
                used=placed.images.used(instant, camera),
            )
        )
    return result


def _placed_shots(placed: SparseMap) -> list[tuple[int, int]]:
    """(instant, camera) of the images that are in the map."""
    return [(instant, camera) for instant, camera in placed.images.pairs() if placed.registered[instant, camera]]


def require_room(images: ImageSet, voxel_m: float) -> None:
    """Check, before any work, that a map through the recorded places of the images would fit in memory.

    Raises:
        InputError: it would not.
    """
    for motion in images.motions:
        fusion.require_room(motion.name, motion.trajectory.at(images.time_s)[:, :3, 3], voxel_m)


def depth_stage(
    placed: SparseMap, seen: Sequence[ImageView], options: StereoOptions, work: Work, pool: Pool, progress: Progress
) -> DepthFiles:
    """Depth of each image without what masks leave out, measured or found; what was done before is not done again."""

    def find(folder: Path) -> None:
        if placed.images.depths is not None:
            depth_files.write(folder, unmasked(placed, measured(placed, seen, progress)))
        else:
            depth_files.find(seen, options, folder, tasks=work.tasks(DEPTH), pool=pool, progress=progress)

    return DepthFiles(work.stage(DEPTH, find))


def measured(placed: SparseMap, seen: Sequence[ImageView], progress: Progress) -> Iterator[DepthImage]:
    """What the depth camera measured, image by image."""
    for number, (shot, view) in enumerate(zip(_placed_shots(placed), seen, strict=True), start=1):
        yield surface.depth_from_sensor(view, placed.images.depth_m(*shot))
        progress("measured depth", number / len(seen))


def unmasked(placed: SparseMap, depths: Iterator[DepthImage | None]) -> Iterator[DepthImage | None]:
    """The depth images without what masks leave out."""
    for shot, depth in zip(_placed_shots(placed), depths, strict=True):
        used = placed.images.used(*shot)
        yield depth if depth is None or used is None else depth.where(used)
