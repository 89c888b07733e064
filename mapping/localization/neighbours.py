"""What neighbours in time say of a pose: whether the vehicle can have come there, and where it must have been between.

A pose is believed with the others that a vehicle of a given speed can have flown through; of poses that contradict
each other the larger consistent part counts (longest chain).
"""

import numpy as np

from flight import FloatArray, frames, rotations

SLACK_M = 0.2
"""How far two poses at the same time may be apart: errors of both, and of their times."""


def reachable(time_s: FloatArray, positions_m: FloatArray, fastest_m_s: float) -> np.ndarray:
    """(n,) bool: the largest part of the poses in which each can be reached from the one before.

    Args:
        time_s: (n,) increasing.
        positions_m: (n, 3), NaN where there is no pose.
    """
    known = np.flatnonzero(np.isfinite(positions_m[:, 0]))
    length, before = np.ones(len(known), dtype=int), np.full(len(known), -1)
    for k in range(1, len(known)):
        here, earlier = known[k], known[:k]
        apart_m = np.linalg.norm(positions_m[earlier] - positions_m[here], axis=1)
        linked = np.flatnonzero(apart_m <= SLACK_M + fastest_m_s * (time_s[here] - time_s[earlier]))
        if len(linked):
            best = linked[len(linked) - 1 - np.argmax(length[linked][::-1])]  # of equal ones the latest
            length[k], before[k] = length[best] + 1, best
    chosen = np.zeros(len(time_s), dtype=bool)
    k = int(length.argmax()) if len(known) else -1
    while k >= 0:
        chosen[known[k]] = True
        k = before[k]
    return chosen


def predicted(time_s: FloatArray, T_world_body: FloatArray, instant: int, within_s: float) -> FloatArray | None:
    """The pose (4, 4) of an instant between two known ones, or beside one, no more than `within_s` away; else None."""
    known = np.flatnonzero(np.isfinite(T_world_body[:, 0, 0]) & (np.abs(time_s - time_s[instant]) <= within_s))
    earlier, later = known[known < instant], known[known > instant]
    if not len(earlier) or not len(later):
        nearest = earlier[-1:] if len(earlier) else later[:1]
        return T_world_body[nearest[0]] if len(nearest) else None
    a, b = earlier[-1], later[0]
    share = (time_s[instant] - time_s[a]) / (time_s[b] - time_s[a])
    q_a, q_b = (rotations.from_matrix(T_world_body[k, :3, :3]) for k in (a, b))
    position_m = (1.0 - share) * T_world_body[a, :3, 3] + share * T_world_body[b, :3, 3]
    return frames.transform(rotations.slerp(q_a, q_b, share), position_m)
