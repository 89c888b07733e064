"""Messages about recorded flights: the list, their streams, their clocks moved to stand side by side."""

from typing import Annotated, Literal

import msgspec

from gcs_web.protocol.base import Command, Question, State

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
    """Where, on the log's clock; empty for everywhere."""
    what: str = ""
    """One or two words, the same for the same fault."""


class FlightCard(msgspec.Struct, frozen=True):
    """A flight log of the project at a glance."""

    name: str
    state: Literal["reading", "ready", "unreadable"]
    role: Role = "learn"
    note: str = ""
    """What people wrote about it."""
    sentence: str = ""
    """Why it cannot be read."""
    recorded_at: str = ""
    """Of the file, ISO 8601, UTC."""
    vehicle_said: str = ""
    """With which vehicle file its plan was checked, else the vehicle's name; empty if the log says neither."""
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
    notes: list[str] = []
    """What the log, faultless as it may be, is of no use for."""
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
    left_out: list[str] = []
    """Why a formula is none of its streams."""


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


class SpectrumCurve(msgspec.Struct, frozen=True):
    """Power spectral density of one curve."""

    label: str
    kind: CurveKind
    frequency_hz: list[float]
    density: list[float]
    """In the stream's unit squared, a Hz."""
    share: float
    """Of the samples that are in it; the others stand between pauses that are too close for it."""


class Spectrum(msgspec.Struct, frozen=True):
    flight: str
    key: str
    curves: list[SpectrumCurve]


class Spectrogram(msgspec.Struct, frozen=True):
    """What was measured of a stream, as power over time and frequency."""

    flight: str
    key: str
    time_s: list[float]
    frequency_hz: list[float]
    power_db: list[list[float]]
    """For each frequency its row over time, of the unit squared a Hz."""


class Pairs(msgspec.Struct, frozen=True):
    """One stream of a flight against another, at the same instants."""

    flight: str
    time_s: list[float]
    x: list[float]
    y: list[float]


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


class Flights(State, frozen=True, tag="flights"):
    """The project's flights, the newest first."""

    flights: list[FlightCard]


class ListFlights(Command, frozen=True, tag="list_flights", kw_only=True):
    """Look again at the folder of flights."""


class SetRole(Command, frozen=True, tag="set_role", kw_only=True):
    flight: str
    role: Role


class SetNote(Command, frozen=True, tag="set_note", kw_only=True):
    """Keep a note on a flight; empty takes it away."""

    flight: str
    note: Annotated[str, msgspec.Meta(max_length=500)]


class RenameFlight(Command, frozen=True, tag="rename_flight", kw_only=True):
    """Give a flight's log another name; the reply has it."""

    flight: str
    name: str


class OpenFlights(Command, frozen=True, tag="open_flights", kw_only=True):
    """Ask what there is to draw of flights; the reply has `flights`."""

    flights: list[str]
    formulas: list[str] = []
    """Keys of streams that people wrote, which are offered too."""


class ReadStreams(Question, frozen=True, tag="read_streams", kw_only=True):
    """Ask for streams over a stretch of a flight's shifted time; the reply has `parts`."""

    flight: str
    streams: list[str]
    from_s: float
    to_s: float
    points: int
    """About as many times as there are pixels."""


class ReadSpectrum(Question, frozen=True, tag="read_spectrum", kw_only=True):
    """Ask how a stream's variance over a stretch is spread over frequencies; the reply has `spectrum`."""

    flight: str
    stream: str
    from_s: float
    to_s: float


class ReadSpectrogram(Question, frozen=True, tag="read_spectrogram", kw_only=True):
    """As `read_spectrum`, over time as well; the reply has `spectrogram`."""

    flight: str
    stream: str
    from_s: float
    to_s: float


class ReadPairs(Question, frozen=True, tag="read_pairs", kw_only=True):
    """Ask for one stream against another over a stretch; the reply has `pairs`."""

    flight: str
    x: str
    y: str
    from_s: float
    to_s: float


class FixFlight(Command, frozen=True, tag="fix_flight", kw_only=True):
    """Apply the fixes that the checks propose, into a new log; the reply has its name."""

    flight: str
    only: str = ""
    """The sentence of the one finding whose fix is applied; empty: all."""


class DiscardFlight(Command, frozen=True, tag="discard_flight", kw_only=True):
    """Move a flight's log aside; the reply has the name under which it is kept."""

    flight: str


class RestoreFlight(Command, frozen=True, tag="restore_flight", kw_only=True):
    """Bring back a log that was moved aside."""

    kept: str


class TakeLog(Command, frozen=True, tag="take_log", kw_only=True):
    """Read a log that was sent to `/incoming`; the reply has the flight's name, or asks for a column map."""

    file: str
    column_map: str = ""


AlignBy = Literal["trajectory", "take_off", "motion", "speed", "height"]
"""Two flights stand side by side by an event of both, or by the correlation of a stream."""


class Aligned(msgspec.Struct, frozen=True):
    """How far a flight is moved to stand beside the first one, on their shifted times."""

    flight: str
    by_s: float | None
    """None where that cannot be told."""
    words: str
    """By what, and how sure it is; or why it cannot be told."""


class AlignFlights(Question, frozen=True, tag="align_flights", kw_only=True):
    """Ask how far to move flights beside the first of them; the reply has `aligned`."""

    flights: list[str]
    by: AlignBy
