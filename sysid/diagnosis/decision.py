"""The verdict on one candidate: from everything that was found about it, by one function, and then in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.free_form import axes_of
from sysid.diagnosis.evidence.score import Score
from sysid.diagnosis.examined import Outside
from sysid.diagnosis.findings import Outcome, Size, Verdict
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.diagnosis.trial import Trial


class Reason(Enum):
    """What a verdict rests on."""

    CONFIRMED = auto()
    """Added to the model, and judged right."""
    NEGLIGIBLE = auto()
    """Part of the model, at a size of no consequence."""
    USEFUL_PROXY = auto()
    """Added to the model because it helps, though a curve shows that it is another law."""
    FEW_STRETCHES = auto()
    """It explains about as much as any curve does, in too few stretches of flight."""
    ONE_OF_SEVERAL = auto()
    """Nothing tells it from others, of which one is missing."""
    NO_LOAD = auto()
    """It shows, and is no load."""
    TRIED = auto()
    """It was tried and not kept."""
    CURVE_EXPLAINS_MORE = auto()
    ANOTHER_EXPLAINS_MORE = auto()
    REJECTED_FIT = auto()
    """A fit that is not to be used excludes nothing."""
    TOO_SMALL = auto()
    """Whatever it may be, its whole interval lies below what would matter."""
    WEAK_SIGN = auto()
    """Its whole interval lies below what would matter, and yet it shows some sign of itself."""
    TOO_WEAK = auto()
    """Its interval holds sizes that would matter, and none of them for sure."""


@dataclass(frozen=True, slots=True)
class Case:
    """What was found about one candidate."""

    candidate: Candidate
    score: Score
    """Of the last model that lacked it."""
    sizes: tuple[Size, ...]
    trial: Trial | None
    """The last in which it was tried."""
    added: bool
    """Whether it is part of the last model, and named."""
    curve: Outside | None
    """That explains what no name does."""
    undecided: Trial | None
    """That could not decide between it and others, of which one is missing."""
    doubted: bool
    """Whether the best curve does not clearly outdo it."""
    carried_by: tuple[str, ...]
    """Of a payload that was added: the flights that carry it; empty for all else."""
    no_load: str
    """Why what shows is no load, in words; empty if it may be one, or is no payload."""
    rejected: bool
    """Whether the last fit is not to be used, so that nothing is excluded by it."""
    useful_proxy: bool = False
    """Whether it is part of the last model because it helps, though a curve explains more."""
    negligible: bool = False
    """Whether it is part of the last model at a size of no consequence."""

    def within(self, share: float) -> bool:
        """Whether the whole interval of every size lies within this share of the usual one."""
        return all(size.within(share) for size in self.sizes)

    @property
    def confidence_alone(self) -> float:
        """That it is missing, by its own significance; a curve of a channel that it acts on takes its share."""
        alone = min(THRESHOLDS.even_confidence, max(0.0, 1.0 - self.score.significance / 0.01))
        if self.curve is None or not {*axes_of(self.curve.channel)} & {*self.candidate.channels}:
            return alone
        return alone * (1.0 - self.curve.confidence)

    @property
    def confidence_added(self) -> float:
        """That its name is right; a law that no known effect is may show in more channels than the curve's."""
        assert self.trial is not None
        return min(self.trial.confidence, THRESHOLDS.beside_curve) if self.curve else self.trial.confidence


@dataclass(frozen=True, slots=True)
class Decision:
    """The verdict on a candidate."""

    verdict: Verdict
    reason: Reason
    confidence: float
    """Probability that this effect is missing; of one that was added, that it is the right name."""


def stated(confidence: float, *, unsure: bool) -> float:
    """What may be stated of an effect or a curve: even odds at most where the fit is not to be used."""
    return min(THRESHOLDS.even_confidence, confidence) if unsure else confidence


