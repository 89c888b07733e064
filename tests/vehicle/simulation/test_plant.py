"""The simulated vehicle obeys the laws of motion."""

import numpy as np
import pytest

import vehicle
from flight import InputError, rotations
from flight.frames import GRAVITY_M_S2
from vehicle import simulate
from vehicle.simulation import integrate


def bare(**changes):
    """A vehicle without aerodynamics beyond thrust."""
    v = vehicle.example()
    for name in ("rotor_drag_thrust", "parasitic_drag", "motor_lag", "centre_of_mass"):
        v = v.without_effect(name)
    return v


def test_with_dead_rotors_it_falls_freely():
    start = simulate.State(np.array([0, 0, 50.0]), np.array([3.0, 0, 1.0]))
    plant = simulate.Plant(bare(), start)
    plant.step(np.zeros(4), 2.0)
    np.testing.assert_allclose(plant.position_world_m, [6.0, 0.0, 52.0 - GRAVITY_M_S2 * 2.0], atol=1e-9)
    np.testing.assert_allclose(plant.specific_force_body_m_s2, 0.0, atol=1e-12)


def test_angular_momentum_and_energy_are_kept_without_torque():
    v = bare()
    start = simulate.State(rate_body_rad_s=np.array([4.0, 3.0, -5.0]))
    plant = simulate.Plant(v, start)
    inertia = np.diag(vehicle.rigid_body(v).inertia_kg_m2)
    momentum = lambda p: rotations.rotate(p.q_world_body, inertia * p.rate_body_rad_s)  # noqa: E731
    energy = lambda p: 0.5 * inertia @ p.rate_body_rad_s**2  # noqa: E731
    before = momentum(plant), energy(plant)
    plant.step(np.zeros(4), 3.0)
    np.testing.assert_allclose(momentum(plant), before[0], rtol=1e-8)
    assert energy(plant) == pytest.approx(before[1], rel=1e-9)


def test_hover_stays_where_it_is():
    v = vehicle.example()
    plant = simulate.Plant(v, simulate.hovering(v, np.array([1.0, 2.0, 3.0]), yaw_rad=1.0))
    plant.step(plant.rotor_speed_rad_s, 1.0)
    np.testing.assert_allclose(plant.position_world_m, [1, 2, 3], atol=1e-9)
    np.testing.assert_allclose(plant.specific_force_body_m_s2, [0, 0, GRAVITY_M_S2], atol=1e-9)


def test_halving_the_step_shrinks_the_error_sixteenfold():
    v = vehicle.example()
    command = vehicle.invert.hover(v) + np.array([30.0, -30, 25, -20])

    def fly(step_s):
        plant = simulate.Plant(v, step_s=step_s)
        plant.step(command, 0.8)
        return plant.position_world_m

    truth = fly(1e-4)
    coarse, fine = np.abs(fly(8e-3) - truth).max(), np.abs(fly(4e-3) - truth).max()
    assert 12 < coarse / fine < 20
    assert np.abs(fly(1e-3) - truth).max() < 1e-7


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_the_kernel_integrates_as_numpy_does(name):
    v = vehicle.example(name)
    rng = np.random.default_rng(3)
    start = simulate.State(np.zeros(3), rng.normal(0, 3, 3), rotations.exp(rng.normal(0, 1, 3)), rng.normal(0, 3, 3))
    world = integrate.world_row((1.0, -2.0, 0.5), GRAVITY_M_S2, -np.inf, np.inf)
    command, volts = rng.uniform(500, 1200, (1, 4)), np.array([[16.0]])
    rows = [start.row()[None], start.row()[None]]
    forces = [np.zeros((1, 3)), np.zeros((1, 3))]
    steppers = [integrate.stepper(v), integrate.numpy_stepper(v)]
    energy = [s(world, command, volts, 60, 1e-3, r, f) for s, r, f in zip(steppers, rows, forces, strict=True)]
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-11)
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-11)
    np.testing.assert_allclose(energy[0], energy[1], rtol=1e-12)


def test_steady_wind_is_only_a_moving_frame():
    v = vehicle.example()
    wind = np.array([2.0, -1.0, 0.3])
    command = vehicle.invert.hover(v) + np.array([20.0, -10, 0, 5])
    still = simulate.Plant(v, simulate.hovering(v, np.zeros(3)))
    blown = simulate.hovering(v, np.zeros(3))
    blown = simulate.State(blown.position_world_m, wind, blown.q_world_body, rotor_speed_rad_s=blown.rotor_speed_rad_s)
    moving = simulate.Plant(v, blown, wind=simulate.Wind(tuple(wind)))
    for plant in (still, moving):
        plant.step(command, 1.0)
    np.testing.assert_allclose(moving.position_world_m - wind, still.position_world_m, atol=1e-9)


def test_gusts_repeat_with_the_seed_and_have_the_given_standard_deviation():
    def winds(seed):
        plant = simulate.Plant(
            vehicle.example(), rng=np.random.default_rng(seed), wind=simulate.Wind((1.0, 0, 0), 0.5, 0.2)
        )
        found = []
        for _ in range(4000):
            plant.step(plant.rotor_speed_rad_s, 0.02)
            found.append(plant.wind_world_m_s)
        return np.array(found)

    first = winds(5)
    np.testing.assert_array_equal(first, winds(5))
    np.testing.assert_allclose(first.std(axis=0), 0.5, rtol=0.15)
    assert first[:, 0].mean() == pytest.approx(1.0, abs=0.15)


def test_the_floor_carries_it_until_the_rotors_lift_it():
    v = vehicle.example()
    plant = simulate.Plant(v, simulate.State(), ground_m=0.0)
    plant.step(np.full(4, 500.0), 1.0)
    np.testing.assert_array_equal(plant.position_world_m, 0.0)
    np.testing.assert_allclose(plant.specific_force_body_m_s2, [0, 0, GRAVITY_M_S2])
    plant.step(1.1 * vehicle.invert.hover(v), 1.0)
    assert plant.position_world_m[2] > 0.2


def test_the_battery_empties_as_it_flies():
    plant = simulate.Plant(vehicle.example())
    full = plant.battery_v
    plant.step(plant.rotor_speed_rad_s, 20.0)
    assert plant.battery_v < full


def test_bad_commands_are_refused():
    plant = simulate.Plant(vehicle.example())
    with pytest.raises(InputError, match="4 finite"):
        plant.step(np.array([1.0, 2, np.nan, 3]), 0.01)
    with pytest.raises(InputError, match=r"expected shape \(4,\) or \(1, 4\), got \(1, 3\)"):
        plant.step(np.zeros(3), 0.01)
    with pytest.raises(InputError, match="duration_s"):
        plant.step(np.zeros(4), 0.0)
    with pytest.raises(InputError, match="rng"):
        simulate.Plant(vehicle.example(), wind=simulate.Wind(gust_std_m_s=1.0))
