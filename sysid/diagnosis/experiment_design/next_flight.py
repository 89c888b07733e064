"""Which flight would settle it: manoeuvres simulated with the present model, ranked by evidence per second flown.

A flight that has not been flown has no residuals, but its information is known: the estimator's own linearisation at
the simulated states, with the noise of the fit. Added to the information of the flights so far, it says how well two
confounded effects will be separated, or how small a size will show.
"""

import logging
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, overload

import numpy as np

from flight import FloatArray, InfeasibleError, InputError, Progress, Trajectory, Waypoints, silent
from sysid.diagnosis.effect_sizes import VISIBLE_SIGMAS
from sysid.diagnosis.evidence.candidates import Candidate, require_missing
from sysid.diagnosis.evidence.evidence import Evidence
from sysid.diagnosis.evidence.score import inverse_of
from sysid.diagnosis.examined import Model
from sysid.diagnosis.experiment_design.rehearsal import Rehearsal, Room, fitted_into, rehearse, waypoints_of
from sysid.diagnosis.findings import Verdict
from sysid.diagnosis.procedure import NODE_RATE_HZ, Diagnosis
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.joint_problem.unknowns import SENSOR_NAMES, nuisances
from sysid.logs.checks.payload import PAYLOAD
from vehicle import manoeuvres
from vehicle.effects.base import Effect

logger = logging.getLogger(__name__)

