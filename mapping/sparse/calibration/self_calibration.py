"""Self-calibration of one camera: its images are placed with start lenses, and the lens that was freed starts again.

Features, and their matches before verification, do not depend on the lens: all tries share them. Runs in a child
process only (see `child`).
"""

import dataclasses
import logging
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, MapError, Progress
from mapping.camera import trial as calibration_trial
from mapping.camera.adjustment import Observations
from mapping.camera.errors import Kind
from mapping.camera.rig import Camera, Rig
from mapping.input.images import ImageSet
from mapping.sparse.mapper import colmap, colmap_model
from mapping.sparse.mapper.colmap import SparseOptions

logger = logging.getLogger(__name__)

_OPTIONS = SparseOptions(features=1000)
_LARGEST_PX = 3.0
"""Reprojection error from which an observation supports a lens no more."""
_LEAST_PLACED = 0.5
_CONVERGED = 0.005
"""Relative change of the focal length below which a lens is not tried again. A lens that is off by some percent gives
wrong matches and poses, which hold the adjustment back: 381 px went to 376 and 377.2 px on the recorded walk."""
_MOST_ROUNDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A lens, and what it explains."""

    camera: Camera
    placed: int
    """Images with a pose."""
    support: float
    """Sum over the observations of 1 - (error / 3 px)^2 (MSAC; Torr and Zisserman, 2000): many and small errors."""
    reprojection_error_px: float
    """Mean."""
    focal_std: float
    """Standard deviation of the focal length by the matches, as a share of it."""
    is_converged: bool
    """Whether a try that started from this lens ended there again."""


def calibrate(images: ImageSet, starts: Sequence[Camera], *, progress: Progress) -> Found | None:
    """The lens of a camera that took overlapping images; None if no start places half of them.

    Args:
        images: of one camera.
        starts: lenses to start from. The one that then explains most is tried again until it stays.
    """
    with tempfile.TemporaryDirectory() as name:
        database = Path(name) / "database.db"
        images = _with(images, starts[0])
        signatures, _ = colmap.extract(database, images, _OPTIONS, progress)

        def tried(camera: Camera, name: str) -> Found | None:
            def named(stage: str, fraction: float) -> None:
                progress(name + stage, fraction)

            return _tried(database, _with(images, camera), signatures, named)

        found = [tried(start, f"lens {k + 1} of {len(starts)}: ") for k, start in enumerate(starts)]
        best = max((f for f in found if f is not None), key=lambda f: f.support, default=None)
        for number in range(_MOST_ROUNDS):
            if best is None or best.is_converged:
                break
            again = tried(best.camera, f"best lens again ({number + 1}): ")
            if again is None or again.support < 0.5 * best.support:
                break
            best = again
    return best if best is not None and best.placed >= _LEAST_PLACED * images.count else None


def _with(images: ImageSet, camera: Camera) -> ImageSet:
    return dataclasses.replace(images, rig=Rig((camera,), refine_intrinsics=True))


def _tried(database: Path, images: ImageSet, signatures: list[np.ndarray], progress: Progress) -> Found | None:
    """Place the images with a lens, then free it; None if that gives no map or no lens."""
    import pycolmap

    start = images.rig.cameras[0]
    with pycolmap.Database.open(database) as opened:
        opened.update_camera(colmap_model.colmap_camera(start, camera_id=1))
        opened.clear_two_view_geometries()
    colmap.match(database, images, signatures, _OPTIONS, progress)
    try:
        model = colmap.place(database, images, _OPTIONS, progress)
        colmap.refine(database, model, images.rig, _OPTIONS, progress)
    except (MapError, RuntimeError, IndexError, ValueError) as error:  # COLMAP's, as pybind11 translates them
        logger.info("%s: %s", start.params, error)
        return None
    seen = colmap_model.observations(model, images)
    camera, error_px = seen.rig.cameras[0], _errors_px(seen)
    shows_a_point = bool(np.isfinite(error_px).any())  # a lens that was bent out of shape may show none
    if not shows_a_point or not 0.1 * camera.width < camera.focal_px[0] < 10.0 * camera.width:
        return None
    focal = next(f for f in calibration_trial.hold(seen).findings if f.candidate.kind is Kind.FOCAL)
    return Found(
        camera=camera,
        placed=int(np.isfinite(seen.T_world_body[:, 0, 0]).sum()),
        support=float(np.maximum(1.0 - (error_px / _LARGEST_PX) ** 2, 0.0).sum()),
        reprojection_error_px=float(error_px.mean()),
        focal_std=float(focal.std[0]),
        is_converged=abs(camera.focal_px[0] / start.focal_px[0] - 1.0) < _CONVERGED,
    )


def _errors_px(seen: Observations) -> FloatArray:
    point, instant, _ = seen.index.T
    camera = seen.rig.cameras[0]
    T_camera_world = np.linalg.inv(seen.T_world_body[instant] @ camera.T_body_camera)
    points = np.einsum("oij,oj->oi", T_camera_world[:, :3, :3], seen.points_world[point]) + T_camera_world[:, :3, 3]
    return np.nan_to_num(np.linalg.norm(camera.project(points) - seen.pixels, axis=1), nan=np.inf)
