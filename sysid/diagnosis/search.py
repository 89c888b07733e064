"""Forward and backward: add the candidate that explains most, keep it if unseen flights agree, look again."""

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flight import FlightLog, Progress, silent
from sysid.diagnosis import effect_sizes
from sysid.diagnosis.belief import supported
from sysid.diagnosis.equation import Equation, equation
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.confirm import CostReduction, Judge
from sysid.diagnosis.evidence.evidence import BLOCK_S, block_edges
from sysid.diagnosis.evidence.weigh import Fitted, Scales
from sysid.diagnosis.examined import (
    Form,
    Model,
    Outside,
    alike,
    as_good_as,
    examine,
    forms_and_curve,
    left_unexplained,
    of_another_form,
    stands,
)
from sysid.diagnosis.exchange import Exchange, exchange
from sysid.diagnosis.families import family_of
from sysid.diagnosis.findings import JudgedBy, Outcome
from sysid.diagnosis.fitting import candidates_fitted, fitted_once, refit_without, superfluous, with_it
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.diagnosis.trial import Trial
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.options import Options
from sysid.estimator.result import Identification

logger = logging.getLogger(__name__)

NONE_HELD_OUT, TOO_SHORT = "no flight was held out", "the held-out flights are too short"


def _weighed(model: Model, tried: Sequence[Fitted], unseen: Judge | str) -> tuple[list[Fitted], Model]:
    """Candidates by their weight, the heaviest first, and the model that this one makes.

    Forms of one family that the training flights hardly distinguish are told by the held-out ones too.
    """
    first = max(tried, key=lambda c: c.reduction.total)
    if model.tried.scales is None:
        model.tried.scales = Scales(first, model.judge, with_it(model, first).evidence)
    scales = model.tried.scales
    ordered = sorted(tried, key=scales.weight, reverse=True)
    if not isinstance(unseen, str):
        _compete(scales, ordered, unseen)
        ordered.sort(key=scales.weight, reverse=True)
    for c in ordered:
        logger.info(
            "%s: log odds %.1f, dispersion %.1f", c.candidate.name, scales.weight(c), scales.dispersion(c.candidate)
        )
    return ordered, with_it(model, ordered[0])


def _compete(scales: Scales, ordered: Sequence[Fitted], unseen: Judge) -> None:
    """Let forms of the best one's family predict the held-out flights, where its lead is no clear one."""
    best, *others = ordered
    own = family_of(best.candidate.name)
    for rival in others:
        close = scales.weight(best) - scales.weight(rival) < THRESHOLDS.contested
        if close and family_of(rival.candidate.name) == own and rival.candidate.name not in scales.held_out:
            unseen.set_noise(best.fit.noise)
            reduction = unseen.reduction(best.fit.vehicle, rival.fit.vehicle)
            scales.held_out[rival.candidate.name] = reduction.total / scales.dispersion(rival.candidate)
            logger.info("%s against %s, held out: %.1f", rival.candidate.name, best.candidate.name, reduction.total)


@dataclass(frozen=True, slots=True)
class Search:
    """The whole search."""

    models: tuple[Model, ...]
    """The base, then after each change."""
    trials: tuple[Trial, ...]
    added: tuple[Candidate, ...]
    """Named effects."""
    negligible: tuple[Candidate, ...]
    """Part of the last model as well, and not named: confirmed, at a size of no consequence."""
    proxies: tuple[Candidate, ...]
    """Part of the last model because they lower the held-out error, though a curve explains more."""
    outside: Outside | None
    """None also where the best curve does not clearly outdo a candidate that nothing refuted."""
    forms: tuple[Form, ...]
    """Named effects whose laws are not exactly the catalogue's, each with the curve that shows it."""
    doubted: tuple[str, ...]
    """Candidates that the best curve does not clearly outdo, and that nothing refuted."""
    refuted: frozenset[str]
    """Candidates that something speaks against."""
    undecided: Trial | None
    """One of its confounded effects is missing from the last model."""
    drawn_at: Model
    """Where `outside` was looked for: the last model before any proxy, with the likelier one in it where two could not
    be separated."""
    unseen: tuple[Flight, ...]
    """Held-out flights, with what they were found to carry."""
    left: float
    """Log odds of the best curve at `drawn_at` that is of no named effect's form, stated or not."""
    left_anywhere: float
    """The same of any form."""
    another_form: Mapping[str, float]
    """By named effect, probability that its law is of a form that the catalogue lacks."""
    too_short: str
    """In words, that the held-out flights are too short to judge by; empty if they are not, or none were given."""
    equation: Equation | None
    """The simplest law of what follows a variable and is no known effect, or of what a named effect's law leaves."""


