"""Laws every wrench and every flight must obey, whatever the numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vehicle
from flight import rotations
from flight.frames import GRAVITY_M_S2
from vehicle import simulate

MIRROR = [3, 2, 1, 0]  # left and right rotors change places
HALF_TURN = [2, 3, 0, 1]
POLAR, AXIAL = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
SYMMETRIC = (
    "inflow_linear",
    "translational_lift",
    "rotor_drag_speed",
    "parasitic_drag_speed",
    "flapping_moment",
    "wake_skew_moment",
    "rotor_interaction",
    "descent_loss",
    "gyroscopic_torque",
    "angular_damping",
    "angular_damping_quadratic",
    "thrust_affine",
    "torque_affine",
)
"""Effects that know no left or right with the values they are planted with."""


def everything_symmetric():
    v = vehicle.example().without_effect("centre_of_mass")
    for name in SYMMETRIC:
        effect = vehicle.effects.find(name)
        v = v.with_effect(name, **{s.name: s.planted for s in effect.parameters})
    return v.with_value("parasitic_drag_speed.drag_y_kg_m", v.value("parasitic_drag_speed.drag_x_kg_m"))


triples = st.tuples(*[st.floats(-6.0, 6.0)] * 3).map(np.array)
speeds = st.tuples(*[st.floats(300.0, 1500.0)] * 4).map(np.array)


@settings(max_examples=60)
@given(velocity=triples, rate=triples, speed=speeds)
def test_the_mirror_image_of_a_motion_has_the_mirror_image_of_its_wrench(velocity, rate, speed):
    v = everything_symmetric()
    force, torque = vehicle.wrench(v, velocity, rate, speed)
    mirrored = vehicle.wrench(v, velocity * POLAR, rate * AXIAL, speed[MIRROR])
    np.testing.assert_allclose(mirrored[0], force * POLAR, atol=1e-9)
    np.testing.assert_allclose(mirrored[1], torque * AXIAL, atol=1e-9)


@settings(max_examples=60)
@given(velocity=triples, rate=triples, speed=speeds)
def test_forward_and_backward_are_alike_after_half_a_turn(velocity, rate, speed):
    v, turn = everything_symmetric(), np.array([-1.0, -1.0, 1.0])
    force, torque = vehicle.wrench(v, velocity, rate, speed)
    turned = vehicle.wrench(v, velocity * turn, rate * turn, speed[HALF_TURN])
    np.testing.assert_allclose(turned[0], force * turn, atol=1e-9)
    np.testing.assert_allclose(turned[1], torque * turn, atol=1e-9)


@settings(max_examples=60)
@given(velocity=triples, speed=speeds)
def test_drag_never_pushes(velocity, speed):
    base = vehicle.example().without_effect("rotor_drag_thrust").without_effect("parasitic_drag")
    for name in ("rotor_drag_thrust", "rotor_drag_speed", "parasitic_drag", "parasitic_drag_speed"):
        effect = vehicle.effects.find(name)
        dragged = base.with_effect(name, **{s.name: s.planted for s in effect.parameters})
        with_it, _ = vehicle.wrench(dragged, velocity, np.zeros(3), speed)
        without, _ = vehicle.wrench(base, velocity, np.zeros(3), speed)
        lifting = vehicle.wrench(base, velocity, np.zeros(3), speed)[0][0, 2] > 0.0
        if lifting or name != "rotor_drag_thrust":
            assert (with_it - without)[0] @ velocity <= 1e-12


def test_thrust_and_weight_scale_together():
    """From motion alone mass and force coefficients are one: scaling both changes no acceleration."""
    v = vehicle.example("hummingbird")
    heavier = v
    for name in v.parameters:
        if name.startswith(("mass", "inertia")) or ("." in name and not name.startswith("motor_lag")):
            heavier = heavier.with_value(name, 1.7 * v.value(name))
    rng = np.random.default_rng(0)
    motion = rng.normal(0, 4, (30, 3)), rng.normal(0, 3, (30, 3)), rng.uniform(200, 900, (30, 4))
    for a, b in zip(vehicle.acceleration(v, *motion), vehicle.acceleration(heavier, *motion), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_power_of_the_wrench_is_the_change_of_energy(name):
    v = vehicle.example(name)
    body = vehicle.rigid_body(v)

    def energy(plant):
        speed, w = plant.velocity_world_m_s, plant.rate_body_rad_s
        return (
            0.5 * body.mass_kg * (speed @ speed)
            + 0.5 * w @ body.inertia_kg_m2 @ w
            + body.mass_kg * GRAVITY_M_S2 * (plant.position_world_m[2])
        )

    def power(plant):
        velocity = rotations.rotate(rotations.conjugate(plant.q_world_body), plant.velocity_world_m_s)
        force, torque = vehicle.wrench(v, velocity, plant.rate_body_rad_s, plant.rotor_speed_rad_s)
        return float(force[0] @ velocity + torque[0] @ plant.rate_body_rad_s)

    plant = simulate.Plant(
        v, simulate.State(velocity_world_m_s=np.array([4.0, -2, 1]), rotor_speed_rad_s=np.full(4, 500.0))
    )
    command = vehicle.invert.hover(v) + np.array([20.0, -15, 10, -20])
    start, work, before = energy(plant), 0.0, power(plant)
    for _ in range(1000):
        plant.step(command, 1e-3)
        now = power(plant)
        work, before = work + 0.5e-3 * (before + now), now
    assert energy(plant) - start == pytest.approx(work, rel=1e-5, abs=1e-5)


def test_turning_the_world_turns_the_flight():
    v = vehicle.example()
    turn = rotations.from_yaw(0.8)
    command = vehicle.invert.hover(v) + np.array([25.0, -10, 5, -15])
    start = simulate.State(np.array([1.0, 2, 3]), np.array([3.0, 1, -1]), rotations.exp(np.array([0.2, -0.3, 0.1])))
    turned = simulate.State(
        rotations.rotate(turn, start.position_world_m),
        rotations.rotate(turn, start.velocity_world_m_s),
        rotations.multiply(turn, start.q_world_body),
    )
    a, b = simulate.Plant(v, start), simulate.Plant(v, turned)
    for plant in (a, b):
        plant.step(command, 1.0)
    np.testing.assert_allclose(b.position_world_m, rotations.rotate(turn, a.position_world_m), atol=1e-10)
    np.testing.assert_allclose(b.rate_body_rad_s, a.rate_body_rad_s, atol=1e-10)


def test_added_payload_is_the_sum_of_two_bodies():
    v = vehicle.example().without_effect("centre_of_mass")
    place, added = np.array([0.03, -0.02, -0.05]), 0.2
    whole = vehicle.rigid_body(v.with_effect("payload", added_kg=added, x_m=place[0], y_m=place[1], z_m=place[2]))
    alone = vehicle.rigid_body(v)
    centre = added * place / (alone.mass_kg + added)
    assert whole.mass_kg == pytest.approx(alone.mass_kg + added)
    np.testing.assert_allclose(whole.centre_of_mass_m, centre, atol=1e-15)

    def about(mass, r):
        return mass * ((r @ r) * np.eye(3) - np.outer(r, r))

    both = alone.inertia_kg_m2 + about(alone.mass_kg, centre) + about(added, place - centre)
    np.testing.assert_allclose(whole.inertia_kg_m2, both, atol=1e-15)
