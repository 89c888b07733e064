"""Exposure of each image, and how much darker its rim is, from surface points that several images show.

The logarithm of a brightness is that of the surface point, plus one gain for each image, plus a polynomial of the
angle from the optical axis for each camera (vignetting). Least squares with Huber's weights; the points' own
brightnesses are eliminated. After Goldman and Chen, "Vignette and exposure calibration and compensation", 2005.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray

_FALLOFF_TERMS = 2
_PRIOR_STD = 1.0
"""Of every unknown, in units of the logarithm: only what no shared point determines is held by it."""
_NOISE_STD = 0.05
"""Of one observation: also the point at which Huber's weights begin to fall."""
_ROUNDS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Brightness:
    """n observations: how bright a surface point is in an image."""

    image: NDArray[np.int64]
    """(n,) which image."""
    point: NDArray[np.int64]
    """(n,) which surface point."""
    log: FloatArray
    """(n,) natural logarithm of the brightness."""
    angle: FloatArray
    """(n,) from the optical axis, divided by the camera's half field of view: 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """What to divide the images by."""

    log_gain: FloatArray
    """(images,) natural logarithm; their mean is 0."""
    log_falloff: FloatArray
    """(cameras, 2) of each camera: natural logarithm at a relative angle a is c1 a^2 + c2 a^4."""
    camera: NDArray[np.int64]
    """(images,) camera of each image."""

    def gain(self, image: int, angle: FloatArray) -> FloatArray:
        """Brightness in the image relative to the surface's, at relative angles from the optical axis."""
        return np.exp(self.log_gain[image] + _powers(angle) @ self.log_falloff[self.camera[image]])


def solve(seen: Brightness, camera: Sequence[int]) -> Exposure:
    """The exposures under which the images agree best.

    Args:
        camera: (images,) number of the camera of each image.
    """
    from scipy import sparse

    cameras = np.asarray(camera, dtype=np.int64)
    count, kinds, n = len(cameras), int(cameras.max()) + 1, len(seen.log)
    rows = np.arange(n)
    gains = sparse.csr_array((np.ones(n), (rows, seen.image)), shape=(n, count))
    place = _FALLOFF_TERMS * cameras[seen.image][:, None] + np.arange(_FALLOFF_TERMS)
    falloff = sparse.csr_array(
        (_powers(seen.angle).ravel(), (np.repeat(rows, _FALLOFF_TERMS), place.ravel())),
        shape=(n, _FALLOFF_TERMS * kinds),
    )
    A = sparse.hstack([gains, falloff]).tocsr()
    of_point = sparse.csr_array((np.ones(n), (seen.point, rows)), shape=(int(seen.point.max(initial=0)) + 1, n))
    weight, unknowns = np.ones(n), np.zeros(count + _FALLOFF_TERMS * kinds)
    for _ in range(_ROUNDS):
        W = sparse.diags_array(weight / _NOISE_STD**2)
        per_point = of_point @ W
        total = np.maximum(per_point.sum(axis=1), 1e-12)
        A_point, log_point = (per_point @ A).toarray() / total[:, None], (per_point @ seen.log) / total
        # normal equations without the points: A'WA - (sum over points of total a a')
        normal = (A.T @ W @ A).toarray() - A_point.T @ (total[:, None] * A_point)
        right = A.T @ (W @ seen.log) - A_point.T @ (total * log_point)
        unknowns = np.linalg.solve(normal + np.eye(len(normal)) / _PRIOR_STD**2, right)
        of_surface = log_point - A_point @ unknowns
        residual = np.abs(seen.log - A @ unknowns - of_surface[seen.point])
        weight = np.minimum(1.0, _NOISE_STD / np.maximum(residual, 1e-12))
    log_gain = unknowns[:count] - unknowns[:count].mean()
    return Exposure(log_gain, unknowns[count:].reshape(kinds, _FALLOFF_TERMS), cameras)


def _powers(angle: FloatArray) -> FloatArray:
    square = np.square(angle)
    return np.stack([square, np.square(square)], axis=-1)