@dataclass(slots=True)
class _History:
    """How far the search has come."""

    models: list[Model]
    trials: list[Trial] = field(default_factory=list)
    added: list[Candidate] = field(default_factory=list)
    removed: set[str] = field(default_factory=set)
    undecided: tuple[Trial, Model] | None = None
    """The first attempt since the last addition that could not tell between confounded effects, and its model."""

    @property
    def mattering(self) -> tuple[Candidate, ...]:
        """Additions of a size that matters."""
        return tuple(candidate for candidate in self.added if effect_sizes.matters(self.models[-1].fit, candidate))

    def add(self, trial: Trial, model: Model) -> None:
        self.trials.append(trial)
        self.models.append(model)
        self.added.append(trial.candidate)
        self.undecided = None

    def remove(self, why: Trial, without: Model) -> None:
        """Args: why: names the addition that goes."""
        self.trials.append(why)
        self.models.append(without)
        self.added.remove(why.candidate)
        self.removed.add(why.candidate.name)


def search(
    logs: Sequence[FlightLog],
    base: Identification,
    held_out: Sequence[Flight],
    options: Options,
    *,
    most: int,
    progress: Progress = silent,
) -> Search:
    """Forward with a backward look after each addition, at most `most` additions."""
    too_short = short(held_out)
    judge = Judge(held_out, base.noise, clock=base.clock) if held_out and not too_short else None
    unseen = judge or (TOO_SHORT if too_short else NONE_HELD_OUT)
    found = _History([examine(base)])
    _add_what_is_missing(logs, found, unseen, options, most=most, progress=progress)
    while most > 1 and _simplified(logs, found, unseen, options):
        _add_what_is_missing(logs, found, unseen, options, most=most, progress=progress)
    while found.undecided is None and len(found.mattering) < most and _take_out_small(logs, found, options):
        pass
    trial, at = found.undecided or (None, found.models[-1])
    named = (*found.added, *((trial.candidate,) if trial else ()))
    forms, outside = _forms_and_curve(at, named, found.trials) if len(found.mattering) < most else ([], None)
    refuted = frozenset((*found.removed, *(t.candidate.name for t in found.trials if t.refuted)))
    doubted = () if outside is None else tuple(s.name for s in as_good_as(outside, at) if s.name not in refuted)
    stated = None if doubted or outside is None else _as_sure(outside, found.trials)
    helpers = _useful_proxies(logs, found.models[-1], found.trials, unseen, options)
    return Search(
        models=(*found.models, *(model for _, model in helpers)),
        trials=(*found.trials, *(helper for helper, _ in helpers)),
        added=found.mattering,
        negligible=tuple(candidate for candidate in found.added if candidate not in found.mattering),
        proxies=tuple(helper.candidate for helper, _ in helpers),
        outside=stated,
        forms=tuple(forms),
        doubted=doubted,
        refuted=refuted,
        undecided=trial,
        drawn_at=at,
        unseen=judge.flights if judge else tuple(held_out),
        left=left_unexplained(at, _explained(named, found.trials)),
        left_anywhere=left_unexplained(at, ()),
        another_form=of_another_form(at, _explained(named, found.trials)),
        equation=_equation(at, stated, forms),
        too_short=too_short,
    )


def _equation(at: Model, stated: Outside | None, forms: Sequence[Form]) -> Equation | None:
    """A law of the curve that is stated; without one, of what the law of a named effect leaves."""
    if stated is not None:
        return equation(at, stated)
    found = (equation(at, curve, beside=candidate.name) for candidate, curve in forms)
    return next((one for one in found if one is not None), None)