BELIEVED = 0.05
"""A size estimated with at least this significance is taken for the candidate's; else its usual size."""
POSSIBLE = 0.05
"""Rivals at least this likely are worth a flight."""
NEEDS_A_CEILING = ("ceiling_climb",)
"""Manoeuvres that make no sense in free space."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """One manoeuvre, fitted to the space and the vehicle, and what flying it would be worth."""

    name: str
    trajectory: Trajectory
    expected_log_odds: float
    """By how much the log odds of the true candidate against its rival (or `nothing there`) are expected to grow."""
    known_log_odds: float
    """What the flights so far are worth by the same measure."""
    supposed: dict[str, float]
    """Parameter to the size this rests on: as estimated where the flights so far show it, else the usual one."""
    expected_sigmas: dict[str, float]
    """Parameter to its size in standard errors, after this flight."""
    smallest_visible: dict[str, float]
    """Parameter to the smallest size that would then be called present, nine times in ten."""
    top_speed_m_s: float
    sentence: str

    @property
    def duration_s(self) -> float:
        return self.trajectory.duration_s

    @property
    def per_second(self) -> float:
        """Expected log odds per second flown."""
        return self.expected_log_odds / self.duration_s

    def waypoints(self) -> Waypoints:
        """Points for `goshawk plan`, close enough together that the way between them is the manoeuvre's.

        The planner flies them as fast as the vehicle may; that is usually at least as telling.

        Raises:
            InputError: the manoeuvre stays in one place.
        """
        return waypoints_of(self.trajectory, self.name)

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "duration_s": self.duration_s,
            "expected_log_odds": self.expected_log_odds,
            "expected_log_odds_per_s": self.per_second,
            "known_log_odds": self.known_log_odds,
            "supposed": self.supposed,
            "expected_sigmas": self.expected_sigmas,
            "smallest_visible": self.smallest_visible,
            "top_speed_m_s": self.top_speed_m_s,
            "sentence": self.sentence,
        }


@dataclass(frozen=True, slots=True)
class Ranking(Sequence[Proposal]):
    """Proposals, the best per second first; a sequence."""

    candidates: tuple[str, ...]
    proposals: tuple[Proposal, ...]
    skipped: tuple[tuple[str, str], ...]
    """Manoeuvres that cannot be flown here, with the reason."""

    @overload
    def __getitem__(self, index: int) -> Proposal: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Proposal]: ...
    def __getitem__(self, index: int | slice) -> Proposal | Sequence[Proposal]:
        return self.proposals[index]

    def __len__(self) -> int:
        return len(self.proposals)

    def __iter__(self) -> Iterator[Proposal]:
        return iter(self.proposals)


def rank(
    model: Diagnosis | Model,
    *,
    candidates: Sequence[str] | None = None,
    free_volume_m: tuple[float, float, float],
    corner_world_m: tuple[float, float, float] | None = None,
    library: Sequence[str] | None = None,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> Ranking:
    """Every manoeuvre that fits, by what it would tell about the candidates per second flown.

    Args:
        candidates: two or more to be separated, or one whose size is in doubt; else what the diagnosis leaves open.
        free_volume_m: where the vehicle's centre may go, along x, y and z.
        corner_world_m: lowest corner of that volume; without it, the volume's floor is 0.5 m above the ground.
        library: names of manoeuvres; else all of `vehicle.manoeuvres.LIBRARY`.

    Raises:
        InputError: a candidate is unknown or shows on no flight of this kind, none is in doubt, or the volume is none.
    """
    question = ask(model, candidates)
    room = Room.of(free_volume_m, corner_world_m)
    names = tuple(library or manoeuvres.LIBRARY)
    proposals, skipped = [], []
    for i, name in enumerate(names):
        progress("rehearse", i / len(names))
        try:
            if name in NEEDS_A_CEILING:
                raise InfeasibleError("it needs a known ceiling above it, not free space")
            trajectory = fitted_into(manoeuvres.make(name), room, question.model.fit.vehicle)
            flown = rehearse(question.model.fit, trajectory, room, NODE_RATE_HZ, rng)
        except InfeasibleError as error:
            skipped.append((name, str(error)))
            logger.info("%s: %s", name, error)
            continue
        proposals.append(question.proposal(name, trajectory, flown))
    progress("rehearse", 1.0)
    best_first = tuple(sorted(proposals, key=lambda p: -p.per_second))
    return Ranking(tuple(s.name for s in question.candidates), best_first, tuple(skipped))


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Candidates to be separated, or one to be sized, and what the flights so far know about them."""

    model: Model
    candidates: tuple[Candidate, ...]
    known: FloatArray
    """(p, p) information of the flights so far on base parameters and candidates, biases of single logs taken out."""

    def proposal(self, name: str, trajectory: Trajectory, flown: Rehearsal) -> Proposal:
        """What a rehearsed flight would be worth."""
        after = self.known + self.information(flown)
        before_odds, odds = self.log_odds(self.known), self.log_odds(after)
        expected, smallest = self.sizes(after)
        sentence = self._sentence(name, trajectory.duration_s, odds - before_odds, before_odds, expected, smallest)
        speed = float(np.linalg.norm(flown.states.velocity_world_m_s, axis=1).max())
        supposed = {n: float(v) for s in self.candidates for n, v in zip(s.parameters, self._size(s), strict=True)}
        return Proposal(
            name, trajectory, odds - before_odds, before_odds, supposed, expected, smallest, speed, sentence
        )

    def information(self, flown: Rehearsal) -> FloatArray:
        """(p, p) what a rehearsed flight would add to `known`."""
        fit = self.model.fit
        point = fit.solution.point
        unbiased = {name: point.sensors[name] for name in SENSOR_NAMES}
        point = replace(point, sensors=unbiased, states=(flown.states,))
        sensor = fit.unknowns.sensor if flown.flight.has_pose else ()
        own, _ = nuisances([flown.flight], fit.clock, fit.vehicle)
        own = replace(own, model=fit.unknowns.model, sensor=sensor)
        return shared_information(Evidence([flown.flight], point, fit.noise, own, self.model.candidate_set))

    def log_odds(self, information: FloatArray) -> float:
        """Expected log odds of the true candidate: against the rival hardest to tell from it, or against nothing."""
        if len(self.candidates) == 1:
            return 0.5 * self._unexplained(information, self.candidates[0], None)
        pairs = combinations(self.candidates, 2)
        return 0.5 * min(
            min(self._unexplained(information, a, b), self._unexplained(information, b, a)) for a, b in pairs
        )

    def _unexplained(self, information: FloatArray, true: Candidate, rival: Candidate | None) -> float:
        """Squares of what base parameters and rival cannot reproduce of a candidate's trace, over its dispersion."""
        mine, size = self._places(true), self._size(true)
        given = self._base() if rival is None else np.concatenate([self._base(), self._places(rival)])
        left = _without(information, mine, given)
        return max(0.0, float(size @ left @ size)) / self.model.scores[true.name].dispersion

    def sizes(self, information: FloatArray) -> tuple[dict[str, float], dict[str, float]]:
        """Size in standard errors, and smallest visible size, of every parameter; each candidate without the others."""
        expected: dict[str, float] = {}
        smallest: dict[str, float] = {}
        for candidate in self.candidates:
            left = _without(information, self._places(candidate), self._base())
            variance = self.model.scores[candidate.name].dispersion * np.diag(inverse_of(left))
            for name, size, v in zip(candidate.parameters, self._size(candidate), variance, strict=True):
                if v > 0.0:
                    expected[name], smallest[name] = abs(float(size)) / v**0.5, VISIBLE_SIGMAS * float(v**0.5)
        return expected, smallest

    def _sentence(
        self,
        name: str,
        duration_s: float,
        odds: float,
        before: float,
        expected: dict[str, float],
        smallest: dict[str, float],
    ) -> str:
        from scipy.special import expit

        if len(self.candidates) > 1:
            told = " from ".join(s.name for s in self.candidates)
            sure = float(expit(before + odds))
            text = f"{duration_s:.0f} s of {name} are expected to tell {told} with log odds of {odds:.1f}"
            text = f"{text}. The flights so far are worth {before:.1f}; the right one would then be {_sure(sure)}"
            return f"{text} ({self._supposition()})"
        if not expected:
            return f"{duration_s:.0f} s of {name} would not show {' '.join(s.name for s in self.candidates)} at all"
        units = {f"{e.name}.{s.name}": s.unit for e in self._effects() for s in e.parameters}
        clear = max(expected, key=lambda n: expected[n])
        text = f"after {duration_s:.0f} s of {name}, {clear} would stand out by {expected[clear]:.1f} standard errors"
        text = f"{text}; it would show from {smallest[clear]:.2g} {units[clear]} upwards"
        return f"{text} ({self._supposition()})"

    def _supposition(self) -> str:
        shown = [self._is_shown(s) for s in self.candidates]
        load = " and the load carried" if PAYLOAD in {s.name for s in self.candidates} else ""
        return (
            f"supposing {'estimated' if all(shown) else 'estimated and usual' if any(shown) else 'usual'} sizes{load}"
        )

    def _effects(self) -> list[Effect]:
        return [self.model.candidate_set.vehicle.effect(s.effect) for s in self.candidates]

    def _base(self) -> np.ndarray:
        return np.arange(len(_shared(self.model.evidence)[0]))

    def _places(self, candidate: Candidate) -> np.ndarray:
        names = _kept_names(self.model.evidence)
        return np.array([names.index(n) for n in candidate.parameters], dtype=np.intp)

    def _size(self, candidate: Candidate) -> FloatArray:
        return self.model.scores[candidate.name].size if self._is_shown(candidate) else np.array(candidate.usual)

    def _is_shown(self, candidate: Candidate) -> bool:
        """Whether the flights so far give its size."""
        return self.model.scores[candidate.name].significance < BELIEVED


