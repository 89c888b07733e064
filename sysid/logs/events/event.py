"""What happened during a recording, as rows of one table whatever the format; and the kinds there are."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from flight import FlightLog
from flight.flight_log import COLUMNS
from sysid.logs.events.repair import Repair, Span

EVENTS = "events"
"""Key of a log's metadata: the events that its reader found, as `Event.as_dict` writes them."""
SPLITS = "splits_s"
"""Key of a log's metadata: spans (begin, end) before and after which lie flights of their own."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a reference says of a kind of event."""

    sentence: str
    """What is looked for, and by what it is told."""
    detectable: str
    """The least size that is found, with its unit."""
    repair: str
    """What is proposed, or done in reading."""


DETECTABLE_TURN_DEG = 6.0
"""Least jump of an attitude that is named."""
DETECTABLE_JUMP_M = 0.1
"""Least jump of a position that is named."""
DETECTABLE_JUMP_M_S = 1.0
"""Least jump of a velocity that is named."""
DETECTABLE_CLOCK_S = 0.2
"""Least step of a clock that is told from a gap."""
DETECTABLE_FROZEN_S = 0.3
"""Least time that a moving value repeats itself."""
UPRIGHT = 0.9
"""Cosine of the axis and the vertical, from which on a turn is one of the heading."""

WAY_OUT_SPLIT = "fit the pieces before and after as separate flights (gaps='split')"
WAY_OUT_BLANK = "write NaN there"

KINDS: Mapping[str, Kind] = {
    "missing stamp": Kind("A row has no time, or none that is finite.", "1 row", "the row is left out"),
    "zero stamp": Kind("A row's time is 0 amid others that are not.", "1 row", "the row is left out"),
    "wild stamp": Kind("A few rows' times are far from those before and after.", "1 row", "the rows are left out"),
    "repeated stamp": Kind("Rows have the time of the row before.", "1 row", "the first of them is kept"),
    "order": Kind("Rows within ten of each other are in another order than their times.", "1 row", "they are sorted"),
    "clock wrap": Kind(
        "A counter of 16, 31 or 32 bits (us, ms, ns; also signed) begins anew.", "1 wrap", "it is unwrapped"
    ),
    "clock back": Kind(
        "Times go back and on from there; the motion, or the other streams, show how long it really was.",
        "1 sample",
        "what follows is shifted where that is shown, else the flight is split there",
    ),
    "clock ahead": Kind(
        "Times leap, but the motion goes on as within one sample, or the other streams have no such leap.",
        f"{DETECTABLE_CLOCK_S:g} s",
        "what follows is shifted",
    ),
    "reset": Kind(
        "The estimator's own reset counter moves (PX4: quat_reset_counter, xy_reset_counter, z_reset_counter ...).",
        "1 count",
        "the flight is split there",
    ),
    "attitude jump": Kind(
        "The attitude turns between two samples, and stays so; neither the gyro nor the turning around shows it.",
        f"{DETECTABLE_TURN_DEG:g} deg",
        "the flight is split there, and the shorter piece turned back",
    ),
    "attitude excursion": Kind(
        "The attitude jumps and jumps back within 2 s: swapped or hidden markers.",
        f"{DETECTABLE_TURN_DEG:g} deg",
        "NaN is written over the stretch",
    ),
    "position jump": Kind(
        "The position moves between two samples, and stays so; neither the velocity nor the motion around shows it.",
        f"{DETECTABLE_JUMP_M:g} m",
        "the flight is split there",
    ),
    "position excursion": Kind(
        "The position jumps and jumps back within 2 s, or drops to the origin.",
        f"{DETECTABLE_JUMP_M:g} m",
        "NaN is written over the stretch",
    ),
    "velocity jump": Kind(
        "The velocity changes between two samples by what neither accelerometer nor position shows, and stays so.",
        f"{DETECTABLE_JUMP_M_S:g} m/s (slower than 60 Hz: what 60 m/s2 make of a step)",
        "the flight is split there",
    ),
    "velocity excursion": Kind(
        "The velocity jumps and jumps back within 2 s.",
        f"{DETECTABLE_JUMP_M_S:g} m/s (slower than 60 Hz: what 60 m/s2 make of a step)",
        "NaN is written over the stretch",
    ),
    "frozen": Kind(
        "A moving quantity repeats exactly one value, for longer than it does elsewhere.",
        f"{DETECTABLE_FROZEN_S:g} s",
        "NaN is written over the stretch",
    ),
    "clipped": Kind(
        "Gyro or accelerometer repeat their extreme, and enter and leave it in leaps: the end of the sensor's range.",
        "3 samples",
        "NaN is written over the stretch",
    ),
}
"""Every kind of event, for the reference and for whoever plants faults."""


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened during a recording."""

    kind: str
    """A key of `KINDS`."""
    stream: str
    """Quantity of `COLUMNS`, or the file's own name of it; `time` where the log has one clock."""
    span: Span
    """First and last instant, on the log's clock."""
    size: float
    unit: str
    """`deg`, `m`, `m/s`, `s` or `rows`."""
    sentence: str
    """What is wrong, with the evidence; `{at}` becomes the first instant."""
    way_out: str
    """What was done in reading, or is to be done."""
    certain: bool
    """Whether the repair is the only one that the evidence allows."""
    done: bool = False
    """Whether it was repaired when the file was read: no log holds times that do not rise."""
    repair: Repair | None = None
    """As a change of the log that was read."""

    def placed(self) -> "Event":
        """The same with its time in the sentence."""
        return replace(self, sentence=self.sentence.replace("{at}", f"{self.span[0]:.3f} s"))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        own = ("kind", "stream", "size", "unit", "sentence", "way_out", "certain", "done")
        return {name: getattr(self, name) for name in own} | {
            "span_s": list(self.span),
            "split": self.repair is not None and self.repair.action == "split",
        }


def of_log(log: FlightLog) -> list[Event]:
    """The events that the log's reader found, those that are in its time."""
    found: list[Event] = []
    for entry in log.metadata.get(EVENTS, []):
        begin_s, end_s = map(float, entry["span_s"])
        repair = Repair("split", COLUMNS.get(entry["stream"], ()), spans=((begin_s, end_s),))
        own = {name: value for name, value in entry.items() if name not in ("span_s", "split")}
        found.append(Event(**own, span=(begin_s, end_s), repair=repair if entry["split"] else None))
    if not len(log):
        return found
    first_s, last_s = log.time_s[0], log.time_s[-1]
    return [event for event in found if event.done or (first_s <= event.span[1] and event.span[0] <= last_s)]


def noted(events: Iterable[Event], *, begin_s: float = 0.0) -> dict[str, Any]:
    """Metadata that say which events a reader found; times less `begin_s`."""
    moved = [replace(e, span=(float(e.span[0] - begin_s), float(e.span[1] - begin_s))) for e in events]
    return {EVENTS: [event.placed().as_dict() for event in moved]} if moved else {}


def splits(log: FlightLog) -> list[Span]:
    """Spans before and after which the log holds flights of their own."""
    return sorted((float(begin_s), float(end_s)) for begin_s, end_s in log.metadata.get(SPLITS, []))
