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
    unit: str
    variable: VariableName
    x: list[float]
    y: list[float]
    band: list[float]
    probability: float


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
    """Of the vehicle that it changes."""


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
