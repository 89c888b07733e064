"""The lag of the inner loop, in flight: by how the vehicle turned after the rates that were sent.

Every candidate lag predicts the turn between two poses; least squares of what was seen, about each axis, beside the
lag that is assumed. A hover turns too little to tell: it goes on as assumed.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from firmware_bridge.offboard.poses import Pose
from flight import FloatArray, rotations

CANDIDATES_S = np.linspace(0.005, 0.07, 27)[:, None]
"""(c, 1): of a first-order lag, beside the delay."""
ASSUMED_STD_S = 0.01
"""Of the assumed lag."""
_APART_S, _LONGEST_S = 0.04, 0.2
"""Between the poses of a turn: the nearer, the more of it is their noise."""
_TURNS_RAD_S = 0.2
"""What is asked for in less is an answer to the poses' noise."""
_LEAST_NOISE_RAD = 1e-3
_SETTLED_S = 0.4
"""From the first command known: how it turned before fades."""
_KEPT = 256
_WINDOW_S, _LEAST_WINDOWS, _FADES = 1.0, 2, 0.95
"""A gust pulls every turn of a while the same way: windows of turning are independent, and the old ones fade."""
_LEAST_SCATTER = 2.0
"""Of windows over that of single turns; few windows may agree by chance."""


@dataclass(frozen=True, slots=True)
class _Turned:
    """What the candidates have turned by, since the beginning."""

    time_s: float
    angle_rad: FloatArray
    """(c, 2) about x and y."""
    asked_rad_s: float


class InnerLag:
    """One flight; `command` for every rate sent, `pose` for every pose."""

    def __init__(self, assumed_s: float, delay_s: float) -> None:
        self.assumed_s, self._delay_s = assumed_s, delay_s
        self._shape = (len(CANDIDATES_S), 2)
        self._sums, self.turns, self._windows = np.zeros(self._shape), 0.0, 0
        self._pull, self._scatter, self._singly = (np.zeros(self._shape) for _ in range(3))
        """Residuals times what a longer lag changes: summed over the window, the squares of that, of each turn's."""
        self._window_s = -np.inf
        self.forget()

    def forget(self) -> None:
        """What was sent is not known; what was learnt stays."""
        self._due: deque[tuple[float, FloatArray]] = deque()
        self._rate, self._asked = np.zeros(self._shape), np.zeros(2)
        self._turned: deque[_Turned] = deque(maxlen=_KEPT)
        self._from: Pose | None = None
        self._known_s = np.inf

    def command(self, time_s: float, rate_body_rad_s: FloatArray) -> None:
        """(3,) sent now."""
        self._due.append((time_s + self._delay_s, rate_body_rad_s[:2]))
        while self._due and self._due[0][0] <= time_s:
            self._asked = self._due.popleft()[1]
        self._known_s = min(self._known_s, time_s + _SETTLED_S)
        last = self._turned[-1] if self._turned else _Turned(time_s, np.zeros(self._shape), 0.0)
        step_s = time_s - last.time_s
        before = self._rate
        self._rate = before + (1.0 - np.exp(-step_s / CANDIDATES_S)) * (self._asked - before)
        angle = last.angle_rad + 0.5 * step_s * (before + self._rate)
        self._turned.append(_Turned(time_s, angle, float(np.abs(self._asked).max())))

    def pose(self, pose: Pose) -> None:
        """Compare the turn since one that was taken before."""
        begin = self._from
        if pose.time_s < self._known_s or (begin is not None and pose.time_s - begin.time_s < _APART_S):
            return
        self._from = pose
        if begin is None or pose.time_s - begin.time_s > _LONGEST_S:
            return
        then, now = self._at(begin.time_s), self._at(pose.time_s)
        if then is None or now is None or max(then.asked_rad_s, now.asked_rad_s) < _TURNS_RAD_S:
            return
        seen = rotations.log(rotations.multiply(rotations.conjugate(begin.q_world_body), pose.q_world_body))[:2]
        self._take(pose.time_s, seen, now.angle_rad - then.angle_rad)

    def _take(self, time_s: float, seen_rad: FloatArray, turned_rad: FloatArray) -> None:
        """One turn (2,), beside those of the candidates (c, 2)."""
        if time_s - self._window_s > _WINDOW_S:
            self._scatter += self._pull**2
            for sums in (self._sums, self._scatter, self._singly):
                sums *= _FADES
            self.turns, self._windows, self._window_s = _FADES * self.turns, self._windows + 1, time_s
            self._pull[:] = 0.0
        missed = seen_rad - turned_rad
        pull = missed * np.gradient(turned_rad, CANDIDATES_S[:, 0], axis=0)
        self._sums += missed**2
        self._singly += pull**2
        self._pull += pull
        self.turns += 1.0

    def _at(self, time_s: float) -> _Turned | None:
        rows = self._turned
        later = next((i for i in range(len(rows) - 1, 0, -1) if rows[i - 1].time_s <= time_s), None)
        if later is None or rows[later].time_s < time_s:
            return None
        before, after = rows[later - 1], rows[later]
        share = (time_s - before.time_s) / max(after.time_s - before.time_s, 1e-9)
        angle = before.angle_rad + share * (after.angle_rad - before.angle_rad)
        return _Turned(time_s, angle, after.asked_rad_s)

    def found(self) -> tuple[FloatArray, FloatArray]:
        """Lags about x and y (2,) with their standard deviations: flight and assumption, each by what it knows."""
        lags, stds = np.full(2, self.assumed_s), np.full(2, ASSUMED_STD_S)
        for axis in range(2) if self._flown else ():
            least = int(np.argmin(self._sums[:, axis]))
            noise2 = max(self._sums[least, axis] / self.turns, _LEAST_NOISE_RAD**2)
            scatter = (self._scatter + self._pull**2)[least, axis] / max(self._singly[least, axis], 1e-30)
            odds = self._sums[:, axis] / noise2 / max(scatter, _LEAST_SCATTER)
            odds += ((CANDIDATES_S[:, 0] - self.assumed_s) / ASSUMED_STD_S) ** 2
            weights = np.exp(-0.5 * (odds - odds.min()))
            weights /= weights.sum()
            lags[axis] = weights @ CANDIDATES_S[:, 0]
            stds[axis] = np.sqrt(weights @ (CANDIDATES_S[:, 0] - lags[axis]) ** 2)
        return lags, stds

    @property
    def _flown(self) -> bool:
        return self._windows > _LEAST_WINDOWS

    def words(self, *, other_clock: bool) -> str:
        """What was found.

        Args:
            other_clock: the poses are stamped by one that is not ours: their age, as far as unknown, passes for lag.
        """
        lags, stds = self.found()
        least = np.argmin(self._sums, axis=0)
        ends = {len(CANDIDATES_S) - 1: " or more", 0: " or less"} if self._flown else {}
        each = zip(("roll", "pitch"), lags, least, strict=True)
        told = ", ".join(f"{axis} {1e3 * lag:.0f} ms{ends.get(int(i), '')}" for axis, lag, i in each)
        if not self._flown:
            return f"{told}, as assumed"
        age = ", with the unknown age of poses of another clock" if other_clock else ""
        return f"{told}, known to {np.ceil(1e3 * stds.max()):.0f} ms{age}"
