"""Calibration, whole: a truth of other physics is identified from its logs, preflown, and then flown.

Shared are the controller, the numbers of the sensors' noise (`Sensors.typical`) and, by form, the laws of thrust and
drag. Integrator, spectrum of the gusts and every number of the truth are the tests' own; told are its mass, the gusts'
size and length, and the control rate. Lags of the truths spread as far as the model says. A preflight flies at the
truth's 400 Hz: at 500 Hz the tube would be a tenth slimmer in places, and hold 83 % of flights in place of 90 %.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy import special

import preflight
import sysid
import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from flight import FloatArray, Trajectory, rotations
from goshawk.paper import curves
from preflight import core
from tests.preflight import rotorpy_physics, test_exam
from tests.preflight.other_physics import OtherPlant, Together, VonKarman, unlike_the_drawing
from tests.preflight.rotorpy_physics import RotorPy
from tests.preflight.test_exam import AIR, CURVE, GUST_M_S, AlongTheWay
from tests.sysid import flying
from vehicle import Vehicle, simulate

WIND_M_S = 2.0
QUANTILES = (0.05, 0.1, 0.3)


@dataclass(frozen=True)
class Subject:
    """A truth, and what is believed of it before any flight."""

    truth: Callable[[], flying.Truth | RotorPy]
    drawing: Callable[[], Vehicle]


def drawing(name: str = "rigter2019") -> Vehicle:
    drone = vehicle.example(name)
    for axis in "xyz":
        drone = drone.with_value(f"pose_sensor_{axis}_m", 0.0)
    return drone


SUBJECTS = {
    "the tests' own": Subject(unlike_the_drawing, drawing),
    "RotorPy's Hummingbird": Subject(
        lambda: RotorPy(rotorpy_physics.hummingbird(), 0.005), lambda: drawing("hummingbird")
    ),
    "crazyflow's cf21B_500": Subject(
        lambda: RotorPy(rotorpy_physics.crazyflow(), rotorpy_physics.CRAZYFLOW_LAG_S), rotorpy_physics.crazyflow_drawing
    ),
}
OWN = "the tests' own"


def flown(
    model: Vehicle,
    path: Trajectory,
    wind_m_s: float,
    gust_m_s: float,
    seed: int,
    *,
    lag_s: float | None = None,
    together: Together | None = None,
    of: str = OWN,
) -> closed_loop.Flown:
    """The truth along a path, its controller told a model."""
    truth = SUBJECTS[of].truth()
    rng = np.random.default_rng((606, seed))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    wind = wind_m_s * np.array([np.cos(angle), np.sin(angle), 0.0])
    gusts = VonKarman(gust_m_s, core.Air().gust_length_m, wind, rng)
    start = path.position([0.0])[0] * [1.0, 1.0, 0.0]
    truth = truth if lag_s is None else replace(truth, lag=lag_s)
    plant = OtherPlant(truth, start, wind_m_s=wind, gusts=gusts, together=together)
    return closed_loop.fly(plant, parameters_of(model), path, sensors=Sensors.typical(), seed=seed, imu=True)


def lags_s(model: Vehicle, count: int) -> FloatArray:
    """(count,) as a preflight draws them."""
    lag = model.parameter("motor_lag.rise_s")
    width = np.sqrt(np.log1p((lag.std / lag.value) ** 2))
    return lag.value * np.exp(width * np.random.default_rng(607).standard_normal(count) - 0.5 * width**2)


def flights(model: Vehicle, path: Trajectory, count: int, of: str = OWN) -> list[closed_loop.Flown]:
    """Many in the exam's wind, the truth of each with a lag that the model holds for as likely: no log told it."""
    together = Together(count)
    return together.fly(
        functools.partial(
            flown,
            model,
            path,
            WIND_M_S,
            GUST_M_S,
            100 + i,
            lag_s=float(lag_s),
            together=together,
            of=of,
        )
        for i, lag_s in enumerate(lags_s(model, count))
    )


@functools.cache
def identified(of: str = OWN) -> sysid.Identification:
    paths = (curves.vertical(turns=3), curves.figure_eight(turns=2), curves.general(turns=2))
    believed = SUBJECTS[of].drawing()
    logs = [flown(believed, path, 0.0, 0.3, i, of=of).log for i, path in enumerate(paths)]
    return sysid.identify(logs, believed)


