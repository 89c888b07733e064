"""A candidate that goes again leaves the vehicle as it was: with a law of thrust, above all."""

from dataclasses import replace

import pytest

import vehicle
from sysid.diagnosis.evidence.candidates import Candidate, added, taken_out
from vehicle import effects

BASE = vehicle.example("hummingbird").without_effect("inflow_linear").without_effect("translational_lift")
LAWS_OF_THRUST = [e.name for e in effects.catalogue().values() if e.instead_of and e.instead_of in BASE.effects]
THERE = Candidate("", "", (), (), (), (), "", ())


@pytest.mark.parametrize("name", LAWS_OF_THRUST)
def test_a_law_that_contains_another_leaves_that_one_behind(name: str):
    effect = effects.find(name)
    theirs, ours = effect.takes_over
    one = replace(THERE, name=name, effect=name, parameters=(f"{name}.{effect.strength[0]}",))
    with_it = added(BASE, one, [-1e-4]).with_value(f"{name}.{ours}", 7e-6, std=1e-7, source="identified from a")
    without = taken_out(with_it, name)
    assert set(without.effects) == set(BASE.effects)
    left = without.parameter(f"{effect.instead_of}.{theirs}")
    assert (left.value, left.std, left.source) == (7e-6, 1e-7, "identified from a")


def test_there_are_such_laws():
    assert "thrust_bem" in LAWS_OF_THRUST


def test_any_other_effect_just_goes():
    assert taken_out(BASE.with_effect("flapping_moment"), "flapping_moment").parameters == BASE.parameters
