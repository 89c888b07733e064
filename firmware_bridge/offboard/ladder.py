"""What the guard does when something is lost: one table of stages, each with what leads out of it.

| stage | sticks | leaves it |
| --- | --- | --- |
| waiting | centred, throttle low, disarmed | the planner asks to fly: fresh pose, disarmed, no other mode |
| following | the planner's force and rates | below |
| descending | level, no yaw, a bounded descent | on the ground, disarmed, killed, or the pilot's switch is off |
| pilot | hovering, which the firmware does not look at | disarmed; the switch is on again: descending |
| down | throttle low, disarmed | the firmware says so, after 5 s; a pilot with a receiver disarms |

Following ends in *descending* when the planner is gone or silent for 0.1 s, its pose is older than 0.2 s or not the
vehicle's, or a mode is on in which sticks are no rates; on the ground in *down*. It ends in *pilot* when the override
switch is off, and never comes back in the same flight. A vehicle that the pilot armed with the switch off is his.
"""

from dataclasses import dataclass
from enum import IntEnum

PLANNER_SILENT_S = 0.1
POSE_STALE_S = 0.2
LEAST_DOWN_S, DOWN_S = 0.2, 5.0
"""Of disarming sticks: what the firmware said of arming may be older than they are."""
UNHEARD_S = 10.0
"""A firmware that has said nothing for so long is not waited for."""
AHEAD_S = 0.02


class Wish(IntEnum):
    """What the planner asks for."""

    WAIT = 0
    FLY = 1
    STOP = 2
    """It has landed: disarm."""
    DESCEND = 3
    KILL = 4
    """Rotors off, wherever it is."""


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
    OTHER_MODE = 7
    GUARD_FAULT = 8
    PILOT_ARMED = 9


WORDS = {
    Reason.NONE: "",
    Reason.PLANNER_GONE: "the planner's process ended",
    Reason.PLANNER_SILENT: f"the planner was silent for {PLANNER_SILENT_S} s",
    Reason.POSE_STALE: f"no pose for {POSE_STALE_S} s that agrees with the flight",
    Reason.PILOT_TOOK_OVER: "the pilot took the sticks back",
    Reason.DISARMED: "the firmware disarmed",
    Reason.ASKED: "the planner asked to",
    Reason.OTHER_MODE: "a mode came on in which sticks are no body rates",
    Reason.GUARD_FAULT: "the guard met an error of its own",
    Reason.PILOT_ARMED: "it was armed before it gave us the sticks, or too early: give them over, wait, then arm",
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
    lifted: bool = True
    """Whether it has left the ground."""
    other_mode: bool = False
    """Whether a mode is on in which sticks are no rates."""
    receiver: bool = False
    """Whether a pilot has a receiver, and arms by it."""
    heard_s: float = float("inf")
    """When the firmware last answered."""
    arming_told: bool = True
    """What it says of arming is newer than what it was last asked for."""
    left: bool = False
    """Whether the pilot has left the mode that follows us, before it was armed."""


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

    def fail(self, now_s: float, *, lifted: bool) -> None:
        """The guard's own error: down, without the planner."""
        if self.stage in (Stage.WAITING, Stage.FOLLOWING):
            self.stage = Stage.DESCENDING if self._was_armed and lifted else Stage.DOWN
            self.reason, self._since_s = Reason.GUARD_FAULT, now_s

    def _next(self, now_s: float, seen: Seen) -> tuple[Stage, Reason]:
        if self.stage is Stage.WAITING:
            return self._from_waiting(now_s, seen)
        if self.stage is Stage.DOWN:
            return (Stage.ENDED if self._over(now_s, seen) else Stage.DOWN), Reason.NONE
        if self.stage is Stage.ENDED:
            return Stage.ENDED, Reason.NONE
        if self._was_armed and not seen.armed:
            return Stage.DOWN, Reason.DISARMED
        if self.stage is Stage.PILOT:
            return self._from_pilot(now_s, seen)
        if not seen.sticks_ours and self._was_armed:
            return Stage.PILOT, Reason.PILOT_TOOK_OVER if self._was_ours else Reason.PILOT_ARMED
        if seen.wish is Wish.KILL:
            return Stage.DOWN, Reason.ASKED
        if self.stage is Stage.FOLLOWING:
            return self._from_following(now_s, seen)
        return (Stage.DOWN if seen.landed else Stage.DESCENDING), Reason.NONE

    def _over(self, now_s: float, seen: Seen) -> bool:
        """Whether sending may stop: with a receiver, a landed vehicle would get the pilot's throttle."""
        since_s = now_s - self._since_s
        if seen.receiver:
            away = (not seen.armed and seen.arming_told) or not seen.sticks_ours or now_s - seen.heard_s > UNHEARD_S
            return since_s > LEAST_DOWN_S and away
        return since_s > (DOWN_S if seen.armed else LEAST_DOWN_S)

    @staticmethod
    def _from_waiting(now_s: float, seen: Seen) -> tuple[Stage, Reason]:
        if seen.armed and seen.receiver:
            return Stage.PILOT, Reason.PILOT_ARMED
        if seen.planner_gone:
            return Stage.ENDED, Reason.PLANNER_GONE
        ready = _fresh(now_s, seen) and not seen.armed and not seen.other_mode
        return (Stage.FOLLOWING if seen.wish is Wish.FLY and ready else Stage.WAITING), Reason.NONE

    @staticmethod
    def _from_pilot(now_s: float, seen: Seen) -> tuple[Stage, Reason]:
        if now_s - seen.heard_s > UNHEARD_S:
            return Stage.ENDED, Reason.NONE
        if not seen.sticks_ours:
            return Stage.PILOT, Reason.NONE
        return (Stage.DESCENDING if seen.lifted else Stage.DOWN), Reason.NONE

    def _from_following(self, now_s: float, seen: Seen) -> tuple[Stage, Reason]:
        lost = Stage.DESCENDING if self._was_armed and seen.lifted else Stage.DOWN
        if seen.planner_gone:
            return lost, Reason.PLANNER_GONE
        if now_s - seen.command_s > PLANNER_SILENT_S:
            return lost, Reason.PLANNER_SILENT
        if seen.wish is Wish.STOP:
            return Stage.DOWN, Reason.NONE
        if seen.wish is Wish.DESCEND:
            return lost, Reason.ASKED
        if seen.left:
            return lost, Reason.PILOT_TOOK_OVER
        if seen.other_mode:
            return lost, Reason.OTHER_MODE
        if not _fresh(now_s, seen):
            return lost, Reason.POSE_STALE
        return Stage.FOLLOWING, Reason.NONE


def _fresh(now_s: float, seen: Seen) -> bool:
    """Whether the pose is neither old, nor of the future, nor no number."""
    return -AHEAD_S <= now_s - seen.pose_s <= POSE_STALE_S
