"""By which size a standard error is judged: what every vehicle has by its own, what may be nil by what is typical."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

import vehicle
from sysid.estimator.uncertainty.identifiable import usual_size
from vehicle import specs

PLAIN = vehicle.example("hummingbird").with_effect("thrust_affine").with_effect("angular_damping")


def size(name: str, value: float) -> float:
    return usual_size(PLAIN, cast("Any", SimpleNamespace(value=lambda _: value)), name)


@pytest.mark.parametrize("name", ["thrust_affine.constant_n", "thrust_affine.slope_n_s", "angular_damping.x_n_m_s"])
def test_a_parameter_that_may_be_nil_is_not_judged_by_a_small_value_of_its_own(name):
    typical = specs(PLAIN)[name].prior
    assert size(name, 1e-3 * typical) == typical
    assert size(name, 5.0 * typical) == 5.0 * typical


@pytest.mark.parametrize("name", ["thrust_quadratic.k_n_s2", "rotor_yaw_torque.torque_n_m_s2", "inertia_zz_kg_m2"])
def test_what_every_vehicle_has_is_judged_by_its_value(name):
    assert size(name, 0.1 * PLAIN.value(name)) == PLAIN.value(name)
    assert size(name, 3.0 * PLAIN.value(name)) == 3.0 * PLAIN.value(name)
