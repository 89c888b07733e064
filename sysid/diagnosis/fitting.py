"""Which candidates are fitted in full beside a model, each fit, and the model without an addition."""

import logging
from collections.abc import Collection, Sequence
from dataclasses import replace

from flight import FlightLog, InputError
from sysid.diagnosis.evidence import candidates
from sysid.diagnosis.evidence.candidates import POSE_DELAY, Candidate
from sysid.diagnosis.evidence.weigh import Fitted
from sysid.diagnosis.examined import (
    Model,
    alike,
    as_good_as,
    examine,
    lead,
    loss,
    reproduced,
    significant,
    stated_curve,
)
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from sysid.estimator.result import Identification
from vehicle import Vehicle, effects

logger = logging.getLogger(__name__)


def refit(logs: Sequence[FlightLog], model: Model, candidate: Candidate, options: Options) -> Identification:
    """Fit the model with a candidate in it.

    Where the effect that is missing is large, the model has been bent out of shape to make up for it, and from there no
    way may lead back; then the fit starts from the numbers that the model was given.
    """
    start = candidates.added(model.fit.vehicle, candidate, list(model.scores[candidate.name].size))
    flights = model.flights if candidate.between_flights else model.fit.flights
    near = replace(model.fit, flights=flights)
    try:
        return identify(logs, start, holding_others(options, start, candidate), near=near)
    except InputError:
        if candidate.between_flights:
            raise
        given = model.fit.vehicle
        for free in (e for e in model.fit.parameters if e.status == "free"):
            given = given.with_value(free.name, free.start)
        start = candidates.added(given, candidate, [0.0] * len(candidate.parameters))
        return identify(logs, start, holding_others(options, start, candidate), given=model.fit.given)


def holding_others(options: Options, vehicle: Vehicle, candidate: Candidate) -> Options:
    """Parameters of the same effect that are no part of the candidate stay where they are, unless already found."""
    own = {f"{candidate.effect}.{s.name}": s for s in vehicle.effect(candidate.effect).parameters}
    idle = [n for n, s in own.items() if n not in candidate.columns and vehicle.value(n) == (s.default * s.optional)]
    return replace(options, held=tuple(dict.fromkeys((*options.held, *idle))))


def candidates_fitted(
    logs: Sequence[FlightLog], model: Model, options: Options, refused: Collection[str]
) -> list[Fitted]:
    """The best candidates, each fitted in full.

    Once one of them is beyond chance, something is missing, and a confounded effect that explains about as much may be
    it, whatever its own significance. So may be whoever a curve beyond chance does not clearly outdo.
    Those that explain far less than one that was refused are left out: their traces are alike, and what unseen flights
    could not confirm of the better one speaks against the worse one too.
    A clock that is off looks like a torque by dn/dt, so such effects wait until the clocks are right.
    """
    found = [s for s in significant(model) if s.name not in refused]
    if any(s.name == POSE_DELAY for s in found):
        refused = {*refused, *_by_rotor_acceleration(model)}
        found = [s for s in found if s.name not in refused]
    if not found and (curve := stated_curve(model)) is not None:
        found = [s for s in as_good_as(curve, model) if s.name not in refused]
    if not found:
        return []
    gain = {s.name: model.scores[s.name].gain_unseen for s in model.candidate_set.candidates}
    others = [s for s in model.candidate_set.candidates if s.name not in refused and s not in found]
    close = [*found, *(s for s in others if any(alike(model, s, f) for f in found))]
    close = [s for s in close if gain[s.name] > THRESHOLDS.rival_share * gain[found[0].name]]
    best = sorted(close, key=lambda s: -gain[s.name])[: THRESHOLDS.rivals]
    tried = _unless_hopeless(logs, model, options, best)
    better = [c for name in refused if (c := model.tried.fitted.get(name)) is not None]
    return [c for c in tried if not any(_outdone(model, c, b) for b in better)]


