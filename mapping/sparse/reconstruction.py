"""The sparse map: images to metric poses and points in a z-up world."""

import contextlib
import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, MapError, Progress, silent
from mapping import child, stages
from mapping.camera import residual_field
from mapping.camera.rig import Camera, Rig
from mapping.camera.trial import LEAST_BASELINE_M
from mapping.input.images import ImageSet
from mapping.sparse import alignment, model_files
from mapping.sparse.alignment import Alignment, Length
from mapping.sparse.calibration import calibration
from mapping.sparse.calibration.calibration import Registration
from mapping.sparse.localization_map import LocalizationMap
from mapping.sparse.mapper import colmap, overlap, pairing
from mapping.sparse.mapper.colmap import SparseOptions
from mapping.sparse.mapper.overlap import UnplacedRun
from mapping.sparse.tracks import Tracks
from mapping.stages import Work
from mapping.workers import Pool, Threads

CALIBRATION = "calibration"
"""The stage that ends with the poses adjusted to the camera file's trial."""
_LEAST_SHARE = 0.5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SparseMap(Registration):
    """Where the images were taken, and the points they share."""

    images: ImageSet
    """The images; their rig has the lenses the map was made with."""
    T_world_body: FloatArray
    """(instants, 4, 4) metres, z up; NaN where an instant could not be placed."""
    points_world_m: FloatArray
    """(m, 3)."""
    alignment: Alignment
    """Where scale and up came from."""

    @property
    def rig(self) -> Rig:
        return self.images.rig

    @property
    def placed(self) -> np.ndarray:
        """(instants,) bool."""
        return np.isfinite(self.T_world_body[:, 0, 0])

    @property
    def shape_std_m(self) -> FloatArray:
        """(instants,) standard deviation of the positions but for place, attitude and size of the whole map.

        NaN where not placed, and where depth images gave the poses.
        """
        if self.trial.shape_std is None or self.images.depths is not None:
            return np.full(len(self.T_world_body), np.nan)
        return self.alignment.scale * self.trial.shape_std

    @property
    def position_std_m(self) -> FloatArray:
        """(instants,) the same with that of the scale, about the middle of the path."""
        middle = np.nanmean(self.T_world_body[:, :3, 3], axis=0)
        from_middle_m = np.linalg.norm(self.T_world_body[:, :3, 3] - middle, axis=1)
        return np.hypot(self.shape_std_m, self.alignment.witnesses[0].std * from_middle_m)

    def T_world_camera(self, instant: int, camera: int) -> FloatArray:
        return self.T_world_body[instant] @ self.rig.cameras[camera].T_body_camera

    def ranges_m(self, instant: int, camera: int) -> FloatArray:
        """Distances from a camera to the points it sees."""
        seen = (self.observations[:, 1] == instant) & (self.observations[:, 2] == camera)
        points = self.points_world_m[self.observations[seen, 0]]
        return np.linalg.norm(points - self.T_world_camera(instant, camera)[:3, 3], axis=1)

    def localization_map(self) -> LocalizationMap:
        return LocalizationMap(self.points_world_m, self.descriptors)

    def tracks(self) -> Tracks:
        """Where the images see the points; instants by their number among the placed ones."""
        whole = Tracks(self.observations, self.pixels)
        return whole.part(np.ones(len(self.points_world_m), bool), self.placed)


