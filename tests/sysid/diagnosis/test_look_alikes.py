"""Confounded effects: the right one is named where flights can tell, and nobody where they cannot.

Flights of `vehicle.flights` with one effect of the example vehicle in another's place.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import vehicle
from flight import FlightLog
from sysid import Options, identify
from sysid.diagnosis import Diagnosis, diagnose, fitting
from sysid.diagnosis.belief import curve_is_there
from sysid.diagnosis.evidence.weigh import Fitted, Scales
from sysid.diagnosis.examined import Model, Tried, as_good_as, best_curve, examine, lead, stands
from sysid.diagnosis.experiment_design import next_flight
from sysid.diagnosis.experiment_design.rehearsal import Room, fitted_into
from sysid.diagnosis.fitting import candidates_fitted, refit
from sysid.diagnosis.thresholds import THRESHOLDS
from vehicle import Vehicle, flights, manoeuvres
from vehicle.simulation.simulate import Wind

SPACE = Room.of((6.0, 6.0, 3.0))
OPTIONS = Options(node_rate_hz=100.0, gusts="white")
LITTLE = ("doublets", "throttle_steps")
"""Manoeuvres that say little about drag."""


def planted(right: str, wrong: str, scale: float = 1.0) -> tuple[Vehicle, Vehicle]:
    """The vehicle without both, and with the right one at `scale` times its usual size."""
    base = vehicle.example()
    for name in (right, wrong):
        base = base.without_effect(name) if name in base.effects else base
    usual = {s.name: scale * s.prior for s in vehicle.effects.find(right).parameters}
    return base, base.with_effect(right, source="planted", **usual)


def flown(truth: Vehicle, names: Sequence[str], rng: np.random.Generator) -> list[FlightLog]:
    """In a breeze."""
    made = [fitted_into(manoeuvres.make(name), SPACE, truth) for name in names]
    breeze = Wind(gust_std_m_s=0.1)
    return [flights.measure(flights.fly_trajectory(truth, t, wind=breeze, rng=rng), rng=rng) for t in made]


@pytest.fixture(scope="module")
def fitted() -> tuple[Model, dict[str, Fitted]]:
    """Without `rotor_drag_speed`, which was there; and what was fitted in its place."""
    base, truth = planted("rotor_drag_speed", "rotor_drag_thrust")
    logs = flown(truth, (*LITTLE, "oblique"), np.random.default_rng(3))
    model = examine(identify(logs, base, OPTIONS))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "THRESHOLDS", replace(THRESHOLDS, screened=np.inf))  # whoever is beyond hope, too
        return model, {c.candidate.name: c for c in candidates_fitted(logs, model, OPTIONS, ())}


@pytest.fixture(scope="module")
def doubtful() -> Diagnosis:
    base, truth = planted("parasitic_drag_speed", "parasitic_drag", 2.0)
    return diagnose(flown(truth, LITTLE, np.random.default_rng(3)), base, auto=True)


@pytest.mark.parametrize("weighed_by", ["rotor_drag_speed", "rotor_drag_thrust"])
def test_the_right_name_outweighs_its_look_alike_whoever_sets_the_scales(fitted, weighed_by):
    """At the model without it the right one's errors scatter several times more: a scatter of its own would sink it."""
    model, tried = fitted
    right, wrong = tried["rotor_drag_speed"], tried["rotor_drag_thrust"]
    assert model.scores["rotor_drag_speed"].dispersion > 2.0 * model.scores["rotor_drag_thrust"].dispersion
    by = tried[weighed_by]
    scales = Scales(by, model.judge, examine(by.fit).evidence)
    assert scales.weight(right) - scales.weight(wrong) > THRESHOLDS.clear_lead


def test_what_tells_look_alikes_apart_is_louder_once_the_effect_is_no_noise(fitted):
    """The lead at the noise of the fit, over the lead at the noise of the model that takes the effect for noise."""
    model, tried = fitted
    right, wrong = tried["rotor_drag_speed"], tried["rotor_drag_thrust"]
    judge = model.judge.at(right.fit.noise, right.fit.solution.point)
    at_fit = judge.reduction(wrong.fit.vehicle, right.fit.vehicle).total
    assert at_fit > 1.5 * (right.reduction.total - wrong.reduction.total) > 0.0


def foretold_and_full(model: Model, first: Fitted, rival: Fitted) -> tuple[float, float]:
    """Log odds for the first by the score test at its fit, and by both fits."""
    after = examine(first.fit)
    scales = Scales(first, model.judge, after.evidence)
    return lead(after, first.candidate, rival.candidate), scales.weight(first) - scales.weight(rival)


def test_the_score_test_at_the_best_fit_foretells_the_lead_of_a_full_fit(fitted):
    model, tried = fitted
    foretold, full = foretold_and_full(model, tried["rotor_drag_speed"], tried["rotor_drag_thrust"])
    assert foretold == pytest.approx(full, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong", "scale"),
    [("rotor_drag_speed", "rotor_drag_thrust", 4.0), ("parasitic_drag_speed", "parasitic_drag", 6.0)],
)
def test_the_score_test_foretells_a_lead_where_effects_are_large_whoever_is_first(right, wrong, scale):
    base, truth = planted(right, wrong, scale)
    logs = flown(truth, (*LITTLE, "oblique"), np.random.default_rng(3))
    model = examine(identify(logs, base, OPTIONS))
    made = {}
    for name in (right, wrong):
        fit = refit(logs, model, model.candidate_set.candidate(name), OPTIONS)
        reduction = model.judge.reduction(model.fit.vehicle, fit.vehicle, fit.solution.point)
        made[name] = Fitted(model.candidate_set.candidate(name), fit, reduction)
    for first, rival in ((right, wrong), (wrong, right)):
        foretold, full = foretold_and_full(model, made[first], made[rival])
        assert foretold == pytest.approx(full, rel=0.4)


