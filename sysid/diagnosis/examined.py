"""A fitted model with the evidence at it, and what can be asked of it: who stands out, what curve, who stands in."""

import logging
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sysid.diagnosis.belief import curve_is_there, rising
from sysid.diagnosis.evidence import load
from sysid.diagnosis.evidence.candidates import Candidate, CandidateSet, candidate_set
from sysid.diagnosis.evidence.confirm import Judge
from sysid.diagnosis.evidence.evidence import Evidence
from sysid.diagnosis.evidence.free_form import (
    DRAG,
    LIFT,
    ROTORS,
    SHOWN_BY_THRUST,
    THRUST,
    WORLD,
    channels_of,
    of_thrust,
)
from sysid.diagnosis.evidence.load import Load
from sysid.diagnosis.evidence.score import Blocks, Given, Loss, Score, inverse_of, loss_without, score
from sysid.diagnosis.evidence.weigh import Fitted, Scales
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.estimator.result import CHANNELS, Identification
from sysid.logs.checks.payload import PAYLOAD
from vehicle import effects
from vehicle.effects.base import Stage

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class Tried:
    """What was tried beside one model; grows as the search goes on."""

    fitted: dict[str, Fitted | None] = field(default_factory=dict)
    """By candidate; None where the fit failed."""
    examined: "dict[str, Model]" = field(default_factory=dict)
    """By candidate, the model that it makes: of one at most."""
    curves: "dict[str, list[Outside]]" = field(default_factory=dict)
    """By channel, once curves were asked for there."""
    scales: Scales | None = None
    undecided: list[Fitted] = field(default_factory=list)
    """Put aside because nothing tells them apart."""
    drawn: "list[Outside]" = field(default_factory=list)
    """Every curve, once the best one was looked for."""
    curve: "list[Outside | None]" = field(default_factory=list)
    """The best one, once it was looked for."""


@dataclass(frozen=True, slots=True)
class Model:
    """A fitted model with the evidence at it."""

    fit: Identification
    candidate_set: CandidateSet
    evidence: Evidence
    scores: dict[str, Score]
    """Of every candidate."""
    judge: Judge
    """Of the flights it was fitted to, at its noise level."""
    tried: Tried
    load: Load | None
    """Which flights may carry a load, where the logs do not say so."""

    @property
    def flights(self) -> tuple[Flight, ...]:
        """Those it was fitted to, with what they may carry."""
        return self.load.marked(self.fit.flights) if self.load else self.fit.flights

    @property
    def all_heard(self) -> bool:
        """Whether every known effect was in the running: none lacked a reading, and none failed to be fitted."""
        return self.candidate_set.all_heard and None not in self.tried.fitted.values()


@dataclass(frozen=True, slots=True)
class Outside:
    """A curve that explains what no named effect does."""

    channel: str
    variable: str
    score: Score
    confidence: float
    """Probability that channel and variable are right."""


Form = tuple[Candidate, Outside]
"""A named effect whose law is not exactly the catalogue's, and the curve that shows it."""


def examine(fit: Identification) -> Model:
    """Score every candidate at a fitted model."""
    lined = candidate_set(fit.vehicle, fit.flights, fit.clock)
    evidence = Evidence(fit.flights, fit.solution.point, fit.noise, fit.unknowns, lined)
    carried = _load(fit, lined, evidence)
    alone = Given.of(evidence.named, evidence.base)
    scores = {s.name: _scored(evidence, s, alone) for s in lined.candidates}
    flights = fit.flights
    if carried is not None:
        scores[PAYLOAD], flights = carried.score, carried.marked(flights)
    judge = Judge(flights, fit.noise, fit.solution.point, fit.clock)
    return Model(fit, lined, evidence, scores, judge, Tried(), carried)


def _scored(evidence: Evidence, candidate: Candidate, alone: Given) -> Score:
    one_sided = np.array(candidate.one_sided + (False,) * len(candidate.fitted_along))
    found = score(evidence.named, alone, evidence.place(candidate.columns), one_sided)
    return found.first(len(candidate.parameters))


