"""One law takes the place of several additions that together do what it does, and only then.

An inflow that falls with the climb lifts less per speed along z, and damps the turning about x and y. Linear drag along
z and damping, each the best of its step, explain both in its place.
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle
from flight import FlightLog
from sysid import Options, identify
from sysid.diagnosis import exchange as swaps
from sysid.diagnosis import search
from sysid.diagnosis.evidence.candidates import Candidate, candidate_set
from sysid.diagnosis.evidence.confirm import CostReduction
from sysid.diagnosis.examined import Model, examine, in_place_of
from sysid.diagnosis.exchange import exchange
from sysid.diagnosis.findings import JudgedBy, Outcome
from sysid.diagnosis.thresholds import THRESHOLDS
from vehicle import Vehicle, flights, manoeuvres
from vehicle.simulation.simulate import Wind

OPTIONS = Options(node_rate_hz=100.0, gusts="white")
STAND_INS = ("parasitic_drag_linear", "angular_damping")
INFLOW_KG = 2.3e-4


@dataclass(frozen=True)
class Bent:
    """Flights, and the model with both stand-ins fitted to them."""

    logs: list[FlightLog]
    model: Model
    added: list[Candidate]

    def candidate(self, name: str) -> Candidate:
        return next(one for one in self.model.candidate_set.candidates if one.name == name)


def bare() -> Vehicle:
    """RotorPy's Hummingbird without what is at stake."""
    known = vehicle.example("hummingbird")
    for name in ("inflow_linear", "translational_lift", "motor_lag"):
        known = known.without_effect(name)
    return known


def fitted_with_both(truth: Vehicle) -> Bent:
    rng = np.random.default_rng(5)
    made = [manoeuvres.make(name) for name in ("doublets", "throttle_steps", "oblique")]
    breeze = Wind(gust_std_m_s=0.1)
    logs = [flights.measure(flights.fly_trajectory(truth, t, wind=breeze, rng=rng), rng=rng) for t in made]
    given = bare().with_effect(STAND_INS[0]).with_effect(STAND_INS[1])
    model = examine(identify(logs, given, OPTIONS))
    known = candidate_set(bare(), model.fit.flights, model.fit.clock).candidates
    return Bent(logs, model, [one for one in known if one.name in STAND_INS])


@pytest.fixture(scope="module")
def inflow() -> Bent:
    return fitted_with_both(bare().with_effect("inflow_linear", inflow_kg=INFLOW_KG))


def test_the_law_that_was_flown_replaces_both_stand_ins_at_its_size(inflow):
    found = exchange(inflow.logs, inflow.model, inflow.added, OPTIONS, ())
    assert found is not None
    assert found.candidate.name == "inflow_linear"
    assert {one.name for one in found.dropped} == {*STAND_INS}
    simpler = found.steps[-1].fit.vehicle
    assert simpler.effects == bare().with_effect("inflow_linear").effects
    assert simpler.value("inflow_linear.inflow_kg") == pytest.approx(INFLOW_KG, rel=0.03)


def test_a_law_that_was_refused_is_not_asked_again(inflow):
    refused = {one.name for one in inflow.model.candidate_set.candidates}
    assert exchange(inflow.logs, inflow.model, inflow.added, OPTIONS, refused) is None


def test_additions_that_were_flown_stay():
    damping: dict[str, Any] = {"x_n_m_s": 3e-3, "y_n_m_s": 3e-3, "z_n_m_s": 1e-3}
    drag: dict[str, Any] = {"drag_x_n_s_m": 0.0, "drag_y_n_s_m": 0.0, "drag_z_n_s_m": 0.08}
    both = bare().with_effect("parasitic_drag_linear", **drag).with_effect("angular_damping", **damping)
    found = fitted_with_both(both)
    assert in_place_of(found.model, found.candidate("inflow_linear"), found.added) == ()
    assert exchange(found.logs, found.model, found.added, OPTIONS, ()) is None


@pytest.mark.parametrize(
    ("fell", "outcome"), [(8.0, Outcome.ADDED), (-1.0, Outcome.ADDED), (-8.0, Outcome.NOT_CONFIRMED)]
)
def test_a_simpler_model_that_predicts_unseen_flights_worse_is_refused(inflow, fell, outcome):
    one = inflow.candidate("inflow_linear")
    reduction = CostReduction(np.full(9, fell) + np.linspace(-4.0, 4.0, 9))
    judge = cast("Any", SimpleNamespace(set_noise=lambda noise: None, reduction=lambda before, after: reduction))
    fitted = SimpleNamespace(reduction=CostReduction(np.ones(9)), fit=inflow.model.fit)
    swap = cast("Any", SimpleNamespace(candidate=one, fitted=fitted, dropped=(), steps=(inflow.model,)))
    trial = search._of_exchange(search._History([inflow.model]), swap, judge)
    assert trial.outcome is outcome
    assert trial.judged_by is JudgedBy.HELD_OUT
    assert trial.confidence <= THRESHOLDS.most_confidence
    lead = reduction.total / inflow.model.scores[one.name].dispersion + THRESHOLDS.clear_lead
    assert trial.confidence == pytest.approx(THRESHOLDS.most_confidence / (1.0 + np.exp(-lead)))


def test_without_flights_held_out_the_training_flights_judge_and_are_named(inflow):
    one = inflow.candidate("inflow_linear")
    fitted = SimpleNamespace(reduction=CostReduction(np.ones(9)), fit=inflow.model.fit)
    swap = cast("Any", SimpleNamespace(candidate=one, fitted=fitted, dropped=(), steps=(inflow.model,)))
    trial = search._of_exchange(search._History([inflow.model]), swap, search.NONE_HELD_OUT)
    assert trial.judged_by is JudgedBy.TRAINING
    assert search.NONE_HELD_OUT in trial.sentence


@pytest.mark.parametrize(("gone", "kept"), [(2, True), (1, False), (0, False)])
def test_one_law_for_one_is_no_simpler(inflow, monkeypatch: pytest.MonkeyPatch, gone: int, kept: bool):
    """To first order two go; the full fits may still need one of them."""
    fitted = SimpleNamespace(fit=inflow.model.fit)
    monkeypatch.setattr(swaps, "fitted_once", lambda logs, model, one, options: fitted)
    monkeypatch.setattr(swaps, "_without_unneeded", lambda logs, one, fitted, added, options: SimpleNamespace(
        candidate=one, dropped=tuple(added[:gone])
    ))  # fmt: skip
    found = exchange(inflow.logs, inflow.model, inflow.added, OPTIONS, ())
    assert (found is not None) == kept
