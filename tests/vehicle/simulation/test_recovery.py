"""Every effect is identifiable: planted on the manoeuvres that excite it, its values are recovered."""

import numpy as np
import pytest

import vehicle
from vehicle import effects, self_test

BASES = {"centre_of_mass_height": "hummingbird"}
"""Vehicles for effects that need another one to show: a height is a lever only for drag at the hubs."""


@pytest.mark.parametrize("name", effects.catalogue())
def test_a_planted_value_is_recovered(name):
    base = vehicle.example(BASES.get(name, "rigter2019"))
    recovery = self_test.run(name, rng=np.random.default_rng(11), base=base)
    assert recovery.passed, f"planted {recovery.planted}, found {recovery.found} +- {recovery.std}"


def test_the_recovery_fails_when_values_are_off_or_not_significant():
    good = self_test.run("angular_damping", rng=np.random.default_rng(11))
    off = self_test.Recovery(good.names, good.planted + 5 * good.std, good.found, good.std)
    assert not off.passed
    insignificant = self_test.Recovery(good.names, good.planted, good.planted, 10 * np.abs(good.planted))
    assert not insignificant.passed
