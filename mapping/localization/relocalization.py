"""Relocalization of images in a map: matching against the map's points, then the pose of the whole rig.

Every map point keeps the mean of its descriptors. Features of new images are compared with all of them at once; what
matches clearly gives 2D-3D pairs of all cameras of an instant, and they give one pose, found robustly by COLMAP.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FloatArray, Progress, frames, silent
from mapping import child
from mapping.camera.rig import Rig
from mapping.input.images import ImageSet
from mapping.sparse import features
from mapping.sparse.localization_map import LocalizationMap

_STAGE = "localizing"
_ROWS = 2000


@dataclass(frozen=True, slots=True)
class LocalizationOptions:
    """Thresholds for matches and poses."""

    features: int = 2000
    """Most features an image."""
    ratio: float = 0.85
    """A match counts if its distance is less than this share of the second best's."""
    outlier_px: float = 4.0
    """Largest reprojection error of a match that supports a pose."""
    least_inliers: int = 30
    """A pose with fewer supporting matches is rejected."""
    least_share: float = 0.15
    """A pose supported by a smaller share of the matches is rejected."""


@dataclass(frozen=True, slots=True, eq=False)
class Localization:
    """One pose for each instant, or none."""

    instants: tuple[str, ...]
    """Image names."""
    T_world_body: FloatArray
    """(n, 4, 4), NaN where it failed."""
    inliers: np.ndarray
    """(n,) matches that support the pose."""
    matches: np.ndarray
    """(n,) matches that were found."""

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
    progress: Progress = silent,
) -> Localization:
    """Poses of `images`' rig in the map.

    Raises:
        MapError: COLMAP crashed.
    """
    return child.run(localize_here, known, images, options or LocalizationOptions(), progress=progress)


def localize_here(
    known: LocalizationMap, images: ImageSet, options: LocalizationOptions, *, progress: Progress
) -> Localization:
    """The work of `localize`, in this process."""
    count = len(images.instants)
    T_world_body = np.full((count, 4, 4), np.nan)
    inliers, matches = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    waiting: list[list[tuple[int, FloatArray, FloatArray]]] = [[] for _ in range(count)]
    found = features.of_set(images, options.features)
    for done, ((instant, camera), image) in enumerate(zip(images.pairs(), found, strict=True), start=1):
        feature, point = match(features.unit(image.descriptors), known.descriptors, options.ratio)
        waiting[instant].append((camera, image.pixels[feature], known.points_world_m[point]))
        matches[instant] += len(feature)
        progress(_STAGE, done / images.count)
    for instant, pairs in enumerate(waiting):
        T, inliers[instant] = _pose(images.rig, pairs, options)
        enough = inliers[instant] >= max(options.least_inliers, options.least_share * matches[instant])
        if T is not None and enough:
            T_world_body[instant] = T
    return Localization(images.instants, T_world_body, inliers, matches)


def match(query: np.ndarray, known: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices (k,) of query descriptors and of the known ones they mean; each known one is meant once at most.

    Args:
        query: (n, 128) unit vectors; known: (m, 128) unit vectors.
    """
    if len(query) == 0 or len(known) < 2:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    best = np.empty(len(query), np.int64)
    best_cosine, next_cosine = np.empty(len(query), np.float32), np.empty(len(query), np.float32)
    meant_by, meant_cosine = np.zeros(len(known), np.int64), np.full(len(known), -1.0, np.float32)
    for start in range(0, len(query), _ROWS):  # a part at a time: all pairs of two maps would not fit the memory
        part = slice(start, start + _ROWS)
        cosine = query[part] @ known.T
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


def _pose(
    rig: Rig, pairs: list[tuple[int, FloatArray, FloatArray]], options: LocalizationOptions
) -> tuple[FloatArray | None, int]:
    """T_world_body (4, 4) from 2D-3D pairs of the cameras of the rig, and how many of them support it."""
    import pycolmap

    from mapping.sparse import colmap_model

    total = sum(len(pixels) for _, pixels, _ in pairs)
    if total < options.least_inliers:
        return None, 0
    ransac = pycolmap.RANSACOptions(max_error=options.outlier_px, random_seed=0, max_num_trials=10_000)
    pixels = np.concatenate([p for _, p, _ in pairs])
    points = np.concatenate([p for _, _, p in pairs])
    if len(rig) == 1:
        estimation = pycolmap.AbsolutePoseEstimationOptions()
        estimation.ransac = ransac
        camera = colmap_model.colmap_camera(rig.cameras[0])
        answer: Any = pycolmap.estimate_and_refine_absolute_pose(pixels, points, camera, estimation)
        T_first_world = answer["cam_from_world"] if answer else None
    else:
        cameras = [colmap_model.colmap_camera(c) for c in rig]
        which = [camera for camera, p, _ in pairs for _ in range(len(p))]
        answer = pycolmap.estimate_and_refine_generalized_absolute_pose(
            pixels, points, which, colmap_model.cam_from_rig(rig), cameras, ransac
        )
        T_first_world = answer["rig_from_world"] if answer else None
    if answer is None or T_first_world is None:
        return None, 0
    T = np.eye(4)
    T[:3] = T_first_world.matrix()
    return frames.invert(rig.cameras[0].T_body_camera @ T), int(np.sum(answer["inlier_mask"]))
