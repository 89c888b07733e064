"""Messages about recorded flights and the model, and their parts; see `gcs_web.protocol`."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command

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


class ArrowScale(msgspec.Struct, frozen=True):
    """Of the arrows at the vehicles: so much for each metre of their length."""

    force_n_per_m: float
    torque_n_m_per_m: float


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


class ChannelResidual(msgspec.Struct, frozen=True):
    """What the model leaves unexplained in one axis, and what that depends on."""

    channel: str
    unit: str
    rms: float
    """Of the residual, means over 0.1 s of all flights."""
    shares: list[float]
    """By variable, the share of its mean square that a curve of the variable predicts, 0 to 1."""


class VariableName(msgspec.Struct, frozen=True):
    name: str
    unit: str
    words: str


class HorizonError(msgspec.Struct, frozen=True):
    """Root mean square prediction error on the flights that judge, after each horizon."""

    quantity: str
    unit: str
    values: list[float]


class Scatter(msgspec.Struct, frozen=True):
    """A residual against a variable: one point for each mean over 0.1 s."""

    channel: str
    unit: str
    variable: VariableName
    share: float
    x: list[float]
    y: list[float]
    flight: list[int]
    """Which of `flights` each point is of."""
    time_s: list[float]
    """On the flight's shifted time, the middle of the mean."""
    flights: list[str]
    held_out: list[bool]
    """By flight."""
    bin_x: list[float]
    bin_mean: list[float]
    bin_band: list[float]
    """Half of the 95 % band of the bin's mean."""
    span_s: float
    """Over which a point is the mean."""


class EffectSize(msgspec.Struct, frozen=True):
    """One parameter of a candidate effect."""

    name: str
    unit: str
    value: float
    sigma: float
    """0: nothing was flown that would show it."""
    low: float
    high: float
    """Between these with 90 %."""
    excluded_above: float
    smallest_visible: float
    """A size of this much would have been found nine times in ten; 0: none would have."""
    usual: float


class Evidence(msgspec.Struct, frozen=True):
    """What speaks for a candidate: means over 0.1 s against the variable that it follows most."""

    channel: str
    unit: str
    variable: VariableName
    x: list[float]
    y: list[float]
    """The effect at its size, and what is left beside it, on the flights that were learned on."""
    effect_x: list[float]
    effect_y: list[float]
    """The effect at its size."""
    held_x: list[float]
    held_before: list[float]
    held_after: list[float]
    """What the fitted model and the last one leave of the held-out flights."""


class Confounded(msgspec.Struct, frozen=True):
    name: str
    title: str
    share: float


class Candidate(msgspec.Struct, frozen=True):
    """An effect that the model may lack."""

    name: str
    title: str
    verdict: Literal["present", "useful proxy", "inconclusive", "excluded"]
    reason: str
    probability: float
    law: str
    sizes: list[EffectSize]
    error_mm: float
    """Position error after 0.5 s that the effect makes at its estimated size."""
    confounded: list[Confounded]
    outlook: str
    """For one that these flights cannot tell: the flight that would; else empty."""
    evidence: Evidence | None


class Stair(msgspec.Struct, frozen=True):
    """A model of the diagnosis and its prediction errors on the flights that judge, mm."""

    model: str
    errors_mm: list[float]


class Attempt(msgspec.Struct, frozen=True):
    name: str
    title: str
    outcome: str
    sentence: str


class OutsideCurve(msgspec.Struct, frozen=True):
    """Something is missing that no known effect is."""

    channel: str
    words: str
    """Of the channel; one of rotor thrust is no axis of force or torque."""
    unit: str
    variable: VariableName
    x: list[float]
    y: list[float]
    band: list[float]
    probability: float
    effect: str = ""
    """Name for an effect of it; empty where none can be made."""
    advice: str = ""
    """Why none can be made, and where to look instead."""


class Tried(msgspec.Struct, frozen=True):
    """The model with an effect added and refitted, not kept yet."""

    effect: str
    title: str
    verdict: str
    use: str
    """The verdict on the refit: usable, doubtful or do not use."""
    reasons: list[str]
    quantities: list[str]
    units: list[str]
    as_it_was: list[float]
    before: list[float]
    """Refitted without the effect."""
    after: list[float]
    """Refitted with it; each after 0.5 s, by quantity. All empty without held-out flights."""
    held_out: list[str]
    changes: list[str]
    vehicle_hash: str
    """Of the vehicle with it: which trial this is."""


