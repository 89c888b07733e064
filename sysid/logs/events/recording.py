"""All events of one recording: what its reader found, and what each stream and a second sensor show."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flight import FlightLog
from sysid.logs.events import attitude_leaps, clipped, frozen, position_leaps, velocity_leaps
from sysid.logs.events.event import Event, of_log, splits
from sysid.logs.events.repair import Span

POSE = POSITION, ATTITUDE = "position_world_m", "q_world_body"
SAME_S = 0.05
"""A jump this close to a reset that the file's own counter shows is that reset."""


def find(log: FlightLog, resting: Sequence[Span] = ()) -> list[Event]:
    """Every event that was not mended yet, and those that were when the file was read.

    Args:
        resting: where the vehicle stands on the ground.
    """
    still = frozen.find(log, resting)
    done, pose = [event for event in of_log(log) if event.done], _leaps(log, still)
    return [*done, *pose, *_of_velocity(log, [*pose, *still]), *still, *clipped.find(log)]


def _of_velocity(log: FlightLog, others: Sequence[Event]) -> list[Event]:
    """Leaps of the velocity apart from those of the pose, which no fit uses it without: they make none refuse a log."""
    near = [(begin_s - SAME_S, end_s + SAME_S) for begin_s, end_s in (cut_out(log, event) for event in others)]
    return velocity_leaps.find(log, [*splits(log), *near])


def leaps(log: FlightLog) -> list[Event]:
    """Resets, jumps and excursions of attitude and position, where the log is not split yet."""
    return _leaps(log, frozen.find(log))


def _leaps(log: FlightLog, still: Sequence[Event]) -> list[Event]:
    """What was frozen leaps when it goes on: that is no other event."""
    cuts = splits(log)
    over = {name: [*cuts, *(cut_out(log, event) for event in still if event.stream == name)] for name in POSE}
    resets = [event for event in of_log(log) if not event.done and not _split_there(event, cuts)]
    found = [*attitude_leaps.find(log, over[ATTITUDE]), *position_leaps.find(log, over[POSITION])]
    for k, reset in enumerate(resets):
        jump = next((event for event in found if _same(event, reset)), None)
        if jump is not None:  # its size is without what the vehicle itself moved
            resets[k] = replace(reset, size=jump.size, repair=jump.repair)
            found.remove(jump)
    return resets + found


def cut_out(log: FlightLog, event: Event) -> Span:
    """The last good row before an event, and the first after it."""
    begin_s, end_s = event.span
    if not event.kind.endswith("excursion") and event.kind != "frozen":
        return begin_s, end_s
    before, after = np.searchsorted(log.time_s, [begin_s, np.nextafter(end_s, np.inf)])
    return float(log.time_s[max(before - 1, 0)]), float(log.time_s[min(after, len(log) - 1)])


def _split_there(event: Event, cuts: list[Span]) -> bool:
    return any(begin_s < event.span[1] and event.span[0] < end_s for begin_s, end_s in cuts)


def _same(event: Event, reset: Event) -> bool:
    near = reset.span[0] - SAME_S < event.span[1] and event.span[0] < reset.span[1] + SAME_S
    return near and event.stream == reset.stream and event.kind.endswith("jump")
