"""Parts of the messages about recorded flights; see `gcs_web.protocol`."""

from typing import Literal

import msgspec

Role = Literal["learn", "hold_out", "leave"]
"""What a flight is for: models are fitted to it, judged by it, or it is left out of both."""
CurveKind = Literal["measured", "plan", "model", "residual"]
StreamGroup = Literal["flight", "force", "column"]


class Finding(msgspec.Struct, frozen=True):
    """What a check says is wrong with a log."""

    level: Literal["warning", "error"]
    sentence: str
    fix: str
    fixable: bool
    """Whether the fix is a change of the log that can be applied by a click."""
    spans_s: list[tuple[float, float]]
    """Where; empty for everywhere."""


class FlightCard(msgspec.Struct, frozen=True):
    """A flight log of the project at a glance."""

    name: str
    state: Literal["reading", "ready", "unreadable"]
    role: Role = "learn"
    sentence: str = ""
    """Why it cannot be read."""
    recorded_at: str = ""
    """Of the file, ISO 8601, UTC."""
    vehicle: str = ""
    """Version of the vehicle file that it was flown with, or the vehicle's name; empty where the log does not say."""
    trajectory: str = ""
    duration_s: float = 0.0
    rows: int = 0
    tracking_mean_m: float | None = None
    """Mean distance from the set-point while on the trajectory; None where it flew none."""
    tracking_worst_m: float | None = None
    path_m: list[float] = []
    """Seen from above: x and y of points along it, one pair after another."""
    findings: list[Finding] = []
    inconclusive: list[str] = []
    """What the flight excites too little to be checked."""
    fixed: list[str] = []
    """What fixes changed, if this log came from another by fixes."""


class Stream(msgspec.Struct, frozen=True):
    """Something that can be drawn over a flight's time."""

    key: str
    name: str
    unit: str
    group: StreamGroup


class OpenedFlight(msgspec.Struct, frozen=True):
    """A flight as its time line begins."""

    name: str
    start_s: float
    end_s: float
    shift_s: float
    """What its clock is moved by to stand beside the first flight that is open."""
    streams: list[Stream]


class CurvePart(msgspec.Struct, frozen=True):
    """One curve of a stream, as many values as there are times."""

    label: str
    kind: CurveKind
    values: list[float | None]


class StreamPart(msgspec.Struct, frozen=True):
    """A stream over a stretch of time, at the level of detail that was asked for: where samples are merged, two times
    stand for each group, the smallest and the largest value at one each."""

    flight: str
    key: str
    time_s: list[float]
    curves: list[CurvePart]
    band: float | None = None
    """White noise keeps within plus and minus this with 95 %; None where nobody knows."""


class ColumnGuess(msgspec.Struct, frozen=True):
    """What a column of a foreign log is taken for."""

    name: str
    columns: list[str]
    reasons: list[str]


class Incoming(msgspec.Struct, frozen=True):
    """A foreign log that was dropped on the page and needs to be told what its columns are."""

    name: str
    column_map: str
    """TOML, drafted; for people to correct."""
    guesses: list[ColumnGuess]
    unused: list[str]