def reconstruct(
    images: ImageSet,
    options: SparseOptions | None = None,
    *,
    length: Length | None = None,
    references: Path | None = None,
    work: Work | None = None,
    pool: Pool | None = None,
    progress: Progress = silent,
) -> SparseMap:
    """Place the images in a metric, upright world.

    Args:
        length: a measured length, which then gives the scale.
        references: recorded positions and gravity; `references.csv` of the image folder by default.
        work: keeps finished stages, so that an interrupted work goes on; a temporary folder by default.
        pool: who matches the images; threads of the child process by default.

    Raises:
        MapError: COLMAP failed, fewer than half of the instants could be placed, or nothing gives the scale.
        InputError, FormatError: the references or the length do not fit the images.
    """
    recorded = alignment.read_references(images, references)
    options = options or SparseOptions()
    with contextlib.nullcontext(work) if work is not None else stages.temporary() as kept:

        def place(folder: Path) -> None:
            # a killed process leaves the calls' folders inside the work's, which the next one removes
            run = functools.partial(child.run, within=kept.folder, lock=kept.lock, progress=progress)
            placed = run(colmap.place_images, images, options, kept, pool or Threads())
            model_files.write(folder, run(calibration.calibrate, images, options, placed))

        near = pairing.near_in_space(images, options.window)
        placing = kept.on(options, near, images.motion_digests())
        model = model_files.read(placing.stage(CALIBRATION, place))
    placed = np.isfinite(model.T_world_body[:, 0, 0])
    if placed.mean() < _LEAST_SHARE:
        runs = overlap.unplaced_runs(images.instants, placed, model.overlaps)
        raise MapError(
            f"only {int(placed.sum())} of {len(placed)} images could be placed; take them closer together, slower, or "
            f"in more light. Not placed: {overlap.summary(runs)}"
        )
    has_baseline = images.rig.baseline_m > LEAST_BASELINE_M and _rig_seen(model.registered)
    aligned = alignment.align(
        images,
        model.T_world_body,
        recorded,
        baseline_std=alignment.baseline_std(images.rig, model.trial.scale_std) if has_baseline else None,
        length=length,
        has_depth=images.depths is not None,
        by_motion=model.by_motion,
        tracked_body=model.tracked_body,
        clocks=model.clocks,
    )
    return SparseMap(
        images=dataclasses.replace(images, rig=model.rig),
        T_world_body=aligned.poses(model.T_world_body),
        points_world_m=aligned.points(model.points_world),
        alignment=aligned,
        **{kept.name: getattr(model, kept.name) for kept in dataclasses.fields(Registration)},
    )


def _rig_seen(registered: np.ndarray) -> bool:
    """Whether several cameras of the rig are in the map at one instant: one at a time gives no scale."""
    return bool((registered.sum(axis=1) > 1).any())


def unplaced(sparse: SparseMap) -> Sequence[str]:
    """Names of the images that have no pose."""
    return [sparse.images.relative(i, c) for i, c in sparse.images.pairs() if not sparse.registered[i, c]]


def unplaced_runs(sparse: SparseMap) -> list[UnplacedRun]:
    """Runs of instants that have no pose, and where they lost the overlap with the others."""
    return overlap.unplaced_runs(sparse.images.instants, sparse.placed, sparse.overlaps)


def residual_fields(placed: SparseMap) -> list[dict[str, Any]]:
    """Reprojection errors over the image of each camera; see `camera.residual_field.field`."""
    return [residual_field.field(*_observed(placed, number)) for number in range(len(placed.rig))]


def residuals_over_radius(placed: SparseMap) -> list[dict[str, Any]]:
    """The same over the angle from the optical axis; see `camera.residual_field.over_radius`."""
    return [residual_field.over_radius(*_observed(placed, number)) for number in range(len(placed.rig))]


def residuals_over_time(placed: SparseMap) -> list[dict[str, Any]]:
    """The same for each placed image: `camera.residual_field.over_time`, the names (`image`) and times (`time_s`)."""
    found = []
    for number in range(len(placed.rig)):
        instants = np.flatnonzero(placed.registered[:, number])
        instant = placed.observations[placed.observations[:, 2] == number, 1]
        image = np.searchsorted(instants, instant)
        time_s = placed.images.time_s[instants]
        found.append(
            residual_field.over_time(*_observed(placed, number), image, len(instants))
            | {
                "image": [placed.images.relative(int(k), number) for k in instants],
                "time_s": [float(t) if np.isfinite(t) else None for t in time_s],
            }
        )
    return found


def _observed(placed: SparseMap, number: int) -> tuple[Camera, FloatArray, FloatArray, FloatArray]:
    """A camera, and of each of its observations the camera's pose (o, 4, 4), the point (o, 3) and the pixel (o, 2)."""
    camera, seen = placed.rig.cameras[number], placed.observations[:, 2] == number
    point, instant = placed.observations[seen, 0], placed.observations[seen, 1]
    T_world_camera = placed.T_world_body[instant] @ camera.T_body_camera
    return camera, T_world_camera, placed.points_world_m[point], placed.pixels[seen]
