"""Laws of the moments in edgewise flow, of blade elements, and of rotors in each other's wakes."""

import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

import vehicle

BARE = vehicle.example("hummingbird")
for _effect in set(BARE.effects) - {"thrust_quadratic"}:
    BARE = BARE.without_effect(_effect)
HOVER = np.full((1, 4), 500.0)
STILL = np.zeros((1, 3))


def change(model, velocity, speed=HOVER, rate=STILL):
    """Force and torque that a model has beyond the bare one."""
    velocity = np.atleast_2d(velocity)
    both = (vehicle.wrench(v, velocity, np.broadcast_to(rate, velocity.shape), speed) for v in (model, BARE))
    (force, torque), (force_bare, torque_bare) = both
    return (force - force_bare)[0], (torque - torque_bare)[0]


def skew(roll=1e-6, pitch=1e-6):
    return BARE.with_effect("wake_skew_moment", roll_kg_m=roll, pitch_kg_m=pitch)


def test_near_hover_the_wakes_moment_is_that_of_flapping():
    velocity = [0.02, -0.03, 0.0]
    flapping = BARE.with_effect("flapping_moment", moment_kg_m=-1e-6)
    np.testing.assert_allclose(change(skew(), velocity)[1], change(flapping, velocity)[1], rtol=1e-3)


def test_roll_and_pitch_have_their_own_coefficients():
    torque = change(skew(1e-6, 3e-6), [1.0, 1.0, 0.0])[1]
    assert torque[1] == pytest.approx(-3.0 * torque[0])


@settings(max_examples=40)
@given(speed=st.floats(0.5, 12.0), faster=st.floats(1.1, 2.0), climb=st.floats(0.2, 4.0))
def test_the_wakes_moment_per_speed_falls_with_speed_and_in_climb(speed, faster, climb):
    def per_speed(v_x, v_z):
        return -change(skew(), [v_x, 0.0, v_z])[1][1] / v_x

    assert 0.0 < per_speed(faster * speed, 0.0) < per_speed(speed, 0.0)
    assert per_speed(speed, climb) < per_speed(speed, 0.0)


def test_without_thrust_there_is_no_wake():
    assert np.allclose(change(skew(), [3.0, 1.0, -2.0], speed=np.zeros((1, 4)))[1], 0.0)


@settings(max_examples=30)
@given(v_x=st.floats(-8.0, 8.0), v_y=st.floats(-8.0, 8.0), height=st.floats(-0.1, 0.1))
def test_drag_at_raised_hubs_is_the_moment_of_flapping(v_x, v_y, height):
    """Why no flight tells the two apart: k_d n v over a lever h is k_f n v with k_f = -h k_d."""
    drag = BARE.with_effect("rotor_drag_speed", drag_kg=1e-4)
    raised = drag.with_effect("centre_of_mass_height", z_m=height)
    flapping = drag.with_effect("flapping_moment", moment_kg_m=height * 1e-4)
    velocity = [v_x, v_y, 1.0]
    for a, b in zip(change(raised, velocity), change(flapping, velocity), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_hubs_above_the_centre_of_mass_tip_the_vehicle_back():
    low = BARE.with_effect("rotor_drag_speed", drag_kg=1e-4).with_effect("centre_of_mass_height", z_m=-0.03)
    assert change(low, [4.0, 0.0, 0.0])[1][1] < 0.0  # nose up


def elements(name, k2=-1e-4):
    k1 = BARE.value("thrust_quadratic.k_n_s2")
    return BARE.without_effect("thrust_quadratic").with_effect(name, k1_n_s2=k1, k2_n_s2_m=k2)


@pytest.mark.parametrize("climb", [-3.0, 0.0, 4.0])
def test_along_the_axis_blade_elements_make_the_thrust_of_the_simpler_law(climb):
    force, simpler = (
        vehicle.wrench(elements(name), np.array([[0.0, 0.0, climb]]), STILL, HOVER)[0]
        for name in ("thrust_blade_element", "thrust_bem")
    )
    np.testing.assert_allclose(force, simpler, rtol=1e-12)


def test_without_inflow_the_advance_ratio_is_translational_lift():
    """Integrating the square of the blade's own air speed over disc and turn: (n r)^2 + v^2 / 2 against (n r)^2."""
    radius_m = BARE.value("rotor_radius_m")
    lift = 1.5 * BARE.value("thrust_quadratic.k_n_s2") / radius_m**2
    lifted = BARE.with_effect("translational_lift", lift_kg_m=lift)
    velocity = [6.0, -3.0, 1.0]
    both = change(elements("thrust_blade_element", k2=0.0), velocity), change(lifted, velocity)
    for a, b in zip(*both, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    azimuth = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    tangential = 500.0 * (np.arange(400)[:, None] + 0.5) / 400.0 * radius_m
    gain = ((tangential + np.hypot(6.0, 3.0) * np.sin(azimuth)) ** 2).mean() / (tangential**2).mean() - 1.0
    assert both[0][0][2] == pytest.approx(gain * vehicle.wrench(BARE, STILL, STILL, HOVER)[0][0, 2], rel=1e-4)


def test_what_front_rotors_gain_and_rear_ones_lose_tips_the_vehicle_without_lifting_it():
    both_ways = BARE.with_effect("rotor_interaction", loss_s_m=0.01, gain_s_m=0.01)
    force, torque = change(both_ways, [3.0, 0.0, 0.0])
    assert abs(force[2]) < 1e-9
    one_way = change(BARE.with_effect("rotor_interaction", loss_s_m=0.01), [3.0, 0.0, 0.0])
    assert one_way[0][2] < 0.0
    assert torque[1] == pytest.approx(2.0 * one_way[1][1])


def test_the_loss_in_descent_is_deepest_at_its_place_and_ends_at_its_width():
    k = BARE.value("thrust_quadratic.k_n_s2")
    disk = 2.0 * BARE.value("air_density_kg_m3") * np.pi * BARE.value("rotor_radius_m") ** 2
    inflow = np.sqrt(k * 500.0**2 / disk)
    lossy = BARE.with_effect("descent_loss", depth=0.3, place=-1.0, half_width=0.5)

    def lost(ratio):
        force, bare = (vehicle.wrench(v, [[0.0, 0.0, ratio * inflow]], STILL, HOVER)[0][0, 2] for v in (lossy, BARE))
        return 1.0 - force / bare

    assert lost(-1.0) == pytest.approx(0.3)
    assert lost(-1.25) == pytest.approx(lost(-0.75)) == pytest.approx(0.3 * 0.75**2)
    assert lost(-0.5) == lost(-1.5) == 0.0


def test_an_uneven_torque_turns_the_vehicle_about_z_alone():
    uneven = BARE.with_effect("uneven_rotor_torque", torque_1_n_m_s2=2e-9)
    force, torque = change(uneven, [1.0, 2.0, 0.0])
    assert np.allclose(force, 0.0)
    np.testing.assert_allclose(torque, [0.0, 0.0, -2e-9 * BARE.spin[1] * 500.0**2])


def test_a_file_that_leaves_out_a_later_parameter_means_its_default(tmp_path):
    path = tmp_path / "v.toml"
    vehicle.save(path, BARE.with_effect("descent_loss", depth=0.3))
    document = tomllib.loads(path.read_text())
    for name in ("place", "half_width"):
        del document["effect"]["descent_loss"][name]
    path.write_text(tomli_w.dumps(document))
    loaded = vehicle.load(path)
    assert loaded.value("descent_loss.place") == -1.25
    assert loaded.value("descent_loss.half_width") == 0.75