def _sure(probability: float) -> str:
    return "more than 99.9 % certain" if probability > 0.999 else f"{probability:.1%} certain"


def ask(model: Diagnosis | Model, candidates: Sequence[str] | None = None) -> Question:
    """The question a flight should answer. Arguments and errors as `rank`."""
    names = tuple(candidates) if candidates else in_doubt(model)
    chosen = model if isinstance(model, Model) else _in_which_all_are_candidates(model, names)
    found = tuple(_candidate(chosen, name) for name in names)
    if len({s.name for s in found}) < len(found):
        raise InputError(f"a candidate is named twice: {', '.join(s.name for s in found)}")
    return Question(chosen, found, shared_information(chosen.evidence))


def in_doubt(model: Diagnosis | Model, worth_flying: Collection[str] | None = None) -> tuple[str, ...]:
    """What is still open: confounded effects of which one is missing, an addition and a rival that may be it, or the
    candidate that may be there. An addition whose rivals are out of the question is settled.

    Args:
        worth_flying: candidates that a flight would show; without a sign of it no other is proposed. None: all.

    Raises:
        InputError: nothing is.
    """
    if isinstance(model, Model):
        ordered = sorted(model.scores, key=lambda name: model.scores[name].significance)
        return tuple(ordered[:2])
    if model.undecided:
        return model.undecided[:2]
    for finding in model.candidates:
        if finding.verdict is Verdict.PRESENT:
            trial = next(t for t in reversed(model.search.trials) if t.candidate.name == finding.name)
            rivals = [name for name, p in trial.rivals if p > POSSIBLE]
            if rivals:
                return finding.name, rivals[0]
    doubts = [f for f in model.candidates if f.verdict is Verdict.INCONCLUSIVE]
    significant = [f for f in doubts if f.significance < THRESHOLDS.chance]
    for finding in significant[:1]:
        for rival, _ in finding.confounded[:1]:
            return finding.name, rival
    if worth_flying is not None:
        doubts = [f for f in doubts if f in significant or f.name in worth_flying]
    if not doubts:
        raise InputError("these flights left no candidate in doubt; name one whose size should be known better")
    return ((significant or doubts)[0].name,)


