"""The steps that COLMAP runs: features, matches, incremental mapping. Runs in a child process only (see `child`)."""

import contextlib
import dataclasses
import json
import logging
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, InputError, MapError, Progress
from mapping.camera.rig import Rig
from mapping.input.images import ImageSet
from mapping.sparse.features import features, repetition
from mapping.sparse.mapper import agreement, colmap_model, growth, known_poses, matched_pairs, pairing, rgbd
from mapping.sparse.mapper.known_poses import KnownPoses
from mapping.stages import Work
from mapping.workers import Pool, Threads

logger = logging.getLogger(__name__)

_MAPPING = "placing images"
_REFINING = "refining"
_DATABASE = "database.db"
_SIGNATURES, _REPEATED, _BY_MOTION = "signatures.npz", "repeated.npy", "by_motion.json"
_REPAIRS = 4

_LEAST_IMAGES = 2
_OUTLIER_PX = 3.0
"""Observations with a larger reprojection error are dropped; 4 keeps moving leaves, 2 drops good ones."""


@dataclass(frozen=True, slots=True)
class SparseOptions:
    """How the sparse map is made."""

    features: int = 1500
    """Most features an image; more cost time in every later step."""
    window: int = 5
    """Each image is matched with this many later ones of the same camera."""
    similar: int = 2
    """And with this many of the most similar ones elsewhere: closes loops."""
    seed: int = 1
    """COLMAP's random number generator."""

    def __post_init__(self) -> None:
        for name, least in (("features", 100), ("window", 1), ("similar", 0)):
            if getattr(self, name) < least:
                raise InputError(f"{name} is {getattr(self, name)}; it must be at least {least}")


FEATURES, MATCHES, POSES = "features", "matches", "poses"
"""Stages whose results survive an interrupted work."""


@dataclass(frozen=True, slots=True)
class PlacedImages:
    """Where the finished stages of an image set are, and what they report."""

    database: Path
    """COLMAP's: features and verified matches."""
    model: Path
    """Folder of COLMAP's model, whose scale is metric only if a rig baseline gave it."""
    repeated: float
    """Upper quartile over the images of `repetition.share`."""
    by_motion: list[int]
    """Instants that recorded motion placed, as depth and features do not join them to the others."""
    motion_notes: list[str]
    """How recorded motion placed images, or why it placed none, or not all, of those that needed it."""
    tracked_body: dict[str, FloatArray]
    """By the kind of a recording whose poses placed the images: the body on what was tracked, (4, 4)."""
    cpu_s: dict[str, float]
    """CPU seconds of each step, all threads."""
    agreeing: dict[str, list[int]] = dataclasses.field(default_factory=dict)
    """By the kind of such a recording: the instants at which the matches agree with its poses."""


def place_images(
    images: ImageSet, options: SparseOptions, work: Work, pool: Pool, *, progress: Progress
) -> PlacedImages:
    """Features, matches and poses of an image set; finished stages of `work` are not done again."""
    watch = Stopwatch()
    work = work.on(options)
    extracted = work.stage(FEATURES, lambda folder: _features(folder, images, options, progress))
    watch.lap("features")
    work = work.on(pairing.near_in_space(images, options.window))
    matched = work.stage(MATCHES, lambda folder: _matches(folder, extracted, images, options, work, pool, progress))
    watch.lap("matches")
    database = matched / _DATABASE
    repeated = float(np.percentile(np.load(extracted / _REPEATED), 75.0))
    placing = work.on(images.motion_digests())
    with repetition.explained(repeated):
        placed = placing.stage(POSES, lambda folder: _placed(folder, database, images, options, progress))
    watch.lap("placing")
    motion = json.loads((placed / _BY_MOTION).read_text())
    motion["tracked_body"] = {kind: np.array(T) for kind, T in motion["tracked_body"].items()}
    return PlacedImages(database, placed, repeated, **motion, cpu_s=watch.cpu_s)


def _features(folder: Path, images: ImageSet, options: SparseOptions, progress: Progress) -> None:
    signatures, repeated = extract(folder / _DATABASE, images, options, progress)
    np.savez(folder / _SIGNATURES, *signatures)
    np.save(folder / _REPEATED, repeated)


def _matches(
    folder: Path,
    extracted: Path,
    images: ImageSet,
    options: SparseOptions,
    work: Work,
    pool: Pool,
    progress: Progress,
) -> None:
    shutil.copyfile(extracted / _DATABASE, folder / _DATABASE)
    with np.load(extracted / _SIGNATURES, allow_pickle=False) as kept:
        signatures = [kept[name] for name in kept.files]
    match(folder / _DATABASE, images, signatures, options, progress, tasks=work.tasks(MATCHES), pool=pool)


