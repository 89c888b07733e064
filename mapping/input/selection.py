"""Which images of a dense sequence to use: as few as the parallax and the overlap allow, and of those the sharp ones.

Corners are tracked from the last chosen image (pyramidal Lucas-Kanade, OpenCV). An image is due when what no rotation
explains of their motion is parallax enough, when the whole motion is so large that there may be parallax in it (past a
wall, a step aside looks like a turn), or when too few are left. The sharpest image shortly before that is chosen.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FloatArray, InputError
from mapping.camera.rig import Camera

_WIDTH = 480
"""Images are made this wide first."""
_CORNERS, _LEAST_CORNERS = 300, 30
_BLIND = 10
"""Images without corners to track: every so many is chosen."""
_WINDOW = 0.6
"""An image is a candidate from this share of the wanted change on."""
_MOST_CANDIDATES = 60
_MOTION = 2.5
"""Over the wanted parallax: motion that makes an image due although a rotation may explain it."""
_BACK_PX = 1.0
"""A corner that is tracked back lands this near, or is lost."""


@dataclass(frozen=True, slots=True)
class SelectionOptions:
    """How far the camera moves between two chosen images."""

    parallax_rad: float = 0.07
    """Median angle between two sights of one point; stereo wants a baseline of 8 % of the distance."""
    least_overlap: float = 0.6
    """Share of the corners that must still be in view."""

    def __post_init__(self) -> None:
        if not 0.001 <= self.parallax_rad <= 0.5:
            raise InputError(f"a parallax of {np.degrees(self.parallax_rad):.2g} deg is not from 0.06 to 29 deg")
        if not 0.1 <= self.least_overlap <= 0.95:
            raise InputError(f"a least overlap of {self.least_overlap:g} is not from 0.1 to 0.95")


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    number: int
    small: np.ndarray
    sharpness: float


def choose(
    images: Iterable[np.ndarray], camera: Camera, options: SelectionOptions, *, used: np.ndarray | None = None
) -> list[int]:
    """Numbers of the images to use, in order.

    Args:
        images: (height, width) uint8 each, in order of time.
        used: (height, width) bool: pixels that are not masked.
    """
    chosen: list[int] = []
    candidates: list[_Candidate] = []
    tracker: _Tracker | None = None
    usable = camera.lit() if used is None else camera.lit() & used
    for number, image in enumerate(images):
        here = _Candidate(number, small := _reduced(image), sharpness(small))
        if tracker is None:
            tracker, chosen = _Tracker(camera, usable, small, options), [number]
            continue
        moved = tracker.moved(small)
        if moved >= _WINDOW:
            candidates.append(here)
        while moved >= 1.0 or len(candidates) > _MOST_CANDIDATES:
            best = max(candidates, key=lambda c: c.sharpness)
            chosen.append(best.number)
            tracker, moved = _Tracker(camera, usable, best.small, options), 0.0
            later = [c for c in candidates if c.number > best.number]
            candidates = []
            for c in later:
                moved = tracker.moved(c.small)
                if moved >= _WINDOW:
                    candidates.append(c)
    if candidates:
        chosen.append(max(candidates, key=lambda c: c.sharpness).number)
    return chosen


def sharpness(gray: np.ndarray) -> float:
    """Variance of the Laplacian over that of the image: falls with blur, not with exposure (Pech-Pacheco, 2000)."""
    import cv2

    smooth = cv2.GaussianBlur(gray, (3, 3), 0.8)  # a noisy image is not a sharp one
    return float(cv2.Laplacian(smooth, cv2.CV_32F).var() / max(float(gray.var()), 1.0))


def _reduced(image: np.ndarray) -> np.ndarray:
    import cv2

    factor = min(_WIDTH / image.shape[1], 1.0)
    return np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), dtype=np.uint8)


class _Tracker:
    """Corners of one image, followed through those after it."""

    def __init__(self, camera: Camera, usable: np.ndarray, small: np.ndarray, options: SelectionOptions) -> None:
        import cv2

        size = (small.shape[1], small.shape[0])
        mask = cv2.resize(usable.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        found = cv2.goodFeaturesToTrack(small, _CORNERS, 0.01, 8.0, mask=mask)
        self._points = np.zeros((0, 1, 2), np.float32) if found is None else found
        self._count = len(self._points)
        self._camera, self._options, self._last = camera, options, small
        self._stretch = camera.width / small.shape[1]
        self._rays = self._directions(self._points)
        self._waited = 0

    def moved(self, small: np.ndarray) -> float:
        """Change since the tracker's image: 1 when the next one is due."""
        import cv2

        self._waited += 1
        if self._count < _LEAST_CORNERS:
            return self._waited / _BLIND
        anywhere: Any = None  # no first guess; OpenCV's stub knows no None
        if len(self._points):
            ahead, found, _ = cv2.calcOpticalFlowPyrLK(self._last, small, self._points, anywhere)
            back, found_back, _ = cv2.calcOpticalFlowPyrLK(small, self._last, ahead, anywhere)
            near = np.linalg.norm((back - self._points)[:, 0], axis=1) < _BACK_PX
            kept = (found[:, 0] > 0) & (found_back[:, 0] > 0) & near
            self._points, self._rays = ahead[kept], self._rays[kept]
        self._last = small
        lost = (1.0 - len(self._points) / self._count) / (1.0 - self._options.least_overlap)
        if len(self._points) < _LEAST_CORNERS:
            return max(lost, 1.0)
        rays = self._directions(self._points)
        parallax = parallax_rad(self._rays @ rotation_between(self._rays, rays).T, rays)
        moved = max(parallax, parallax_rad(self._rays, rays) / _MOTION)
        return max(lost, moved / self._options.parallax_rad)

    def _directions(self, points: np.ndarray) -> FloatArray:
        return self._camera.unproject(self._stretch * (points[:, 0].astype(np.float64) + 0.5))


def parallax_rad(rays_a: FloatArray, rays_b: FloatArray) -> float:
    """Median angle between matched unit rays (n, 3)."""
    chord = np.linalg.norm(rays_a - rays_b, axis=1)
    chord = chord[np.isfinite(chord)]
    return float(np.median(2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)))) if chord.size else 0.0


def rotation_between(rays_a: FloatArray, rays_b: FloatArray) -> FloatArray:
    """R_b_a (3, 3) that takes matched unit rays (n, 3) onto each other, by least squares."""
    known = np.isfinite(rays_a[:, 0]) & np.isfinite(rays_b[:, 0])
    U, _, Vt = np.linalg.svd(rays_b[known].T @ rays_a[known])
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt, dtype=np.float64)