class ParameterRow(msgspec.Struct, frozen=True):
    name: str
    words: str
    value: float
    sigma: float
    unit: str
    source: str


class VehicleVersion(msgspec.Struct, frozen=True):
    number: int
    action: str
    effect: str
    when: str
    current: bool
    undone: bool
    position_mm: float | None
    """Position error after 0.5 s on held-out flights as found when it was made; None where nothing was."""
    verdict: str
    changes: list[str]
    """From the version before."""


# --- from the server ---


class Flights(msgspec.Struct, frozen=True, tag="flights"):
    """The project's flights, the newest first."""

    flights: list[FlightCard]


class Comparison(msgspec.Struct, frozen=True, tag="comparison"):
    """Where the model fails on the flights."""

    state: Literal["none", "current", "old"]
    """`old`: the vehicle, the flights or what they are for have changed since."""
    learn: list[str] = []
    held_out: list[str] = []
    judged_how: str = ""
    """On what the shares are judged, in words."""
    variables: list[VariableName] = []
    channels: list[ChannelResidual] = []
    horizons_s: list[float] = []
    errors: list[HorizonError] = []
    predictions: int = 0
    remarks: list[str] = []
    has_report: bool = False


class Diagnosis(msgspec.Struct, frozen=True, tag="diagnosis"):
    """Which effect the model lacks."""

    state: Literal["none", "current", "old"]
    verdict: str = ""
    probability: float = 0.0
    probabilities: str = ""
    """In a sentence: that one, that of something unknown and that of another effect, each with what it is of."""
    envelope: str = ""
    """How far the flights went, in a sentence: what is stated holds within it."""
    fit: str = ""
    """The verdict on the fit in a sentence."""
    learn: list[str] = []
    held_out: list[str] = []
    candidates: list[Candidate] = []
    attempts: list[Attempt] = []
    horizons: list[str] = []
    staircase: list[Stair] = []
    outside: OutsideCurve | None = None
    unobservable: list[str] = []
    """Effects that no flight of this kind can show, each with the reason."""
    findings: list[str] = []
    left: list[str] = []
    """What the last model leaves unexplained, root mean square, by channel in words."""
    vehicle: str = ""
    """Hash of the vehicle that was diagnosed."""
    logs: str = ""
    """Of the flights as they were then."""
    has_report: bool = False


class Model(msgspec.Struct, frozen=True, tag="model"):
    """The project's vehicle file: its parameters, its versions, and a change that was tried."""

    name: str
    titles: list[str]
    """Of its effects, in words."""
    effects: list[str]
    parameters: list[ParameterRow]
    versions: list[VehicleVersion]
    """In the order they were made."""
    tried: Tried | None = None


# --- from the page ---


class ListFlights(Command, frozen=True, tag="list_flights", kw_only=True):
    """Look again at the folder of flights."""


class SetRole(Command, frozen=True, tag="set_role", kw_only=True):
    flight: str
    role: Role


class OpenFlights(Command, frozen=True, tag="open_flights", kw_only=True):
    """Ask what there is to draw of flights; the reply has `flights`."""

    flights: list[str]


class ReadStreams(Command, frozen=True, tag="read_streams", kw_only=True):
    """Ask for streams over a stretch of a flight's shifted time; the reply has `parts`."""

    flight: str
    streams: list[str]
    from_s: float
    to_s: float
    points: int
    """About as many times as there are pixels."""


class FixFlight(Command, frozen=True, tag="fix_flight", kw_only=True):
    """Apply the fixes that the checks propose, into a new log; the reply has its name."""

    flight: str


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


class ReadScatter(Command, frozen=True, tag="read_scatter", kw_only=True):
    """Ask for a residual against a variable; the reply has `scatter`."""

    channel: str
    variable: str


class Keep(Command, frozen=True, tag="keep", kw_only=True):
    """Make the tried change the next version of the vehicle file."""

    vehicle_hash: str
    """Of the trial that the page showed."""


class DropTried(Command, frozen=True, tag="drop_tried", kw_only=True):
    """Forget the change that was tried; the vehicle file stays as it is."""


class ReturnTo(Command, frozen=True, tag="return_to", kw_only=True):
    """Restore a version of the vehicle file; the present one stays in the history."""

    version: int
