"""Which depths two images contradict: what is not contradicted may be there, and nothing behind it is seen.

Block matching answers every pixel with the depth of its block, and a plain region with that of its edge. Both look like
measurements. So the claim is put to the pixel itself: a pixel that differs from its match shows something else (a thin
object before the surface), and in a plain region every nearer depth looks alike (Kutulakos and Seitz, "A theory of
shape by space carving", 2000: only what the images contradict may be carved).
"""

import numpy as np
from numpy.typing import NDArray

from mapping import _mapping

Grey = NDArray[np.uint8]
Disparity = NDArray[np.int16]

PIXEL_DEVIATIONS = 4.0
"""Standard deviations of the noise by which one pixel may differ from its match."""
MEAN_DEVIATIONS = 1.3
"""Those by which a block of 5x5 may differ in the mean; noise alone gives 0.8."""
LEAST_NOISE = 1.0
"""Grey levels; grey values are whole numbers."""
MEAN_OF_SMALLER_HALF = 0.3246
"""Of the absolute values of a standard normal variable."""
EXPOSURE_BLOCK_PX = 31
"""Edge of the blocks over which the brightness of two images is compared: larger than a thin object."""


def nearest_disparity(left: Grey, right: Grey, disparity: Disparity, disparities: int) -> Disparity:
    """The largest disparity of each pixel that a rectified pair does not contradict.

    Args:
        left, right: (rows, columns).
        disparity: (rows, columns), what the matcher found, in 1/16 of a column; negative where nothing.
        disparities: the number that it searched.

    Returns:
        (rows, columns), never below `disparity`; negative where the images contradict that itself, or nothing is known.
    """
    import cv2

    height, width = disparity.shape
    rows = np.repeat(np.arange(height, dtype=np.float32)[:, None], width, axis=1)
    columns = np.arange(width, dtype=np.float32) - disparity * np.float32(1.0 / 16.0)
    matched = np.asarray(cv2.remap(right, columns, rows, cv2.INTER_LINEAR), np.uint8)
    known = (disparity >= 0) & (left > 0) & (matched > 0)
    if not known.any():
        return np.full_like(disparity, -16)
    expected = relative_brightness(known, left, matched, EXPOSURE_BLOCK_PX) * left
    as_bright = np.asarray(cv2.convertScaleAbs(expected), np.uint8)  # rounded, at most 255
    deviation = noise(np.abs(expected[known] - matched[known]))
    return _mapping.nearest_disparity(
        as_bright, right, disparity, disparities, max(deviation, LEAST_NOISE), PIXEL_DEVIATIONS, MEAN_DEVIATIONS
    )


def noise(differences: NDArray[np.float32]) -> float:
    """Standard deviation by the smaller half of the absolute differences; the others may be wrong matches.

    By the mean of that half, not by its end: grey values are whole numbers, and so is a median of theirs.
    """
    half = np.partition(differences, len(differences) // 2)[: len(differences) // 2 + 1]
    return float(half.mean()) / MEAN_OF_SMALLER_HALF


def relative_brightness(
    known: NDArray[np.bool_], one: NDArray[np.number], other: NDArray[np.number], block: int
) -> NDArray[np.float32]:
    """Brightness of the other image over that of one, in the block round each pixel, by what is known of both."""
    little = np.float32(1e-3)
    ratio = (_block_mean(known, other, block) + little) / (_block_mean(known, one, block) + little)
    return ratio.astype(np.float32, copy=False)


def _block_mean(known: NDArray[np.bool_], image: NDArray[np.number], block: int) -> NDArray[np.float32]:
    """Mean over the block round each pixel, what is not known counted as 0."""
    import cv2

    values = (known * image).astype(np.float32)
    return np.asarray(cv2.boxFilter(values, -1, (block, block), borderType=cv2.BORDER_CONSTANT), np.float32)
