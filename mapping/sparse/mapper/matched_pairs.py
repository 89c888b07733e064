"""Matches of pairs of images, and which of them agree with one motion: tasks that depend on their arguments alone.

Each pair is verified as COLMAP's `verify_matches` does it, with the same result, but wherever the task is done.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import Progress
from mapping import workers
from mapping.sparse.features import features, matching
from mapping.workers import Arrays, Pool, Task

PAIRS = 16
"""Of one task: some tenths of a second."""
LEAST_TRIALS = 30
"""At least, to verify the matches of a pair; the confidence of .999 asks for more where fewer than nine tenths agree.
COLMAP's own 100 take 1.6 times as long and find .01 % more."""

_STAGE = "matching features"
_MODELS = ("E", "F", "H")
"""Essential and fundamental matrix and homography, as COLMAP names them."""


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """What a task is told of an image."""

    camera: Any
    """COLMAP's."""
    keypoints: np.ndarray
    """(n, 2) pixels."""
    descriptors: np.ndarray
    """(n, 128) uint8."""


def write(
    database: Path, pairs: Sequence[tuple[str, str]], *, seed: int, folder: Path, pool: Pool, progress: Progress
) -> None:
    """Match and verify pairs of images, given by their names, and write both to COLMAP's database.

    Pairs that were matched before keep their matches, which do not depend on the lens, and are verified again.

    Args:
        seed: of COLMAP's random numbers.
        folder: keeps the answers of the tasks if this is interrupted.
    """
    import pycolmap

    with pycolmap.Database.open(database) as opened, pycolmap.DatabaseTransaction(opened):
        ids = {row.name: (row.image_id, row.camera_id) for row in opened.read_all_images()}
        groups = [pairs[k : k + PAIRS] for k in range(0, len(pairs), PAIRS)]

        def task(number: int) -> Task:
            asked = [(ids[a][0], ids[b][0]) for a, b in groups[number]]
            shots = {key: _shot(opened, *key) for key in dict.fromkeys(ids[name] for p in groups[number] for name in p)}
            known = [opened.read_matches(a, b) if opened.exists_matches(a, b) else None for a, b in asked]
            return asked, {image: shot for (image, _), shot in shots.items()}, known, seed

        files = workers.files_of(matched, len(groups), task, folder=folder, pool=pool, stage=_STAGE, progress=progress)
        for group, file in zip(groups, files, strict=True):
            _record(opened, [(ids[a][0], ids[b][0]) for a, b in group], workers.arrays(file))


def _shot(opened: Any, image: int, camera: int) -> Shot:
    keypoints = np.asarray(opened.read_keypoints(image))[:, :2].copy()
    return Shot(opened.read_camera(camera), keypoints, np.array(opened.read_descriptors(image).data))


def matched(pairs: list[tuple[int, int]], shots: dict[int, Shot], known: list[np.ndarray | None], seed: int) -> Arrays:
    """The task: matches of pairs of images, and what COLMAP says of each pair.

    Args:
        pairs: numbers of images.
        known: (k, 2) matches of a pair that was matched before.

    Returns:
        `matches` and `inliers` (n, 2) of all pairs, one after the other, with their `counts` and `inlier_counts`; by
        pair COLMAP's `config` and its `models` (3, 3, 3), NaN for those that it did not fit.
    """
    units = {image: features.unit(shot.descriptors) for image, shot in shots.items()}
    found = [
        _enough(matching.match(units[a], units[b]) if before is None else before)
        for (a, b), before in zip(pairs, known, strict=True)
    ]
    verified = [_verified(shots[a], shots[b], matches, seed) for (a, b), matches in zip(pairs, found, strict=True)]
    return {
        "matches": np.concatenate(found),
        "counts": np.array([len(matches) for matches in found]),
        "inliers": np.concatenate([np.asarray(one.inlier_matches, np.uint32).reshape(-1, 2) for one in verified]),
        "inlier_counts": np.array([len(one.inlier_matches) for one in verified]),
        "config": np.array([int(one.config) for one in verified]),
        "models": np.array([[_matrix(getattr(one, name)) for name in _MODELS] for one in verified]),
    }


def _enough(matches: np.ndarray) -> np.ndarray:
    """The matches of a pair, none if they are too few for COLMAP."""
    import pycolmap

    least = pycolmap.TwoViewGeometryOptions().min_num_inliers
    return np.asarray(matches if len(matches) >= least else matches[:0], np.uint32)


def _verified(first: Shot, second: Shot, matches: np.ndarray, seed: int) -> Any:
    """COLMAP's geometry of two views; one without models and inliers where those are too few."""
    import pycolmap

    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed = seed
    options.ransac.min_num_trials = LEAST_TRIALS
    seen = [(shot.camera, shot.keypoints.astype(np.float64)) for shot in (first, second)]
    found = pycolmap.estimate_two_view_geometry(*seen[0], *seen[1], np.ascontiguousarray(matches), options)
    if len(found.inlier_matches) >= options.min_num_inliers:
        return found
    none = pycolmap.TwoViewGeometry()
    none.config = pycolmap.TwoViewGeometryConfiguration.DEGENERATE
    return none


def _matrix(model: np.ndarray | None) -> np.ndarray:
    return np.full((3, 3), np.nan) if model is None else np.asarray(model)


def _record(opened: Any, pairs: list[tuple[int, int]], answer: Arrays) -> None:
    """Write the answer of a task to the database; focal lengths are known, so COLMAP estimates none beside."""
    import pycolmap

    matches = np.split(answer["matches"], np.cumsum(answer["counts"])[:-1])
    inliers = np.split(answer["inliers"], np.cumsum(answer["inlier_counts"])[:-1])
    for number, (a, b) in enumerate(pairs):
        if not opened.exists_matches(a, b):
            opened.write_matches(a, b, matches[number])
        geometry = pycolmap.TwoViewGeometry()
        geometry.config = int(answer["config"][number])
        geometry.inlier_matches = inliers[number]
        for name, model in zip(_MODELS, answer["models"][number], strict=True):
            if np.isfinite(model).all():
                setattr(geometry, name, model)
        opened.write_two_view_geometry(a, b, geometry)
