"""Diagnosis of a vehicle model: fit, see where it fails, name what is missing, add it, judge it on unseen flights."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from flight import FlightLog, InputError, Progress, silent, within
from sysid.diagnosis import equation_text, told
from sysid.diagnosis.belief import Belief, belief, curve_is_there
from sysid.diagnosis.envelope import Envelope, flown
from sysid.diagnosis.evidence import load
from sysid.diagnosis.evidence.free_form import axes_of
from sysid.diagnosis.families import Family, families, family_of
from sysid.diagnosis.families import of_curve as families_of_curve
from sysid.diagnosis.findings import (
    SCHEMA_VERSION,
    Attempt,
    CandidateFinding,
    Outcome,
    OutsideFinding,
    Stair,
    Verdict,
)
from sysid.diagnosis.first_fit import first_fit
from sysid.diagnosis.search import Search, search
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.diagnosis.told import of_attempt, of_candidates, of_curve, of_forms
from sysid.estimator import verdict as fits
from sysid.estimator.fit_to_use import Cause, Chosen, likely_cause
from sysid.estimator.flights.clocks import gyro_is_early
from sysid.estimator.flights.flight_data import left_out
from sysid.estimator.options import Options
from sysid.estimator.predicts import Predicts
from sysid.estimator.prepare import prepare_all
from sysid.estimator.two_vehicles import of_two_vehicles
from sysid.estimator.validation.better import predicts
from sysid.estimator.validation.comparison import HORIZONS_S, Comparison, compare
from sysid.logs import kinds_of_motion, repeated
from sysid.logs.check import check_log
from sysid.logs.checks.payload import PAYLOAD, carries_payload
from vehicle import Vehicle

NODE_RATE_HZ = 100.0
"""States per second while searching; the vehicle's motion is slower than this by far."""