def _placed(folder: Path, database: Path, images: ImageSet, options: SparseOptions, progress: Progress) -> None:
    """COLMAP's model, adjusted; with depth images the poses are those that the depth asks for."""
    by_motion: dict[str, Any] = {"by_motion": [], "motion_notes": [], "tracked_body": {}}
    if images.depths is not None:
        placed = rgbd.place(database, images, _mapping_options(options), progress)
        model = placed.model
        by_motion |= {"by_motion": np.flatnonzero(placed.by_motion).tolist(), "motion_notes": placed.notes}
    else:
        model, known, by_motion["motion_notes"] = place_beside(database, images, options, progress)
        if known is not None:
            by_motion["tracked_body"] = {known.motion.kind: known.T_tracked_body.tolist()}
            agreeing = np.flatnonzero(np.isfinite(known.T_world_body[:, 0, 0]))
            by_motion["agreeing"] = {known.motion.kind: agreeing.tolist()}
        refine(database, model, images.rig, options, progress)
    model.write(folder)
    (folder / _BY_MOTION).write_text(json.dumps(by_motion))


class Stopwatch:
    """CPU seconds between laps."""

    def __init__(self) -> None:
        self._last_s = time.process_time()
        self.cpu_s: dict[str, float] = {}

    def lap(self, name: str) -> None:
        now_s = time.process_time()
        self.cpu_s[name] = round(now_s - self._last_s, 2)
        self._last_s = now_s


def extract(
    database: Path, images: ImageSet, options: SparseOptions, progress: Progress
) -> tuple[list[np.ndarray], list[float]]:
    """Write cameras, rig, instants and the features of all images to `database`.

    Returns:
        For each image the descriptors of its largest features, as unit vectors, for image retrieval; and its
        `repetition.share`.
    """
    import pycolmap

    signatures: list[np.ndarray] = []
    repeated: list[float] = []
    with pycolmap.Database.open(database) as opened, pycolmap.DatabaseTransaction(opened):
        _write_rig(opened, images.rig)
        instants = [pycolmap.Frame(rig_id=1) for _ in images.instants]
        found = features.of_set(images, options.features, progress=progress)
        for (instant, camera), image in zip(images.pairs(), found, strict=True):
            name = images.relative(instant, camera)
            row = pycolmap.Image(name=name, keypoints=np.zeros((0, 2)), camera_id=camera + 1)
            image_id = opened.write_image(row)
            columns = (image.pixels, image.size_px[:, None], image.angle_rad[:, None])
            opened.write_keypoints(image_id, np.concatenate(columns, axis=1).astype(np.float32))
            kind = pycolmap.FeatureExtractorType.SIFT
            opened.write_descriptors(image_id, pycolmap.FeatureDescriptors(kind, image.descriptors))
            sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera + 1)
            instants[instant].add_data_id(pycolmap.data_t(sensor, image_id))
            largest = np.argsort(-image.size_px, kind="stable")[: pairing.SIGNATURE_SIZE]
            signatures.append(features.unit(image.descriptors[largest]))
            repeated.append(repetition.share(image))
        for frame in instants:
            opened.write_frame(frame)
    return signatures, repeated


def _write_rig(opened: Any, rig: Rig) -> None:
    import pycolmap

    made = pycolmap.Rig(rig_id=1)
    for index, (camera, pose) in enumerate(zip(rig, colmap_model.cam_from_rig(rig), strict=True)):
        opened.write_camera(colmap_model.colmap_camera(camera, camera_id=index + 1), use_camera_id=True)
        sensor = pycolmap.sensor_t(pycolmap.SensorType.CAMERA, index + 1)
        if index == 0:
            made.add_ref_sensor(sensor)
        else:
            made.add_sensor(sensor, pose)
    opened.write_rig(made, use_rig_id=True)


def match(
    database: Path,
    images: ImageSet,
    signatures: list[np.ndarray],
    options: SparseOptions,
    progress: Progress,
    *,
    tasks: Path | None = None,
    pool: Pool | None = None,
) -> None:
    """Match neighbours in time, the cameras of the rig with each other, and similar images anywhere.

    Args:
        tasks: folder that keeps what is done if this is interrupted; None: nothing is kept.
        pool: threads of this process by default.
    """
    near = pairing.near_in_space(images, options.window)
    pairs = pairing.choose(images.pairs(), signatures, window=options.window, similar=options.similar, near=near)
    names = [(images.relative(*a), images.relative(*b)) for a, b in pairs]
    with contextlib.ExitStack() as kept:
        folder = tasks or Path(kept.enter_context(tempfile.TemporaryDirectory(dir=database.parent)))
        matched_pairs.write(
            database, names, seed=options.seed, folder=folder, pool=pool or Threads(), progress=progress
        )


def place_beside(
    database: Path, images: ImageSet, options: SparseOptions, progress: Progress
) -> tuple[Any, KnownPoses | None, list[str]]:
    """COLMAP's model of images beside which motion may have been recorded, and what that had to do with it.

    Raises:
        MapError: no two images could be placed against each other.
    """
    progress(_MAPPING, 0.0)
    known, notes = known_poses.find(database, images, options.window)
    if known is not None:
        start = known_poses.triangulated(database, images, known, _mapping_options(options))
        with contextlib.suppress(MapError):  # then the images by themselves
            model = place(database, images, options, progress, start=start)
            return model, known, [*notes, known_poses.placed_text(known)]
    try:
        return place(database, images, options, progress), None, notes
    except MapError as error:
        raise MapError("; ".join([str(error), *notes])) from None


