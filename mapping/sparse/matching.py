"""Which features of two images are alike: mutual nearest neighbours, clearly nearer than the second nearest.

COLMAP's rules (ratio, largest distance, both ways). It searches from either image by an approximate index; here one
exact matrix product serves both ways, at half of the CPU time.
"""

import numpy as np

RATIO = 0.8
"""A match is nearer than this share of the distance to the second nearest, from both images (Lowe, 2004)."""
LARGEST_DISTANCE = 0.7
"""Between unit descriptors."""
_LENGTH = 512.0
"""Of a descriptor in bytes, see `features.Features`."""


def match(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Matches (k, 2) of the descriptors (n, 128) of one image with those (m, 128) of another, both uint8."""
    if not len(first) or not len(second):
        return np.zeros((0, 2), np.uint32)
    a, b = first.astype(np.float32), second.astype(np.float32)
    # squared distances: whole numbers below 2**24, which single precision holds exactly
    squared = a @ (-2.0 * b.T)
    squared += np.square(a).sum(axis=1)[:, None]
    squared += np.square(b).sum(axis=1)
    rows, nearest = np.arange(len(a)), squared.argmin(axis=1)
    least = squared[rows, nearest]
    squared[rows, nearest] = np.inf
    clear = (least <= (LARGEST_DISTANCE * _LENGTH) ** 2) & (least < RATIO**2 * squared.min(axis=1))
    squared[rows, nearest] = least
    own = np.flatnonzero(clear)
    # all other features of the first image are farther from the match: so it is the nearest from that side, too
    others = squared[:, nearest[own]]
    others[own, np.arange(len(own))] = np.inf
    both = own[least[own] < RATIO**2 * others.min(axis=0, initial=np.inf)]
    return np.stack([both, nearest[both]], axis=1).astype(np.uint32)