def _unless_hopeless(
    logs: Sequence[FlightLog], model: Model, options: Options, best: Sequence[Candidate]
) -> list[Fitted]:
    """Candidates fitted in full, but for those that the fit of the first one rules out without a fit of their own."""
    first, *others = best
    fitted = fitted_once(logs, model, first, options)
    if fitted is None or not others:
        return [c for s in best if (c := fitted_once(logs, model, s, options)) is not None]
    after = with_it(model, fitted)
    leads = {s.name: lead(after, first, s) for s in others}
    logger.info("%s: by the score test ahead by %s", first.name, leads)
    open_ = [s for s in others if s.name in model.tried.fitted or not leads[s.name] > THRESHOLDS.screened]
    return [fitted, *(c for s in open_ if (c := fitted_once(logs, model, s, options)) is not None)]


def with_it(model: Model, fitted: Fitted) -> Model:
    """The model that a candidate makes; only the last one asked for is kept, for its evidence is large."""
    known = model.tried.examined
    if fitted.candidate.name not in known:
        known.clear()
        known[fitted.candidate.name] = examine(fitted.fit)
    return known[fitted.candidate.name]


def _by_rotor_acceleration(model: Model) -> set[str]:
    """Names of the candidates that read dn/dt."""
    named = model.candidate_set.candidates
    return {s.name for s in named if "rotor_acceleration_rad_s2" in effects.find(s.effect).needs}


def fitted_once(logs: Sequence[FlightLog], model: Model, candidate: Candidate, options: Options) -> Fitted | None:
    """The candidate fitted in full, once per model; None if that fails."""
    known = model.tried.fitted
    if candidate.name not in known:
        try:
            fit = refit(logs, model, candidate, options)
            reduction = model.judge.reduction(model.fit.vehicle, fit.vehicle, fit.solution.point)
            known[candidate.name] = Fitted(candidate, fit, reduction)
        except InputError as error:
            logger.info("%s could not be fitted: %s", candidate.name, error)
            known[candidate.name] = None
    return known[candidate.name]


def _outdone(model: Model, worse: Fitted, better: Fitted) -> bool:
    """Whether another candidate leaves much the same trace and explains it clearly better."""
    scales = model.tried.scales
    clearly = scales is not None and scales.weight(better) - scales.weight(worse) > THRESHOLDS.clear_lead
    return clearly and reproduced(model, worse.candidate, better.candidate) > THRESHOLDS.competing


def refit_without(logs: Sequence[FlightLog], model: Model, dropped: Candidate, options: Options) -> Model | None:
    """The model without an addition; None if that cannot be fitted."""
    vehicle = model.fit.vehicle
    if effects.find(dropped.effect).separate:
        for name in dropped.parameters:
            vehicle = vehicle.with_value(name, 0.0, source="taken out")
        options = replace(options, held=(*options.held, *dropped.parameters))
    else:
        vehicle = candidates.taken_out(vehicle, dropped.effect)
    try:
        return examine(identify(logs, vehicle, options, near=model.fit))
    except InputError as error:
        logger.info("%s stays: the model without it could not be fitted: %s", dropped.name, error)
        return None


def superfluous(
    logs: Sequence[FlightLog], model: Model, earlier: Sequence[Candidate], options: Options
) -> tuple[Candidate, Model] | None:
    """The addition that the last one has made unnecessary, and the model without it; None if all are needed.

    What would be added again to the model without it is needed, however little the last test of it shows: a few blocks
    decide that one, and all of them say what is left over without it.
    """
    chance = {candidate: loss(model, candidate).significance for candidate in earlier}
    for candidate in sorted(earlier, key=lambda s: -chance[s]):
        if chance[candidate] <= THRESHOLDS.backward_chance:
            break
        without = refit_without(logs, model, candidate, options)
        if without is not None and candidate.name not in {s.name for s in significant(without)}:
            return candidate, without
    return None
