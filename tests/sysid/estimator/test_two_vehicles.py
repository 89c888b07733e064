"""Flights of two vehicles are distinguished, and a vehicle whose model lacks something is not taken for two."""

import numpy as np
import pytest

from flight import FlightLog, InputError
from sysid import Options
from sysid.diagnosis import diagnose
from sysid.estimator import two_vehicles
from sysid.estimator.identification import identify
from sysid.estimator.two_vehicles import of_two_vehicles

WHITE = Options(node_rate_hz=100.0, gusts="white")


def named(logs, names: str) -> list[FlightLog]:
    return [FlightLog(log.columns, {**log.metadata, "name": n}) for log, n in zip(logs, names, strict=True)]


@pytest.fixture(scope="module")
def weaker(flying) -> list[FlightLog]:
    """Flights of a second vehicle, with other propellers."""
    rng = np.random.default_rng(8)
    other = flying.Truth(k1=2.6e-6, c_q=2.2e-8)
    return flying.fly(other, flying.paper_flights(rng), 3, duration_s=8.0, rng=rng, rate_hz=100.0)[:2]


@pytest.fixture(scope="module")
def shorter(campaign) -> list[FlightLog]:
    return [log.slice(0.0, 8.0) for log in campaign]


@pytest.mark.parametrize("order", ["ABab", "aAbB"])
def test_the_flights_of_each_vehicle_are_named(shorter, weaker, truth, order):
    logs = dict(zip("ABab", named([*shorter[:2], *weaker], "ABab"), strict=True))
    flown = [logs[name] for name in order]
    said = of_two_vehicles(flown, truth, identify(flown, truth, WHITE), WHITE)
    assert said is not None
    assert all(f"the flights {group} " in said for group in ("A, B", "a, b"))
    assert "Diagnose each group by itself" in said


@pytest.mark.parametrize("lacking", [(), ("rotor_drag_thrust", "parasitic_drag")])
def test_flights_of_one_vehicle_are_not_taken_for_two(shorter, truth, lacking, monkeypatch):
    """Nor where the file lacks what was added, though the flights were not equally fast and disagree without it."""
    given = truth
    for name in lacking:
        given = given.without_effect(name)
    monkeypatch.setattr(two_vehicles, "WORTH_A_TRIAL", 0.0)
    assert of_two_vehicles(shorter, given, identify(shorter, truth, WHITE), WHITE) is None


@pytest.mark.slow
def test_a_diagnosis_of_two_vehicles_ends_with_one_sentence(shorter, weaker, truth):
    flown = named([*shorter[:2], *weaker], "ABab")
    with pytest.raises(InputError, match="the flights A, B and the flights a, b are not of one vehicle") as error:
        diagnose(flown, truth)
    assert all(len(part.split()) <= 40 for part in str(error.value).split(". "))
