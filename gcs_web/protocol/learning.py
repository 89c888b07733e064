"""Messages about the diagnosis and the vehicle's model."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, State
from gcs_web.protocol.comparison import VariableName


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


class ProposedEquation(msgspec.Struct, frozen=True):
    """The simplest law of a curve, or of what the law of a named effect leaves."""

    sentence: str
    effect: str
    """Name for an effect of it; empty where none can be made."""
    facts: str
    """JSON, as `sysid.diagnosis.equation_text.as_dict` has it."""


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


class Diagnosis(State, frozen=True, tag="diagnosis"):
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
    equation: ProposedEquation | None = None
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


class Model(State, frozen=True, tag="model"):
    """The project's vehicle file: its parameters, its versions, and a change that was tried."""

    name: str
    titles: list[str]
    """Of its effects, in words."""
    effects: list[str]
    parameters: list[ParameterRow]
    versions: list[VehicleVersion]
    """In the order they were made."""
    tried: Tried | None = None


class Keep(Command, frozen=True, tag="keep", kw_only=True):
    """Make the tried change the next version of the vehicle file."""

    vehicle_hash: str
    """Of the trial that the page showed."""


class DropTried(Command, frozen=True, tag="drop_tried", kw_only=True):
    """Forget the change that was tried; the vehicle file stays as it is."""


class ReturnTo(Command, frozen=True, tag="return_to", kw_only=True):
    """Restore a version of the vehicle file; the present one stays in the history."""

    version: int
