"""Several additions that one candidate makes unneeded: the simpler model says the same with one law.

An inflow that falls with the climb lifts less per speed along z and damps the turning about x and y at once. Drag along
z and damping, each the best of its step, explain that together with six numbers, and no single step leads from there to
the one number that is right.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from flight import FlightLog
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.weigh import Fitted
from sysid.diagnosis.examined import Model, examine, in_place_of
from sysid.diagnosis.fitting import fitted_once, superfluous
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.options import Options


@dataclass(frozen=True, slots=True)
class Exchange:
    """A candidate in place of what it makes unneeded."""

    candidate: Candidate
    fitted: Fitted
    dropped: tuple[Candidate, ...]
    steps: tuple[Model, ...]
    """With the candidate added, then after each of `dropped` went."""


def exchange(
    logs: Sequence[FlightLog],
    model: Model,
    added: Sequence[Candidate],
    options: Options,
    refused: Collection[str],
) -> Exchange | None:
    """The candidate that makes most additions unneeded, two at least, fitted without them; None if there is none.

    Args:
        refused: candidates that are not to be asked.
    """
    replaced = {
        one.name: in_place_of(model, one, added)
        for one in model.candidate_set.candidates
        if one.name not in refused and model.scores[one.name].significance < THRESHOLDS.weak_sign
    }
    asked = [one for one in model.candidate_set.candidates if len(replaced.get(one.name, ())) > 1]
    order = {one.name: (-len(replaced[one.name]), model.scores[one.name].significance) for one in asked}
    for candidate in sorted(asked, key=lambda one: order[one.name])[: THRESHOLDS.rivals]:
        fitted = fitted_once(logs, model, candidate, options)
        if fitted is None:
            continue
        found = _without_unneeded(logs, candidate, fitted, added, options)
        if len(found.dropped) > 1:
            return found
    return None


def _without_unneeded(
    logs: Sequence[FlightLog], candidate: Candidate, fitted: Fitted, added: Sequence[Candidate], options: Options
) -> Exchange:
    steps, dropped = [examine(fitted.fit)], []
    while (unneeded := superfluous(logs, steps[-1], [a for a in added if a not in dropped], options)) is not None:
        dropped.append(unneeded[0])
        steps.append(unneeded[1])
    return Exchange(candidate, fitted, tuple(dropped), tuple(steps))