def _load(fit: Identification, lined: CandidateSet, evidence: Evidence) -> Load | None:
    """Which flights may carry a load; the evidence then knows that the others do not."""
    if any(f.carries_payload is not None for f in fit.flights) or PAYLOAD not in {s.name for s in lined.candidates}:
        return None
    return load.find(evidence, fit.flights)


def significant(model: Model) -> list[Candidate]:
    """Candidates beyond chance, best first."""
    found = [s for s in model.candidate_set.candidates if _stands_out(s, model.scores[s.name])]
    return sorted(found, key=lambda s: -model.scores[s.name].gain_unseen)


def _stands_out(candidate: Candidate, found: Score) -> bool:
    beyond_chance = found.significance < THRESHOLDS.chance and found.gain_unseen > THRESHOLDS.least_gain
    beyond_chance |= found.significance < THRESHOLDS.doubtful and found.log_odds > THRESHOLDS.clear_odds
    return beyond_chance and bool((np.abs(found.size) > THRESHOLDS.least_size * np.array(candidate.usual)).any())


def best_curve(model: Model, channels: Sequence[str]) -> Outside | None:
    """The free-form curve that explains most in some channels, if any is beyond chance."""
    return _best_of(model, [curve for curve in _curves(model, channels) if _beyond_chance(curve.score)])


def _curves(model: Model, channels: Sequence[str]) -> list[Outside]:
    known, channels = model.tried.curves, _own(model, channels)
    fresh = [channel for channel in channels if channel not in known]
    alone = Given.of(model.evidence.named, model.evidence.base)
    for channel in fresh:
        blocks, groups = model.evidence.with_curves(channel), model.evidence.groups(channel)
        known[channel] = [Outside(channel, v, score(blocks, alone, columns), 1.0) for _, v, columns in groups]
    return [curve for channel in channels for curve in known[channel]]


def _own(model: Model, channels: Sequence[str]) -> list[str]:
    """Those that the vehicle has: a candidate may show in the thrust of any rotor there is."""
    none = ROTORS[model.fit.vehicle.rotors :]
    return [channel for channel in channels if channel not in none]


def _beyond_chance(found: Score) -> bool:
    clear = found.significance < THRESHOLDS.chance_curve and found.gain_unseen > THRESHOLDS.least_gain_curve
    return clear or (found.significance < THRESHOLDS.doubtful_curve and found.log_odds > THRESHOLDS.clear_odds_curve)


def _best_of(model: Model, found: Sequence[Outside]) -> Outside | None:
    if not found:
        return None
    found = _without_repeated(found)
    apart = _apart_from_thrust(found)
    if apart > 0.0:
        found = [o for o in found if not of_thrust(o.channel)]
    best = max(found, key=lambda o: o.score.gain_unseen)
    rivals = [o for o in found if o.channel == best.channel or of_thrust(o.channel) or of_thrust(best.channel)]
    lead = [best.score.gain_unseen - o.score.gain_unseen for o in rivals]
    odds = float(np.exp(-np.array(lead) / best.score.dispersion).sum())
    if of_thrust(best.channel) or best.channel in SHOWN_BY_THRUST:
        odds += float(np.exp(-abs(apart)))  # of the other of the two
    confidence = THRESHOLDS.most_confidence * curve_is_there(best.score.log_odds) / odds
    if not model.all_heard:
        confidence = min(confidence, THRESHOLDS.even_confidence)
    return replace(best, confidence=confidence)


def _without_repeated(found: Sequence[Outside]) -> list[Outside]:
    """Curves without those of lift that say no more than that of F_z against the same variable.

    The two differ by moments about a centre of mass that is not in the middle of the hubs.
    """
    alone = {o.variable: o.score for o in found if o.channel == "F_z"}

    def is_repeated(lift: Outside) -> bool:
        own = alone.get(lift.variable)
        return own is not None and lift.score.gain_unseen < own.gain_unseen + THRESHOLDS.clear_lead * own.dispersion

    return [o for o in found if o.channel != LIFT or not is_repeated(o)]


