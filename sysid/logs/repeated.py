"""Do two logs hold the same stretch of flight? Then one of them says nothing that the other does not."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from flight import FlightLog, InputError
from flight.rotations import FloatArray

MOST_SHARED = 0.05
"""Of the shorter log's poses. Noise never repeats one, and a simulated vehicle at rest has one pose alone."""
LEAST_POSES = 20
"""... and so many."""


def refuse(logs: Sequence[FlightLog], names: Sequence[str]) -> None:
    """Refuse logs that share poses to the last bit: a copy in another file, or a part of another log.

    Raises:
        InputError: two of them do.
    """
    poses = [_poses(log) for log in logs]
    for (one, first), (other, second) in combinations(zip(names, poses, strict=True), 2):
        shared, least = len(first & second), min(len(first), len(second))
        if shared >= LEAST_POSES and shared > MOST_SHARED * least:
            raise InputError(
                f"{one} and {other} hold the same flight ({shared / least:.0%} of the poses are the same); "
                "give it once, and hold another flight out"
            )


def _poses(log: FlightLog) -> set[bytes]:
    """Measured poses, each once, whatever the clock."""
    if not (log.has("position_world_m") and log.has("q_world_body")):
        return set()
    rows: FloatArray = np.concatenate([log.vector("position_world_m"), log.vector("q_world_body")], axis=1)
    return {row.tobytes() for row in np.ascontiguousarray(rows[np.isfinite(rows).all(axis=1)])}
