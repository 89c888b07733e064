"""Off board six or eight rotors fly by collective thrust and body rates; the embedded mixer refuses them."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import controller
from firmware_bridge.autopilot import settings as autopilot_settings
from firmware_bridge.autopilot.flavour import PX4
from firmware_bridge.offboard import settings
from firmware_bridge.offboard.collective.at_rest import RotorsAtRest
from flight import InputError
from goshawk.commands.fly import autopilot, crazyflie, many_rotors, offboard
from goshawk.commands.preflight import inputs
from vehicle import Parameter, draft, effects, invert
from vehicle.draft import Known
from vehicle.forces import Surroundings

RATES = {"roll_srate": "100", "pitch_srate": "100", "yaw_srate": "100", "min_check": "1050"}


def made(frame: str, lean_rad: float = 0.0) -> vehicle.Vehicle:
    hubs, spin = draft.layout(0.28, frame)
    outward = hubs / np.linalg.norm(hubs, axis=1)[:, None]
    aside = -np.cross([0.0, 0.0, 1.0], outward) * spin[:, None]
    axis = np.cos(lean_rad) * np.array([0.0, 0.0, 1.0]) + np.sin(lean_rad) * aside
    mass, radius = Parameter(1.6, 0.01, "kg", "given"), Parameter(0.115, 0.0, "m", "given")
    known = Known(
        name=frame, mass_kg=mass, hub_body_m=hubs, spin=spin, axis_body=axis if lean_rad else None,
        rotor_radius_m=radius, hover_rad_s=500.0, rotor_speed_max_rad_s=900.0,
    )  # fmt: skip
    return draft.draft(known)


def test_the_thrust_map_is_of_rotors_at_steady_speed():
    plain = made("x")
    heavy = plain.with_effect("rotor_acceleration_torque", rotor_inertia_kg_m2=1e-4)
    assert offboard.thrust_map(heavy) == offboard.thrust_map(plain)


@pytest.mark.parametrize("frame", ["hex", "octo", "y6"])
def test_four_equivalent_rotors_give_the_same_force_at_the_same_speed_in_flight(frame):
    drone = made(frame).with_effect("rotor_drag_speed", drag_kg=1e-4).with_effect("inflow_linear", inflow_kg=2e-4)
    four = many_rotors.as_four(drone)
    rng = np.random.default_rng(1)
    air, speed = rng.normal(0.0, 4.0, (10, 3)), rng.uniform(300.0, 800.0, (10, 1))
    still = np.zeros((10, 3))
    theirs, _ = vehicle.wrench(drone, air, still, np.repeat(speed, drone.rotors, axis=1))
    ours, _ = vehicle.wrench(four, air, still, np.repeat(speed, 4, axis=1))
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)
    np.testing.assert_allclose(invert.hover(four), 500.0, rtol=2e-4)


@pytest.mark.parametrize("frame", ["hex", "octo", "y6"])
@pytest.mark.parametrize("name", effects.catalogue())
def test_with_any_effect_four_give_the_same_force_but_for_what_is_left_out(frame, name):
    drone = made(frame)
    if name in ("thrust_bem", "thrust_blade_element"):
        drone = drone.without_effect("thrust_quadratic")
    drone = drone.with_effect(
        name, **{s.name: s.planted or s.default for s in effects.find(name, drone.rotors).parameters}
    )
    if name == "thrust_blade_element":  # a law by the radius, which the controller does not have at all
        with pytest.raises(InputError, match="the controller needs a thrust law"):
            controller.parameters_of(many_rotors.as_four(drone))
        return
    four = many_rotors.as_four(drone)
    expected = drone.without_effect(name) if name in many_rotors.LEFT_OUT else drone
    rng = np.random.default_rng(2)
    air, speed, still = rng.normal(0.0, 5.0, (20, 3)), rng.uniform(300.0, 800.0, (20, 1)), np.zeros((20, 3))
    theirs, ours = (
        vehicle.wrench(one, air, still, np.repeat(speed, one.rotors, axis=1), near(one.rotors))[0]
        for one in (expected, four)
    )
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)
    assert (
        name not in many_rotors.LEFT_OUT or name not in controller.EFFECTS or not controller.EFFECTS[name].compensated
    )


def near(rotors: int) -> Surroundings:
    """20 times .3 m above ground and .6 m below a ceiling."""
    level, zero = np.tile([1.0, 0.0, 0.0, 0.0], (20, 1)), np.zeros((20, rotors))
    return Surroundings(level, np.full(20, 0.3), np.full(20, 0.6), zero)


@pytest.mark.parametrize("frame", ["x", "hex", "octo", "y6"])
def test_a_throttles_force_at_rest_is_that_of_the_controllers_rotors_at_the_same_speed(frame):
    """Off board the mixer's rotor speed becomes a throttle by the map of all rotors: both must mean one speed."""
    drone = made(frame, 0.1 if frame == "hex" else 0.0).with_effect("inflow_linear", inflow_kg=2e-4)
    drone = drone.with_effect("weak_rotor", loss_1=0.1)
    four, by_throttle = many_rotors.as_four(drone), offboard.thrust_map(drone)
    at_rest = RotorsAtRest(
        controller.Controller(controller.parameters_of(four)).raw.parameters().ravel(), four.mass_kg
    )  # fmt: skip
    throttle = np.linspace(0.3, 0.95, 12)
    speed = drone.limits.rotor_speed_max_rad_s * (offboard.IDLE + (1.0 - offboard.IDLE) * throttle)
    given = [by_throttle.force_n(float(u)) for u in throttle]
    np.testing.assert_allclose([at_rest.force_n(np.full(4, n), 0.0) for n in speed], given, rtol=2e-3)
    if drone.rotors == 4:  # itself, its weak rotor and all
        return
    force, _ = vehicle.wrench(four, *np.zeros((2, 12, 3)), np.repeat(speed[:, None], 4, axis=1))
    np.testing.assert_allclose(force[:, 2], given, rtol=2e-3)