def place(database: Path, images: ImageSet, options: SparseOptions, progress: Progress, *, start: Any = None) -> Any:
    """Incremental mapping; returns COLMAP's largest model, without images that are in the wrong place.

    Args:
        start: COLMAP's model, which is grown in place; None: from scratch.

    The relative pose of the first two images is sometimes wrong. The others still get right poses relative to each
    other, so the wrong images are removed and placed again, now in a correct map. So is what lies beyond a break.
    """
    model = _grow(database, images, options, start, progress)
    for _ in range(_REPAIRS):
        wrong = _wrong_instants(database, images, model)
        if not wrong:
            return model
        logger.info("placing %d images again", len(wrong))
        _take_out(model, wrong)
        if model.num_reg_images() < _LEAST_IMAGES:
            break
        model = _grow(database, images, options, model, progress)
    _take_out(model, _wrong_instants(database, images, model))
    if model.num_reg_images() < _LEAST_IMAGES:
        raise MapError(
            "no map: the matches between the images contradict each other; check that the camera file is that of these "
            "images"
        )
    return model


def _grow(database: Path, images: ImageSet, options: SparseOptions, start: Any, progress: Progress) -> Any:
    """Place all images that can be placed, from scratch or from a model.

    Lenses stay fixed here: freed on two images of a forward-moving camera they diverge (a focal length of
    138 px and k = 30 where 375 and 0.06 are right). `refine` frees them once all images constrain them.
    """
    placed = 0

    def count() -> None:
        nonlocal placed
        placed += 1
        progress(_MAPPING, min(placed / len(images.instants), 1.0))

    progress(_MAPPING, 0.0)
    growing = _mapping_options(options)
    # nothing is adjusted to the end while more is to come: `refine` does that, with COLMAP's own limits
    growing.ba_local_max_refinements, growing.ba_local_function_tolerance = 1, 1e-4
    growing.ba_global_max_refinements, growing.ba_global_function_tolerance = 2, 1e-5
    model = growth.largest_model(database, growing, start, count)
    if model is None:
        raise MapError(
            "no map: no two of these images could be placed against each other; "
            "they need texture, overlap and a camera that moves sideways or forward, not only turns"
        )
    return model


def _wrong_instants(database: Path, images: ImageSet, model: Any) -> set[str]:
    """Names of the instants whose matches disagree with the map, or with its largest part."""
    T_world_body, _, rig = colmap_model.poses(model, images)
    pairs = agreement.of_pairs(database, images, rig, T_world_body)
    instants = np.flatnonzero((pairs.of_instants() < agreement.LEAST) | (pairs.part() > 0))
    return {images.relative(i, c) for i, c in images.pairs() if i in instants}


def _take_out(model: Any, names: set[str]) -> None:
    """Remove instants and every point they saw: those points are the wrong copy of the scene."""
    wrong = [model.image(k) for k in model.reg_image_ids() if model.image(k).name in names]
    for point_id in {p.point3D_id for image in wrong for p in image.get_observation_points2D()}:
        model.delete_point3D(point_id)
    for frame_id in {image.frame_id for image in wrong}:
        model.deregister_frame(frame_id)


def _mapping_options(options: SparseOptions) -> Any:
    import pycolmap

    mapping = pycolmap.IncrementalPipelineOptions()
    mapping.random_seed = options.seed
    mapping.extract_colors = False
    mapping.min_model_size = 3
    mapping.ba_refine_focal_length = False
    mapping.ba_refine_extra_params = False
    mapping.ba_refine_principal_point = False
    mapping.ba_refine_sensor_from_rig = False
    mapping.mapper.abs_pose_max_error = 2.0 * _OUTLIER_PX
    mapping.mapper.filter_max_reproj_error = _OUTLIER_PX
    mapping.triangulation.merge_max_reproj_error = _OUTLIER_PX
    mapping.triangulation.complete_max_reproj_error = _OUTLIER_PX
    mapping.mapper.abs_pose_refine_focal_length = False
    mapping.mapper.abs_pose_refine_extra_params = False
    return mapping


def refine(database: Path, model: Any, rig: Rig, options: SparseOptions, progress: Progress) -> None:
    """Adjust everything together, lenses freed where asked; the rig and the principal points stay."""
    import pycolmap

    progress(_REFINING, 0.0)
    mapping = _mapping_options(options)
    mapping.ba_refine_focal_length = rig.refine_intrinsics
    mapping.ba_refine_extra_params = rig.refine_intrinsics
    with pycolmap.Database.open(database) as opened:
        cache = pycolmap.DatabaseCache.create(opened, pycolmap.DatabaseCacheOptions())
        mapper = pycolmap.IncrementalMapper(cache)
        mapper.begin_reconstruction(model)
        growth.adjust(mapper, mapping, normalize=False)
        mapper.end_reconstruction(False)
        if len(rig) > 1 and not pycolmap.align_reconstruction_to_orig_rig_scales(cache.rigs, model):
            raise MapError(f"{_REFINING}: the distance between the cameras of the rig could not be restored")
    progress(_REFINING, 1.0)