def _apart_from_thrust(found: Sequence[Outside]) -> float:
    """Log odds that the channels that thrust shows in have a law each, against one of thrust for all of them.

    One law of thrust moves these channels at once, so it explains more than any curve of a single one even where each
    has its own law (a moment against both velocities looks like thrust lost in the wake). Were it thrust, curves
    channel by channel could not explain more than it. Minus infinity without a curve of thrust.
    """
    best = max((o for o in found if of_thrust(o.channel)), key=lambda o: o.score.gain_unseen, default=None)
    if best is None:
        return -np.inf
    gains = [[o.score.gain_unseen for o in found if o.channel == channel] for channel in SHOWN_BY_THRUST]
    return (sum(max(own, default=0.0) for own in gains) - best.score.gain_unseen) / best.score.dispersion


def stated_curve(model: Model) -> Outside | None:
    """The best curve of all, if it is sure enough to be stated."""
    if not model.tried.curve:
        model.tried.drawn.extend(_curves(model, channels_of(model.fit.vehicle)))
        model.tried.curve.append(_sure_of(model, model.tried.drawn))
    return model.tried.curve[0]


def _sure_of(model: Model, drawn: Sequence[Outside]) -> Outside | None:
    best = _best_of(model, [curve for curve in drawn if _beyond_chance(curve.score)])
    return best if best is not None and best.confidence >= THRESHOLDS.least_confidence_curve else None


def forms_and_curve(model: Model, named: Sequence[tuple[Candidate, float]]) -> tuple[list[Form], Outside | None]:
    """Which named effects have not exactly the catalogue's law, and the best curve that is of no such law's form.

    Args:
        named: effects, each with the fall of the cost as it was added.
    """
    forms: list[Form] = []
    curve, own = stated_curve(model), set[str]()
    while curve is not None and (of := form_of(curve, named, model.tried.drawn)) is not None:
        forms.append((of, curve))
        own |= {curve.channel, *shown_in(of)}
        curve = _sure_of(model, [other for other in model.tried.drawn if other.channel not in own])
    return forms, curve


def left_unexplained(model: Model, named: Sequence[tuple[Candidate, float]]) -> float:
    """Log odds, on blocks left out, of the best curve beside the model, sure or not, that is of no named law's form.

    Args:
        named: effects, each with the fall of the cost as it was added.
    """
    stated_curve(model)
    drawn = model.tried.drawn
    left = [curve.score.log_odds for curve in drawn if form_of(curve, named, drawn) is None]
    return float(np.max(left, initial=0.0))  # nan stays nan


def of_another_form(model: Model, named: Sequence[tuple[Candidate, float]]) -> dict[str, float]:
    """Probability, by named effect, that its law is of a form that the catalogue lacks.

    For that a curve of the same physics is there beside the named law, and moves the vehicle by a share of what the law
    does that is no matter of time stamps or mass.

    Args:
        named: effects, each with the fall of the cost as it was added.
    """
    stated_curve(model)
    drags = [candidate for candidate, _ in named if _is_drag(candidate)]
    own = [(curve, [of]) for curve in model.tried.drawn if (of := form_of(curve, named, model.tried.drawn)) is not None]
    own += [(curve, drags) for curve in _curves(model, [DRAG])] if drags else []
    found: dict[str, float] = {}
    for curve, laws in own:
        share = _of_what_they_do(model, curve, laws)
        known = curve_is_there(curve.score.log_odds) * rising(share, THRESHOLDS.even_form, 4)
        found |= {law.name: max(known, found.get(law.name, 0.0)) for law in laws}
    return found


