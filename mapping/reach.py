"""How far from the origin of its frame a map may lie: files of meshes hold 32-bit numbers, 1 mm apart at 10 km."""

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, InputError

FARTHEST_M = 10_000.0
"""At the coordinates of a national grid, 5,400 km, a mesh would be off by 0.25 m."""


_REMEDY = "subtract a round number of metres from all coordinates (of a national grid, say)"


def require_near_origin(points_world_m: FloatArray, what: str, remedy: str = _REMEDY) -> None:
    """Check that positions (n, 3), NaN where unknown, are not too far from the origin.

    Args:
        remedy: what to do about it, for the message.

    Raises:
        InputError: one of them is; the message names `what`.
    """
    known = np.abs(points_world_m[np.isfinite(points_world_m)])
    if known.size and (farthest_m := float(known.max())) > FARTHEST_M:
        raise InputError(
            f"{what} would lie {farthest_m / 1000.0:,.4g} km from the origin, at most {FARTHEST_M / 1000.0:g} km may "
            f"be: {remedy}"
        )


def single_step(numbers: NDArray[np.generic]) -> float:
    """How far apart numbers of single precision are at the largest of these; 0 if they are finer than single."""
    largest = np.max(np.abs(numbers), initial=0.0)
    if not np.isfinite(largest) or not np.array_equal(numbers, numbers.astype(np.float32)):
        return 0.0
    return float(np.spacing(np.float32(largest)))
