"""From a finished search to what a diagnosis says: a finding on every candidate, on every attempt, and on the curve."""

import numpy as np

from sysid.diagnosis import effect_sizes, traces
from sysid.diagnosis.decision import Case, decide, sentence, stated
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.free_form import UNIT, of_thrust
from sysid.diagnosis.evidence.score import Score
from sysid.diagnosis.examined import Model, Outside, of_its_physics
from sysid.diagnosis.findings import Attempt, CandidateFinding, Outcome, OutsideFinding, Verdict
from sysid.diagnosis.search import Search
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.diagnosis.trial import Trial
from sysid.logs.checks.payload import PAYLOAD
from vehicle import rigid_body


def of_candidates(found: Search, *, unsure: bool) -> tuple[CandidateFinding, ...]:
    """Args: unsure: whether the fit is rejected, so that nothing is excluded, or named with more than even odds."""
    first = found.models[0]
    sized = [(s, _scored(found, s).size) for s in first.candidate_set.candidates]
    errors = traces.prediction_error_m(first, sized)
    result = [_finding(found, s, errors[s.name], unsure=unsure) for s in first.candidate_set.candidates]
    order = list(Verdict)
    return tuple(sorted(result, key=lambda f: (order.index(f.verdict), f.significance, -f.gain)))


def by_form(found: Search, named: CandidateFinding) -> tuple[str, float, tuple[tuple[str, float], ...]]:
    """A named candidate, its probability, and its rivals with theirs, as the attempt that added it left them."""
    added = (t for t in reversed(found.trials) if t.candidate.name == named.name and t.outcome is Outcome.ADDED)
    trial = next(added, None)
    if trial is None or not trial.confidence > 0.0:
        return named.name, named.confidence, ()
    share = named.confidence / trial.confidence
    return named.name, named.confidence, tuple((name, share * p) for name, p in trial.rivals)


def _model_without(found: Search, candidate: Candidate) -> Model:
    """The last model that lacked it, and what it took the place of: beside those it would hardly show."""
    of_it = (t for t in reversed(found.trials) if t.candidate.name == candidate.name)
    trial = next(of_it, None)
    lacking = {candidate.name, *(trial.in_place_of if trial else ())}
    models = [m for m in found.models if candidate.name in m.scores]
    return next((m for m in reversed(models) if lacking <= m.scores.keys()), models[-1])


def _scored(found: Search, candidate: Candidate) -> Score:
    return _model_without(found, candidate).scores[candidate.name]


def _finding(found: Search, candidate: Candidate, error_m: float, *, unsure: bool) -> CandidateFinding:
    scored = _scored(found, candidate)
    trial = next((t for t in reversed(found.trials) if t.candidate.name == candidate.name), None)
    present = trial is not None and candidate.name in {s.name for s in found.added}
    proxy = trial is not None and candidate.name in {s.name for s in found.proxies}
    negligible = candidate.name in {s.name for s in found.negligible}
    in_model = present or proxy or negligible
    if in_model:
        sizes = effect_sizes.fitted(candidate, scored, found.models[-1].fit)
    else:
        sizes = effect_sizes.scored(candidate, scored)
    case = Case(
        candidate=candidate,
        score=scored,
        sizes=sizes,
        trial=trial,
        added=present,
        curve=found.outside,
        undecided=found.undecided if found.undecided and candidate.name in found.undecided.between else None,
        doubted=candidate.name in found.doubted,
        carried_by=_carriers(found) if candidate.name == PAYLOAD else (),
        no_load=_no_load(found.models[-1]) if candidate.name == PAYLOAD else "",
        rejected=unsure,
        useful_proxy=proxy,
        negligible=negligible,
    )
    decision = decide(case)
    before = _model_without(found, candidate) if in_model else found.models[-1]
    known = candidate.name in before.scores
    return CandidateFinding(
        name=candidate.name,
        verdict=decision.verdict,
        reason=sentence(case, decision),
        sizes=sizes,
        gain=trial.training.total if trial is not None and in_model else scored.gain_unseen,
        significance=scored.significance,
        error_m=error_m,
        confidence=decision.confidence,
        confounded=traces.confounded(before, candidate, THRESHOLDS.confounded) if known else (),
        settled_by=candidate.excited_by,
        channels=candidate.channels,
        regressor=candidate.regressor,
    )


def of_forms(found: Search) -> tuple[str, ...]:
    """Which named effects have not exactly the catalogue's law, and where that shows."""
    explained = {t.candidate.name: t.training.total for t in found.trials}
    return tuple(
        f"the law of {candidate.name} is not exactly the catalogue's: what it leaves of {curve.channel} follows "
        f"{curve.variable}, {curve.score.gain_unseen / explained[candidate.name]:.0%} of what it explains"
        for candidate, curve in found.forms
    )


def _carriers(found: Search) -> tuple[str, ...]:
    """Flights that carry the load, the held-out ones too."""
    flights = (*found.models[-1].fit.flights, *found.unseen)
    return tuple(f.name for f in flights if f.carries_payload is not False)


def _no_load(model: Model) -> str:
    return model.load.doubt if model.load else ""


def of_attempt(trial: Trial, *, unsure: bool) -> Attempt:
    judged = trial.held_out
    return Attempt(
        name=trial.candidate.name,
        outcome=trial.outcome,
        sentence=trial.sentence,
        confidence=stated(trial.confidence, unsure=unsure),
        rivals=trial.rivals,
        reduction=judged.total,
        reduction_sigma=judged.sigma,
        judged_on=trial.judged_on,
    )


def of_curve(model: Model, found: Outside, *, unsure: bool) -> OutsideFinding:
    blocks = found.score
    curve = next(c for c in model.evidence.curves if c.variable == found.variable)
    low, high = (0.0, 1.0) if found.variable == "constant" else (curve.knots[3], curve.knots[-4])
    at = np.linspace(low, high, 80)
    basis = curve.basis(at)
    variance = np.einsum("ij,jk,ik->i", basis, blocks.covariance, basis)
    body = rigid_body(model.fit.vehicle)
    scale = 1.0
    if not of_thrust(found.channel):
        axis = "xyz".index(found.channel[2])
        scale = body.mass_kg if found.channel[0] == "F" else body.inertia_kg_m2[axis, axis]
    return OutsideFinding(
        channel=found.channel,
        variable=found.variable,
        variable_unit=UNIT[found.variable],
        at=at,
        acceleration=basis @ blocks.size,
        band=np.sqrt(np.maximum(variance, 0.0)),
        force_or_torque=float(scale),
        gain=blocks.gain_unseen,
        significance=blocks.significance,
        confidence=stated(found.confidence, unsure=unsure),
        nearest=tuple((one.name, share) for one, share in of_its_physics(found, model)),
    )