def _of_what_they_do(model: Model, curve: Outside, laws: Sequence[Candidate]) -> float:
    """Root mean square of a curve over that of laws in the model, what else is fitted having its share of both."""
    names = [n for law in laws for n in law.parameters if n in model.fit.free_names]
    if not names or not curve.score.gain_unseen > 0.0:
        return 0.0
    own = model.evidence.place(names)
    values = np.array([model.fit.vehicle.value(n) for n in names])
    lost = loss_without(model.evidence.named, np.setdiff1d(model.evidence.base, own), own, values).gain
    return float(np.sqrt(curve.score.gain_unseen / lost)) if lost > 0.0 else np.inf


def form_of(
    curve: Outside, named: Sequence[tuple[Candidate, float]], drawn: Sequence[Outside] = ()
) -> Candidate | None:
    """The named effect of whose law a curve is the form: in its channel, by what it reads, and of which the curve
    explains a small share; None if there is none. What follows a level axis' own speed along it is drag: beside named
    drags it is the form of one of them as long as it explains less.

    Then the curve shows that this effect's law is not exactly the catalogue's, and nothing that is missing besides.

    Args:
        named: effects, each with the fall of the cost as it was added: measured, for what a model would lose without
            a lag is far outside the reach of a quadratic.
        drawn: other curves of the same model.
    """
    own = [(explained, candidate) for candidate, explained in named if _by_what_it_reads(curve, candidate, drawn)]
    drags = [pair for pair in own if (curve.channel, curve.variable) in LEVEL_DRAG and _is_drag(pair[1])]
    most, best = max(drags or own, key=lambda pair: pair[0], default=(0.0, None))
    share = 1.0 if drags else THRESHOLDS.form_share
    return best if curve.score.gain_unseen < share * most else None


LEVEL_DRAG = (("F_x", "v_x"), ("F_y", "v_y"))
"""Channel and variable of a force along a level axis by the speed along it."""


def _is_drag(candidate: Candidate) -> bool:
    return effects.find(candidate.effect).family == DRAG


def _by_what_it_reads(curve: Outside, candidate: Candidate, drawn: Sequence[Outside]) -> bool:
    """Whether a curve is in a channel of a candidate, and against something its law reads or as good as that.

    What a damping leaves does not follow the velocity; where it seems to, a curve against the rate is hardly worse.
    """
    if curve.channel not in shown_in(candidate):
        return False
    rivals = [o.score.gain_unseen for o in drawn if o.channel == curve.channel and reads(candidate, o)]
    least = curve.score.gain_unseen - THRESHOLDS.clear_lead * curve.score.dispersion
    return reads(candidate, curve) or max(rivals, default=-np.inf) > least


def as_good_as(curve: Outside, model: Model) -> list[Candidate]:
    """Candidates that a curve in a channel of theirs does not clearly outdo, best first."""
    gain = {s.name: model.scores[s.name].gain_unseen for s in model.candidate_set.candidates}
    least = curve.score.gain_unseen - THRESHOLDS.clear_lead * curve.score.dispersion
    own = [s for s in model.candidate_set.candidates if curve.channel in shown_in(s)]
    return sorted((s for s in own if gain[s.name] > max(least, THRESHOLDS.least_gain)), key=lambda s: -gain[s.name])


def of_its_physics(curve: Outside, model: Model) -> list[tuple[Candidate, float]]:
    """Candidates in a curve's channel that read what it is drawn against, each with its likelihood beside the others.

    None of them is the law; the one that explains most of it is of its family. A curve of thrust is asked of laws of
    thrust alone: a moment may explain what unequal thrusts leave about x and y.
    """
    asked = [s for s in model.candidate_set.candidates if curve.channel in shown_in(s) and reads(s, curve)]
    if of_thrust(curve.channel):
        asked = [s for s in asked if effects.find(s.effect).stage in THRUST_STAGES]
    own = [(s, model.scores[s.name].gain_unseen / curve.score.dispersion) for s in asked]
    own = [(s, gain) for s, gain in own if np.isfinite(gain)]
    most = max((gain for _, gain in own), default=0.0)
    found = [(s, float(np.exp(gain - most))) for s, gain in own] if most > 0.0 else []
    total = sum(odds for _, odds in found)
    return sorted(((s, odds / total) for s, odds in found), key=lambda pair: -pair[1])


