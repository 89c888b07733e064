"""Whether the law of a named drag is of a form that the catalogue lacks, on flights of a vehicle with linear drag."""

import numpy as np
import pytest

import vehicle
from sysid import Options, identify
from sysid.diagnosis.evidence.candidates import candidate_set
from sysid.diagnosis.examined import examine, of_another_form
from sysid.diagnosis.procedure import while_searching
from tests.sysid import flying
from vehicle import Vehicle

WHITE = while_searching(Options(gusts="white"))
LINEAR = ("parasitic_drag_linear",)
STAND_INS = ("rotor_drag_thrust", "parasitic_drag_speed")


def linear_drag(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return -0.3 * velocity * [1.0, 1.0, 0.0], 0.0 * rate


@pytest.fixture(scope="module")
def logs() -> list:
    truth = flying.Truth(rotor_drag=0.0, drag_xy=0.0, drag_z=0.0, extra=linear_drag)
    rng = np.random.default_rng(4)
    return flying.fly(truth, flying.paper_flights(rng), 3, duration_s=16.0, rng=rng, rate_hz=100.0)


def with_drag(*names: str) -> Vehicle:
    bare = vehicle.example().without_effect("rotor_drag_thrust").without_effect("parasitic_drag")
    for name in names:
        bare = bare.with_effect(name)
    return bare


@pytest.mark.slow
@pytest.mark.parametrize(("names", "lacking"), [(LINEAR, False), (STAND_INS, True)])
def test_laws_that_stand_in_for_another_drag_are_told_from_the_right_one(logs: list, names, lacking: bool):
    """No curve along one axis shows it: the coefficients are of both."""
    model = examine(identify(logs, with_drag(*names), WHITE))
    every = candidate_set(with_drag(), model.fit.flights)
    found = of_another_form(model, [(every.candidate(name), 1e9) for name in names])
    assert set(found) == set(names)
    assert all((probability > 0.6) if lacking else (probability < 0.05) for probability in found.values())
