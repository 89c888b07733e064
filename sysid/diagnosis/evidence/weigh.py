"""Which of several candidates that leave much the same trace is it? All are weighed on one pair of scales.

A model takes the effect that it lacks for noise. So what speaks for one candidate and against another shows only
against the noise that is left with an effect in the model, and the costs of all are taken at the level that the best of
them leaves. It is the same with scatter: at the model that lacks an effect errors scatter with the effect's own trace,
most of all for the candidate that fits best, which would be its undoing. How they scatter with the best one in the
model, along it and along its rival, makes less of the difference between the two.
"""

from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.confirm import CostReduction, Judge
from sysid.diagnosis.evidence.evidence import Evidence
from sysid.diagnosis.evidence.score import score
from sysid.estimator.result import Identification


@dataclass(frozen=True, slots=True)
class Fitted:
    """A candidate fitted in full."""

    candidate: Candidate
    fit: Identification
    reduction: CostReduction
    """Of the cost of the training flights, at the noise of the model without it."""


class Scales:
    """Log odds between candidates for one model."""

    def __init__(self, best: Fitted, judge: Judge, evidence: Evidence) -> None:
        """
        Args:
            best: the fitted that fits best.
            judge: of the flights it was fitted to; its noise level is replaced by the candidate's.
            evidence: at the candidate's fit.
        """
        fit = best.fit
        self._best = best.candidate
        self._judge = judge.at(fit.noise, fit.solution.point)
        self._zero: FloatArray = self._judge.costs(fit.vehicle)
        self._blocks, self._base, self._names = evidence.named, evidence.base, evidence.names
        self.held_out: dict[str, float] = {}
        """Log odds that held-out flights add, by candidate, against the one that was best then."""

    def weight(self, fitted: Fitted) -> float:
        """Log odds against the best; each parameter costs what Schwarz's criterion asks."""
        fit, candidate = fitted.fit, fitted.candidate
        lead = float((self._zero - self._judge.costs(fit.vehicle, fit.solution.point)).sum())
        told = self.held_out.get(candidate.name, 0.0)
        return lead / self.dispersion(candidate) - 0.5 * len(candidate.columns) * np.log(len(self._zero)) + told

    def dispersion(self, rival: Candidate) -> float:
        """By how much errors vary more than white noise would along the best candidate or along this one."""
        return max(self._along(self._best), self._along(rival))

    def _along(self, candidate: Candidate) -> float:
        """1 where the model with the best candidate has no room for the other one beside it."""
        columns = np.array([self._names.index(n) for n in candidate.columns if n in self._names], dtype=np.intp)
        given = np.setdiff1d(self._base, columns)
        return score(self._blocks, given, columns).dispersion if len(columns) else 1.0