ONE_FLIGHT = (
    "hold another flight out (--held-out), for one alone is judged by its own stretches and hides what differs between "
    "flights"
)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of `diagnose`."""

    base: Vehicle
    """The vehicle as it was given."""
    vehicle: Vehicle
    """The fitted vehicle with what was added."""
    additions: tuple[str, ...]
    """Candidates added because they are missing, in order."""
    negligible: tuple[str, ...]
    """Candidates added because they show, at a size of no consequence: not named as missing."""
    proxies: tuple[str, ...]
    """Candidates added because they lower the held-out error, though a curve shows that another law is missing."""
    candidates: tuple[CandidateFinding, ...]
    """Every candidate, likeliest first."""
    outside: OutsideFinding | None
    """Something is missing that none of the known effects is."""
    attempts: tuple[Attempt, ...]
    staircase: tuple[Stair, ...]
    """Prediction errors of each model of the history, on held-out flights if there were any."""
    invisible: tuple[tuple[str, str], ...]
    """Effects that no flight of this kind can show, with the reason."""
    flights: tuple[str, ...]
    held_out: tuple[str, ...]
    findings: tuple[str, ...]
    """Of the identification: sentences the user should read."""
    search: Search
    """Fits and evidence behind it all, for plots."""
    payload_carried: tuple[bool, ...]
    """Of each flight, then of each that was held out, whether it carries the payload that was added; empty if none was,
    or if the logs say so themselves."""
    judged: Comparison
    """Every model of the staircase on the flights it was judged by, for plots."""
    input_verdict: fits.Verdict
    """Of the checks of all logs and of the first fit: what is against their use with this vehicle file."""
    predicts: Predicts
    """Of the last model, beside the vehicle as it was given."""
    cause: Cause | None
    """Why the fit is not to be used, by a trial; None where it may be, or where no trial tells."""

    @property
    def undecided(self) -> tuple[str, ...]:
        """Candidates of which one is still missing and the flights do not separate them, the likeliest first."""
        return self.search.undecided.between if self.search.undecided else ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """Candidates that would hardly show so much by chance, and that too little speaks for to name them.

        None that was refuted, and none that is too small to matter whatever it is.
        """
        open_ = [s for s in self.candidates if s.verdict is Verdict.INCONCLUSIVE and s.name not in self.search.refuted]
        shown = [s for s in open_ if s.significance < THRESHOLDS.doubtful or s.name in self.search.doubted]
        return tuple(s.name for s in shown if _of_consequence(s))

    @property
    def says_missing(self) -> bool:
        """Whether anything is said to be missing; else its probability is that of nothing being missing."""
        return bool(self.additions or self.undecided or self.proxies or self.outside is not None)

    @property
    def unsaid(self) -> tuple[CandidateFinding, ...]:
        """Candidates that may make a sentence wrong that says nothing of them.

        If nothing is said to be missing, all that may be of consequence. Else the doubts in channels where nothing that
        is stated shows: what is left in those of a stated effect may be of its form. No other candidates: of some
        thirty, one is below one in 200 by chance in every seventh sentence.
        """
        if not self.says_missing:
            return tuple(s for s in self.candidates if _of_consequence(s))
        stated = {*self.additions, *self.undecided, *self.proxies}
        channels = {c for s in self.candidates if s.name in stated for c in s.channels}
        if self.outside is not None:
            channels |= set(axes_of(self.outside.channel))
        doubts = [s for s in self.candidates if s.name in self.doubts and s.name not in stated]
        return tuple(s for s in doubts if not channels & set(s.channels))

    @property
    def envelope(self) -> Envelope:
        """How far the training flights went."""
        return flown(self.search.models[-1].fit.solution.point.states)

    @property
    def only_hovers(self) -> bool:
        """Whether no training flight does more than hover: then next to nothing could show."""
        return any(note.startswith(kinds_of_motion.HOVERING) for note in self.findings)

    @property
    def pose_may_be_late(self) -> bool:
        """Whether the clocks leave that open, so that nothing is sure that `pose_delay` would change."""
        return gyro_is_early(self.search.models[-1].fit.clocks)

    @property
    def verdict(self) -> str:
        """The whole diagnosis in a sentence or two."""
        parts = []
        if self.additions:
            lacking = [one for one in self.families if one.is_another_form]
            nearest = {name for one in lacking for name in one.names}
            names = [self._said(name) for name in self.additions if name not in nearest]
            parts.append(f"missing was {' and '.join((*names, *(one.lacking for one in lacking)))}")
        if self.undecided:
            one_family = {family_of(name) for name in self.undecided}
            what = f"{one_family.pop()} is missing, as " if len(one_family) == 1 else ""
            said = f"{' or '.join(self.undecided)}{'' if what else ' is missing'}"
            parts.append(f"{'besides, ' if parts else ''}{what}{said}: they are confounded in these flights")
        if self.outside is not None:
            o = self.outside
            physics = f", {self.family_of_curve.lacking}" if self.family_of_curve else ""
            parts.append(
                f"{'besides, ' if parts else ''}something is missing that no known effect is: "
                f"{o.channel} against {o.variable}{physics}"
            )
        if self.proxies:
            forms = " and ".join(candidate.name for candidate, _ in self.search.forms)
            left = f"what the catalogue's law of {forms} leaves" if forms else "something that no known effect is"
            of = " or ".join((*self.search.doubted, left)) if self.outside is None else "it"
            one = len(self.proxies) == 1
            helps = f"helps as a proxy for {of}, and is added" if one else f"help as proxies for {of}, and are added"
            parts.append(f"{' and '.join(self.proxies)} {helps}")
        unsaid = {s.name for s in self.unsaid}
        if doubts := [name for name in self.doubts if name in unsaid]:
            open_ = f"{' or '.join(doubts)} may be"
            alone = f"nothing is confirmed to be missing, but {open_}: these flights are inconclusive"
            parts.append(f"{open_} missing too, which is not confirmed" if parts else alone)
        if self.negligible:
            shows = f"{' and '.join(self.negligible)} {'shows' if len(self.negligible) == 1 else 'show'}"
            parts += [] if parts else ["nothing that matters is missing"]
            parts.append(f"{shows}, too small to matter")
        if self.search.too_short and self.says_missing:
            parts.append("the held-out flights are too short to confirm it")
        if self.pose_may_be_late:
            parts.append(
                "the gyro is early against the pose, but not all streams by the same time, so the pose may be late or "
                "time stamps wrong: read the clocks"
            )
        if self.leaves_too_much:
            parts.append("so much stays unexplained that these flights are inconclusive: read the findings")
        if self.input_verdict.against:
            unsure = "none of it is sure, for" if parts else "these flights are inconclusive, for"
            parts.append(
                f"{unsure} the logs contradict themselves or the vehicle file: {self.input_verdict.against[0]}"
            )
        said = "; ".join(parts) if parts else "nothing that these flights could show is missing"
        to_fly = ", ".join(kinds_of_motion.FLY.values())
        return f"{said}; they only hover, where little shows: fly {to_fly}" if self.only_hovers else said

    def _said(self, name: str) -> str:
        both = zip((*self.flights, *self.held_out), self.payload_carried, strict=False)
        loaded = [flight for flight, carries in both if carries]
        if name == PAYLOAD and loaded:
            return f"{name} (carried by {', '.join(loaded)} alone)"
        return name

    @property
    def families(self) -> tuple[Family, ...]:
        """What is missing by family, with the probability of each form."""
        most = THRESHOLDS.even_confidence if self.fit_verdict.against else THRESHOLDS.most_confidence
        named = [told.by_form(self.search, s) for s in self.candidates if s.name in self.additions]
        open_ = self.search.undecided
        if open_ is not None:
            apart = {family_of(name): name for name in reversed(open_.between)}  # the likeliest of each
            between = [(name, open_.probability(name)) for name in open_.between]
            named += [(name, dict(between)[name], between) for name in apart.values()]
        return families(named, self.search.another_form, most=most)

    @property
    def family_of_curve(self) -> Family | None:
        """Of what no known effect is: of which physics its law is, if that is likelier than not."""
        if self.outside is None:
            return None
        found = families_of_curve(self.outside.nearest, self.outside.confidence)
        sure = found is not None and found.probability > THRESHOLDS.even_confidence * self.outside.confidence
        return found if sure else None

    @property
    def leaves_too_much(self) -> bool:
        """Whether the last model is too far from the flights for anything to be excluded."""
        return self.search.models[-1].fit.leaves_too_much

    @property
    def fit_verdict(self) -> fits.Verdict:
        """Whether to use the numbers of the last model."""
        verdict = self.input_verdict.beside(self.search.models[-1].fit.verdict)
        return replace(verdict, predicts=self.predicts)

    @property
    def belief(self) -> Belief:
        """Probability that the whole sentence is right, and of what else may be true."""
        unsure = bool(self.fit_verdict.against) or bool(self.search.too_short) or self.pose_may_be_late
        unsure |= self.only_hovers
        unsure |= bool(self.proxies and self.search.doubted)  # for something unknown, or for one of these
        names = [s.confidence for s in self.candidates if s.verdict is Verdict.PRESENT]
        names += [one.known_form for one in self.families]
        if self.undecided:
            names.append(min(1.0, sum(s.confidence for s in self.candidates if s.name in self.undecided)))
        names.append(1.0 - max((s.confidence for s in self.unsaid), default=0.0))
        curve = self.outside.confidence if self.outside else None
        curve = self.family_of_curve.probability if self.family_of_curve else curve
        if self.proxies and curve is None and not self.search.forms:
            curve = curve_is_there(self.search.left_anywhere)  # said to be for something unknown; no curve is sure
        return belief(
            names,
            curve=curve,
            left=self.search.left,
            most=THRESHOLDS.even_confidence if unsure else THRESHOLDS.most_confidence,
        )

    @property
    def confidence(self) -> float:
        """Probability, within the flown envelope, that the sentence is right; if nothing is said, that nothing is."""
        return self.belief.as_stated

    def as_dict(self) -> dict[str, Any]:
        """The facts as plain JSON values, as `goshawk diagnose --json` prints them."""
        return {
            "schema": "goshawk-diagnosis",
            "version": SCHEMA_VERSION,
            "verdict": self.verdict,
            "confidence": self.confidence,
            "probabilities": self.belief.as_dict(),
            "envelope": self.envelope.as_dict(),
            "fit": self.fit_verdict.as_dict(),
            "flights": list(self.flights),
            "held_out": list(self.held_out),
            "base": {"vehicle": self.base.name, "effects": list(self.base.effects)},
            "candidates": [s.as_dict() for s in self.candidates],
            "families": [one.as_dict() for one in self.families],
            "additions": list(self.additions),
            "negligible": list(self.negligible),
            "proxies": list(self.proxies),
            "payload_carried": list(self.payload_carried) or None,
            "undecided": list(self.undecided),
            "attempts": [a.as_dict() for a in self.attempts],
            "outside": self.outside.as_dict() if self.outside else None,
            "outside_family": self.family_of_curve.as_dict() if self.family_of_curve else None,
            "equation": equation_text.as_dict(self.search.equation) if self.search.equation else None,
            "staircase": [s.as_dict() for s in self.staircase],
            "parameters": {
                name: {"value": p.value, "sigma": p.std, "unit": p.unit} for name, p in self.vehicle.parameters.items()
            },
            "invisible": dict(self.invisible),
            "findings": list(self.findings),
            "clocks": [asdict(c) for c in self.search.models[-1].fit.clocks],
        }


def _of_consequence(found: CandidateFinding) -> bool:
    """Whether its interval reaches a size of consequence.

    What a vehicle weighs shows in every hover, so of a load that is what matters.
    """
    return found.reaches(THRESHOLDS.matters if found.name == PAYLOAD else THRESHOLDS.least_size)


def while_searching(options: Options) -> Options:
    """How every model of a diagnosis is fitted, so that fits differ by their effects alone."""
    return replace(options, node_rate_hz=NODE_RATE_HZ)


def diagnose(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    *,
    held_out: Sequence[FlightLog] = (),
    auto: bool = False,
    options: Options | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Find what the model lacks.

    The vehicle is first fitted to the flights; every effect it lacks is then scored, the likeliest is fitted in full
    and kept only if flights that were not used agree. With `auto` this goes on until nothing significant is left.
    Disturbances are white unless the first fit is then not to be used; lasting ones take their place there.

    Args:
        logs: flights to learn from.
        held_out: flights only used to judge; without them stretches of the training flights are judged by the rest.
        auto: add all that is missing, not only the first.

    Raises:
        InputError: no flight, a log that cannot be used, flights that show too little or of two vehicles, or
            `options.free`.
    """
    names = [str(log.metadata.get("name", f"flight {i + 1}")) for i, log in enumerate((*logs, *held_out))]
    _validate(logs, held_out, options)
    shared = repeated.check((*logs, *held_out), names)
    input_verdict = fits.of_logs(check_log(log, vehicle) for log in (*logs, *held_out))
    options = while_searching(options or Options(gusts="white"))
    try:
        first, found = _searched(logs, vehicle, held_out, options, 8 if auto else 1, progress)
    except InputError as error:
        why = "".join(f"; {sentence}" for sentence in input_verdict.against[:1])
        raise InputError(f"{error}{why}") from error
    last = found.models[-1].fit
    if said := of_two_vehicles(logs, vehicle, last, first.options):
        raise InputError(said)
    unsure = bool(input_verdict.beside(last.verdict).against)
    models = {"as given": vehicle, "fitted": first.fit.vehicle}
    fits_of = dict(zip(_labels(found), (model.fit for model in found.models[1:]), strict=True))
    models |= {label: fit.vehicle for label, fit in fits_of.items()}
    carried = _carried(found, logs, held_out)
    noise = {label: fit.noise for label, fit in {"fitted": first.fit, **fits_of}.items()}
    judged = compare(carried[len(logs) :] or carried[: len(logs)], models, first.options, noise=noise)
    on = "held-out flights" if held_out else "the training flights"
    better = predicts(judged, "as given", list(models)[-1], on)
    refused = unsure and not (input_verdict.misread or better.better)
    cause = likely_cause(logs, last.vehicle, replace(first, fit=last)) if refused else None
    progress("diagnose", 1.0)
    return Diagnosis(
        base=vehicle,
        vehicle=last.vehicle,
        additions=tuple(s.name for s in found.added),
        negligible=tuple(s.name for s in found.negligible),
        proxies=tuple(s.name for s in found.proxies),
        candidates=of_candidates(found, unsure=unsure),
        outside=of_curve(found.drawn_at, found.outside, unsure=unsure) if found.outside else None,
        attempts=tuple(of_attempt(t, unsure=unsure) for t in found.trials),
        staircase=_staircase(judged, models),
        invisible=found.models[0].candidate_set.invisible,
        flights=tuple(names[: len(logs)]),
        held_out=tuple(names[len(logs) :]),
        findings=kinds_of_motion.notes(logs, vehicle)
        + first.said
        + ((found.too_short,) if found.too_short else ())
        + of_forms(found)
        + last.findings
        + left_out(found.unseen)
        + judged.not_converged
        + shared
        + ((ONE_FLIGHT,) if len(logs) + len(held_out) == 1 else ()),
        search=found,
        payload_carried=_newly_told((*logs, *held_out), carried),
        judged=judged,
        input_verdict=input_verdict,
        predicts=better,
        cause=cause,
    )