def _in_which_all_are_candidates(diagnosis: Diagnosis, names: Sequence[str]) -> Model:
    """The last model of the search that lacks all of them."""
    for model in reversed(diagnosis.search.models):
        known = {s.name for s in model.candidate_set.candidates} | {s.effect for s in model.candidate_set.candidates}
        if known.issuperset(names):
            return model
    return diagnosis.search.models[0]


def _candidate(model: Model, name: str) -> Candidate:
    """By the candidate's name, or by the effect's: then the likeliest of its candidates."""
    reasons = dict(model.candidate_set.invisible)
    if name in reasons:
        raise InputError(f"no flight of this kind can show {name}: {reasons[name]}")
    require_missing(name, model.fit.vehicle)
    of_effect = [s for s in model.candidate_set.candidates if s.effect == name]
    if of_effect:
        return max(of_effect, key=lambda s: model.scores[s.name].gain_unseen)
    return model.candidate_set.candidate(name)


def _kept_names(evidence: Evidence) -> list[str]:
    return [name for part in _shared(evidence) for name in part]


def _shared(evidence: Evidence) -> tuple[list[str], list[str]]:
    """Names of the base's columns, less the biases of single logs, and of the candidates'."""
    base = [evidence.names[i] for i in evidence.base if not evidence.names[i].endswith("]")]
    return base, list(evidence.names[len(evidence.base) :])


def shared_information(evidence: Evidence) -> FloatArray:
    """(p, p) about base parameters and candidates, with the biases of single logs free."""
    kept = evidence.place(_kept_names(evidence))
    rest = np.setdiff1d(np.arange(len(evidence.names)), kept)
    return _without(evidence.named.information.sum(axis=0), kept, rest)


def _without(information: FloatArray, kept: np.ndarray, free: np.ndarray) -> FloatArray:
    """Information about some columns when others are free (Schur complement)."""
    cross = information[kept[:, None], free]
    inner = information[kept[:, None], kept]
    return inner - cross @ inverse_of(information[free[:, None], free]) @ cross.T if len(free) else inner
