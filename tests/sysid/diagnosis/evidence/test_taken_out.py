"""A candidate that goes again leaves the vehicle as it was: with a law of thrust, above all."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import sysid
import vehicle
from sysid.diagnosis import fitting
from sysid.diagnosis.effect_sizes import scored
from sysid.diagnosis.evidence.candidates import Candidate, added, candidate_set, taken_out
from sysid.diagnosis.evidence.score import Score
from vehicle import effects

BASE = vehicle.example("hummingbird").without_effect("inflow_linear").without_effect("translational_lift")
LAWS_OF_THRUST = [e.name for e in effects.catalogue().values() if e.instead_of and e.instead_of in BASE.effects]
THERE = Candidate("", "", (), (), (), (), "", ())


def hovering_with(law: str, k2: float) -> vehicle.Vehicle:
    one = replace(THERE, name=law, effect=law, parameters=(f"{law}.k2_n_s2_m",))
    return added(BASE, one, [k2]).with_value(f"{law}.k1_n_s2", 7e-6, std=1e-7, source="identified from a")


def lift_n(flying: vehicle.Vehicle, speed_rad_s: np.ndarray) -> float:
    still = np.zeros((1, 3))
    return vehicle.wrench(flying, still, still, speed_rad_s[None])[0][0, 2]


@pytest.mark.parametrize("k2", [0.0, -1e-5, -1.547e-4])
@pytest.mark.parametrize("name", LAWS_OF_THRUST)
def test_a_law_that_contains_another_leaves_that_one_behind_with_the_lift_of_hover(name: str, k2: float):
    with_it = hovering_with(name, k2)
    without = taken_out(with_it, name)
    assert set(without.effects) == set(BASE.effects)
    hover = vehicle.invert.hover(with_it)
    assert lift_n(without, hover) == pytest.approx(lift_n(with_it, hover), rel=1e-3)
    assert vehicle.invert.hover(without) == pytest.approx(hover, rel=1e-3)
    left = without.parameter(f"{effects.find(name).instead_of}.{effects.find(name).takes_over[0]}")
    assert left.source == "identified from a"
    assert left.std / left.value == pytest.approx(1e-7 / 7e-6)


def test_what_two_laws_share_keeps_its_value():
    narrow = hovering_with("thrust_bem", -5e-5)
    wide = narrow.without_effect("thrust_bem").with_effect("thrust_blade_element", k1_n_s2=7e-6, k2_n_s2_m=-5e-5)
    left = taken_out(wide, "thrust_blade_element")
    assert left.value("thrust_bem.k2_n_s2_m") == -5e-5
    assert left.value("thrust_bem.k1_n_s2") == pytest.approx(7e-6)


def test_beside_the_law_that_it_contains_a_law_just_goes():
    both = BASE.with_effect("thrust_bem", k1_n_s2=1e-6, k2_n_s2_m=-1e-5)
    assert taken_out(both, "thrust_bem").parameters == BASE.parameters


def test_there_are_such_laws():
    assert "thrust_bem" in LAWS_OF_THRUST


def test_any_other_effect_just_goes():
    assert taken_out(BASE.with_effect("flapping_moment"), "flapping_moment").parameters == BASE.parameters


def test_the_search_fits_what_is_left_of_a_law_of_thrust(monkeypatch):
    model: Any = SimpleNamespace(fit=SimpleNamespace(vehicle=hovering_with("thrust_bem", -1e-4)))
    fitted: list[vehicle.Vehicle] = []
    monkeypatch.setattr(fitting, "identify", lambda logs, start, options, near: fitted.append(start))
    monkeypatch.setattr(fitting, "examine", lambda fit: fit)
    fitting.refit_without([], model, replace(THERE, name="thrust_bem", effect="thrust_bem"), sysid.Options())
    assert [set(one.effects) for one in fitted] == [set(BASE.effects)]


def test_the_interval_of_a_candidate_is_that_of_its_score():
    drag = next(c for c in candidate_set(BASE, [flight()]).candidates if c.name == "rotor_drag_thrust")
    q = len(drag.parameters)
    found = Score(
        np.arange(q), np.ones(q), np.eye(q), np.full(q, 4.0), np.full(q, 24.0), 1.0, 1.0, np.ones(2), 0.1, 1.0
    )
    assert [s.half90 for s in scored(drag, found)] == pytest.approx(list(found.half90))
    assert scored(drag, found)[0].half90 == pytest.approx(1.6449 * 2.0, rel=1e-3)


def flight() -> Any:
    speed = np.full((10, 4), 500.0)
    return SimpleNamespace(
        rotor_speed_rad_s=speed,
        driven_by_command=False,
        carries_payload=None,
        log_index=0,
        streams={},
        battery_v=np.full(10, 12.0),
        has_pose=True,
    )
