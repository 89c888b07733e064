"""Several additions that one candidate makes unneeded: a simpler model says the same with one law.

An inflow that falls with the climb lifts less per speed along z and damps the turning about x and y at once. Drag along
z and damping, each the best of its step, explain that together with six numbers, and no single step leads from there to
the one number that is right.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from flight import FlightLog
from sysid.diagnosis import effect_sizes
from sysid.diagnosis.evidence.candidates import POSE_DELAY, Candidate
from sysid.diagnosis.evidence.confirm import CostReduction
from sysid.diagnosis.evidence.weigh import Fitted
from sysid.diagnosis.examined import Model, examine, in_place_of, stands
from sysid.diagnosis.fitting import fitted_once, superfluous
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.options import Options
from vehicle import effects


@dataclass(frozen=True, slots=True)
class Exchange:
    """A candidate in place of what it makes unneeded."""

    candidate: Candidate
    fitted: Fitted
    dropped: tuple[Candidate, ...]
    steps: tuple[Model, ...]
    """With the candidate added, then after each of `dropped` went."""
    reduction: CostReduction
    """Of the training flights, from the model with all of `dropped` to the last of `steps`."""
    dispersion: float
    """By how much cost falls exaggerate log odds here."""

    @property
    def is_simpler(self) -> bool:
        """Whether one law with fewer parameters takes the place of several."""
        return len(self.dropped) > 1 and len(self.candidate.parameters) < sum(len(d.parameters) for d in self.dropped)

    @property
    def weight(self) -> float:
        """Log odds beside other exchanges, each parameter at its price (Schwarz, 1978)."""
        saved = sum(len(d.parameters) for d in self.dropped) - len(self.candidate.parameters)
        price = 0.5 * np.log(len(self.reduction.by_block))
        return float(self.reduction.total / self.dispersion + price * saved)


def exchange(
    logs: Sequence[FlightLog],
    model: Model,
    added: Sequence[Candidate],
    options: Options,
    refused: Collection[str],
) -> list[Exchange]:
    """Candidates that make several additions unneeded, fitted without them, the likeliest first.

    Args:
        added: those that may go. A single rotor's part and another thrust law stay: the rest of their effect would too.
        refused: candidates that are not to be asked.
    """
    may_go = [a for a in added if not _is_part(a)]
    replaced = {
        one.name: in_place_of(model, one, may_go)
        for one in model.candidate_set.candidates
        if one.name not in refused and _may_come(one) and model.scores[one.name].significance < THRESHOLDS.weak_sign
    }
    asked = [one for one in model.candidate_set.candidates if len(replaced.get(one.name, ())) > 1]
    order = {one.name: (-len(replaced[one.name]), model.scores[one.name].significance) for one in asked}
    found: list[Exchange] = []
    for candidate in sorted(asked, key=lambda one: order[one.name])[: THRESHOLDS.rivals]:
        fitted = fitted_once(logs, model, candidate, options)
        if fitted is None:
            model.tried.fitted.pop(candidate.name)  # it was no candidate on its own: curves are as sure as before
            continue
        one = _without_unneeded(logs, model, candidate, fitted, may_go, options)
        last = one.steps[-1]
        if one.is_simpler and effect_sizes.matters(last.fit, candidate) and stands(last, candidate, refused) is None:
            found.append(one)
    return sorted(found, key=lambda one: -one.weight)


def _is_part(addition: Candidate) -> bool:
    effect = effects.find(addition.effect)
    return effect.separate or bool(effect.instead_of)


def _may_come(candidate: Candidate) -> bool:
    return not candidate.between_flights and candidate.name != POSE_DELAY


def _without_unneeded(
    logs: Sequence[FlightLog],
    model: Model,
    candidate: Candidate,
    fitted: Fitted,
    added: Sequence[Candidate],
    options: Options,
) -> Exchange:
    steps, dropped = [examine(fitted.fit)], list[Candidate]()
    while (unneeded := superfluous(logs, steps[-1], [a for a in added if a not in dropped], options)) is not None:
        dropped.append(unneeded[0])
        steps.append(unneeded[1])
    reduction = model.judge.reduction(model.fit.vehicle, steps[-1].fit.vehicle)
    return Exchange(candidate, fitted, tuple(dropped), tuple(steps), reduction, model.scores[candidate.name].dispersion)
