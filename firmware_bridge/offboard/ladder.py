"""What the guard does when something is lost: one table of stages, each with what leads out of it.

| stage | sticks | leaves it |
| --- | --- | --- |
| waiting | centred, throttle low, disarmed | the planner asks to fly |
| following | the planner's force and rates | below |
| descending | level, no yaw, a bounded descent | on the ground, or disarmed |
| pilot | as descending, which the firmware does not look at | disarmed |
| down | throttle low, disarmed | the firmware says so, or after a second |

Following ends in *descending* when the planner is gone or silent for 0.1 s, or its pose is older than 0.2 s; in *pilot*
when the override switch is off; it never comes back from there in the same flight.
"""

from dataclasses import dataclass
from enum import IntEnum

PLANNER_SILENT_S = 0.1
POSE_STALE_S = 0.2
DOWN_S = 1.0


class Wish(IntEnum):
    """What the planner asks for."""

    WAIT = 0
    FLY = 1
    STOP = 2
    """It has landed: disarm."""
    DESCEND = 3


class Stage(IntEnum):
    WAITING = 0
    FOLLOWING = 1
    DESCENDING = 2
    PILOT = 3
    DOWN = 4
    ENDED = 5


class Reason(IntEnum):
    """Why the planner is not followed."""

    NONE = 0
    PLANNER_GONE = 1
    PLANNER_SILENT = 2
    POSE_STALE = 3
    PILOT_TOOK_OVER = 4
    DISARMED = 5
    ASKED = 6


WORDS = {
    Reason.NONE: "",
    Reason.PLANNER_GONE: "the planner's process ended",
    Reason.PLANNER_SILENT: f"the planner was silent for {PLANNER_SILENT_S} s",
    Reason.POSE_STALE: f"no pose for {POSE_STALE_S} s that agrees with the flight",
    Reason.PILOT_TOOK_OVER: "the pilot took the sticks back",
    Reason.DISARMED: "the firmware disarmed",
    Reason.ASKED: "the planner asked to",
}


@dataclass(frozen=True, slots=True)
class Seen:
    """What the guard knows at a tick."""

    wish: Wish
    planner_gone: bool
    command_s: float
    """When the planner was last heard."""
    pose_s: float
    """Of the pose that its last command rests on."""
    armed: bool
    sticks_ours: bool
    """MSP is the only receiver, or the override switch is on."""
    landed: bool
    """By the descent's own judgement."""


class Ladder:
    """One flight."""

    def __init__(self) -> None:
        self.stage, self.reason = Stage.WAITING, Reason.NONE
        self._was_armed = self._was_ours = False
        self._since_s = 0.0

    def step(self, now_s: float, seen: Seen) -> Stage:
        self._was_armed |= seen.armed
        self._was_ours |= seen.sticks_ours and seen.armed
        wanted, reason = self._next(now_s, seen)
        if wanted is not self.stage:
            self.stage, self._since_s = wanted, now_s
            self.reason = self.reason if reason is Reason.NONE else reason
        return self.stage

    def _next(self, now_s: float, seen: Seen) -> tuple[Stage, Reason]:
        if self.stage is Stage.WAITING:
            return self._from_waiting(seen)
        if self.stage is Stage.DOWN:
            over = not seen.armed or now_s - self._since_s > DOWN_S
            return (Stage.ENDED if over else Stage.DOWN), Reason.NONE
        if self.stage is Stage.ENDED:
            return Stage.ENDED, Reason.NONE
        if self._was_armed and not seen.armed:
            return Stage.DOWN, Reason.DISARMED
        if self._was_ours and not seen.sticks_ours:
            return Stage.PILOT, Reason.PILOT_TOOK_OVER
        if self.stage is Stage.FOLLOWING:
            return self._from_following(now_s, seen)
        return (Stage.DOWN if seen.landed and self.stage is Stage.DESCENDING else self.stage), Reason.NONE

    @staticmethod
    def _from_waiting(seen: Seen) -> tuple[Stage, Reason]:
        if seen.planner_gone:
            return Stage.ENDED, Reason.PLANNER_GONE
        return (Stage.FOLLOWING if seen.wish is Wish.FLY else Stage.WAITING), Reason.NONE

    def _from_following(self, now_s: float, seen: Seen) -> tuple[Stage, Reason]:
        lost = Stage.DESCENDING if self._was_armed else Stage.DOWN
        if seen.planner_gone:
            return lost, Reason.PLANNER_GONE
        if now_s - seen.command_s > PLANNER_SILENT_S:
            return lost, Reason.PLANNER_SILENT
        if seen.wish is Wish.STOP:
            return Stage.DOWN, Reason.NONE
        if seen.wish is Wish.DESCEND:
            return lost, Reason.ASKED
        if now_s - seen.pose_s > POSE_STALE_S:
            return lost, Reason.POSE_STALE
        return Stage.FOLLOWING, Reason.NONE
