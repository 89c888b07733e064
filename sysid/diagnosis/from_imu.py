"""Diagnosis of flights without a pose: which fault gyro, accelerometer and commands show.

Only what the IMU feels is tried: a weak or bent rotor, a centre of mass beside the hubs, uneven propellers, turning
masses.
What needs the velocity (drag, inflow, flapping) is not tried, and named.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flight import FlightLog, InputError, Progress, silent, within
from sysid.diagnosis import effect_sizes
from sysid.diagnosis.decision import Case, decide, sentence
from sysid.diagnosis.evidence import candidates, rotor_line
from sysid.diagnosis.evidence.candidates import Candidate, CandidateSet, base_names, candidate_set
from sysid.diagnosis.evidence.evidence import Blocks
from sysid.diagnosis.evidence.score import Score, score
from sysid.diagnosis.findings import Size, Verdict
from sysid.diagnosis.fitting import holding_others
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator import from_imu
from sysid.estimator.flights import clocks
from sysid.estimator.flights.clocks import Clock
from sysid.estimator.motors import motor
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare_all
from sysid.estimator.result import Identification
from sysid.estimator.verdict import Use
from sysid.estimator.without_pose.fit import block_scores, concentrated_cost
from sysid.estimator.without_pose.sensing import shown_at_rest
from vehicle import Vehicle, effects

logger = logging.getLogger(__name__)

SCHEMA, SCHEMA_VERSION = "goshawk-diagnosis-imu", 1
"""Of `ImuDiagnosis.as_dict`."""
BLOCK_S = 0.25
"""Stretches of time that are independent: the noise model has whitened all that lasts less than a tenth of a second."""
MOST = 4
"""Faults that are named at most."""
WEAK, UNEQUAL = "weak_rotor", "unequal_motors"
"""One rotor that gives less thrust; every rotor with a factor of its own."""
NEEDS_VELOCITY = "it depends on air speed or height, which no IMU measures; record a pose"
THRUST_LAW = "it differs from the fitted thrust curve by air speed, which no IMU measures; record a pose"


@dataclass(frozen=True, slots=True)
class ImuFinding:
    """What gyro and accelerometer say about one candidate."""

    name: str
    verdict: Verdict
    reason: str
    sizes: tuple[Size, ...]
    significance: float
    """Probability that chance alone would explain as much."""
    confidence: float
    """Probability that it is missing; of one that was added, that this is the right name."""

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "verdict": str(self.verdict),
            "reason": self.reason,
            "sizes": {s.parameter: s.as_dict() for s in self.sizes},
            "evidence": {"chance": self.significance},
            "confidence": self.confidence,
        }


@dataclass(frozen=True, slots=True)
class ImuDiagnosis:
    """Result of `diagnose`."""

    base: Vehicle
    """The vehicle as it was given."""
    fit: Identification
    """Of the last model, with what was added."""
    candidates: tuple[ImuFinding, ...]
    """Every candidate that shows in such flights, likeliest first."""
    undecided: tuple[str, ...]
    """Candidates of which one is missing and the flights do not separate them, the likeliest first."""
    late_gyro: Clock | None
    """The accelerometer's clock, where the gyro is surely behind it: a low-pass of its own, or late samples."""
    bent: rotor_line.Line | None
    """The rotor whose vibration is several times every other's."""
    invisible: tuple[tuple[str, str], ...]
    """Effects that no flight of this kind can show, with the reason."""
    flights: tuple[str, ...]

    @property
    def vehicle(self) -> Vehicle:
        return self.fit.vehicle

    @property
    def named(self) -> tuple[ImuFinding, ...]:
        """What is missing."""
        return tuple(one for one in self.candidates if one.verdict is Verdict.PRESENT)

    @property
    def additions(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.named)

    @property
    def verdict(self) -> str:
        """The whole diagnosis in a sentence or two."""
        parts = []
        if self.named:
            parts.append(f"missing was {' and '.join(self._said(one.name) for one in self.named)}")
        if self.undecided:
            parts.append(f"{' or '.join(self.undecided)} is missing: they are confounded in these flights")
        if self.late_gyro is not None:
            ms, std = -1e3 * self.late_gyro.delay_s, 1e3 * self.late_gyro.std_robust
            parts.append(f"the gyro is {ms:.1f} ± {std:.2g} ms behind the accelerometer")
        if self.bent is not None:
            parts.append(self.bent.sentence)
        if self.fit.verdict.use is Use.REJECTED:
            parts.append(f"none of it is sure, for the fit is {self.fit.verdict.sentence}")
        return "; ".join(parts) if parts else "nothing that an IMU could show in these flights is missing"

    def _said(self, name: str) -> str:
        if name != UNEQUAL:
            return name
        factor = np.array([1.0 - self.vehicle.value(f"{WEAK}.loss_{i}") for i in range(self.vehicle.rotors)])
        share = ", ".join(f"{s:+.1%}" for s in factor / factor.mean() - 1.0)
        return f"unequal motors (thrust of rotors 0 to {len(factor) - 1} against their mean: {share})"

    @property
    def confidence(self) -> float:
        """Probability that the sentence is right; if nothing is said, that nothing an IMU could show is missing."""
        sure = [one.confidence for one in self.named]
        if self.undecided:
            sure.append(sum(one.confidence for one in self.candidates if one.name in self.undecided))
        if not sure:
            sure = [1.0 - max((one.confidence for one in self.candidates), default=0.0)]
        most = THRESHOLDS.even_confidence if self.fit.verdict.against else THRESHOLDS.most_confidence
        return float(min(most, np.prod(sure)))

    def as_dict(self) -> dict[str, Any]:
        """The facts as plain JSON values."""
        late = self.late_gyro
        return {
            "schema": SCHEMA,
            "version": SCHEMA_VERSION,
            "verdict": self.verdict,
            "confidence": self.confidence,
            "fit": self.fit.verdict.as_dict(),
            "flights": list(self.flights),
            "base": {"vehicle": self.base.name, "effects": list(self.base.effects)},
            "candidates": [one.as_dict() for one in self.candidates],
            "additions": list(self.additions),
            "undecided": list(self.undecided),
            "gyro_late_s": None if late is None else {"value": -late.delay_s, "sigma": late.std_robust},
            "bent_rotor": None if self.bent is None else {"rotor": self.bent.rotor, "rms_m_s2": self.bent.rms_m_s2},
            "parameters": {
                name: {"value": p.value, "sigma": p.std, "unit": p.unit} for name, p in self.vehicle.parameters.items()
            },
            "invisible": dict(self.invisible),
            "findings": list(self.fit.findings),
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """A fitted model, and what every candidate would explain beside it."""

    fit: Identification
    all: CandidateSet
    scores: Mapping[str, Score]
    """Of the candidates that show at all, by name."""

    def candidates(self) -> list[Candidate]:
        return [one for one in (*self.all.candidates, *_unequal(self.all)) if one.name in self.scores]


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A candidate fitted in full."""

    candidate: Candidate
    fit: Identification
    odds: float
    """Log odds of the flights for it, disturbances that the noise model does not hold allowed for."""


def diagnose(
    logs: Sequence[FlightLog], vehicle: Vehicle, *, options: Options | None = None, progress: Progress = silent
) -> ImuDiagnosis:
    """Name the faults that flights without a pose show.

    Raises:
        InputError: no flight, one that has a pose, flights that show too little, or `options.free`.
    """
    options = options or Options()
    if options.free is not None:
        raise InputError("a diagnosis estimates what each candidate adds: use --hold in place of --free")
    if not logs:
        raise InputError("no flight was given; a diagnosis needs at least one log")
    flights = prepare_all(logs, options, [vehicle])
    if with_pose := [f.name for f in flights if f.has_pose]:
        raise InputError(f"{with_pose[0]} has a pose and others have none: diagnose those with a pose by themselves")
    first = within(progress, "diagnose", 0.0, 0.4)
    model = from_imu.identify(flights, vehicle, options, vehicle, first, effects=(from_imu.AFFINE,))
    looked, added, undecided = _look(model), list[_Trial](), list[_Trial]()
    base_look = looked
    while len(added) < MOST:
        progress("diagnose", 0.4 + 0.15 * len(added))
        trials = _trials(looked, options, [t.candidate for t in added])
        if not trials:
            break
        if len(close := [t for t in trials if trials[0].odds - t.odds < THRESHOLDS.clear_lead]) > 1:
            undecided = close
            break
        added = [*(t for t in added if effect_sizes.shows(trials[0].fit, t.candidate)), trials[0]]
        looked = _look(trials[0].fit)
    bent, unseen = rotor_line.find(logs, looked.fit)
    progress("diagnose", 1.0)
    names = tuple(str(log.metadata.get("name", f"flight {i + 1}")) for i, log in enumerate(logs))
    mute = [s for s in base_look.all.candidates if s.name not in base_look.scores]
    reasons = [(s.name, THRUST_LAW if effects.find(s.effect).instead_of else NEEDS_VELOCITY) for s in mute]
    found = (*(_named(t, base_look, looked.fit) for t in added), *_others(looked, added, undecided))
    return ImuDiagnosis(
        base=vehicle,
        fit=looked.fit,
        candidates=tuple(sorted(found, key=lambda one: (one.verdict is not Verdict.PRESENT, -one.confidence))),
        undecided=tuple(t.candidate.name for t in undecided),
        late_gyro=_late_gyro(model.clocks),
        bent=bent,
        invisible=(*base_look.all.invisible, *reasons, *([("bent_rotor", unseen)] if unseen else [])),
        flights=names,
    )


def _look(fit: Identification) -> _Look:
    """Linearise where the model stands, with every candidate at zero."""
    found = candidate_set(fit.vehicle, fit.flights)
    own = base_names(fit.unknowns.model, found.vehicle)
    columns = [name for one in found.candidates for name in one.columns if name not in own]
    unknowns = replace(fit.unknowns, model=(*own, *columns))
    flights = [from_imu.with_delays(flight) for flight in fit.flights]
    point = replace(fit.solution.point, vehicle=found.vehicle, states=())
    parts = block_scores(flights, point, unknowns, BLOCK_S)
    blocks = Blocks(np.stack([pull for _, pull in parts]), np.stack([information for information, _ in parts]))
    seen = np.einsum("bii->i", blocks.information)
    place = {name: i for i, name in enumerate(unknowns.names)}
    given = np.array([i for name, i in place.items() if name not in columns])
    scores = {}
    of_motion = tuple(name for name in columns if name not in motor.parameters(found.vehicle))
    felt = {*shown_at_rest(fit.flights[0], found.vehicle, of_motion)} | ({*columns} - {*of_motion})
    for one in (*found.candidates, *_unequal(found)):
        tested = np.array([place[name] for name in one.columns])
        if (seen[tested] > 0.0).all() and felt.issuperset(one.columns) and not effects.find(one.effect).instead_of:
            scores[one.name] = score(blocks, given, tested, np.array(one.one_sided))
    return _Look(fit, found, scores)


def _unequal(found: CandidateSet) -> list[Candidate]:
    """Every rotor with a factor of its own, against the first's: what they have in common is the thrust coefficient."""
    weak = [one for one in found.candidates if one.effect == WEAK]
    if not weak:
        return []
    names, usual = [one.parameters[0] for one in weak[1:]], [one.usual[0] for one in weak[1:]]
    free = (False,) * len(names)
    return [replace(weak[0], name=UNEQUAL, parameters=tuple(names), one_sided=free, usual=tuple(usual))]


def _trials(looked: _Look, options: Options, added: Sequence[Candidate]) -> list[_Trial]:
    """The most significant candidates, each fitted in full, the likeliest first."""
    by_gain = sorted(looked.candidates(), key=lambda one: -looked.scores[one.name].gain_unseen)
    found = [one for one in by_gain if _is_significant(looked.scores[one.name])]
    if not found:
        return []
    least = THRESHOLDS.rival_share * looked.scores[found[0].name].gain_unseen
    rivals = [one for one in by_gain if looked.scores[one.name].gain_unseen > least][: THRESHOLDS.rivals]
    dispersion = max(looked.scores[one.name].dispersion for one in rivals)
    before = concentrated_cost(*_of(looked.fit))
    trials = []
    for one in rivals:
        try:
            fit = _refit(looked, one, options, added)
        except InputError as error:
            logger.info("%s could not be fitted: %s", one.name, error)
            continue
        more = 0.5 * (len(one.parameters) - 1) * np.log(len(looked.scores[one.name].unseen_by_block))  # Schwarz (1978)
        odds = (before - concentrated_cost(*_of(fit))) / dispersion - float(more)
        if effect_sizes.matters(fit, one) and effect_sizes.shows(fit, one) and odds > THRESHOLDS.confirming_odds:
            trials.append(_Trial(one, fit, odds))
    return _plainest(sorted(trials, key=lambda trial: -trial.odds))


def _plainest(trials: list[_Trial]) -> list[_Trial]:
    """Without unequal motors where one weak rotor explains as much."""
    single = max((t.odds for t in trials if t.candidate.name.startswith(f"{WEAK}[")), default=-np.inf)
    clearly = [t for t in trials if t.candidate.name == UNEQUAL and t.odds > single + THRESHOLDS.clear_lead]
    if clearly:
        return [t for t in trials if not t.candidate.name.startswith(f"{WEAK}[")]
    return [t for t in trials if t.candidate.name != UNEQUAL]


def _is_significant(found: Score) -> bool:
    return found.significance < THRESHOLDS.chance and found.log_odds > THRESHOLDS.confirming_odds


def _of(fit: Identification) -> tuple[list[Any], Any]:
    return [from_imu.with_delays(f) for f in fit.flights], replace(fit.solution.point, states=())


def _refit(looked: _Look, candidate: Candidate, options: Options, added: Sequence[Candidate]) -> Identification:
    start = candidates.added(looked.fit.vehicle, candidate, list(looked.scores[candidate.name].size))
    held = holding_others(options, start, candidate)
    flights, given = looked.fit.flights, looked.fit.given
    return from_imu.identify(flights, start, held, given, silent, effects=(), near=looked.fit)


def _named(trial: _Trial, before: _Look, fit: Identification) -> ImuFinding:
    """One that was added, with the sizes of the last fit."""
    one = trial.candidate
    sizes = effect_sizes.fitted(one, before.scores[one.name], fit)
    sure = 1.0 / (1.0 + np.exp(-min(trial.odds, 50.0)))
    confidence = float(min(THRESHOLDS.most_confidence, sure))
    return ImuFinding(one.name, Verdict.PRESENT, f"log odds {trial.odds:.0f} for it", sizes, 0.0, confidence)


def _others(looked: _Look, added: Sequence[_Trial], undecided: Sequence[_Trial]) -> list[ImuFinding]:
    """Candidates that were not added."""
    named = {trial.candidate.name for trial in added}
    between = {trial.candidate.name: trial.odds for trial in undecided}
    rejected = looked.fit.verdict.use is Use.REJECTED
    found = []
    for one in looked.candidates():
        if one.name in named:
            continue
        own = looked.scores[one.name]
        sizes = effect_sizes.scored(one, own)
        if one.name in between:
            others = " or ".join(name for name in between if name != one.name)
            why = f"either it or {others} is missing; these flights do not show which"
            share = 1.0 / sum(np.exp(odds - between[one.name]) for odds in between.values())
            found.append(ImuFinding(one.name, Verdict.INCONCLUSIVE, why, sizes, own.significance, float(share)))
            continue
        case = Case(one, own, sizes, None, False, None, None, False, (), "", rejected)
        decision = decide(case)
        reason = sentence(case, decision)
        found.append(ImuFinding(one.name, decision.verdict, reason, sizes, own.significance, decision.confidence))
    return found


def _late_gyro(found: Sequence[Clock]) -> Clock | None:
    """The accelerometer's clock where it surely shows that the gyro is behind it, of the surest log."""
    of_force = [c for c in found if c.stream == clocks.STREAMS[clocks.ACCELEROMETER]]
    return min((c for c in of_force if c.off and c.delay_s < 0.0), key=lambda c: c.std_robust, default=None)
