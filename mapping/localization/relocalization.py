"""Relocalization of images in a map: matching against the map's points, then the pose of the whole rig.

Every map point keeps the mean of its descriptors. Features of new images are compared with all of them at once; what
matches clearly gives 2D-3D pairs of all cameras of an instant, and they give one pose, found robustly by COLMAP.

Where the instants have times, neighbours count: a pose that no vehicle reaches from the others is refused, and an
instant without a pose is looked for again where its neighbours were, among the points near each feature's direction.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, Progress, frames, silent
from mapping import child
from mapping.camera.rig import Rig
from mapping.input.images import ImageSet
from mapping.localization import neighbours, pose_certainty
from mapping.localization.pose_certainty import Match
from mapping.sparse.features import feature_files, features
from mapping.sparse.features.feature_files import FeatureFiles
from mapping.sparse.features.features import Features
from mapping.sparse.localization_map import LocalizationMap

_STAGE, _SECOND_STAGE = "localizing", "looking again beside neighbours"
_OUTLIER_PX = 4.0
"""Largest reprojection error of a match that supports a pose."""
_LEAST_INLIERS, _LEAST_SHARE = 30, 0.15
"""A pose that fewer matches, or a smaller share of them, support is rejected."""
_BESIDE_RAD = 0.35
"""Angle from a feature within which its point is looked for again: what a vehicle turns between two images."""
_ROWS = 256
"""Features that are compared with the whole map at once: fresh memory for 2000 takes half as long as the comparison."""


@dataclass(frozen=True, slots=True)
class LocalizationOptions:
    """Thresholds for matches and poses."""

    features: int = 2000
    """Most features an image."""
    ratio: float = 0.85
    """A match counts if its distance is less than this share of the second best's."""
    fastest_m_s: float = 15.0
    """A pose that is not reached at this speed from its neighbours in time is rejected."""
    neighbours_s: float = 2.0
    """How far in time a neighbour may be that says where to look for an instant again."""


@dataclass(frozen=True, slots=True, eq=False)
class Localization:
    """One pose for each instant, or none."""

    instants: tuple[str, ...]
    """Image names."""
    T_world_body: FloatArray
    """(n, 4, 4), NaN where it failed."""
    covariance: FloatArray
    """(n, 6, 6) of position (world, m) and turn (body, rad), in the map: its own errors come on top. NaN where it
    failed."""
    inliers: np.ndarray
    """(n,) matches that support the pose."""
    matches: np.ndarray
    """(n,) matches that were found."""
    refused: dict[str, str]
    """Images without a pose, and why."""

    @property
    def found(self) -> np.ndarray:
        """(n,) bool."""
        return np.isfinite(self.T_world_body[:, 0, 0])

    @property
    def failed(self) -> tuple[str, ...]:
        """Images without a pose."""
        return tuple(name for name, good in zip(self.instants, self.found, strict=True) if not good)


def localize(
    known: LocalizationMap,
    images: ImageSet,
    *,
    options: LocalizationOptions | None = None,
    keep: Path | None = None,
    progress: Progress = silent,
) -> Localization:
    """Poses of `images`' rig in the map.

    Args:
        keep: an existing, empty folder that gets the images' features, as `FeatureFiles`.

    Raises:
        MapError: COLMAP crashed.
    """
    if keep is None:
        with tempfile.TemporaryDirectory(prefix="goshawk-") as name:
            return localize(known, images, options=options, keep=Path(name), progress=progress)
    return child.run(localize_here, known, images, options or LocalizationOptions(), keep, progress=progress)


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """What is found of one instant."""

    T_world_body: FloatArray | None
    """(4, 4)."""
    supporting: list[Match]
    """The matches that support it."""
    matches: int
    """All matches."""
    refusal: str = ""
    """Why there is no pose."""

    @property
    def inliers(self) -> int:
        return sum(len(pixels) for _, pixels, _ in self.supporting)


