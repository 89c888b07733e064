"""Do two logs hold the same stretch of flight? Then one of them says nothing that the other does not."""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from flight import FlightLog, InputError
from flight.rotations import FloatArray

MOST_SHARED = 0.5
"""Of the shorter log's poses: two flights that a script starts alike, without noise, share less."""
NOTED = 0.05
"""... and from so much on that is said. Noise never repeats a pose."""
LEAST_POSES = 20
"""... and so many."""
_DECIMALS = 5
"""Of a pose that are compared: a copy with six decimals, or in single precision, is one. No sensor is as quiet."""


def check(logs: Sequence[FlightLog], names: Sequence[str]) -> tuple[str, ...]:
    """Refuse logs that share most poses in order: a copy in another file, or a part of another log.

    In order, as two flights that hover where a file has three decimals come upon the same poses by chance. A vehicle at
    rest has one pose.

    Returns:
        Which logs share some poses.

    Raises:
        InputError: two of them share most.
    """
    poses = [_poses(log) for log in logs]
    notes: list[str] = []
    for (one, first), (other, second) in combinations(zip(names, poses, strict=True), 2):
        shared, least = _in_order(first, second), min(len(first), len(second))
        if shared < LEAST_POSES or shared <= NOTED * least:
            continue
        if shared > MOST_SHARED * least:
            raise InputError(
                f"{one} and {other} hold the same flight ({shared / least:.0%} of the poses are the same); "
                "give it once, and hold another flight out"
            )
        notes.append(f"{one} and {other} share {shared / least:.0%} of their poses: that part counts twice")
    return tuple(notes)


def _in_order(first: dict[bytes, int], second: dict[bytes, int]) -> int:
    """How many poses of the first come in the second in the same order (longest increasing subsequence)."""
    ends: list[int] = []
    for place in (second[pose] for pose in first if pose in second):
        at = bisect_left(ends, place)
        ends[at : at + 1] = [place]
    return len(ends)


def _poses(log: FlightLog) -> dict[bytes, int]:
    """Measured poses in the order in which each comes first, with its place in it, whatever clock or sign of q."""
    if not (log.has("position_world_m") and log.has("q_world_body")):
        return {}
    rows: FloatArray = np.concatenate([log.vector("position_world_m"), log.vector("q_world_body")], axis=1)
    known = rows[np.isfinite(rows).all(axis=1)]
    known[:, 3:] *= np.where(known[:, 3:4] < 0.0, -1.0, 1.0)
    known = np.ascontiguousarray(known.round(_DECIMALS) + 0.0)  # no -0
    return {pose: place for place, pose in enumerate(dict.fromkeys(row.tobytes() for row in known))}