def _validate(logs: Sequence[FlightLog], held_out: Sequence[FlightLog], options: Options | None) -> None:
    if options is not None and options.free is not None:
        raise InputError(
            "a diagnosis estimates what each candidate adds, so --free (options.free) is not possible here; keep "
            "parameters as they are with --hold (options.held)"
        )
    if any(log is other for log in held_out for other in logs):
        raise InputError("a flight is given both for fitting and as held out; give each flight for one of the two")


def _searched(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    held_out: Sequence[FlightLog],
    options: Options,
    most: int,
    progress: Progress,
) -> tuple[Chosen, Search]:
    """The fit of the vehicle as it is, and the search from there."""
    first = first_fit(logs, vehicle, options, within(progress, "diagnose", 0.0, 0.1))
    progress("diagnose", 0.15)
    unseen = prepare_all(held_out, first.options, [vehicle])
    return first, search(logs, first.fit, unseen, first.options, most=most, progress=progress)


def _carried(found: Search, logs: Sequence[FlightLog], held_out: Sequence[FlightLog]) -> list[FlightLog]:
    """All logs, saying whether they carry the payload if one was added."""
    if PAYLOAD not in {s.name for s in (*found.added, *found.negligible)}:
        return [*logs, *held_out]
    return [*load.marked(logs, found.models[-1].flights), *load.marked(held_out, found.unseen)]


def _newly_told(before: Sequence[FlightLog], after: Sequence[FlightLog]) -> tuple[bool, ...]:
    """What each log carries; empty if that was no news."""
    told = [(carries_payload(old), carries_payload(new)) for old, new in zip(before, after, strict=True)]
    return () if all(old == new for old, new in told) else tuple(new is not False for _, new in told)


def _staircase(judged: Comparison, models: Iterable[str]) -> tuple[Stair, ...]:
    """Args: models: their names, the first first."""
    return tuple(
        Stair(name, {f"{h:g} s": e for h, e in zip(HORIZONS_S, judged.errors[name]["position"], strict=True)})
        for name in models
    )


def _labels(found: Search) -> list[str]:
    signs = {Outcome.ADDED: "+ {}", Outcome.REMOVED: "- {}", Outcome.USEFUL_PROXY: "+ {} (proxy)"}
    return [signs[t.outcome].format(t.candidate.name) for t in found.trials if t.outcome in signs]