@pytest.mark.parametrize(
    ("far", "left"), [(1.0, {"rotor_drag_speed"}), (1e9, {"rotor_drag_speed", "rotor_drag_thrust"})]
)
def test_a_rival_beyond_hope_is_not_fitted_in_full(fitted, monkeypatch, far, left):
    model, tried = fitted
    asked: list[str] = []
    monkeypatch.setattr(fitting, "THRESHOLDS", replace(THRESHOLDS, screened=far))
    monkeypatch.setattr(fitting, "fitted_once", lambda _, __, one, ___: asked.append(one.name) or tried.get(one.name))
    fresh = replace(model, tried=Tried(examined={"rotor_drag_speed": examine(tried["rotor_drag_speed"].fit)}))
    found = {c.candidate.name for c in candidates_fitted((), fresh, OPTIONS, ())}
    assert found & {"rotor_drag_speed", "rotor_drag_thrust"} == left
    assert left <= set(asked)
    assert ("rotor_drag_thrust" in asked) == ("rotor_drag_thrust" in left)


def test_scales_ask_a_price_for_every_parameter(fitted):
    _, tried = fitted
    best = tried["rotor_drag_speed"]
    scales = Scales(best, fitted[0].judge, examine(best.fit).evidence)
    blocks = len(best.reduction.by_block)
    assert scales.weight(best) == pytest.approx(-0.5 * len(best.candidate.parameters) * np.log(blocks))
    assert scales.dispersion(best.candidate) >= 1.0


def test_nobody_is_named_where_two_explain_as_much(doubtful):
    pair = {"parasitic_drag", "parasitic_drag_speed"}
    assert doubtful.additions == ()
    assert set(doubtful.undecided) == pair
    assert "or" in doubtful.verdict
    assert "confounded in these flights" in doubtful.verdict
    sure = {s.name: s.confidence for s in doubtful.candidates if s.name in pair}
    assert all(0.02 < p < 0.95 for p in sure.values())
    left = curve_is_there(doubtful.search.left)
    assert doubtful.confidence == pytest.approx(sum(sure.values()) * (1.0 - left))
    assert {s.verdict for s in doubtful.candidates if s.name in pair} == {"inconclusive"}
    assert doubtful.outside is None
    assert doubtful.as_dict()["undecided"] == list(doubtful.undecided)


def test_the_flight_proposed_next_tells_the_undecided_apart(doubtful):
    assert next_flight.in_doubt(doubtful) == doubtful.undecided


def test_no_curve_is_called_unknown_while_a_known_effect_explains_as_much(fitted):
    model, _ = fitted
    curve = best_curve(model, ["F_x"])
    assert curve is not None
    assert as_good_as(curve, model)[0].name == "rotor_drag_speed"
    elsewhere = [candidate.name for candidate in as_good_as(replace(curve, channel="F_z"), model)]
    assert "rotor_drag_speed" not in elsewhere


def test_a_name_is_no_proxy_for_a_curve_that_may_be_a_known_effect():
    """Of two missing effects the first one found leaves the other, which looks like a curve until it is asked."""
    base, lift = planted("translational_lift", "inflow_linear")
    usual = {s.name: 0.5 * s.prior for s in vehicle.effects.find("inflow_linear").parameters}
    truth = lift.with_effect("inflow_linear", source="planted", **usual)
    logs = flown(truth, (*LITTLE, "oblique", "vertical_weave"), np.random.default_rng(3))
    model = examine(identify(logs, base, OPTIONS))
    name = next(s for s in model.candidate_set.candidates if s.name == "inflow_linear")
    after = examine(refit(logs, model, name, OPTIONS))
    assert stands(after, name) is None
    assert as_good_as(best_curve(after, ["T"]), after)[0].name == "translational_lift"
    assert stands(after, name, refused=("translational_lift",)) is not None


@pytest.mark.slow
def test_what_rests_on_few_stretches_is_doubted_and_not_drawn_as_unknown():
    base, truth = planted("inflow_linear", "thrust_affine")
    found = diagnose(flown(truth, (*LITTLE, "vertical_weave"), np.random.default_rng(3)), base, auto=True)
    assert found.outside is None
    assert found.additions in ((), ("inflow_linear",))
    assert "inflow_linear" in found.verdict


@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong", "least"),
    [
        ("rotor_drag_thrust", "rotor_drag_speed", 0.9),
        ("rotor_drag_speed", "rotor_drag_thrust", 0.85),  # 0.888 and 0.898: the other drag explains nearly as much
        ("parasitic_drag", "parasitic_drag_speed", 0.85),
        ("parasitic_drag_speed", "parasitic_drag", 0.9),
    ],
)
def test_what_the_flights_so_far_cannot_name_is_named_after_the_proposed_flight(right, wrong, least):
    rng = np.random.default_rng(3)
    base, truth = planted(right, wrong)
    before = flown(truth, LITTLE, rng)
    first = diagnose(before, base, auto=True)
    assert first.additions == ()
    assert next(s for s in first.candidates if s.name == right).verdict == "inconclusive"
    best = next_flight.rank(
        first,
        candidates=[right, wrong],
        free_volume_m=(6.0, 6.0, 3.0),
        library=("oblique", "throttle_steps"),
        rng=np.random.default_rng(0),
    )[0]
    breeze = Wind(gust_std_m_s=0.1)
    new = flights.measure(flights.fly_trajectory(truth, best.trajectory, wind=breeze, rng=rng), rng=rng)
    settled = diagnose([*before, new], base, auto=True)
    assert settled.additions == (right,)
    assert settled.outside is None
    assert settled.confidence > least
