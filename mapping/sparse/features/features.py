"""Features of an image: SIFT corners spread over the image, with descriptors COLMAP and our matcher both read.

OpenCV's SIFT, not COLMAP's: the same corners at a third of the CPU time, and both are compared by unit vectors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FloatArray, Progress, silent
from mapping import workers
from mapping.camera.rig import Camera
from mapping.input.images import ImageSet

_CELL_PX = 64
_RIM_PX = 7
_STAGE = "finding features"


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Corners of one image."""

    pixels: FloatArray
    """(n, 2), COLMAP's pixel coordinates."""
    size_px: FloatArray
    """(n,) scale of the corner."""
    angle_rad: FloatArray
    """(n,) its direction."""
    descriptors: np.ndarray
    """(n, 128) uint8: 512 times the root of the L1-normalised SIFT descriptor."""


def of_set(images: ImageSet, count: int, *, progress: Progress = silent) -> Iterator[Features]:
    """At most `count` features of each image, in the order of `images.pairs()`."""
    masks = [_mask(camera) for camera in images.rig]
    found = workers.in_order(
        lambda shot: find(images.gray(*shot), _usable(masks[shot[1]], images.used(*shot)), count), images.pairs()
    )
    for done, features in enumerate(found, start=1):
        progress(_STAGE, done / images.count)
        yield features


def find(gray: np.ndarray, mask: np.ndarray, count: int) -> Features:
    """At most `count` corners of `gray` (height, width) inside `mask`, the strongest of each part of the image."""
    import cv2

    # without the precise upscale corners are off by a quarter pixel
    sift: Any = cv2.SIFT.create(contrastThreshold=0.02, enable_precise_upscale=True)
    corners = _spread(sift.detect(gray, mask), count)
    if not corners:
        empty = np.zeros(0)
        return Features(np.zeros((0, 2)), empty, empty, np.zeros((0, 128), dtype=np.uint8))
    corners, raw = sift.compute(gray, corners)
    root = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-6))
    return Features(
        pixels=np.array([c.pt for c in corners]) + 0.5,
        size_px=np.array([0.5 * c.size for c in corners]),
        angle_rad=np.radians([c.angle for c in corners]),
        descriptors=np.clip(np.round(512.0 * root), 0, 255).astype(np.uint8),
    )


def unit(descriptors: np.ndarray) -> np.ndarray:
    """(n, 128) descriptors as float32 of unit length."""
    values = np.asarray(descriptors, dtype=np.float32)
    return values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-6)


def _spread(corners: Sequence[Any], count: int) -> list[Any]:
    """The strongest corner of every cell, then the second of every cell, and so on, for an even spread."""
    unique = {(c.pt, c.size): c for c in corners}  # one direction a corner: two cost matching time squared
    ranked = sorted(unique.values(), key=lambda c: -c.response)
    taken: dict[tuple[int, int], int] = {}
    turn = np.empty(len(ranked), dtype=np.int64)
    for k, c in enumerate(ranked):
        cell = (int(c.pt[0]) // _CELL_PX, int(c.pt[1]) // _CELL_PX)
        turn[k] = taken[cell] = taken.get(cell, 0) + 1
    return [ranked[k] for k in np.argsort(turn, kind="stable")[:count]]


def _mask(camera: Camera) -> np.ndarray:
    """255 where a feature may be: the rim of the lit circle is an edge that does not move with the scene."""
    import cv2

    lit = camera.lit().astype(np.uint8) * 255
    return cv2.erode(lit, np.ones((_RIM_PX, _RIM_PX), np.uint8)) if not lit.all() else lit


def _usable(mask: np.ndarray, used: np.ndarray | None) -> np.ndarray:
    """The camera's mask without what the image's own leaves out, nor the edge of that."""
    import cv2

    if used is None:
        return mask
    kept = cv2.erode(used.astype(np.uint8), np.ones((_RIM_PX, _RIM_PX), np.uint8), borderValue=1)
    return np.where(kept > 0, mask, 0).astype(np.uint8)
