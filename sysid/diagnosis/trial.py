"""One attempt to add a candidate: what judged it, how it ended, and that in words."""

from dataclasses import dataclass

import numpy as np

from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.confirm import CostReduction
from sysid.diagnosis.examined import Outside
from sysid.diagnosis.findings import JudgedBy, Outcome
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.result import Identification


@dataclass(frozen=True, slots=True)
class Trial:
    """One attempt to add a candidate, and how it ended."""

    candidate: Candidate
    outcome: Outcome
    training: CostReduction
    held_out: CostReduction
    """On flights that were not used, or on each training flight left out in turn."""
    judged_by: JudgedBy
    why: str
    """Why held-out flights did not judge; empty if they did."""
    confirmed: bool
    """Whether those flights prefer the model with it, and its fitted size is not zero."""
    confidence: float
    """Probability that this is the effect: that it is the one among its rivals, and that there is one at all."""
    rivals: tuple[tuple[str, float], ...]
    """Confounded effects that were fitted, with their probabilities."""
    proxy_for: Outside | None
    fit: Identification
    vanishes: bool = False
    """Whether the full fit leaves it next to nothing, whatever its score was."""
    in_place_of: tuple[str, ...] = ()
    """Additions that it explains as well, alone."""

    @property
    def refuted(self) -> bool:
        """Whether something speaks against it, more than that too little speaks for it."""
        refused = self.outcome is Outcome.NOT_CONFIRMED and self.judged_by is JudgedBy.HELD_OUT
        return self.outcome is Outcome.PROXY or refused

    @property
    def between(self) -> tuple[str, ...]:
        """Names that nothing separates: its own and those of rivals almost as likely."""
        least = self.confidence * np.exp(-THRESHOLDS.clear_lead)
        return (self.candidate.name, *(name for name, p in self.rivals if p > least))

    @property
    def judged_on(self) -> str:
        """In words, what confirmed or refused it."""
        return f"{self.judged_by} ({self.why})" if self.why else str(self.judged_by)

    def probability(self, name: str) -> float:
        """That one of the names of `between` is the right one."""
        return {self.candidate.name: self.confidence, **dict(self.rivals)}[name]

    @property
    def sentence(self) -> str:
        """How it ended, with the numbers."""
        judged, curve = self.held_out, self.proxy_for
        scatter = (
            f"± {judged.sigma:.1f}" if np.isfinite(judged.sigma) else "(one stretch of flight: uncertainty unknown)"
        )
        way = f"{'rose' if judged.total < 0.0 else 'fell'} by {abs(judged.total):.1f}"
        numbers = f"the cost of {self.judged_on} {way} {scatter}"
        match self.outcome:
            case Outcome.ADDED if self.in_place_of:
                return f"in place of {' and '.join(self.in_place_of)}, which it explains alone: {numbers}"
            case Outcome.ADDED:
                return f"helped: {numbers}"
            case Outcome.NOT_CONFIRMED if self.vanishes:
                return f"not added: its fitted size is not significantly different from zero; {numbers}"
            case Outcome.NOT_CONFIRMED:
                return f"{'fell, but not surely enough' if judged.total > 0.0 else 'did not help'}: {numbers}"
            case Outcome.UNDECIDED:
                return f"not named: {' or '.join(self.between[1:])} explains as much; {numbers}"
            case Outcome.REMOVED if curve is not None:
                return (
                    f"taken out again: a free curve of {curve.channel} against {curve.variable} is needed, and beside "
                    "it an effect too small to matter may be a part of that law"
                )
            case Outcome.REMOVED:
                return "taken out again: a later addition made it unnecessary"
            case Outcome.PROXY:
                assert curve is not None
                return (
                    f"not named: a free curve of {curve.channel} against {curve.variable} explains more, and beside it "
                    "the effect is not needed"
                )
            case Outcome.USEFUL_PROXY:
                assert curve is not None
                return (
                    f"added as a useful proxy: {numbers}, but a free curve of {curve.channel} against {curve.variable} "
                    "shows that another law is missing"
                )