def _add_what_is_missing(
    logs: Sequence[FlightLog], found: _History, unseen: Judge | str, options: Options, *, most: int, progress: Progress
) -> None:
    """Try the most likely candidate until none is left, and take out what each addition makes unnecessary."""
    refused = set(found.removed)
    while len(found.mattering) < most:
        trial, model = _next(logs, found.models[-1], unseen, options, refused)
        if trial is None or model is None:
            break
        if unseen == TOO_SHORT:
            trial = replace(trial, confidence=min(trial.confidence, THRESHOLDS.unjudged_confidence))
        progress("diagnose", 1.0 - 0.7 ** (len(found.trials) + 1))
        if trial.outcome is not Outcome.ADDED:
            open_ = trial.outcome is Outcome.UNDECIDED
            refused.update(trial.between if open_ else [trial.candidate.name])
            found.undecided = (trial, model) if open_ and found.undecided is None else found.undecided
            found.trials.append(trial)
            continue
        found.add(trial, model)
        refused = set(found.removed)  # beside a wrong model was no fair hearing
        while (unneeded := superfluous(logs, found.models[-1], found.added[:-1], options)) is not None:
            dropped, without = unneeded
            found.remove(replace(trial, candidate=dropped, outcome=Outcome.REMOVED), without)
            refused.add(dropped.name)


def _simplified(logs: Sequence[FlightLog], found: _History, unseen: Judge | str, options: Options) -> bool:
    """Put one candidate in place of several additions, if one explains what they do; whether one was."""
    exchanges = exchange(logs, found.models[-1], found.mattering, options, found.removed)
    for one in exchanges:
        trial = _of_exchange(found, one, unseen, [other for other in exchanges if other is not one])
        logger.info("%s: %s", one.candidate.name, trial.sentence)
        if trial.outcome is Outcome.ADDED:
            found.add(trial, one.steps[0])
            for dropped, without in zip(one.dropped, one.steps[1:], strict=True):
                gone = replace(trial, candidate=dropped, outcome=Outcome.REMOVED, in_place_of=())
                found.remove(gone, without)
            return True
    return False


def _of_exchange(found: _History, one: Exchange, unseen: Judge | str, others: Sequence[Exchange]) -> Trial:
    """How an exchange is judged: the simpler model must not predict flights that were not used worse.

    That it is simpler counts as a clear lead, and it must stay likelier than the model before. Its training fall is
    that of all the additions it takes the place of, for it explains what they did.
    """
    before, after = found.models[-1], one.steps[-1]
    added = {t.candidate.name: t.training.by_block for t in found.trials if t.outcome is Outcome.ADDED}
    fell = [added[dropped.name] for dropped in one.dropped]
    most = THRESHOLDS.most_confidence
    if isinstance(unseen, str):
        judged, by = one.reduction, JudgedBy.TRAINING
        most = THRESHOLDS.unjudged_confidence
    else:
        unseen.set_noise(before.fit.noise)
        judged, by = unseen.reduction(before.fit.vehicle, after.fit.vehicle), JudgedBy.HELD_OUT
    lead = judged.total / one.dispersion + THRESHOLDS.clear_lead
    better = lead > 0.0 and judged.total >= -THRESHOLDS.contradicting_sigmas * judged.sigma  # not so if one is NaN
    odds = {other.candidate.name: float(np.exp(min(0.0, other.weight - one.weight))) for other in others}
    sure = most / (1.0 + np.exp(-lead) + sum(odds.values())) if better else 0.0
    return Trial(
        candidate=one.candidate,
        outcome=Outcome.ADDED if better else Outcome.NOT_CONFIRMED,
        training=CostReduction(np.sum([*fell, one.reduction.by_block], axis=0)),
        held_out=judged,
        judged_by=by,
        why="" if by is JudgedBy.HELD_OUT else str(unseen),
        confirmed=better,
        confidence=float(sure),
        rivals=tuple((name, sure * p) for name, p in odds.items() if p > 0.0),
        proxy_for=None,
        fit=one.fitted.fit,
        in_place_of=tuple(dropped.name for dropped in one.dropped),
    )


