"""Whether poses are those of the vehicle that flies: a stream may go on with new stamps and an old pose.

The firmware's own attitude, by its gyroscope, is the witness: what stands still by the poses turns by that. A pose that
repeats to the last bit is none either, as a real one shakes. What has lied once in a flight is not believed again.
"""

from collections import deque

import numpy as np

from firmware_bridge.offboard.poses import Pose
from flight import FloatArray, rotations

APART_RAD, APART_S = 0.25, 0.2
"""Tilt by poses from tilt by the firmware, which its accelerometer pulls by some .2 rad in a long acceleration."""
SAME_S, FEWEST_SAME = 0.1, 3
_KEPT = 64


class PoseWatch:
    """One flight; `attitude` for every answer of the firmware, `pose` for every pose."""

    def __init__(self) -> None:
        self.lying = False
        self._ups: deque[tuple[float, FloatArray]] = deque(maxlen=_KEPT)
        self._last: Pose | None = None
        self._same_s, self._same = 0.0, 0
        self._apart_s: float | None = None

    def attitude(self, time_s: float, up_body: FloatArray) -> None:
        """World's up in body axes (3,) by the firmware."""
        if not self._ups or time_s > self._ups[-1][0]:
            self._ups.append((time_s, up_body))

    def pose(self, pose: Pose, *, flying: bool) -> None:
        """Judge a pose; on the ground nothing shakes, and nothing is held against it."""
        frozen, apart = self._frozen(pose), self._apart(pose)
        if not flying:
            self._apart_s = None
        self.lying |= flying and (frozen or apart)

    def _frozen(self, pose: Pose) -> bool:
        last, self._last = self._last, pose
        same = (
            last is not None
            and np.array_equal(last.position_world_m, pose.position_world_m)
            and np.array_equal(last.q_world_body, pose.q_world_body)
        )
        self._same = self._same + 1 if same else 1
        self._same_s = self._same_s if same else pose.time_s
        return self._same >= FEWEST_SAME and pose.time_s - self._same_s > SAME_S - 1e-9

    def _apart(self, pose: Pose) -> bool:
        if not self._ups or pose.time_s - self._ups[-1][0] > APART_S:
            return False
        told = min(self._ups, key=lambda up: abs(up[0] - pose.time_s))[1]
        cosine = float(np.clip(told @ rotations.matrix(pose.q_world_body)[2], -1.0, 1.0))
        if np.arccos(cosine) < APART_RAD:
            self._apart_s = None
            return False
        self._apart_s = pose.time_s if self._apart_s is None else self._apart_s
        return pose.time_s - self._apart_s > APART_S