def decide(case: Case) -> Decision:
    """The one place where a verdict is made; the first reason that holds decides."""
    open_ = Verdict.INCONCLUSIVE
    confidence = case.undecided.probability(case.candidate.name) if case.undecided else case.confidence_alone
    confidence = stated(confidence, unsure=case.rejected)
    if case.doubted:
        return Decision(open_, Reason.FEW_STRETCHES, max(THRESHOLDS.even_confidence, confidence))
    if case.undecided is not None:
        return Decision(open_, Reason.ONE_OF_SEVERAL, confidence)
    if case.useful_proxy:
        return Decision(Verdict.PROXY, Reason.USEFUL_PROXY, confidence)
    if case.negligible:
        return Decision(Verdict.EXCLUDED, Reason.NEGLIGIBLE, 0.0)
    if case.added and case.trial is not None:
        return Decision(Verdict.PRESENT, Reason.CONFIRMED, stated(case.confidence_added, unsure=case.rejected))
    if case.no_load:
        return Decision(open_, Reason.NO_LOAD, confidence)
    if case.trial is not None and case.trial.outcome is not Outcome.ADDED:
        return Decision(open_, Reason.TRIED, confidence)
    if case.score.significance < THRESHOLDS.chance:
        more = Reason.CURVE_EXPLAINS_MORE if case.curve else Reason.ANOTHER_EXPLAINS_MORE
        return Decision(open_, more, confidence)
    if not case.within(THRESHOLDS.matters):
        return Decision(open_, Reason.TOO_WEAK, confidence)
    if case.rejected:
        return Decision(open_, Reason.REJECTED_FIT, confidence)
    if not case.within(THRESHOLDS.least_size) and case.score.significance < THRESHOLDS.weak_sign:
        return Decision(open_, Reason.WEAK_SIGN, confidence)
    return Decision(Verdict.EXCLUDED, Reason.TOO_SMALL, 0.0)


def sentence(case: Case, decision: Decision) -> str:
    """Why, in words."""
    candidate, trial, curve = case.candidate, case.trial, case.curve
    match decision.reason:
        case Reason.CONFIRMED:
            assert trial is not None
            return _confirmed(trial, case.carried_by)
        case Reason.FEW_STRETCHES:
            return "no curve explains clearly more, yet too few stretches of flight show it"
        case Reason.ONE_OF_SEVERAL:
            assert case.undecided is not None
            others = " or ".join(name for name in case.undecided.between if name != candidate.name)
            return f"either it or {others} is missing; these flights do not show which"
        case Reason.NO_LOAD:
            return case.no_load
        case Reason.NEGLIGIBLE:
            return f"it shows, and is too small to matter: {_limits(case.sizes)} can be excluded (95 %)"
        case Reason.USEFUL_PROXY:
            assert trial is not None
            return trial.sentence
        case Reason.TRIED:
            assert trial is not None
            return trial.sentence
        case Reason.CURVE_EXPLAINS_MORE:
            assert curve is not None
            return f"significant, but the curve of {curve.channel} against {curve.variable} explains more"
        case Reason.ANOTHER_EXPLAINS_MORE:
            return "significant, but another explains more; look again after adding that one"
        case Reason.REJECTED_FIT:
            return "the fit is not to be used, so it excludes nothing: read the verdict on it"
        case Reason.TOO_SMALL:
            return f"{_limits(case.sizes)} can be excluded (95 %)"
        case Reason.WEAK_SIGN:
            small = f"{_limits(case.sizes)} can be excluded (95 %)"
            return f"there is a weak sign of it, and it is too small to matter: {small}"
        case Reason.TOO_WEAK:
            return _too_weak(case.sizes)


def _limits(sizes: Sequence[Size]) -> str:
    return ", ".join(f"{s.parameter.split('.')[1]} above {s.excluded_above:.2g} {s.unit}" for s in sizes)


def _too_weak(sizes: Sequence[Size]) -> str:
    """The parameter that is open the farthest beyond what would matter."""
    open_ = [s for s in sizes if s.sigma > 0.0]
    if not open_:
        return "nothing was flown that would show it"
    worst = max(open_, key=lambda s: s.excluded_above / s.usual)
    name, (low, high) = worst.parameter.split(".")[1], worst.interval90
    return (
        f"too weak to tell with these flights: {name} is within {low:.2g} and {high:.2g} {worst.unit} (90 %), would "
        f"have shown from {worst.smallest_visible:.2g} on, and is usually {worst.usual:.2g}"
    ).replace(" 1 (", " (")


def _confirmed(trial: Trial, carried_by: Sequence[str]) -> str:
    where = f"carried by {', '.join(carried_by)} and no other flight; " if carried_by else ""
    text = f"{where}it lowers the training flights' cost by {trial.training.total:.0f}, and {trial.judged_on} agree"
    if trial.in_place_of:
        text = f"{trial.sentence}; the training flights' cost fell by {trial.training.total:.0f} in all"
    doubtful = [f"{name} ({p:.0%})" for name, p in trial.rivals if p > 0.05]
    return text + (f"; it may also be {' or '.join(doubtful)}" if doubtful else "")