def _take_out_small(logs: Sequence[FlightLog], found: _History, options: Options) -> bool:
    """Take out an addition too small to matter beside a curve; whether one went."""
    curve = _forms_and_curve(found.models[-1], found.added, found.trials)[1]
    if (small := _small_beside(curve, found.models[-1], found.added)) is None:
        return False
    without = refit_without(logs, found.models[-1], small, options)
    others = [candidate for candidate in found.added if candidate != small]
    if without is None or _forms_and_curve(without, others, found.trials)[1] is None:
        return False  # the curve needs it: neither would be left
    last = next(t for t in reversed(found.trials) if t.candidate == small)
    found.remove(replace(last, outcome=Outcome.REMOVED, proxy_for=curve), without)
    return True


def _useful_proxies(
    logs: Sequence[FlightLog], model: Model, trials: Sequence[Trial], unseen: Judge | str, options: Options
) -> list[tuple[Trial, Model]]:
    """Names that a curve outdoes, or that went as too small beside one, while each still lowers the held-out error.

    They come last, so that they take nothing from a right name, and the curve is drawn without them; the one that
    explained most comes first. With models.
    """
    found: list[tuple[Trial, Model]] = []
    outdone = {t.candidate.name: t for t in trials if t.proxy_for is not None and t.confirmed}
    for trial in sorted(outdone.values(), key=lambda t: -t.training.total):
        if trial.candidate.name not in model.scores or trial.candidate.between_flights:
            continue
        fitted = fitted_once(logs, model, trial.candidate, options)
        if fitted is None or not effect_sizes.matters(fitted.fit, trial.candidate):
            continue
        reduction, confirmed, why = _confirmed(model, fitted, unseen)
        if not confirmed:
            continue
        judged_by = JudgedBy.LEFT_OUT if why else JudgedBy.HELD_OUT
        model = examine(fitted.fit)
        how = {"outcome": Outcome.USEFUL_PROXY, "training": fitted.reduction, "held_out": reduction}
        found.append((replace(trial, **how, judged_by=judged_by, why=why, fit=fitted.fit), model))
    return found


def short(held_out: Sequence[Flight]) -> str:
    """Why held-out flights cannot judge, in words; empty if they can, or if there are none."""
    blocks = sum(len(block_edges(f.time_s)) for f in held_out)
    if not held_out or blocks >= THRESHOLDS.least_blocks:
        return ""
    length_s = sum(float(f.time_s[-1] - f.time_s[0]) for f in held_out)
    return (
        f"the held-out flights {', '.join(dict.fromkeys(f.name for f in held_out))} last {length_s:.1f} s, too little "
        f"to judge by: hold out {THRESHOLDS.least_blocks * BLOCK_S:.0f} s or more, best a flight of another kind"
    )


def _next(
    logs: Sequence[FlightLog], model: Model, unseen: Judge | str, options: Options, refused: Collection[str]
) -> tuple[Trial | None, Model | None]:
    """Try the most likely candidate; also the model with it.

    Args:
        unseen: who judges, or in words why nobody does.
    """
    tried = candidates_fitted(logs, model, options, refused)
    if not tried:
        return None, None
    (best, *others), after = _weighed(model, tried, unseen)
    odds = {c.candidate.name: _odds(model, best, c) for c in (*others, *model.tried.undecided)}
    share = 1.0 / (1.0 + sum(odds.values()))
    outdone_by = stands(after, best.candidate, refused)
    reduction, confirmed, why = _confirmed(model, best, unseen)
    there = supported(reduction.total, model.scores[best.candidate.name].dispersion)
    vanishes = not effect_sizes.matters(best.fit, best.candidate) and not effect_sizes.shows(best.fit, best.candidate)
    confirmed &= not vanishes
    outcome = Outcome.PROXY if outdone_by else Outcome.ADDED if confirmed else Outcome.NOT_CONFIRMED
    as_likely = float(np.exp(-THRESHOLDS.clear_lead))
    level = [c for c in tried if c is best or odds[c.candidate.name] > as_likely]
    confounded = max(odds.values(), default=0.0) > as_likely and any(
        effect_sizes.matters(c.fit, c.candidate) for c in level
    )
    if outcome is Outcome.ADDED and confounded:
        outcome = Outcome.UNDECIDED
        model.tried.undecided += level
    sure = THRESHOLDS.most_confidence * share * there
    trial = Trial(
        candidate=best.candidate,
        outcome=outcome,
        training=best.reduction,
        held_out=reduction,
        judged_by=JudgedBy.LEFT_OUT if why else JudgedBy.HELD_OUT,
        why=why,
        confirmed=confirmed,
        confidence=sure,
        rivals=tuple((name, sure * p) for name, p in odds.items() if p > 0.0),
        proxy_for=outdone_by,
        fit=best.fit,
        vanishes=vanishes,
    )
    logger.info(
        "%s: %s, training %.1f, held out %.1f +- %.1f",
        best.candidate.name,
        outcome,
        best.reduction.total,
        reduction.total,
        reduction.sigma,
    )
    return trial, after