def localize_here(
    known: LocalizationMap, images: ImageSet, options: LocalizationOptions, keep: Path, *, progress: Progress
) -> Localization:
    """The work of `localize`, in this process."""
    answers = [_answer(images.rig, matches) for matches in _matched(known, images, options, keep, progress)]
    if (np.diff(images.time_s) > 0.0).all():  # not where a time is unknown (NaN)
        answers = _reachable(answers, images.time_s, options)
        answers = _looked_for_again(answers, known, images, FeatureFiles(keep), options, progress)
    missing = np.full((6, 6), np.nan)
    return Localization(
        images.instants,
        _poses(answers),
        np.array(
            [
                missing
                if answer.T_world_body is None
                else pose_certainty.covariance(images.rig, answer.supporting, answer.T_world_body)
                for answer in answers
            ]
        ),
        np.array([answer.inliers for answer in answers], dtype=np.int64),
        np.array([answer.matches for answer in answers], dtype=np.int64),
        {name: answer.refusal for name, answer in zip(images.instants, answers, strict=True) if answer.refusal},
    )


def _poses(answers: list[_Answer]) -> FloatArray:
    """(n, 4, 4), NaN where there is none."""
    nowhere = np.full((4, 4), np.nan)
    return np.array([nowhere if answer.T_world_body is None else answer.T_world_body for answer in answers])


def _matched(
    known: LocalizationMap, images: ImageSet, options: LocalizationOptions, keep: Path, progress: Progress
) -> Iterator[list[Match]]:
    """The matches of each instant with the whole map."""
    matches: list[Match] = []
    found = feature_files.written(keep, features.of_set(images, options.features))
    shots = images.pairs()
    for done, ((instant, camera), image) in enumerate(zip(shots, found, strict=True), start=1):
        feature, point = match(features.unit(image.descriptors), known.descriptors, options.ratio)
        matches.append((camera, image.pixels[feature], known.points_world_m[point]))
        progress(_STAGE, done / images.count)
        if done == len(shots) or shots[done][0] != instant:
            yield matches
            matches = []


def _reachable(answers: list[_Answer], time_s: FloatArray, options: LocalizationOptions) -> list[_Answer]:
    """The answers without the poses that contradict their neighbours in time."""
    positions_m = _poses(answers)[:, :3, 3]
    kept = neighbours.reachable(time_s, positions_m, options.fastest_m_s)
    reason = f"not reached from its neighbours in time at {options.fastest_m_s:g} m/s"
    return [
        answer if answer.T_world_body is None or good else _Answer(None, [], answer.matches, reason)
        for answer, good in zip(answers, kept, strict=True)
    ]


def _looked_for_again(
    answers: list[_Answer],
    known: LocalizationMap,
    images: ImageSet,
    found: Sequence[Features],
    options: LocalizationOptions,
    progress: Progress,
) -> list[_Answer]:
    """The answers, and those of instants that are found where their neighbours in time say."""
    T_world_body = _poses(answers)
    result = list(answers)
    failed = [k for k, answer in enumerate(answers) if answer.T_world_body is None]
    for done, instant in enumerate(failed, start=1):
        expected = neighbours.predicted(images.time_s, T_world_body, instant, options.neighbours_s)
        if expected is not None:
            again = _answer(images.rig, _matched_beside(known, images, found, instant, expected, options))
            result[instant] = again if again.T_world_body is not None else result[instant]
        progress(_SECOND_STAGE, done / len(failed))
    return _reachable(result, images.time_s, options)


def _matched_beside(
    known: LocalizationMap,
    images: ImageSet,
    found: Sequence[Features],
    instant: int,
    expected: FloatArray,
    options: LocalizationOptions,
) -> list[Match]:
    """The matches of one instant, each with a point that is near the feature's direction from the expected pose."""
    matches: list[Match] = []
    for index, (of, number) in enumerate(images.pairs()):
        if of != instant:
            continue
        image, camera = found[index], images.rig.cameras[number]
        in_camera = frames.apply(frames.invert(expected @ camera.T_body_camera), known.points_world_m)
        rays = in_camera / np.linalg.norm(in_camera, axis=1, keepdims=True)
        beside = Beside(camera.unproject(image.pixels), rays, float(np.cos(_BESIDE_RAD)))
        feature, point = match(features.unit(image.descriptors), known.descriptors, options.ratio, beside)
        matches.append((number, image.pixels[feature], known.points_world_m[point]))
    return matches


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """Which known points a feature may mean: those near its direction."""

    of_query: FloatArray
    """(n, 3) unit rays of the features."""
    of_known: FloatArray
    """(m, 3) unit rays to the points."""
    least_cosine: float
    """Of the angle between them."""


