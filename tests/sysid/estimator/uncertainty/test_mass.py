"""A wrong mass scales all that is fitted: it is named from that, and from nothing less."""

import re
from dataclasses import replace

import numpy as np
import pytest

from sysid.estimator.uncertainty import mass
from vehicle import Vehicle

FILE_ERROR = 0.05
BY_MASS = (
    "inertia_xx_kg_m2",
    "inertia_yy_kg_m2",
    "inertia_zz_kg_m2",
    "thrust_bem.k1_n_s2",
    "rotor_yaw_torque.torque_n_m_s2",
)
THROUGH_AIR = BY_MASS[3:]


def file_of(truth: Vehicle, rng: np.random.Generator, *, mass_kg: float, error: float = FILE_ERROR) -> Vehicle:
    """A vehicle file whose numbers are off by chance, as it says, and whose mass was given so."""
    given = truth.with_value("mass_kg", mass_kg, std=0.0, source="guessed")
    for name in BY_MASS:
        wrong = truth.value(name) * (1.0 + error * rng.standard_normal())
        given = given.with_value(name, wrong, std=error * truth.value(name), source="data sheet")
    return given


def fitted(truth: Vehicle, given: Vehicle, through_air: float = 1.0) -> dict[str, tuple[float, float]]:
    """What flights of the true vehicle give: everything per mass, with an error of half a per cent."""
    scale = given.mass_kg / truth.mass_kg
    factors = {name: scale * (through_air if name in THROUGH_AIR else 1.0) for name in BY_MASS}
    return {name: (truth.value(name) * f, 0.005 * truth.value(name)) for name, f in factors.items()}


def test_a_wrong_mass_is_named_with_the_mass_that_would_agree(truth):
    named = 0
    for seed in range(200):
        given = file_of(truth, np.random.default_rng(seed), mass_kg=1.15 * truth.mass_kg)
        common = mass.common_factor(given, fitted(truth, given))
        assert common is not None
        assert common.witnesses == len(BY_MASS)
        assert abs(common.value - 1.15) < 5.0 * common.sigma
        said = mass.sentences(given, fitted(truth, given), 1.15, 900.0)
        named += "is likely wrong; weigh the vehicle" in said[0]
    assert named > 0.9 * 200


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_the_masses_that_are_said_to_agree_hold_the_true_one(truth, factor):
    """Also where a wrong one is too little off to be named."""
    held, given_outside = 0, 0
    for seed in range(200):
        given = file_of(truth, np.random.default_rng(seed), mass_kg=factor * truth.mass_kg)
        found = fitted(truth, given)
        low, high = re.findall(r"masses of (\S+) to (\S+) kg agree", mass.what_is_known(given, found))[0]
        held += float(low) < truth.mass_kg < float(high)
        given_outside += not float(low) <= given.mass_kg <= float(high)
        if "is likely wrong" in "".join(mass.sentences(given, found, factor, 900.0)):
            assert not float(low) < given.mass_kg < float(high)
    assert held > 0.98 * 200
    assert given_outside < 0.02 * 200 if factor == 1.0 else given_outside > 0.3 * 200


def test_a_right_mass_is_left_alone(truth):
    named = sum(
        bool(mass.sentences(given, fitted(truth, given), 1.0, 900.0))
        for given in (file_of(truth, np.random.default_rng(seed), mass_kg=truth.mass_kg) for seed in range(500))
    )
    assert named <= 0.01 * 500


@pytest.mark.parametrize("through_air", [0.85, 1.2])
def test_thin_air_is_no_wrong_mass(truth, through_air):
    """It moves what goes through the air and no inertia; then the thrust alone is told, and not which it is."""
    given = file_of(truth, np.random.default_rng(3), mass_kg=truth.mass_kg, error=0.001)
    (said,) = mass.sentences(given, fitted(truth, given, through_air), through_air, 900.0)
    assert "flights cannot tell which" in said


def test_many_coefficients_of_thin_air_are_no_wrong_mass(truth):
    """At 1,000 m, of a file with exact numbers: six coefficients against three inertias."""
    drags = tuple(n for n, p in truth.parameters.items() if p.unit.startswith(("N", "kg")) and n not in BY_MASS)
    names = (*BY_MASS, *(name for name in drags if truth.value(name) > 0.0 and name != "mass_kg"))
    assert len(names) >= 8
    given = truth.with_value("mass_kg", truth.mass_kg, std=0.0, source="weighed")
    found = {}
    for name in names:
        given = given.with_value(name, truth.value(name), std=0.001 * truth.value(name), source="data sheet")
        found[name] = truth.value(name) * (1.0 if name.startswith("inertia_") else 0.89), 0.005 * truth.value(name)
    common = mass.common_factor(given, found)
    assert common is not None
    assert common.sigmas > mass.SIGMAS
    (said,) = mass.sentences(given, found, 0.89, 900.0)
    assert "flights cannot tell which" in said


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_inertias_of_a_heavy_drawing_are_no_wrong_mass(truth, factor):
    given = truth
    for name in BY_MASS[:4]:
        share = 0.01 if name.startswith("inertia_") else 0.05
        given = given.with_value(name, truth.value(name), std=share * truth.value(name), source="drawing")
    found = {name: (truth.value(name) * (factor if "inertia" in name else 1.0), 0.0) for name in BY_MASS[:4]}
    assert mass.sentences(given, found, 1.0, 900.0) == []


def test_without_stated_errors_or_an_inertia_nothing_is_known_of_the_mass(truth):
    given = file_of(truth, np.random.default_rng(3), mass_kg=1.3 * truth.mass_kg)
    found = fitted(truth, given)
    assert mass.common_factor(given, {name: found[name] for name in THROUGH_AIR}) is None
    unstated = replace(given, parameters={n: replace(p, std=0.0) for n, p in given.parameters.items()})
    assert mass.common_factor(unstated, found) is None
    assert "Whether it is right does not show" in mass.what_is_known(unstated, found)
