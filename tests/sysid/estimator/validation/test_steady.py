"""What lasts in the measured disturbance: a weight, a wind, a centre of mass, each found for what it is."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from flight import FlightLog
from sysid.estimator.validation.lasting import lasting
from sysid.estimator.validation.steady import NEEDS, Known, Steady, steady
from tests.vehicle import frames
from vehicle import Vehicle, draft, manoeuvres, simulate

FILE = vehicle.example("rigter2019")
DRAG = ("rotor_drag_thrust", "parasitic_drag")
WIND = (2.0, -1.0, 0.0)


@cache
def flown(what: str) -> FlightLog:
    """A true vehicle or weather that is not the file's, flown by a controller of the file."""
    truth, file, wind, gust_m_s = FILE, FILE, (0.0, 0.0, 0.0), 0.0
    if what == "heavy":
        truth = truth.with_value("mass_kg", 1.05 * truth.mass_kg)
    elif what == "weak":
        truth = truth.with_effect("weak_rotor", loss_0=0.05, loss_1=0.05, loss_2=0.05, loss_3=0.05)
    elif what == "nicked":
        truth = truth.with_effect("weak_rotor", loss_2=0.15)
    elif what == "off centre":
        truth = truth.with_value("centre_of_mass.x_m", truth.value("centre_of_mass.x_m") + 0.005)
    elif what == "more drag":
        file = _without(file)
    elif what == "wind":
        wind = WIND
    elif what == "wind, no drag known":
        file, wind = _without(file), WIND
    elif what == "gusts":
        wind, gust_m_s = WIND, 1.0
    path = manoeuvres.scaled(manoeuvres.make("oblique"), 0.5)
    start = simulate.State(path.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(truth, start, wind=simulate.Wind(wind, gust_m_s), ground_m=0.0, rng=np.random.default_rng(1))
    return closed_loop.fly(plant, parameters_of(file), path, sensors=Sensors.typical(), imu=True).log


def _without(file: Vehicle) -> Vehicle:
    for effect in DRAG:
        file = file.without_effect(effect)
    return file


def found(what: str, file: Vehicle = FILE) -> Steady:
    one = steady(flown(what), file, file)
    assert one is not None
    return one


def test_gusts_are_told_beside_the_wind_and_hardly_any_of_calm_air():
    gusty, calm = found("gusts"), found("wind")
    assert gusty.gust_m_s == pytest.approx(1.0, rel=0.3)
    assert calm.gust_m_s == pytest.approx(0.0, abs=0.4)
    assert found("wind, no drag known", _without(FILE)).gust_m_s is None


def test_a_drag_that_the_file_lacks_makes_no_storm():
    """With the airframe's drag alone, a tenth of all at these speeds, errors of the model would count tenfold."""
    assert found("wind", FILE.without_effect("rotor_drag_thrust")).gust_m_s is None


def test_a_flight_as_the_file_has_it_offers_nothing():
    said = lasting({"calm": found("calm")}, FILE)
    assert said.sentences == ()
    assert said.changes == ()


@pytest.mark.parametrize(("what", "ratio"), [("heavy", 1.05), ("weak", 1.0 / 0.95)])
def test_weight_over_thrust_is_found_and_both_readings_are_offered(what, ratio):
    one = found(what)
    assert one.weight.value == pytest.approx(ratio, abs=0.005)
    said = lasting({"a": one, "b": one}, FILE)
    assert "weighs 4.9% more" in said.sentences[0] or "weighs 5." in said.sentences[0]
    assert "less thrust" in said.sentences[0]
    (_, mass), (_, thrust) = said.changes
    assert mass["mass_kg"] == pytest.approx(ratio * FILE.mass_kg, rel=0.005)
    weaker = FILE
    for name, value in thrust.items():
        weaker = weaker.with_value(name, value)
    again = steady(flown(what), weaker, FILE)
    assert again is not None
    assert again.weight.value == pytest.approx(1.0, abs=0.005)


def test_missing_thrust_and_a_torque_that_fit_one_rotor_are_that_rotor():
    said = lasting({"walk": found("nicked")}, FILE)
    assert len(said.sentences) == 1
    assert "rotor 2 gives 1" in said.sentences[0]
    assert said.changes == ()
    known = FILE.with_effect("weak_rotor")
    one = steady(flown("nicked"), known, known)
    assert one is not None
    ((_, values),) = lasting({"walk": one}, known).changes
    assert values["weak_rotor.loss_2"] == pytest.approx(0.15, abs=0.02)


def test_a_lasting_wind_is_neither_weight_nor_drag():
    one = found("wind")
    assert one.wind_m_s is not None
    assert [w.value for w in one.wind_m_s] == pytest.approx(WIND[:2], abs=0.15)
    assert one.weight.value == pytest.approx(1.0, abs=0.01)
    said = lasting({"walk": one}, FILE).sentences
    told = re.search(r"m/s from (\d+) deg", said[0])
    assert told is not None
    assert float(told[1]) == pytest.approx(np.rad2deg(np.arctan2(1.0, -2.0)), abs=4.0)  # from (-2, 1)
    assert not any("follows the velocity" in sentence or "weighs" in sentence for sentence in said)


def test_without_drag_in_the_file_a_force_is_told_and_no_wind():
    file = _without(FILE)
    one = found("wind, no drag known", file)
    assert one.wind_m_s is None
    assert "a lasting force of" in lasting({"walk": one}, file).sentences[0]


def test_drag_that_the_file_lacks_is_no_wind():
    file = _without(FILE)
    said = lasting({"walk": found("more drag", file)}, file).sentences
    assert any("follows the velocity" in sentence for sentence in said)
    assert not any("lasting force" in sentence or "wind of" in sentence for sentence in said)


def test_a_lasting_torque_is_a_centre_of_mass_beside_the_files():
    said = lasting({"walk": found("off centre")}, FILE)
    ((_, centre),) = said.changes
    assert centre["centre_of_mass.x_m"] == pytest.approx(FILE.value("centre_of_mass.x_m") + 0.005, abs=3e-4)
    assert centre["centre_of_mass.y_m"] == pytest.approx(FILE.value("centre_of_mass.y_m"), abs=3e-4)
    assert "no effect of flight" in said.sentences[-1]


@pytest.mark.parametrize("gone", NEEDS)
def test_without_the_motion_nothing_is_said(gone):
    log = flown("heavy")
    stem = gone.split("_world")[0].split("_body")[0].split("_rad")[0]
    columns = {
        n: v for n, v in log.columns.items() if not n.startswith((stem + "_0", stem + "_world_", stem + "_body_"))
    }
    assert steady(replace(log, columns=columns), FILE, FILE) is None


def test_two_seconds_are_too_short():
    log = flown("heavy")
    assert steady(log.slice(log.time_s[0], log.time_s[0] + 2.0), FILE, FILE) is None


def test_flights_that_disagree_on_the_weight_raise_its_error():
    one = found("heavy")
    other = replace(one, weight=Known(one.weight.value - 0.08, one.weight.std))
    assert not any("weighs" in sentence for sentence in lasting({"a": one, "b": other}, FILE).sentences)


@pytest.mark.parametrize("frame", ["x", "hex", "octo"])
def test_a_weak_rotor_of_any_number_is_told_with_its_own_loss(frame):
    body, loss = draft.draft(frames.small(frame)).with_effect("weak_rotor"), 0.3
    missing = loss / body.rotors
    none, surely = Known(0.0, 1e-4), 1e-4
    arm_x, arm_y = (float(arm) * missing for arm in body.hub_body_m[1, :2])
    one = Steady(
        Known(1.0 / (1.0 - missing), surely),
        None,
        (none, none),
        none,
        0.0,
        (Known(arm_x, surely), Known(arm_y, surely)),
        False,
    )
    said = lasting({"walk": one}, body)
    assert said.sentences[0].startswith("rotor 1 gives 30% less thrust")
    ((_, values),) = said.changes
    assert values["weak_rotor.loss_1"] == pytest.approx(loss, abs=1e-6)