def test_leaning_and_weak_rotors_pull_less():
    four = many_rotors.as_four(made("hex", 0.2).with_effect("weak_rotor", loss_2=0.3))
    expected = np.cos(0.2) * (1.0 - 0.3 / 6.0) * made("hex", 0.2).value("thrust_quadratic.k_n_s2") * 1.5
    assert four.value("thrust_quadratic.k_n_s2") == pytest.approx(expected)
    assert "weak_rotor" not in four.effects


def test_four_upright_rotors_are_left_as_they_are():
    drone = vehicle.example()
    assert many_rotors.as_four(drone) is drone


@pytest.mark.parametrize("frame", ["hex", "octo"])
def test_the_controller_on_the_ground_takes_what_stands_in(frame):
    drone = made(frame)
    values = controller.parameters_of(many_rotors.as_four(drone)).parameters
    assert values["mass_kg"] == drone.mass_kg
    built = controller.Controller(controller.parameters_of(many_rotors.as_four(drone)))
    assert built.parameters()["mass_kg"] == pytest.approx(drone.mass_kg)
    with pytest.raises(InputError, match="drives four rotors along body z; this vehicle has"):
        controller.parameters_of(drone)


@pytest.mark.parametrize("frame", ["x", "hex", "octo"])
def test_the_thrust_map_is_that_of_all_rotors(frame):
    drone = made(frame)
    full = drone.rotors * drone.value("thrust_quadratic.k_n_s2") * drone.limits.rotor_speed_max_rad_s**2
    assert offboard.thrust_map(drone).force_n(1.0) == pytest.approx(full, rel=1e-3)


def test_tilted_rotors_have_no_embedded_mixer_and_no_rehearsal():
    with pytest.raises(InputError, match="has tilted rotors"):
        controller.parameters_of(made("x", 0.1))
    with pytest.raises(InputError, match="no rehearsal"):
        offboard.body_of(made("hex"), None, seed=0)


def test_a_preflight_of_six_rotors_is_refused_before_anything_is_read():
    with pytest.raises(InputError, match="a preflight flies our controller, whose mixer drives four rotors"):
        inputs.subject(None, None, made("hex"), None)


def test_before_arming_six_rotors_are_refused_by_firmware_set_up_for_four():
    quad = offboard.Where("udp://127.0.0.1:14550", "127.0.0.1", 0, 0.0)
    told = autopilot_settings.Settings(PX4, 1, {"MPC_THR_HOVER": 0.3}, kind=2)
    found = [one.name for one in autopilot.arming_checks(made("hex"), told, quad, arms=True) if not one.passed]
    assert "rotors" in found
    (mixer,) = [one for one in offboard.arming_checks(made("hex"), settings.Settings(RATES)) if one.name == "mixer"]
    assert str(mixer) == "mixer: QUADX, the vehicle file has 6 rotors; give the file of this vehicle, or mixer HEX6X"


def test_no_crazyflie_has_six_rotors():
    with pytest.raises(InputError, match="has 6 rotors; a Crazyflie has four"):
        crazyflie.fly(made("hex"), None, "radio://0", arms=False, progress=None, cancel=None)
