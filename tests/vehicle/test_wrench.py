"""The wrench: kernel against plain NumPy, derivatives against complex steps, and the paper's own numbers."""

import numpy as np
import pytest

import vehicle
from flight import InputError
from vehicle import dynamics, forces, invert


def samples(n=300, seed=1):
    rng = np.random.default_rng(seed)
    return rng.normal(0, 4, (n, 3)), rng.normal(0, 3, (n, 3)), rng.uniform(400, 1500, (n, 4))


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_the_kernel_agrees_with_numpy_to_rounding(name):
    v = vehicle.example(name)
    fast, slow = vehicle.wrench(v, *samples()), forces.wrench_numpy(v, *samples())
    for a, b in zip(fast, slow, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_derivatives_agree_with_complex_steps(name):
    v = vehicle.example(name)
    velocity, rate, speed = samples()
    velocity[:, 2] = np.abs(velocity[:, 2])  # in fast descent momentum theory itself is singular
    names = [p for p in v.parameters if not p.startswith("motor_lag")]
    jacobian = vehicle.acceleration_jacobian(v, velocity, rate, speed, parameters=names)
    motion = np.hstack([velocity, rate, speed])
    value, slopes = dynamics._complex_steps(v, motion, names, forces.NOTHING_KNOWN, True)
    np.testing.assert_allclose(jacobian.value, value, atol=1e-9)
    np.testing.assert_allclose(jacobian.velocity, slopes[:, :, :3], atol=1e-9)
    np.testing.assert_allclose(jacobian.rate, slopes[:, :, 3:6], atol=1e-9)
    np.testing.assert_allclose(jacobian.rotor_speed, slopes[:, :, 6:10], atol=1e-9)
    scale = np.abs(slopes[:, :, 18:]).max(axis=(0, 1)) + 1e-300
    np.testing.assert_allclose(jacobian.parameters / scale, slopes[:, :, 18:] / scale, atol=1e-9)


@pytest.mark.parametrize(("speed_m_s", "gain"), [(8.5, 0.124), (10.5, 0.168)])
def test_level_flight_gains_the_thrust_the_table_of_the_paper_misses(speed_m_s, gain):
    v = vehicle.example().without_effect("parasitic_drag").without_effect("rotor_drag_thrust")
    n = vehicle.invert.hover(v)
    still, _ = vehicle.wrench(v, np.zeros(3), np.zeros(3), n)
    moving, _ = vehicle.wrench(v, np.array([speed_m_s, 0, 0]), np.zeros(3), n)
    assert moving[0, 2] / still[0, 2] - 1 == pytest.approx(gain, abs=5e-4)


def test_rotor_speeds_invert_the_wrench():
    v = vehicle.example()
    velocity, rate, speed = samples(50)
    force, torque = vehicle.wrench(v, velocity, rate, speed)
    reached = vehicle.invert.rotor_speeds(v, force[:, 2], torque, velocity, rate)
    fast_descent = velocity[:, 2] < -2.0  # thrust is not a monotonic function of speed there
    np.testing.assert_allclose(reached[~fast_descent], speed[~fast_descent], atol=1e-6)


def test_the_compiled_inverse_agrees_with_the_plain_one():
    v = vehicle.example("hummingbird")
    velocity, rate, speed = samples(40)
    force, torque = vehicle.wrench(v, velocity, rate, speed)
    wanted = np.column_stack([force[:, 2], torque])
    start = np.full((40, 4), 700.0)
    plain = invert.rotor_speeds_numpy(v, wanted, velocity, rate, start.copy(), forces.open_air(40))
    fast = invert.rotor_speeds(v, force[:, 2], torque, velocity, rate, guess_rad_s=start)
    np.testing.assert_allclose(fast, plain, atol=1e-7)
    np.testing.assert_allclose(fast, speed, atol=1e-6)


def test_an_impossible_wrench_has_no_rotor_speeds():
    speeds = invert.rotor_speeds(vehicle.example(), np.array([-5.0, 7.0]), np.zeros((2, 3)), np.zeros(3), np.zeros(3))
    assert np.isnan(speeds[0]).all()
    assert np.isfinite(speeds[1]).all()


def test_wrong_shapes_and_names_are_refused():
    v = vehicle.example()
    with pytest.raises(InputError, match="rotor_speed"):
        vehicle.wrench(v, np.zeros(3), np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match="rows"):
        vehicle.wrench(v, np.zeros((2, 3)), np.zeros((3, 3)), np.zeros(4))
    with pytest.raises(InputError, match="no parameter"):
        vehicle.wrench_jacobian(v, np.zeros(3), np.zeros(3), np.zeros(4), parameters=["drag"])
