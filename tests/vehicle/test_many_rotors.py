"""Six and eight rotors, and tilted ones: their forces, how they share a wrench, their files, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vehicle
from flight import InputError
from vehicle import (
    Parameter,
    allocation,
    commented,
    draft,
    dynamics,
    effects,
    flatness,
    invert,
    layouts,
    manoeuvres,
    simulate,
)
from vehicle.draft import Known
from vehicle.forces import open_air
from vehicle.importers import import_ardupilot, import_betaflight, import_px4

MORE = ("hex", "hex+", "octo", "octo+", "y6", "x8")


def made(frame: str, axis_body=None, firmware: str | None = None) -> vehicle.Vehicle:
    hubs, spin = draft.layout(0.28, frame, firmware)
    mass, radius = Parameter(1.6, 0.01, "kg", "given"), Parameter(0.115, 0.0, "m", "given")
    known = Known(
        name=frame, mass_kg=mass, hub_body_m=hubs, spin=spin, axis_body=axis_body, rotor_radius_m=radius,
        hover_rad_s=500.0, rotor_speed_max_rad_s=900.0,
    )  # fmt: skip
    return draft.draft(known)


def leaning(frame: str, lean_rad: float) -> vehicle.Vehicle:
    """Every rotor leans sideways, so that its thrust turns the body as its torque does."""
    hubs, spin = draft.layout(0.28, frame)
    outward = hubs / np.linalg.norm(hubs, axis=1)[:, None]
    aside = -np.cross([0.0, 0.0, 1.0], outward) * spin[:, None]
    return made(frame, np.cos(lean_rad) * np.array([0.0, 0.0, 1.0]) + np.sin(lean_rad) * aside)


@pytest.mark.parametrize("frame", MORE)
def test_every_rotor_of_a_regular_frame_carries_the_same_share_in_hover(frame):
    drone = made(frame)
    assert drone.rotors == len(layouts.find(frame).rotors)
    np.testing.assert_allclose(invert.hover(drone), 500.0, rtol=2e-4)


@pytest.mark.parametrize("frame", MORE)
def test_the_allocation_is_the_pseudo_inverse_and_gives_the_wrench_that_is_asked_for(frame):
    drone = made(frame)
    rng = np.random.default_rng(1)
    speed, still = np.full((1, drone.rotors), 450.0), np.zeros((1, 3))
    slope = dynamics.wrench_jacobian(drone, still, still, speed, surroundings=open_air(1, drone.rotors)).rotor_speed
    shares = allocation.shares(drone)
    np.testing.assert_allclose(shares, np.linalg.pinv(slope[0, 2:] / (2.0 * speed)), rtol=1e-9, atol=1e-6)
    thrust, torque = rng.uniform(14.0, 20.0, 20), rng.normal(0.0, 0.15, (20, 3)) * [1.0, 1.0, 0.2]
    found = invert.rotor_speeds(drone, thrust, torque, np.zeros((20, 3)), np.zeros((20, 3)))
    force, moment = vehicle.wrench(drone, np.zeros((20, 3)), np.zeros((20, 3)), found)
    np.testing.assert_allclose(force[:, 2], thrust, rtol=1e-9)
    np.testing.assert_allclose(moment, torque, atol=1e-9)
    np.testing.assert_allclose(found**2, np.column_stack([thrust, torque]) @ shares.T, rtol=1e-7)


@settings(max_examples=20)
@given(st.sampled_from(("hex", "octo")), st.integers(0, 7), st.floats(0.02, 0.3))
def test_no_other_speeds_of_the_same_wrench_have_a_smaller_sum_of_fourth_powers(frame, rotor, size):
    drone = made(frame)
    speed = invert.rotor_speeds(drone, np.array([16.0]), np.array([[0.1, -0.05, 0.01]]), np.zeros(3), np.zeros(3))[0]
    slope = np.linalg.pinv(allocation.shares(drone))
    along = np.eye(drone.rotors)[rotor % drone.rotors]
    idle = along - np.linalg.pinv(slope) @ (slope @ along)  # changes nothing of the wrench
    other = speed**2 + size * 1e5 * idle
    assert (other**2).sum() >= (speed**4).sum()


def test_a_wrench_that_would_take_pulling_down_has_no_speeds():
    assert np.isnan(
        invert.rotor_speeds(made("hex"), np.array([2.0]), np.array([[3.0, 0.0, 0.0]]), *np.zeros((2, 3)))
    ).all()


@pytest.mark.parametrize(
    "drone", [made("hex"), leaning("hex", 0.15), leaning("octo", 0.1)], ids=["hex", "lean", "octo"]
)
def test_flatness_gives_speeds_that_make_the_paths_thrust_and_torque(drone):
    drone = drone.with_effect("rotor_drag_speed", drag_kg=1e-4).with_effect("parasitic_drag", drag_xy_kg_m=0.01)
    path = manoeuvres.make("oblique")
    flat = flatness.state(drone, path, path.sample(0.1))
    around = open_air(len(flat.time_s), drone.rotors)
    air, rate = flatness.air_velocity_body(flat), flat.rate_body_rad_s
    force, torque = vehicle.wrench(drone, air, rate, flat.rotor_speed_rad_s, around)
    np.testing.assert_allclose(force[:, 2], flat.thrust_n, rtol=1e-8)
    np.testing.assert_allclose(torque, flat.torque_n_m, atol=1e-8)


def test_upright_axes_written_out_are_the_same_vehicle():
    for frame in ("x", "hex"):
        plain, same = made(frame), made(frame, np.tile([0.0, 0.0, 1.0], (len(layouts.find(frame).rotors), 1)))
        for name in ("rotor_drag_speed", "flapping_moment", "gyroscopic_torque", "weak_rotor", "uneven_rotor_torque"):
            planted = {s.name: s.planted for s in plain.effect(name).parameters}
            plain, same = plain.with_effect(name, **planted), same.with_effect(name, **planted)
        rng = np.random.default_rng(2)
        motion = rng.normal(size=(8, 3)), rng.normal(size=(8, 3)), rng.uniform(300, 700, (8, plain.rotors))
        for one, other in zip(vehicle.wrench(plain, *motion), vehicle.wrench(same, *motion), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_a_leaning_rotor_pushes_and_turns_along_its_axis():
    lean = 0.2
    drone = leaning("x", lean)
    force, torque = vehicle.wrench(drone, np.zeros(3), np.zeros(3), np.array([500.0, 0.0, 0.0, 0.0]))
    thrust = drone.value("thrust_quadratic.k_n_s2") * 500.0**2
    drag = drone.value("rotor_yaw_torque.torque_n_m_s2") * 500.0**2
    axis = drone.axis_body[0]
    np.testing.assert_allclose(force[0], thrust * axis, rtol=1e-12)
    turned = np.cross(drone.hub_body_m[0], thrust * axis) - drone.spin[0] * drag * axis
    np.testing.assert_allclose(torque[0], turned, rtol=1e-12, atol=1e-15)


def test_turning_the_body_turns_the_force_of_tilted_rotors_with_it():
    drone, quarter = leaning("hex", 0.2), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    drone = drone.with_effect("rotor_drag_speed", drag_kg=1e-4).with_effect("thrust_affine", slope_n_s=1e-4)
    turned = replace(drone, hub_body_m=drone.hub_body_m @ quarter.T, axis_body=drone.axis_body @ quarter.T)
    rng = np.random.default_rng(3)
    air, rate, speed = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.uniform(300, 700, (5, 6))
    one = vehicle.wrench(drone, air, rate, speed)
    other = vehicle.wrench(turned, air @ quarter.T, rate @ quarter.T, speed)
    for mine, theirs in zip(one, other, strict=True):
        np.testing.assert_allclose(mine @ quarter.T, theirs, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("drone", [made("hex"), leaning("octo", 0.1)], ids=["hex", "octo"])
def test_the_file_reads_back_and_names_every_rotor(drone, tmp_path):
    drone = drone.with_effect("weak_rotor", loss_5=0.1)
    for write in (vehicle.save, commented.write):
        write(tmp_path / "v.toml", drone)
        read = vehicle.load(tmp_path / "v.toml")
        np.testing.assert_array_equal(read.hub_body_m, drone.hub_body_m)
        assert read.value("weak_rotor.loss_5") == 0.1
        if drone.axis_body is None:
            assert vehicle.vehicle_hash(read) == vehicle.vehicle_hash(drone)
        else:
            np.testing.assert_allclose(read.axis_body, drone.axis_body, rtol=1e-15)
    assert f"# Rotors 0 to {drone.rotors - 1} (" in (tmp_path / "v.toml").read_text()


def test_an_effect_of_single_rotors_has_one_parameter_for_each():
    assert [s.name for s in effects.find("weak_rotor", 6).parameters] == [f"loss_{i}" for i in range(6)]
    assert effects.find("weak_rotor", 4) is effects.find("weak_rotor")
    with pytest.raises(InputError, match="no parameter loss_6"):
        made("hex").with_effect("weak_rotor", loss_6=0.1)


@pytest.mark.parametrize(
    ("spins", "words"),
    [([1, 1, 1, 1, 1, 1], "cannot lift and turn"), ([1, 1, 1, 1, 1, -1], "leaves rotor")],
)
def test_spins_that_cannot_hold_the_heading_are_refused_in_a_sentence(spins, words):
    hubs, _ = draft.layout(0.28, "hex")
    with pytest.raises(InputError, match=words):
        draft.require_controllable(hubs, np.array(spins, dtype=np.float64))


def test_leaning_rotors_hold_a_heading_that_spins_alone_would_not():
    hubs, _ = draft.layout(0.28, "hex")
    spin = np.ones(6)
    outward = hubs / np.linalg.norm(hubs, axis=1)[:, None]
    aside = np.cross([0.0, 0.0, 1.0], outward) * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])[:, None]
    with pytest.raises(InputError):
        draft.require_controllable(hubs, spin)
    draft.require_controllable(hubs, spin, np.cos(0.3) * np.array([0.0, 0.0, 1.0]) + np.sin(0.3) * aside)


@pytest.mark.parametrize("count", [3, 9])
def test_other_numbers_of_rotors_are_refused(count):
    angle = np.arange(count) * 2.0 * np.pi / count
    hubs = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    with pytest.raises(InputError, match="expected 4 to 8"):
        replace(made("x"), hub_body_m=hubs, spin=np.ones(count))


def test_a_state_or_command_of_another_number_of_rotors_is_refused():
    with pytest.raises(InputError, match="4 rotor speeds; hex has 6"):
        simulate.Plant(made("hex"), simulate.State())
    plant = simulate.Plant(made("hex"))
    with pytest.raises(InputError, match=r"expected shape \(6,\)"):
        plant.step(np.full(4, 500.0), 0.01)


@pytest.mark.parametrize("frame", MORE)
def test_an_uncommanded_vehicle_hovers_in_the_simulation(frame):
    plant = simulate.Plant(made(frame), step_s=5e-3)
    plant.step(invert.hover(plant.vehicle), 0.1)
    assert np.linalg.norm(plant.velocity_world_m_s) < 1e-3


@pytest.mark.parametrize(("firmware", "frame"), [(f, n) for f, known in layouts.FIRMWARES.items() for n in known])
def test_a_firmwares_motors_sit_where_our_own_rotors_do(firmware, frame):
    """The same hubs in another order; Betaflight turns all of some frames the other way."""
    theirs, spin = draft.layout(0.3, frame, firmware)
    ours, own_spin = draft.layout(0.3, frame)
    order = [int(np.linalg.norm(ours - hub, axis=1).argmin()) for hub in theirs]
    assert sorted(order) == list(range(len(ours)))
    np.testing.assert_allclose(ours[order], theirs, atol=1e-5)
    ratio = spin * own_spin[order]
    assert (ratio == ratio[0]).all()
    draft.require_controllable(theirs, spin)


def test_three_firmwares_hexarotors_are_read(tmp_path):
    ardupilot, betaflight, px4 = (tmp_path / name for name in ("a.param", "b.txt", "p.params"))
    ardupilot.write_text("FRAME_CLASS,2\nFRAME_TYPE,1\n")
    known = import_ardupilot.read(ardupilot)
    np.testing.assert_allclose(known.hub_body_m[0], [0.0, -1.0, 0.0], atol=1e-6)  # motor 1: right, clockwise
    assert known.spin.tolist() == [-1, 1, -1, 1, 1, -1]
    betaflight.write_text("# Betaflight / STM32\nmixer HEX6X\nset yaw_motors_reversed = ON\n")
    known = import_betaflight.read(betaflight)
    np.testing.assert_allclose(known.hub_body_m[4], [0.0, -1.0, 0.0], atol=1e-6)  # motor 5: right
    assert known.spin.tolist() == [-1, -1, 1, 1, 1, -1]
    hubs, spin = draft.layout(0.3, "hex", "px4")
    lines = [f"CA_ROTOR_COUNT {len(hubs)}"]
    for i, (hub, turn) in enumerate(zip(hubs, spin, strict=True)):
        lines += [f"CA_ROTOR{i}_PX {hub[0]}", f"CA_ROTOR{i}_PY {-hub[1]}", f"CA_ROTOR{i}_KM {0.05 * turn}"]
    px4.write_text("\n".join(lines))
    known = import_px4.read(px4)
    np.testing.assert_allclose(known.hub_body_m, hubs, atol=1e-9)
    assert known.spin.tolist() == spin.tolist()


@pytest.mark.parametrize("drone", [made("hex"), leaning("octo", 0.1)], ids=["hex", "octo"])
def test_derivatives_agree_with_differences(drone):
    drone = drone.with_effect("weak_rotor", loss_5=0.05).with_effect("rotor_drag_speed", drag_kg=1e-4)
    rng, r = np.random.default_rng(4), drone.rotors
    air, rate, speed = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.uniform(300, 700, (3, r))
    names = ("weak_rotor.loss_5", "inertia_xx_kg_m2")
    found = dynamics.acceleration_jacobian(drone, air, rate, speed, parameters=names)
    assert found.rotor_speed.shape == (3, 6, r)

    def six(*motion, of=drone):
        return np.concatenate(dynamics.acceleration(of, *motion), axis=1)

    for i in range(r):
        step = 1e-3 * np.eye(r)[i]
        slope = (six(air, rate, speed + step) - six(air, rate, speed - step)) / 2e-3
        np.testing.assert_allclose(found.rotor_speed[:, :, i], slope, rtol=1e-5, atol=1e-7)
    for k, name in enumerate(names):
        small = 1e-5 * max(drone.value(name), 1e-2)
        up, down = (drone.with_value(name, drone.value(name) + sign * small) for sign in (1.0, -1.0))
        slope = (six(air, rate, speed, of=up) - six(air, rate, speed, of=down)) / (2.0 * small)
        np.testing.assert_allclose(found.parameters[:, :, k], slope, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("frame", layouts.FRAMES)
def test_a_files_comment_tells_every_rotor_from_the_others(frame):
    named = commented.places(made(frame).hub_body_m)
    assert len(set(named)) == len(named)
    assert f"({', '.join(named)})" in commented.text(made(frame))


def test_of_more_than_four_rotors_the_angle_clockwise_from_ahead_is_told():
    assert commented.places(made("octo").hub_body_m)[:2] == ["front left -22.5°", "front left -67.5°"]
    assert commented.places(made("y6").hub_body_m)[::3] == ["front left -60° above", "front left -60° below"]
    assert commented.places(made("x").hub_body_m)[0] == "front left"


def test_a_rotor_in_the_middle_is_in_nobodys_wake():
    ring, spin = draft.layout(0.28, "x")
    drone = replace(made("x"), hub_body_m=np.vstack([ring, np.zeros(3)]), spin=np.append(spin, 1.0))
    lossy = drone.with_effect("rotor_interaction", loss_s_m=0.01, gain_s_m=0.01)
    alone = np.array([0.0, 0.0, 0.0, 0.0, 500.0])
    force, _ = vehicle.wrench(lossy, np.array([3.0, 1.0, 0.0]), np.zeros(3), alone)
    np.testing.assert_allclose(force, vehicle.wrench(drone, np.array([3.0, 1.0, 0.0]), np.zeros(3), alone)[0])
    slope = dynamics.wrench_jacobian(lossy, np.ones((1, 3)), np.zeros((1, 3)), np.full((1, 5), 400.0))
    assert np.isfinite(slope.rotor_speed).all()
    assert np.isfinite(slope.velocity).all()
