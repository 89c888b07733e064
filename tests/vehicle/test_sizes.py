"""Usual sizes follow the vehicle: units agree, the reference vehicle keeps its own, a small one has small ones."""

import re
from dataclasses import replace

import numpy as np
import pytest

import vehicle
from vehicle import effects, sizes
from vehicle.effects.base import SAME

DIMENSIONS = {  # mass, length, time
    "kg": (1, 0, 0), "m": (0, 1, 0), "m2": (0, 2, 0), "s": (0, 0, 1), "s2": (0, 0, 2), "N": (1, 1, -2), "1": (0, 0, 0),
}  # fmt: skip
SCALED = [(e.name, s) for e in effects.catalogue().values() for s in e.parameters if s.scaling != SAME]


def dimensions(unit: str) -> np.ndarray:
    above, _, below = unit.partition("/")
    total = np.zeros(3)
    for part, sign in ((above, 1), (below, -1)):
        for token in part.split():
            assert token in DIMENSIONS, token
            total += sign * np.array(DIMENSIONS[token])
    return total


@pytest.mark.parametrize(("effect", "spec"), SCALED, ids=[f"{e}.{s.name}" for e, s in SCALED])
def test_a_scaling_agrees_with_the_unit_up_to_gravity_or_the_density_of_air(effect, spec):
    mass, arm, speed = spec.scaling
    left = dimensions(spec.unit) - [mass, arm, -speed]
    of_gravity = left[0] == 0.0 and left[2] == -2.0 * left[1]
    of_air = left[0] == 1.0 and left[1] == -3.0 and left[2] == 0.0
    assert of_gravity or of_air, f"{effect}: {spec.unit} leaves {left}"


def test_what_depends_on_the_vehicle_by_its_unit_is_scaled():
    """Masses, forces and moments of inertia are never the same on a vehicle of 30 g."""
    for effect in effects.catalogue().values():
        for spec in effect.parameters:
            if re.search(r"kg|N", spec.unit):
                assert spec.scaling != SAME, f"{effect.name}.{spec.name} in {spec.unit}"


def test_the_reference_vehicle_has_the_catalogues_sizes():
    mass_kg, arm_m, hover_rad_s = sizes.REFERENCE
    own = vehicle.example("rigter2019")
    assert own.mass_kg == pytest.approx(mass_kg)
    assert np.linalg.norm(own.hub_body_m[0]) == pytest.approx(arm_m, rel=0.01)
    for effect in effects.catalogue().values():
        for spec in effect.parameters:
            assert sizes.usual(spec, own, hover_rad_s) == pytest.approx(spec.prior, rel=0.02)


def test_usual_damping_is_the_same_share_of_what_a_vehicle_of_any_size_can_turn_with():
    """Damping at a body rate over weight times arm, where the rate counts in rotor speeds."""
    spec = effects.find("angular_damping").parameters[0]
    large = vehicle.example("rigter2019")
    small = replace(large, hub_body_m=0.3 * large.hub_body_m).with_value("mass_kg", 0.03)
    shares = [
        sizes.usual(spec, v, n) * n / (v.mass_kg * np.linalg.norm(v.hub_body_m[0, :2]))
        for v, n in ((large, 950.0), (small, 2200.0))
    ]
    assert shares[0] == pytest.approx(shares[1])
