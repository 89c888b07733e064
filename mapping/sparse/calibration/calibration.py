"""COLMAP's model with the calibration on trial, corrected by what is found. Runs in a child process only.

A process of its own (see `child`): one that has placed a thousand images keeps gigabytes that the trial needs.
"""

import dataclasses
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, Progress
from mapping.camera import adjustment
from mapping.camera import trial as calibration_trial
from mapping.camera.adjustment import Observations
from mapping.camera.pose_priors import Recorded
from mapping.camera.rig import Rig
from mapping.camera.trial import Trial
from mapping.input.images import ImageSet
from mapping.input.trajectory import MotionKind
from mapping.sparse.calibration import eccentricity
from mapping.sparse.features import features, repetition
from mapping.sparse.mapper import agreement, colmap, colmap_model, overlap
from mapping.sparse.mapper.colmap import PlacedImages, SparseOptions, Stopwatch

_TRYING = "trying the calibration"
_LEAST_CLOCK_STD_S = 1e-3
"""Poses are recorded, and interpolated, no more exactly in time."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Registration:
    """Which images are placed, by which features, and what speaks for it: the same in whatever world frame."""

    registered: np.ndarray
    """(instants, cameras) bool."""
    descriptors: np.ndarray
    """(m, 128) float32 of unit length: the mean descriptor of each point."""
    observations: np.ndarray
    """(o, 3) int: point, instant, camera."""
    pixels: FloatArray
    """(o, 2) where the centres of the patches of surface are seen: the features, moved as the adjustment had them."""
    reprojection_error_px: float
    """Mean over the points of each one's mean over the images that see it, as COLMAP states it, of these pixels."""
    least_agreement: float
    """The worst placed image's share of matches that agree with the map."""
    breaks: np.ndarray
    """(b, 2) instants across which the map is broken, see `agreement`; none if depth images placed them."""
    overlaps: np.ndarray
    """(p, 3) pairs of instants and the number of verified matches between them."""
    repeated: float
    """Share of the features that look like others of the same image; a quarter of the images has more."""
    by_motion: list[int]
    """Placed instants that recorded motion joins to the others, as depth and features do not."""
    motion_notes: list[str]
    """How recorded motion placed images, or why it placed none, or not all, of those that needed it."""
    tracked_body: dict[str, FloatArray] = dataclasses.field(default_factory=dict)
    """By the kind of a recording whose poses placed the images: the body on what was tracked, (4, 4)."""
    clocks: dict[str, list[float]] = dataclasses.field(default_factory=dict)
    """By the kind of a recording that held the poses: how late its clock is, and the standard deviation (s)."""
    trial: Trial
    """What the matches say of the camera file; its poses and points are COLMAP's, not the world's."""
    cpu_s: dict[str, float]
    """CPU seconds of each step, all threads."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SparseModel(Registration):
    """What COLMAP found, in its own world frame; the scale is metric only if a rig baseline gave it."""

    rig: Rig
    """With refined lenses if they were to be refined, and corrected by what the trial of the calibration found."""
    T_world_body: FloatArray
    """(instants, 4, 4); NaN where not registered."""
    points_world: FloatArray
    """(m, 3)."""


def calibrate(images: ImageSet, options: SparseOptions, placed: PlacedImages, *, progress: Progress) -> SparseModel:
    """Poses and points of placed images, adjusted to what the trial finds.

    Depth images gave their poses themselves: what the trial finds of their camera is reported, and changes nothing.

    Raises:
        MapError: COLMAP cannot go on with the corrected calibration.
    """
    import pycolmap

    watch = Stopwatch()
    progress(_TRYING, 0.0)
    model = pycolmap.Reconstruction(placed.model)
    seen = _features_seen(placed.database, model, images)
    recorded = _recorded(images, placed)
    trial = calibration_trial.hold(seen, recorded)
    watch.lap("trial of the calibration")
    if images.depths is None:
        images = dataclasses.replace(images, rig=trial.rig)
        colmap_model.write_back(model, images, trial)
        if len(trial.present) > len(trial.inexpressible):  # else COLMAP would choose the same matches
            with repetition.explained(placed.repeated):
                _choose_matches_again(placed.database, model, trial.rig, options, progress)
            # matches chosen by the wrong calibration show too little of what is wrong with it (8.4 % of 9.1 %)
            progress(_TRYING, 0.0)
            again = dataclasses.replace(_features_seen(placed.database, model, images), rig=seen.rig)
            trial = calibration_trial.hold(again, recorded)
            images = dataclasses.replace(images, rig=trial.rig)
            colmap_model.write_back(model, images, trial)
            watch.lap("trial on the matches of the corrected calibration")
        colmap_model.drop_lost_points(model)
    return _read_out(placed, model, images, trial, watch)


def _recorded(images: ImageSet, placed: PlacedImages) -> Recorded | None:
    """Recorded poses that placed images, as priors; odometry drifts, and depth images give the poses by themselves."""
    for motion in images.motions:
        if motion.kind is MotionKind.POSES and motion.kind in placed.tracked_body and images.depths is None:
            agreeing = np.isin(np.arange(len(images.time_s)), placed.agreeing.get(motion.kind, []))
            when_s = np.where(agreeing, images.time_s, np.nan)  # beyond a jump the matches contradict them
            return Recorded(
                motion.name,
                lambda late_s, path=motion.trajectory, when_s=when_s: path.at(when_s + late_s),
                placed.tracked_body[motion.kind],
                _is_dense(motion.trajectory.time_s, images.time_s),
                motion.trajectory.std,
            )
    return None


def _clocks(trial: Trial) -> dict[str, list[float]]:
    judged = trial.priors
    if judged is None or judged.refused or judged.late_std_s == 0.0:
        return {}
    return {MotionKind.POSES: [judged.late_s, max(judged.late_std_s, _LEAST_CLOCK_STD_S)]}


def _is_dense(recorded_s: FloatArray, images_s: FloatArray) -> bool:
    """Whether a recording has so many poses between the images that those at other times are known, too."""
    steps_s = np.diff(np.sort(images_s[np.isfinite(images_s)]))
    return bool(len(steps_s)) and float(np.median(np.diff(recorded_s))) <= 0.5 * float(np.median(steps_s))


def _choose_matches_again(database: Path, model: Any, rig: Rig, options: SparseOptions, progress: Progress) -> None:
    """Let COLMAP take matches in and out of the model with corrected lenses, which stay as they are."""
    fixed = dataclasses.replace(rig, refine_intrinsics=False)
    with tempfile.TemporaryDirectory() as folder:
        colmap.refine(_with_lenses(database, rig, Path(folder)), model, fixed, options, progress)


def _features_seen(database: Path, model: Any, images: ImageSet) -> Observations:
    """What the model explains, each feature where the centre of its patch of surface is seen."""
    seen = colmap_model.observations(model, images)
    return eccentricity.corrected(seen, colmap_model.sizes_px(database, model))


def _with_lenses(database: Path, rig: Rig, folder: Path) -> Path:
    """The database, or a copy with these lenses if their kinds differ: else COLMAP does not go on with the model."""
    import pycolmap

    lenses = [colmap_model.colmap_camera(camera, camera_id=index + 1) for index, camera in enumerate(rig)]
    with pycolmap.Database.open(database) as opened:
        if all(opened.read_camera(lens.camera_id).model == lens.model for lens in lenses):
            return database
    shutil.copyfile(database, folder / database.name)
    with pycolmap.Database.open(folder / database.name) as opened, pycolmap.DatabaseTransaction(opened):
        for lens in lenses:
            opened.update_camera(lens)
    return folder / database.name


def _read_out(placed: PlacedImages, model: Any, images: ImageSet, trial: Trial, watch: Stopwatch) -> SparseModel:
    import pycolmap

    T_world_body, registered, rig = colmap_model.poses(model, images)
    seen = _features_seen(placed.database, model, images)
    sums = np.zeros((len(seen.points_world), 128), dtype=np.float32)
    with pycolmap.Database.open(placed.database) as opened:
        start = 0
        for image_id in model.reg_image_ids():  # in the order of `seen`
            features_seen = np.array(model.image(image_id).get_observation_point2D_idxs(), dtype=np.int64)
            points = seen.index[start : start + len(features_seen), 0]
            sums[points] += features.unit(opened.read_descriptors(image_id).data[features_seen])
            start += len(features_seen)
    pairs = agreement.of_pairs(placed.database, images, rig, T_world_body)
    watch.lap("reading out")
    return SparseModel(
        rig=rig,
        T_world_body=T_world_body,
        registered=registered,
        points_world=seen.points_world,
        descriptors=features.unit(sums),
        observations=seen.index,
        pixels=seen.pixels,
        reprojection_error_px=_reprojection_error_px(seen),
        least_agreement=float(np.nanmin(pairs.of_instants(), initial=1.0)),
        breaks=pairs.breaks() if images.depths is None else np.zeros((0, 2), dtype=np.int64),
        overlaps=overlap.of_instants(placed.database, images),
        repeated=placed.repeated,
        by_motion=placed.by_motion,
        motion_notes=[*placed.motion_notes, *([trial.priors.text] if trial.priors else [])],
        tracked_body=placed.tracked_body,
        clocks=_clocks(trial),
        trial=trial,
        cpu_s=placed.cpu_s | watch.cpu_s,
    )


def _reprojection_error_px(seen: Observations) -> float:
    """Mean over the points of each one's mean; observations that the lens does not show are left out."""
    error_px = np.linalg.norm(adjustment.residuals(seen, adjustment.initial(seen)), axis=1)
    shown = np.isfinite(error_px)
    _, point, count = np.unique(seen.index[shown, 0], return_inverse=True, return_counts=True)
    return float((np.bincount(point, error_px[shown]) / count).mean())
