"""Which features of two images show the same thing: those whose descriptors are clearly each other's nearest.

COLMAP's rules and thresholds, but every descriptor is compared with all others: its own matcher searches an
approximate index, which takes longer and misses some.
"""

import numpy as np

LARGEST_DISTANCE = 0.7
"""Between the unit descriptors of a match."""
RATIO = 0.8
"""A match is nearer than this share of the distance to the second nearest, in both images (Lowe, 2004)."""
_ROWS = 512
"""Descriptors that are compared at once: their distances to all others of an image stay in the processor's cache."""


def match(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Matching features of two images, each feature in one match at most.

    Args:
        first, second: (n, 128) and (m, 128) descriptors, float32 of unit length.

    Returns:
        (k, 2) numbers of a feature of the first and one of the second image.
    """
    if min(len(first), len(second)) < 2:
        return np.zeros((0, 2), np.int64)
    there, is_clear = _nearest(first, second)
    asking = np.flatnonzero(is_clear)
    back, is_clear = _nearest(second[there[asking]], first)
    matched = asking[is_clear & (back == asking)]
    return np.stack([matched, there[matched]], axis=1)


def _nearest(query: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) number of the known descriptor nearest to each query, and (n,) whether it is near, and the next is not."""
    nearest, is_clear = np.empty(len(query), np.int64), np.empty(len(query), bool)
    for start in range(0, len(query), _ROWS):
        part = slice(start, start + _ROWS)
        cosine = query[part] @ known.T
        rows, columns = np.arange(len(cosine)), cosine.argmax(axis=1)
        squared = 2.0 - 2.0 * cosine[rows, columns]  # |a - b|^2 of unit vectors
        cosine[rows, columns] = -1.0
        next_squared = 2.0 - 2.0 * cosine.max(axis=1)
        nearest[part] = columns
        is_clear[part] = (squared <= LARGEST_DISTANCE**2) & (squared < RATIO**2 * next_squared)
    return nearest, is_clear
