"""Hover commands, a rotor's thrust on a balance and the mass count as measurements, and contradictions are told."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import sysid
from flight import FlightLog, InputError
from sysid import HoverCommand, RotorThrust
from sysid.estimator.without_pose import anchors_judged
from sysid.estimator.without_pose.anchors import beside, rotor_thrust_n
from sysid.logs.motors import full_throttle
from tests.vehicle import frames
from vehicle import draft

MASS_KG, GRAVITY = 0.65, 9.80665


class Twin:
    """A vehicle, its log of 8 s, and what is true of it."""

    def __init__(self) -> None:
        import without_pose_flights as flights

        rng, body = np.random.default_rng(11), flights.body()
        self.values = flights.drawn(1, rng)
        self.k, self.slope = self.values["thrust_quadratic.k_n_s2"][0], body.value("thrust_affine.slope_n_s")
        self.full, self.start = flights.FULL_RAD_S, flights.start()
        (self.log,) = flights.flown(body, self.values, rng, duration_s=8.0)
        ratio = np.linspace(0.1, 1.0, 2000)
        self.hover = float(np.interp(MASS_KG * GRAVITY / 4.0, self.thrust_n(ratio), ratio))

    def thrust_n(self, ratio):
        speed = self.full * ratio
        return self.k * speed**2 + self.slope * speed

    def fitted(self, *anchors, mass_kg: float = MASS_KG, std_kg: float = 0.0) -> sysid.Identification:
        vehicle = self.start.with_value("mass_kg", mass_kg, std=std_kg)
        return sysid.identify([self.log], vehicle, sysid.Options(anchors=anchors))


@pytest.fixture(scope="module")
def twin(benchmarks_on_path) -> Twin:
    return Twin()


def _said(found: sysid.Identification, words: str) -> str:
    (sentence,) = (finding for finding in found.findings if words in finding)
    return sentence


def test_a_right_hover_command_is_told_beside_what_the_flights_say_without_it(twin):
    found = twin.fitted(HoverCommand(twin.hover, 0.002))
    said = _said(found, "hover command")
    assert "(given): without it flights and the rest say" in said
    assert float(said.split(" say ")[1].split()[0]) == pytest.approx(twin.hover, rel=0.02)
    assert not found.verdict.doubts


def test_a_hover_command_pulls_the_thrust_as_far_as_its_deviation_says(twin):
    plain, near, far = (
        twin.fitted(*anchors).vehicle
        for anchors in ((), (HoverCommand(1.04 * twin.hover, 0.002),), (HoverCommand(1.04 * twin.hover, 0.05),))
    )
    at = twin.start.limits.rotor_speed_max_rad_s * twin.hover
    near_n, far_n, plain_n = (rotor_thrust_n(v, np.array([at]))[0] for v in (near, far, plain))
    assert abs(far_n / plain_n - 1.0) < 0.005
    assert near_n / plain_n < 0.96


def test_a_wrong_hover_command_is_called_a_contradiction_with_figures(twin):
    found = twin.fitted(HoverCommand(1.2 * twin.hover, 0.01))
    said = _said(found, "contradicts flights and the rest, which say")
    assert "standard errors away. Measure it again" in said
    assert said in found.verdict.doubts


def test_a_thrust_on_a_balance_weighs_the_vehicle_and_scales_what_goes_with_the_mass(twin):
    found = twin.fitted(RotorThrust(0.6, twin.thrust_n(0.6), 0.02), mass_kg=0.75, std_kg=0.1)
    assert found.vehicle.mass_kg == pytest.approx(MASS_KG, rel=0.03)
    assert found.vehicle.parameter("mass_kg").std < 0.02
    truth = twin.values["inertia_xx_kg_m2"][0]
    assert found.estimate("inertia_xx_kg_m2").value == pytest.approx(truth, rel=0.04)
    assert "together" in _said(found, "mass 0.75 ± 0.1 kg (given)")
    assert not any("not estimated" in finding for finding in found.findings)


def test_a_thrust_that_contradicts_a_sure_mass_names_the_mass_that_would_agree(twin):
    found = twin.fitted(RotorThrust(0.6, 1.2 * twin.thrust_n(0.6), 0.02))
    said = _said(found, "contradicts flights, mass and the rest")
    agrees_kg = float(said.split("weigh the vehicle: ")[1].split()[0])
    assert agrees_kg == pytest.approx(1.2 * MASS_KG, rel=0.03)
    assert said in found.verdict.doubts
    assert found.vehicle.mass_kg == MASS_KG


def test_hover_commands_at_two_voltages_give_the_batterys_effect(twin):
    sag, first_v, second_v = 0.05, 15.6, 14.2
    low = twin.hover / (1.0 - sag * (first_v - second_v))
    found = twin.fitted(HoverCommand(twin.hover, 0.003, first_v), HoverCommand(low, 0.003, second_v))
    assert found.vehicle.value("battery_sag.sag_per_v") == pytest.approx(sag, rel=0.05)
    assert found.vehicle.value("battery_sag.reference_v") == pytest.approx(first_v, abs=0.3)
    assert "the flights, whose voltage was not logged, were at" in _said(found, "battery: by hover commands")


def test_hover_commands_that_fall_with_the_voltage_contradict_a_battery(twin):
    found = twin.fitted(HoverCommand(twin.hover, 0.003, 15.6), HoverCommand(0.9 * twin.hover, 0.003, 14.2))
    assert "less voltage needs more command" in _said(found, "contradict a battery")
    assert "battery_sag" not in found.vehicle.effects


def test_anchors_of_a_log_in_rotor_speeds_are_refused_and_so_are_figures_that_cannot_be(twin):
    in_speeds = full_throttle.with_command_speeds(twin.log, 2400.0)
    columns = {name: v for name, v in in_speeds.columns.items() if not name.endswith("_ratio")}
    log = FlightLog(columns, {"name": "speeds"})
    with pytest.raises(InputError, match="logged in rotor speeds"):
        sysid.identify([log], twin.start, sysid.Options(anchors=(HoverCommand(0.5),)))
    for wrong in (
        lambda: HoverCommand(1500.0),
        lambda: HoverCommand(0.5, std=0.0),
        lambda: RotorThrust(0.5, -1.0, 0.1),
        lambda: HoverCommand(0.5, battery_v=-1.0),
    ):
        with pytest.raises(InputError):
            wrong()


def test_where_yaw_shows_only_a_ratio_the_shape_of_a_multirotor_settles_its_inertia():
    """A vehicle alike about x and y that hardly rolls: torque and inertia both went to zero together."""
    import without_pose_flights as flights

    rng = np.random.default_rng(8)
    values = flights.drawn(1, rng)
    values["inertia_yy_kg_m2"] = values["inertia_xx_kg_m2"]
    values["inertia_zz_kg_m2"] = 1.6 * values["inertia_xx_kg_m2"]
    (log,) = flights.flown(flights.body(), values, rng, duration_s=8.0, effort=(1.0, 0.1, 0.1))
    estimate = sysid.identify([log], flights.start()).estimate("inertia_zz_kg_m2")
    truth = values["inertia_zz_kg_m2"][0]
    assert abs(estimate.value - truth) < estimate.interval90 < 0.5 * truth


@pytest.mark.parametrize("frame", ["x", "hex", "octo"])
def test_a_hover_command_is_of_all_rotors_of_the_vehicle(frame):
    body, flight = (
        draft.draft(frames.small(frame)),
        SimpleNamespace(full_throttle_rad_s=1000.0, battery_v=np.array([np.nan])),
    )
    right = beside([HoverCommand(0.5, 0.01)], [cast(Any, flight)], body, (), {})
    assert right.hovers_at(body, None) == pytest.approx(0.5, abs=1e-3)
    assert right.errors(body) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("sigmas", "wrong"), [(2.9, False), (3.1, True)])
def test_an_anchor_contradicts_all_the_rest_from_three_standard_errors_on(sigmas, wrong):
    """As far apart as the deviations of both, added in squares, say."""
    rest = anchors_judged._Rest(apart=-0.05 * sigmas, std=0.04)
    known = cast(Any, SimpleNamespace(hovers=(HoverCommand(0.5, 0.03),)))
    judged = anchors_judged._hover(known, 0, rest)
    assert judged.sigmas == pytest.approx(sigmas)
    assert judged.contradicts is wrong
    assert ("contradicts flights and the rest" in judged.sentence) is wrong