@functools.cache
def predicted(flights: int, of: str = OWN) -> preflight.Result:
    options = preflight.Options(
        flights=flights, uncertainty=AIR, risk=0.4, explain=False, rate_hz=400, rotor_speed_measured=True
    )  # as the truth's controller is told
    model = identified(of).vehicle
    return preflight.fly(preflight.Scenario(model, CURVE, AlongTheWay(0.0), radius_m=0.0, clearance_m=1.0), options)


def beside(truths: int, ahead: int, of: str = OWN) -> tuple[list[float], list[tuple[float, float]]]:
    """Shares of true flights inside the tubes of 50, 90 and 99 %, at each time; and contacts: predicted and seen."""
    model = identified(of).vehicle
    seen = [test_exam.kept(each) for each in flights(model, CURVE, truths, of)]
    errors, sideways = (np.array(each) for each in zip(*seen, strict=True))
    result = predicted(ahead, of)
    near = result.record.clearance_m
    walls_m = -np.quantile(near, QUANTILES)
    contacts = [(float(np.mean(near < -wall)), float(np.mean(sideways < -wall))) for wall in walls_m]
    return [float(np.mean(errors <= width_m)) for width_m in result.tube_m()], contacts


def unmoved(wind_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OtherPlant:
    wind = np.array(wind_m_s)
    calm = VonKarman(0.0, 5.0, wind, np.random.default_rng(1))
    return OtherPlant(unlike_the_drawing(), np.zeros(3), wind_m_s=wind, gusts=calm)


def test_the_other_plant_stands_where_it_is_and_falls_without_enough_thrust():
    still = unmoved()
    for _ in range(200):
        still.step(np.full(4, 300.0), 0.0025)
    assert still.position_world_m == pytest.approx(np.zeros(3), abs=1e-6)
    assert still.specific_force_body_m_s2 == pytest.approx([0.0, 0.0, 9.80665])
    still.state[0, 2] = 5.0
    for _ in range(100):
        still.step(np.full(4, 250.0), 0.0025)
    assert still.position_world_m[2] == pytest.approx(5.0 - 0.5 * 9.80665 * 0.25**2, abs=0.03)


def test_a_steady_wind_carries_what_does_not_resist():
    free = unmoved((2.0, 0.0, 0.0))
    free.state[0, 2], free.state[0, 3:6] = 50.0, 0.0  # at the wind's speed
    free.step(np.full(4, 250.0), 0.0025)
    assert free.velocity_world_m_s[:2] == pytest.approx([2.0, 0.0], abs=1e-6)


def test_the_other_gusts_have_the_size_and_the_length_that_are_told():
    gusts = [VonKarman(0.5, 5.0, np.array([0.0, 2.0, 0.0]), np.random.default_rng(i)) for i in range(2000)]
    here, farther = (np.array([each.at(way_m) for each in gusts]) for way_m in (0.0, 2.5))
    assert np.std(here, axis=0) == pytest.approx(np.full(3, 0.5), rel=0.05)
    alike = np.mean(here * farther, axis=0) / 0.25
    x = 2.5 / (1.339 * 5.0)  # von Karman's correlations in closed form
    root = 2.0 ** (2 / 3) / special.gamma(1 / 3) * x ** (1 / 3)
    assert alike[1] == pytest.approx(root * special.kv(1 / 3, x), abs=0.06)  # along the wind
    across = root * (special.kv(1 / 3, x) - 0.5 * x * special.kv(2 / 3, x))
    assert alike[[0, 2]] == pytest.approx(np.full(2, across), abs=0.06)


def risen(lag_s: float, steps: int, together: Together | None = None) -> FloatArray:
    """The state after so many steps of much thrust, in gusts of its own."""
    calm = np.zeros(3)
    gusts = VonKarman(0.5, 5.0, calm, np.random.default_rng(steps))
    plant = OtherPlant(replace(unlike_the_drawing(), lag=lag_s), calm, wind_m_s=calm, gusts=gusts, together=together)
    for _ in range(steps):
        plant.step(np.array([900.0, 910.0, 890.0, 900.0]), 0.0025)
    return plant.state[0]


def test_flights_in_lock_step_are_those_flown_alone_also_where_one_ends_before_another():
    each = ((0.02, 30), (0.03, 60), (0.05, 45))
    together = Together(len(each))
    several = together.fly(functools.partial(risen, *own, together) for own in each)
    for state, own in zip(several, each, strict=True):
        assert state == pytest.approx(risen(*own), rel=1e-12, abs=1e-12)
    assert np.linalg.norm(several[0][:3] - several[1][:3]) > 1e-3


def test_an_error_in_one_flight_ends_all_in_lock_step():
    together = Together(3)

    def breaks(steps: int) -> FloatArray:
        risen(0.03, steps, together)
        raise ZeroDivisionError("one flight's")

    own = (functools.partial(risen, 0.02, 30, together), functools.partial(breaks, 5), functools.partial(breaks, 9))
    with pytest.raises(ZeroDivisionError, match="one flight's"):
        together.fly(own)


def test_a_plant_that_cannot_be_moved_ends_all_in_lock_step():
    together = Together(2)
    ill = [functools.partial(together.step, None, np.zeros((1, 17)), np.zeros(4), 0.0025)] * 2
    with pytest.raises(AttributeError):
        together.fly(ill)


@pytest.mark.slow
def test_a_truth_of_other_physics_is_found_and_flies_as_was_predicted():
    truth, fit = unlike_the_drawing(), identified()
    for axis, value in zip(("xx", "yy", "zz"), truth.inertia, strict=True):
        assert fit.estimate(f"inertia_{axis}_kg_m2").value == pytest.approx(value, rel=0.02)
    (fifty, ninety, ninety_nine), contacts = beside(100, 1000)
    assert 0.44 < fifty < 0.56
    assert 0.87 <= ninety <= 0.93
    assert ninety_nine > 0.97
    for expected, seen in contacts:
        assert test_exam.agree(expected, round(100 * seen), 100)


def as_told(drone: Vehicle, parameters: Mapping[str, Any]) -> Vehicle:
    """A drawing with the truth's own values."""
    drone = drone.with_value("thrust_quadratic.k_n_s2", parameters["k_eta"])
    drone = drone.with_value("rotor_drag_speed.drag_kg", parameters["k_d"])
    for axis in ("xx", "yy", "zz"):
        drone = drone.with_value(f"inertia_{axis}_kg_m2", parameters[f"I{axis}"])
    return drone


@pytest.mark.parametrize("of", [name for name in SUBJECTS if name != OWN])
def test_a_truth_of_rotorpy_moves_as_our_model_with_its_values(of):
    truth = SUBJECTS[of].truth()
    assert isinstance(truth, RotorPy)
    drone = as_told(SUBJECTS[of].drawing(), truth.parameters)
    drag = "parasitic_drag_speed.drag_{}_kg_m"
    for axis in "xyz" if "parasitic_drag_speed" in drone.effects else "":
        drone = drone.with_value(drag.format(axis), truth.parameters[f"c_D{axis}"])
    rng, hover = np.random.default_rng(2), vehicle.invert.hover(drone)
    q = rotations.normalise(np.array([1.0, 0.2, -0.1, 0.3]))
    state = np.concatenate([[0.0, 0.0, 5.0], rng.normal(0.0, 2.0, 3), q, rng.normal(0.0, 1.0, 3), hover])
    command = hover * [1.05, 0.97, 1.01, 0.96]
    found = truth.steps([truth], state[None], command[None], 0.0025)[0]
    plant = simulate.Plant(
        drone, simulate.State(state[:3], state[3:6], q, state[10:13], state[13:]), step_s=0.0025
    )  # fmt: skip
    plant.step(command, 0.0025)
    assert found[3:6] == pytest.approx(plant.velocity_world_m_s, abs=1e-5)
    assert found[6:10] == pytest.approx(plant.q_world_body, abs=1e-6)
    assert found[10:13] == pytest.approx(plant.rate_body_rad_s, abs=1e-4)
    assert found[13:] == pytest.approx(plant.rotor_speed_rad_s, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("of", [name for name in SUBJECTS if name != OWN])
def test_other_vehicles_by_rotorpy_fly_as_was_predicted(of):
    (fifty, ninety, ninety_nine), contacts = beside(60, 600, of)
    assert 0.44 < fifty < 0.56
    assert 0.85 <= ninety <= 0.95
    assert ninety_nine > 0.97
    for expected, seen in contacts:
        assert test_exam.agree(expected, round(60 * seen), 60)