def shown_in(candidate: Candidate) -> list[str]:
    """Channels of curves in which a candidate shows; a force along axes of the body shows along the world's too, and
    what a rotor's thrust shows in may be its thrust."""
    own = [c for c in candidate.channels if c in CHANNELS]
    world = WORLD if any(c.startswith("F_") for c in own) else ()
    thrust = (THRUST, *ROTORS, LIFT) if set(own) & set(SHOWN_BY_THRUST) else ()
    return [*own, *world, *thrust]


THRUST_STAGES = (Stage.THRUST, Stage.THRUST_FACTOR)
"""Where laws of thrust act."""
READS = {
    "v": r"\bv\b|\bv_|drag|world",
    "w": r"\bw\b|\bw_|\bdw/dt",
    "n": r"\bn\b|\bn_|\bT\b|command|voltage",
    "dn/dt": r"dn/dt|dw/dt|command",
    "dc/dt": r"command",
    "height": r"height",
    "voltage": r"voltage",
    "world": r"world",
}
"""Kinds of variables, and words of a regressor by which a law reads one. Time and place no law of a vehicle reads."""
OTHER_KINDS = {"speed": "v", "s": "v", "heading": "world"}
"""Kinds of variables that do not begin with their kind's name."""


def reads(candidate: Candidate, curve: Outside) -> bool:
    """Whether a candidate's law reads what a curve is drawn against."""
    kind = OTHER_KINDS.get(curve.variable) or re.sub(r"_\w+", "", curve.variable.split()[0])
    kind = "world" if curve.channel in WORLD else kind
    return kind in READS and re.search(READS[kind], candidate.regressor) is not None


def alike(model: Model, one: Candidate, other: Candidate) -> bool:
    """Whether either leaves much of the other's trace, so that the two compete for the same evidence."""
    return max(reproduced(model, one, other), reproduced(model, other, one)) > THRESHOLDS.competing


def reproduced(model: Model, candidate: Candidate, other: Candidate) -> float:
    """How much of a candidate's trace another one can reproduce, the base parameters taken out: 0 to 1."""
    evidence, found = model.evidence, model.scores[candidate.name]
    size = found.size if found.significance < 0.05 else np.array(candidate.usual)
    mine, its = evidence.place(candidate.parameters), evidence.place(other.columns)
    columns = np.concatenate([evidence.base, mine, its])
    information = evidence.named.information.sum(axis=0)[columns[:, None], columns]
    b, q = len(evidence.base), len(mine)
    schur = information[b:, b:] - information[b:, :b] @ inverse_of(information[:b, :b]) @ information[:b, b:]
    cross = schur[q:, :q] @ size
    total = float(size @ schur[:q, :q] @ size)
    share = float(cross @ inverse_of(schur[q:, q:]) @ cross) / total if total > 0.0 else 0.0
    return float(np.sqrt(max(0.0, share)))


