"""What does not settle is held, and the errors of what goes along with it allow for that."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import sysid
from sysid.estimator.joint_problem.solver import covariance_of
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.result import NOT_SETTLED
from sysid.estimator.uncertainty.unsettled import least_settled, variances

THRUST, SLOPE, INERTIA = "thrust_bem.k1_n_s2", "thrust_bem.k2_n_s2_m", "inertia_zz_kg_m2"


def stuck(covariance: np.ndarray, *values: list[float]) -> Any:
    """A fit that took these steps, and did not converge."""
    return cast(
        "Any", SimpleNamespace(record=[SimpleNamespace(values=v) for v in values], covariance=lambda: covariance)
    )


def test_what_does_not_settle_is_named_with_what_it_is_confounded_with(truth):
    covariance = np.array([[1.0, 0.97, 0.0], [0.97, 1.0, 0.0], [0.0, 0.0, 1.0]])
    unknowns = Unknowns((THRUST, INERTIA), (), ("bias",))
    steps = [1.0, 5.0, 0.0], [1.1, 7.0, 0.0], [1.0, 5.0, 9.0]  # the last is no parameter of the vehicle
    found = least_settled(stuck(covariance, *steps), unknowns, truth)
    assert found is not None
    assert (found.name, found.confounded, found.held) == (INERTIA, (THRUST,), truth.value(INERTIA))
    covariance[0, 1] = covariance[1, 0] = 0.5
    assert least_settled(stuck(covariance, *steps), unknowns, truth) is None


def test_errors_beside_held_parameters_are_those_with_all_free(truth):
    """What is held one after the other adds up to the joint covariance, where the fit stands at the held values."""
    names = (THRUST, SLOPE, INERTIA)
    made_of = np.array([[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.0, 0.4, 0.1]])
    information = np.linalg.inv(made_of @ made_of.T)
    held = []
    for first in (0, 1):
        left, there = Unknowns(names[first:], (), ()), [truth.value(name) for name in names[first:]]
        found = least_settled(stuck(covariance_of(information[first:, first:]), there, there), left, truth)
        assert found is not None
        assert found.name == names[first]
        held.append(found)
    with_them_held = 1.0 / information[2, 2]
    last = Unknowns((INERTIA,), (), ())
    assert with_them_held + variances(held, last)[0] == pytest.approx((made_of @ made_of.T)[2, 2])
    assert variances((), last) == 0.0


@pytest.mark.slow
def test_thrust_beside_a_held_slope_has_the_error_it_has_with_both_free(flying, truth):
    """In three steps the fit does not settle; with the slope held k1 had an eighth of its error."""
    rng = np.random.default_rng(3)
    gusty = replace(flying.Truth(), gust=0.3, gust_torque=1.0)
    logs = flying.fly(gusty, flying.paper_flights(rng, 1, 0.2), 3, duration_s=12.0, rng=rng, rate_hz=100.0)
    free = sysid.identify(logs, truth)
    assert abs(free.correlation[free.free_names.index(THRUST), free.free_names.index(SLOPE)]) > 0.97
    held = sysid.identify(logs, truth, sysid.Options(max_iterations=3))
    assert held.estimate(SLOPE).status == NOT_SETTLED
    assert held.estimate(THRUST).interval90 > 0.9 * free.estimate(THRUST).interval90
    assert any(SLOPE in finding and "intervals allow for" in finding for finding in held.findings)
    for name in (n for n in held.free_names if n != THRUST):  # those that nothing ties to it keep theirs
        assert held.estimate(name).interval90 == pytest.approx(free.estimate(name).interval90, rel=0.25)
