"""Force and moment against what the sensors say, no model asked."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare
from sysid.estimator.result import CHANNELS
from sysid.estimator.validation import measured
from sysid.estimator.validation.wrench_error import at_centre_of_mass, wrench_errors


@pytest.fixture(scope="module")
def found(campaign, truth):
    models = {"truth": truth, "without drag": truth.without_effect("rotor_drag_thrust")}
    return wrench_errors(campaign[1:2], models)  # the fast one


def test_the_true_model_explains_what_was_measured(found):
    assert (found.explained["truth"] > 0.8).all()
    assert (found.rmse["truth"] < 0.5 * found.size).all()


def test_a_missing_drag_shows_in_the_level_forces(found):
    for i in (CHANNELS.index("F_x"), CHANNELS.index("F_y")):
        assert found.rmse["without drag"][i] > 1.5 * found.rmse["truth"][i]


def test_a_heavier_body_does_not_lower_the_error_of_others(campaign, truth):
    first = wrench_errors(campaign[:1], {"truth": truth})
    heavy = truth.with_value("inertia_xx_kg_m2", 10.0 * truth.value("inertia_xx_kg_m2"))
    beside = wrench_errors(campaign[:1], {"truth": truth, "heavy": heavy})
    np.testing.assert_array_equal(first.rmse["truth"], beside.rmse["truth"])


def test_the_lever_arm_of_the_accelerometer_is_taken_out(campaign, truth):
    """What an accelerometer 5 cm off reads, its place known, is the force at the centre of mass again."""
    place = np.array([0.05, -0.03, 0.02])
    flight = prepare(campaign[2], 0, Options())[0]
    seen, mid = measured.acceleration(flight, measured.states(flight, campaign[2], PoseSensor.of(truth)))
    rate = mid.rate_body_rad_s
    off = seen[:, :3] + np.cross(seen[:, 3:], place) + np.cross(rate, np.cross(rate, place))
    flight = replace(flight, readings={**flight.readings, "specific_force_body_m_s2": off})
    placed = truth.with_effect("imu_errors", **{f"place_{a}_m": float(place[i]) for i, a in enumerate("xyz")})
    np.testing.assert_allclose(at_centre_of_mass(seen, flight, mid, placed), seen, atol=1e-12)
    assert np.abs(at_centre_of_mass(seen, flight, mid, truth) - seen).max() > 0.1


def test_figures_are_json(found):
    facts = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert set(facts["models"]["truth"]["explained"]) == set(CHANNELS)