def stands(after: Model, candidate: Candidate, refused: Collection[str] = ()) -> Outside | None:
    """None if the name stands; else the curve that explains what the name was to explain, and more.

    At the fit with the candidate in the model: a curve in its channels that is still needed beside the name, while the
    name is not needed beside the curve, shows that the name is a proxy. Not so a curve that may be a known effect: that
    effect is asked next, and the name after it once more.

    Args:
        refused: known effects that were asked already.
    """
    curve = best_curve(after, shown_in(candidate))
    if curve is None:
        return None
    beside = [curve]
    if curve.channel in WORLD:  # what pulls in one level direction may pull in the other as well
        beside += [c for c in (best_curve(after, [w]) for w in WORLD if w != curve.channel) if c is not None]
    alone, left = loss(after, candidate), loss(after, candidate, beside)
    needed = left.significance < THRESHOLDS.chance and left.gain > THRESHOLDS.named_share * alone.gain
    drawn = " and ".join(f"{c.channel} vs {c.variable}" for c in beside)
    logger.info(
        "%s: worth %.1f, beside %s %.1f; the curve beside it %.1f",
        *(candidate.name, alone.gain, drawn, left.gain, curve.score.gain_unseen),
    )
    if needed or curve.score.gain_unseen < left.gain:
        return None
    return None if any(known.name not in refused for known in as_good_as(curve, after)) else curve


def loss(model: Model, candidate: Candidate, beside: Sequence[Outside] = ()) -> Loss:
    """What the model would lose without a candidate that is part of it, maybe with curves beside it."""
    evidence = model.evidence
    channels = [c.channel for c in beside]
    wanted = [(c.channel, c.variable) for c in beside]
    drawn = [columns for channel, variable, columns in evidence.groups(*channels) if (channel, variable) in wanted]
    blocks = evidence.with_curves(*channels) if beside else evidence.named
    return _lost(model, blocks, [candidate], np.concatenate(drawn) if drawn else np.array([], dtype=np.intp))


def _lost(model: Model, blocks: Blocks, dropped: Sequence[Candidate], more: IndexArray) -> Loss:
    """Without some candidates that are part of the model; what is not free in it costs nothing.

    Args:
        more: columns of `blocks` that are free beside the base then.
    """
    evidence, free = model.evidence, model.fit.free_names
    names = [n for one in dropped for n in one.parameters if n in free]
    if not names:
        return Loss(0.0, 1.0)
    along = [n for one in dropped for n in one.fitted_along if n in free]
    kept = np.concatenate([np.setdiff1d(evidence.base, evidence.place([*names, *along])), more])
    values = np.array([model.fit.vehicle.value(n) for n in names])
    return loss_without(blocks, kept, evidence.place(names), values)


def lead(model: Model, candidate: Candidate, rival: Candidate) -> float:
    """Log odds for a candidate that is part of a model against a rival in its place, to second order at this fit.

    Minus infinity where no quadratic says it: a lag that is taken out is far outside its reach, and so is whoever has
    no column beside the candidate.
    """
    rooms = {effects.find(one.effect).stage for one in (candidate, rival)}
    if rival.name not in model.scores or rival.between_flights or rooms & {Stage.COMMAND, Stage.DRIVE}:
        return -np.inf
    evidence, columns = model.evidence, model.evidence.place(rival.columns)
    without = _lost(model, evidence.named, [candidate], columns).gain
    beside = score(evidence.named, evidence.base, columns)  # of either sign: as in `without`, and as fits are weighed
    return (without - beside.gain) / max(beside.dispersion, _dispersion(model, candidate))


def _dispersion(model: Model, candidate: Candidate) -> float:
    """By how much the sizes of a candidate that is part of a model vary more than white noise would make them."""
    own = model.evidence.place([n for n in candidate.columns if n in model.evidence.names])
    given = np.setdiff1d(model.evidence.base, own)
    return score(model.evidence.named, given, own).dispersion if len(own) else 1.0


def in_place_of(model: Model, candidate: Candidate, additions: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Additions that are not needed beside a candidate, none of them, to first order at this fit.

    The least needed goes first, and each further one only if all of them together are still unneeded.
    """
    beside = model.evidence.place(candidate.columns)

    def chance(dropped: Sequence[Candidate]) -> float:
        return _lost(model, model.evidence.named, dropped, beside).significance

    gone: tuple[Candidate, ...] = ()
    for one in sorted(additions, key=lambda a: -chance([a])):
        if chance([*gone, one]) > THRESHOLDS.backward_chance:
            gone = (*gone, one)
    return gone
