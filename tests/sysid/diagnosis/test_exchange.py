"""One law takes the place of several additions that together do what it does, and only then.

An inflow that falls with the climb lifts less per speed along z, and damps the turning about x and y. Linear drag along
z and damping, each the best of its step, explain both in its place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from sysid.diagnosis.exchange import Exchange, exchange
from sysid.diagnosis.findings import JudgedBy, Outcome
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.diagnosis.trial import Trial
from vehicle import Vehicle, flights, manoeuvres
from vehicle.simulation.simulate import Wind

OPTIONS = Options(node_rate_hz=100.0, gusts="white")
SUBSTITUTES = ("parasitic_drag_linear", "angular_damping")
INFLOW_KG = 2.3e-4


@dataclass(frozen=True)
class Bent:
    """Flights, and the model with both substitutes fitted to them."""

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
    given = bare().with_effect(SUBSTITUTES[0]).with_effect(SUBSTITUTES[1])
    model = examine(identify(logs, given, OPTIONS))
    known = candidate_set(bare(), model.fit.flights, model.fit.clock).candidates
    return Bent(logs, model, [one for one in known if one.name in SUBSTITUTES])


@pytest.fixture(scope="module")
def inflow() -> Bent:
    return fitted_with_both(bare().with_effect("inflow_linear", inflow_kg=INFLOW_KG))


def test_the_law_that_was_flown_replaces_both_substitutes_at_its_size(inflow):
    found = exchange(inflow.logs, inflow.model, inflow.added, OPTIONS, ())[0]
    assert found.candidate.name == "inflow_linear"
    assert {one.name for one in found.dropped} == {*SUBSTITUTES}
    simpler = found.steps[-1].fit.vehicle
    assert simpler.effects == bare().with_effect("inflow_linear").effects
    assert simpler.value("inflow_linear.inflow_kg") == pytest.approx(INFLOW_KG, rel=0.03)


def test_a_law_that_was_refused_is_not_asked_again(inflow):
    refused = {one.name for one in inflow.model.candidate_set.candidates}
    assert exchange(inflow.logs, inflow.model, inflow.added, OPTIONS, refused) == []


def test_additions_that_were_flown_stay():
    damping: dict[str, Any] = {"x_n_m_s": 3e-3, "y_n_m_s": 3e-3, "z_n_m_s": 1e-3}
    drag: dict[str, Any] = {"drag_x_n_s_m": 0.0, "drag_y_n_s_m": 0.0, "drag_z_n_s_m": 0.08}
    both = bare().with_effect("parasitic_drag_linear", **drag).with_effect("angular_damping", **damping)
    found = fitted_with_both(both)
    assert in_place_of(found.model, found.candidate("inflow_linear"), found.added) == ()
    assert exchange(found.logs, found.model, found.added, OPTIONS, ()) == []


def swap(bent: Bent, name: str = "inflow_linear", *, dropped: int = 2, training: float = 0.0) -> Exchange:
    """An exchange whose last model is the first, with this fall of the cost of nine blocks of training."""
    fitted = cast("Any", SimpleNamespace(reduction=CostReduction(np.ones(9)), fit=bent.model.fit))
    reduction = CostReduction(np.full(9, training / 9.0))
    return Exchange(bent.candidate(name), fitted, tuple(bent.added[:dropped]), (bent.model,), reduction, 1.0)


def judged(bent: Bent, unseen: Any, one: Exchange, others: Sequence[Exchange] = ()) -> Trial:
    added = [addition(a, 10.0) for a in bent.added]
    return search._of_exchange(search._History([bent.model], trials=added), one, unseen, others)


def addition(one: Candidate, fell: float) -> Trial:
    reduction = CostReduction(np.full(9, fell))
    nothing: Any = None
    return Trial(one, Outcome.ADDED, reduction, reduction, JudgedBy.HELD_OUT, "", True, 0.9, (), None, nothing)


def judge(by_block: np.ndarray) -> Any:
    return SimpleNamespace(set_noise=lambda noise: None, reduction=lambda before, after: CostReduction(by_block))


AROUND = np.linspace(-4.0, 4.0, 9)


@pytest.mark.parametrize(
    ("by_block", "outcome"),
    [
        (8.0 + AROUND, Outcome.ADDED),
        (-0.2 + AROUND, Outcome.ADDED),  # it lost less than being simpler is worth
        (-0.5 + AROUND, Outcome.NOT_CONFIRMED),  # within the scatter, and still the less likely one
        (-8.0 + AROUND, Outcome.NOT_CONFIRMED),
        (np.array([-50.0]), Outcome.NOT_CONFIRMED),  # one block has no scatter
        (np.array([np.nan, 1.0]), Outcome.NOT_CONFIRMED),
    ],
)
def test_a_simpler_model_must_stay_likelier_on_unseen_flights(inflow, by_block: np.ndarray, outcome: Outcome):
    trial = judged(inflow, judge(by_block), swap(inflow))
    assert trial.outcome is outcome
    assert trial.judged_by is JudgedBy.HELD_OUT
    lead = by_block.sum() + THRESHOLDS.clear_lead
    expected = THRESHOLDS.most_confidence / (1.0 + np.exp(-lead)) if outcome is Outcome.ADDED else 0.0
    assert trial.confidence == pytest.approx(expected)


def test_it_explained_what_those_did_that_it_takes_the_place_of(inflow):
    trial = judged(inflow, judge(8.0 + AROUND), swap(inflow, training=-7.0))
    assert trial.training.total == pytest.approx(2 * 9 * 10.0 - 7.0)
    assert trial.in_place_of == tuple(one.name for one in inflow.added)
    assert " and ".join(trial.in_place_of) in trial.sentence


@pytest.mark.parametrize("why", [search.NONE_HELD_OUT, search.TOO_SHORT])
def test_without_flights_to_judge_by_even_odds_are_the_most(inflow, why: str):
    trial = judged(inflow, why, swap(inflow, training=90.0))
    assert trial.outcome is Outcome.ADDED
    assert trial.judged_by is JudgedBy.TRAINING
    assert trial.confidence == pytest.approx(THRESHOLDS.unjudged_confidence)
    assert why in trial.sentence


def test_another_law_that_does_it_too_shares_the_odds(inflow):
    one, other = swap(inflow, training=9.0), swap(inflow, "rotor_interaction", training=9.0)
    trial = judged(inflow, judge(8.0 + AROUND), one, [replace(other, candidate=replace(one.candidate, name="other"))])
    assert trial.rivals == (("other", trial.confidence),)
    assert trial.confidence == pytest.approx(0.5 * THRESHOLDS.most_confidence, rel=0.01)


@pytest.mark.parametrize(("gone", "kept"), [(2, True), (1, False), (0, False)])
def test_one_law_for_one_is_no_simpler(inflow, monkeypatch: pytest.MonkeyPatch, gone: int, kept: bool):
    """To first order two go; the full fits may still need one of them."""
    others = {one.name for one in inflow.model.candidate_set.candidates} - {"inflow_linear"}
    monkeypatch.setattr(swaps, "fitted_once", lambda logs, model, one, options: SimpleNamespace(fit=model.fit))
    monkeypatch.setattr(swaps, "_without_unneeded", lambda *_: swap(inflow, dropped=gone))
    monkeypatch.setattr(swaps.effect_sizes, "matters", lambda fit, one: True)
    monkeypatch.setattr(swaps, "stands", lambda model, one, refused: None)
    assert bool(exchange(inflow.logs, inflow.model, inflow.added, OPTIONS, others)) == kept


def test_a_law_with_as_many_numbers_is_no_simpler(inflow):
    one = swap(inflow)
    assert one.is_simpler
    many = replace(one.candidate, parameters=tuple(f"inflow_linear.{i}" for i in range(6)))
    assert not replace(one, candidate=many).is_simpler


def test_a_part_of_an_effect_and_another_thrust_law_stay(inflow, monkeypatch: pytest.MonkeyPatch):
    """Without one rotor's loss the other three would be fitted, unnamed; without thrust there is no flight."""
    asked: list[str] = []

    def in_place(model: Model, one: Candidate, additions: Sequence[Candidate]) -> tuple[Candidate, ...]:
        asked.extend(a.name for a in additions)
        return ()

    monkeypatch.setattr(swaps, "in_place_of", in_place)
    parts = [inflow.candidate("weak_rotor[1]"), inflow.candidate("thrust_bem")]
    exchange(inflow.logs, inflow.model, [*parts, *inflow.added], OPTIONS, ())
    assert {*asked} == {*SUBSTITUTES}
