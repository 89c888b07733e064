"""Whether the autopilot's local frame is that of the poses: only then may it be told where to be.

Place and heading are compared on the ground; over the first metre from where it was armed, how far and which way it
went, which shows a frame that is turned or scaled though its heading agrees. What has once parted in a flight is not
taken again.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from firmware_bridge.offboard.poses import Pose
from flight import FloatArray, rotations

READY_M, READY_RAD = 0.1, np.deg2rad(5.0)
"""Farther apart, or turned more, on the ground they are of two frames: as far aside the plan would be flown."""
APART_M, TURNED_RAD = 0.3, np.deg2rad(10.0)
"""The same in flight, where a word that comes late is of another place."""
AGREED_S, OLD_S = 0.5, 0.3
"""Agreed so long they are of one; an older word is none."""
MOVED_M, MOVED_APART = 1.0, 0.15
"""Horizontally, from where it was armed; the share of it by which the two ways may differ: 9 degrees."""
_KEPT = 64
_REMEDY = "give its estimator these poses (vision=on), or leave out targets=position"
_LATE = "it is another frame, or its words come late"


@dataclass(frozen=True, slots=True)
class _Word:
    """Of the autopilot, and when it came."""

    time_s: float
    position_world_m: FloatArray | None = None
    q_world_body: FloatArray | None = None


class AgreedFrame:
    """One flight. `pose` for every pose; `position` and `attitude` for every word of the autopilot, z up.

    `armed` is to be kept: before, it may be carried about.
    """

    def __init__(self) -> None:
        self._poses: deque[Pose] = deque(maxlen=_KEPT)
        self._words: deque[_Word] = deque(maxlen=_KEPT)
        self._compared_s = {"place": -np.inf, "heading": -np.inf}
        self._since_s, self._first = np.inf, (np.zeros(3), np.zeros(3))
        self.armed = False
        self._off_m = self._turned_rad = self._moved_apart = 0.0
        self._moved, self._parted = False, ""

    def pose(self, pose: Pose) -> None:
        """A pose that is believed, stamped with our time."""
        if not self._poses or pose.time_s > self._poses[-1].time_s:
            self._poses.append(pose)
        while self._words and self._words[0].time_s <= self._poses[-1].time_s:
            self._compare(self._words.popleft())

    def position(self, now_s: float, position_world_m: FloatArray) -> None:
        """(3,)."""
        self._words.append(_Word(now_s, position_world_m=position_world_m))

    def attitude(self, now_s: float, q_world_body: FloatArray) -> None:
        """(4,)."""
        self._words.append(_Word(now_s, q_world_body=q_world_body))

    def unready(self, now_s: float) -> str:
        """Why the vehicle is not to be armed, in words; empty: place and heading agree."""
        short = "" if now_s - self._since_s >= AGREED_S else f"place and heading have not agreed for {AGREED_S:g} s yet"
        return self._parted or self._missing(now_s) or self._differs() or short

    @property
    def apart(self) -> str:
        """Why it is not told, in words: another frame, or one that parted once."""
        return self._parted or self._differs()

    def at(self, now_s: float) -> bool:
        """Whether it may be told now: its ways agreed too."""
        if self._moved and not self._parted:
            self._parted = self._missing(now_s)
        return self._moved and not self.unready(now_s)

    def _missing(self, now_s: float) -> str:
        old = [what for what, time_s in self._compared_s.items() if not now_s - time_s <= OLD_S]
        return f"nothing came of the autopilot's {' and '.join(old)}, or no pose beside it" if old else ""

    def _differs(self) -> str:
        most_m, most_rad = (APART_M, TURNED_RAD) if self.armed else (READY_M, READY_RAD)
        remedy = _LATE if self.armed else _REMEDY
        if not self._off_m <= most_m:
            return f"the autopilot is {self._off_m:.2f} m from its poses, at most {most_m:g}; {remedy}"
        if not abs(self._turned_rad) <= most_rad:
            turned_deg, most_deg = np.rad2deg([abs(self._turned_rad), most_rad])
            return f"the autopilot's heading is {turned_deg:.0f} deg off its poses', at most {most_deg:.0f}; {remedy}"
        if not self._moved_apart <= MOVED_APART:
            share = f"{self._moved_apart:.0%} of it, at most {MOVED_APART:.0%}"
            return f"the autopilot's way differs from its poses' by {share}; {remedy}"
        return ""

    def _compare(self, word: _Word) -> None:
        at = self._pose_at(word.time_s)
        if at is None:
            return
        if word.position_world_m is not None:
            self._compared_s["place"] = word.time_s
            self._off_m = float(np.linalg.norm(word.position_world_m - at.position_world_m))
            self._compare_ways(word.position_world_m, at.position_world_m)
        if word.q_world_body is not None:
            self._compared_s["heading"] = word.time_s
            between = rotations.multiply(word.q_world_body, rotations.conjugate(at.q_world_body))
            self._turned_rad = float(rotations.yaw(between))
        missing, differs = self._missing(word.time_s), self._differs()
        if missing or differs:
            self._since_s = np.inf
            lasting = differs or (missing if self._moved else "")
            self._parted = self._parted or (lasting if self.armed else "")
        elif not np.isfinite(self._since_s):
            self._since_s = word.time_s

    def _compare_ways(self, theirs_m: FloatArray, ours_m: FloatArray) -> None:
        if not self.armed or not np.isfinite(self._since_s):
            self._first, self._moved_apart = (theirs_m, ours_m), 0.0
            return
        their_way, our_way = (theirs_m - self._first[0])[:2], (ours_m - self._first[1])[:2]
        far_m = float(np.linalg.norm(our_way))
        if far_m >= MOVED_M:
            self._moved_apart = float(np.linalg.norm(their_way - our_way)) / far_m
            self._moved |= self._moved_apart <= MOVED_APART

    def _pose_at(self, time_s: float) -> Pose | None:
        """Between the two poses around a time, which are not far apart."""
        later = next((i for i, pose in enumerate(self._poses) if pose.time_s >= time_s), None)
        if not later:
            return None
        before, after = self._poses[later - 1], self._poses[later]
        if after.time_s - before.time_s > OLD_S:
            return None
        share = (time_s - before.time_s) / (after.time_s - before.time_s)
        turn = rotations.log(rotations.multiply(rotations.conjugate(before.q_world_body), after.q_world_body))
        return Pose(
            time_s,
            before.position_world_m + share * (after.position_world_m - before.position_world_m),
            rotations.multiply(before.q_world_body, rotations.exp(share * turn)),
        )
