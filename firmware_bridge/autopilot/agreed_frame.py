"""Whether the autopilot's estimate of its place agrees with the poses: only then may it be told where to be."""

import numpy as np

from firmware_bridge.offboard.poses import Pose
from flight import FloatArray

APART_M, AGREED_S, OLD_S = 0.3, 0.5, 0.3
"""Farther apart they are of two frames; agreed so long they are of one; an older word of either is none."""


class AgreedFrame:
    """One flight."""

    def __init__(self) -> None:
        self._pose_s = self._estimate_s = -np.inf
        self._pose_m = np.full(3, np.nan)
        self._since_s = np.inf

    def pose(self, now_s: float, pose: Pose) -> None:
        self._pose_s, self._pose_m = now_s, pose.position_world_m

    def estimate(self, now_s: float, position_world_m: FloatArray) -> None:
        """(3,), z up."""
        self._estimate_s = now_s
        together = now_s - self._pose_s <= OLD_S and float(np.linalg.norm(position_world_m - self._pose_m)) <= APART_M
        self._since_s = min(self._since_s, now_s) if together else np.inf

    def at(self, now_s: float) -> bool:
        """Whether they agree, and have for a while."""
        fresh = now_s - min(self._pose_s, self._estimate_s) <= OLD_S
        return fresh and now_s - self._since_s >= AGREED_S