def _odds(model: Model, best: Fitted, other: Fitted) -> float:
    """Odds against the best of one that competes with it for the same evidence; else 0, for both may be missing."""
    scales = model.tried.scales
    if scales is None or not alike(model, best.candidate, other.candidate):
        return 0.0
    return float(np.exp(scales.weight(other) - scales.weight(best)))


def _confirmed(model: Model, best: Fitted, unseen: Judge | str) -> tuple[CostReduction, bool, str]:
    """Held-out flights if they can tell; else stretches of the training flights, each judged by the rest, and why.

    The fall of the cost of unseen flights is the logarithm of the odds between the two models, up to the dispersion.
    """
    scored = model.scores[best.candidate.name]
    least = THRESHOLDS.confirming_odds * scored.dispersion
    if isinstance(unseen, str):
        why = unseen
    else:
        before, after = model.fit.vehicle, best.fit.vehicle
        unseen.set_noise(model.fit.noise)
        if best.candidate.between_flights:
            least += np.log(2.0) * unseen.decide_load(after) * scored.dispersion
        reduction = unseen.reduction(before, after)
        could = best.reduction.total * unseen.strength(before, after) / max(model.judge.strength(before, after), 1e-12)
        if reduction.total < 0.0:  # what the model lacks counts as noise in it: the other's noise is asked too
            unseen.set_noise(best.fit.noise)
            reduction = max(reduction, unseen.reduction(before, after), key=lambda f: f.total)
        against = reduction.total < -THRESHOLDS.contradicting_sigmas * reduction.sigma
        could_tell = (
            could > THRESHOLDS.could_confirm * max(reduction.sigma, least) and scored.log_odds < THRESHOLDS.certain_odds
        )
        if reduction.total > least or against or could_tell:
            return reduction, reduction.total > least, ""
        fell = f"{reduction.total:.0f} ± {reduction.sigma:.0f}, of {could:.0f} at best"
        why = f"the cost of held-out flights fell by {fell}: inconclusive"
    return (
        CostReduction(scored.unseen_by_block),
        scored.log_odds > THRESHOLDS.clear_odds and len(scored.unseen_by_block) >= THRESHOLDS.least_blocks,
        why,
    )


def _forms_and_curve(
    model: Model, named: Sequence[Candidate], trials: Sequence[Trial]
) -> tuple[list[Form], Outside | None]:
    return forms_and_curve(model, _explained(named, trials))


def _explained(named: Sequence[Candidate], trials: Sequence[Trial]) -> list[tuple[Candidate, float]]:
    """Effects, each with the fall of the cost as it was added."""
    fell = {t.candidate.name: t.training.total for t in trials}
    return [(candidate, fell[candidate.name]) for candidate in named]


def _small_beside(curve: Outside | None, model: Model, added: Sequence[Candidate]) -> Candidate | None:
    """An addition whose whole interval is too small to matter, beside a curve; None without either.

    The law that the curve is of acts in other channels too, and differently on each flight. A known effect fits a small
    part of that, and flights of the same kinds confirm it.
    """
    if curve is None:
        return None
    return next((candidate for candidate in added if not effect_sizes.may_matter(model.fit, candidate)), None)


def _as_sure(curve: Outside, trials: Sequence[Trial]) -> Outside:
    """The curve, with even odds at most if a name went for another one: what that name explained changed the curve."""
    gone_for = [t.proxy_for for t in trials if t.outcome is Outcome.REMOVED and t.proxy_for is not None]
    if all((c.channel, c.variable) == (curve.channel, curve.variable) for c in gone_for):
        return curve
    return replace(curve, confidence=min(curve.confidence, THRESHOLDS.even_confidence))
