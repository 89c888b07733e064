"""Two cameras whose folders are exchanged, though they look the same way: what both see would lie behind them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray
from mapping.camera.rig import Camera

MOST_INSTANTS = 40
"""That are asked, evenly over the set."""
_RATIO = 0.8
_OFF_PX = 2.0
"""Of a ray from the plane of the other ray and the baseline."""
_PARALLAX_PX = 3.0
"""Less does not tell before from behind."""
_LEAST_ACROSS = 0.2
"""Sine of the angle between a ray and the baseline."""
_LEAST_BASELINE_M = 0.01
_LEAST_TELLING, _CLEARER = 15, 5.0
"""Features of an instant that fit the exchanged order, at least, and over those that fit the given one."""
_MOST_INSTANTS_SHARE = 0.8
"""Of the instants that tell which order fits."""
_LEAST_ALIKE = 0.985
"""Cosine of the angle between two optical axes, 10 degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Of an image."""

    rays: FloatArray
    """(n, 3) in the camera frame."""
    descriptors: NDArray[np.uint8]


def fitting(first: Features, second: Features, cameras: tuple[Camera, Camera]) -> tuple[int, int]:
    """How many features that two images of an instant share lie before both cameras: as given, and exchanged."""
    import cv2

    if min(len(first.descriptors), len(second.descriptors)) < 2:
        return 0, 0
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(first.descriptors, second.descriptors, k=2)
    good = [m for m, other in (p for p in pairs if len(p) == 2) if m.distance < _RATIO * other.distance]
    rays = first.rays[[m.queryIdx for m in good]].reshape(-1, 3), second.rays[[m.trainIdx for m in good]].reshape(-1, 3)
    pixel_rad = 1.0 / min(*cameras[0].focal_px, *cameras[1].focal_px)
    given = _before(rays, cameras, pixel_rad)
    return given, _before(rays, (cameras[1], cameras[0]), pixel_rad)


def can_tell(cameras: tuple[Camera, Camera]) -> bool:
    """Whether folders may have been exchanged unseen: images are of one size, axes within 10 degrees."""
    first, second = cameras
    axes = [camera.T_body_camera[:3, 2] for camera in cameras]
    alike = (first.width, first.height) == (second.width, second.height)
    return alike and float(axes[0] @ axes[1]) > _LEAST_ALIKE


def are_exchanged(found: NDArray[np.int64]) -> bool:
    """Of `fitting` (k, 2) at each instant: in nearly all that tell anything the exchanged order fits.

    Cameras that were not triggered together see things behind them too, at a fast flight to one side only.
    """
    given, exchanged = found.T
    against = exchanged >= np.maximum(_LEAST_TELLING, _CLEARER * given)
    telling = against | (given >= _LEAST_TELLING)
    return bool(against.any() and against.sum() >= _MOST_INSTANTS_SHARE * telling.sum())


def _before(rays: tuple[FloatArray, FloatArray], cameras: tuple[Camera, Camera], pixel_rad: float) -> int:
    """Rays (n, 3) that meet before both cameras."""
    a, b = (each @ camera.T_body_camera[:3, :3].T for each, camera in zip(rays, cameras, strict=True))
    baseline = cameras[1].T_body_camera[:3, 3] - cameras[0].T_body_camera[:3, 3]
    length_m = float(np.linalg.norm(baseline))
    if length_m < _LEAST_BASELINE_M:
        return 0
    normal, across = np.cross(a, baseline / length_m), np.cross(a, b)
    slant, parallax = np.linalg.norm(normal, axis=1), np.linalg.norm(across, axis=1)
    off = np.abs((b * normal).sum(axis=1)) / np.maximum(slant, 1e-9)
    told = (slant > _LEAST_ACROSS) & (off < _OFF_PX * pixel_rad) & (parallax > _PARALLAX_PX * pixel_rad)
    depths = [(np.cross(baseline, ray) * across).sum(axis=1) > 0.0 for ray in (b, a)]
    return int((told & depths[0] & depths[1]).sum())