def match(
    query: np.ndarray, known: np.ndarray, ratio: float, beside: Beside | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Indices (k,) of query descriptors and of the known ones they mean; each known one is meant once at most.

    Args:
        query: (n, 128) unit vectors; known: (m, 128) unit vectors.
        beside: which of them may mean each other; all by default.
    """
    if len(query) == 0 or len(known) < 2:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    best = np.empty(len(query), np.int64)
    best_cosine, next_cosine = np.empty(len(query), np.float32), np.empty(len(query), np.float32)
    meant_by, meant_cosine = np.zeros(len(known), np.int64), np.full(len(known), -1.0, np.float32)
    for start in range(0, len(query), _ROWS):
        part = slice(start, start + _ROWS)
        cosine = query[part] @ known.T
        if beside is not None:
            cosine[beside.of_query[part] @ beside.of_known.T < beside.least_cosine] = -1.0
        rows = np.arange(len(cosine))
        best[part] = cosine.argmax(axis=1)
        best_cosine[part] = cosine[rows, best[part]]
        row, column_cosine = cosine.argmax(axis=0), cosine.max(axis=0)
        better = column_cosine > meant_cosine
        meant_by[better], meant_cosine[better] = start + row[better], column_cosine[better]
        cosine[rows, best[part]] = -1.0
        next_cosine[part] = cosine.max(axis=1)
    mutual = meant_by[best] == np.arange(len(query))
    # |a - b|^2 = 2 - 2 a.b for unit vectors
    chosen = np.flatnonzero(mutual & (1.0 - best_cosine < ratio**2 * (1.0 - next_cosine)))
    return chosen, best[chosen]


def _answer(rig: Rig, matches: list[Match]) -> _Answer:
    """The pose that matches of one instant support, or why there is none."""
    total = sum(len(pixels) for _, pixels, _ in matches)
    if total < _LEAST_INLIERS:
        return _Answer(None, [], total, f"{total} features look like points of the map; {_LEAST_INLIERS} needed")
    T_world_body, supports = _pose(rig, matches)
    count, needed = int(supports.sum()), max(_LEAST_INLIERS, round(_LEAST_SHARE * total))
    if T_world_body is None or count < needed:
        return _Answer(None, [], total, f"{count} of {total} matches agree with one pose; {needed} needed")
    ends = np.cumsum([len(pixels) for _, pixels, _ in matches])
    parts = zip(matches, np.split(supports, ends[:-1]), strict=True)
    return _Answer(T_world_body, [(camera, p[good], x[good]) for (camera, p, x), good in parts], total)


def _pose(rig: Rig, matches: list[Match]) -> tuple[FloatArray | None, np.ndarray]:
    """T_world_body (4, 4) from 2D-3D pairs of the cameras of the rig, and which of them (n,) support it."""
    import pycolmap

    from mapping.sparse.mapper import colmap_model

    ransac = pycolmap.RANSACOptions(max_error=_OUTLIER_PX, random_seed=0, max_num_trials=10_000)
    pixels = np.concatenate([p for _, p, _ in matches])
    points = np.concatenate([p for _, _, p in matches])
    if len(rig) == 1:
        estimation = pycolmap.AbsolutePoseEstimationOptions()
        estimation.ransac = ransac
        camera = colmap_model.colmap_camera(rig.cameras[0])
        answer: Any = pycolmap.estimate_and_refine_absolute_pose(pixels, points, camera, estimation)
        T_first_world = answer["cam_from_world"] if answer else None
    else:
        cameras = [colmap_model.colmap_camera(c) for c in rig]
        which = [camera for camera, p, _ in matches for _ in range(len(p))]
        answer = pycolmap.estimate_and_refine_generalized_absolute_pose(
            pixels, points, which, colmap_model.cam_from_rig(rig), cameras, ransac
        )
        T_first_world = answer["rig_from_world"] if answer else None
    if answer is None or T_first_world is None:
        return None, np.zeros(len(pixels), dtype=bool)
    T = np.eye(4)
    T[:3] = T_first_world.matrix()
    return frames.invert(rig.cameras[0].T_body_camera @ T), np.asarray(answer["inlier_mask"], dtype=bool)
