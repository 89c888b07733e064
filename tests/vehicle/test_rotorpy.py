"""Agreement with RotorPy, an independent simulator, on the forms it has, to rounding."""

import numpy as np
import pytest

import vehicle
from flight import rotations
from flight.frames import GRAVITY_M_S2
from vehicle import dynamics
from vehicle.simulation import integrate

rotorpy = pytest.importorskip("rotorpy.vehicles.multirotor", reason="RotorPy is a development dependency")
OUR_ORDER = [0, 3, 2, 1]  # theirs runs clockwise from front left, ours the other way


@pytest.fixture(scope="module")
def pair():
    from rotorpy.vehicles.hummingbird_params import quad_params

    parameters = dict(quad_params) | {"k_flap": 2e-6, "c_Dy": 0.007, "Ixy": 1e-4, "Iyz": -2e-4, "Ixz": 3e-4}
    ours = vehicle.example("hummingbird").with_effect("flapping_moment", moment_kg_m=2e-6)
    ours = ours.with_value("parasitic_drag_speed.drag_y_kg_m", 0.007)
    ours = ours.with_effect("products_of_inertia", xy_kg_m2=1e-4, yz_kg_m2=-2e-4, xz_kg_m2=3e-4)
    theirs = rotorpy.Multirotor(parameters, aero=True)
    theirs.g, theirs.weight = GRAVITY_M_S2, np.array([0.0, 0.0, -theirs.mass * GRAVITY_M_S2])
    return ours, theirs


def test_the_wrench_agrees_to_rounding(pair):
    ours, theirs = pair
    rng = np.random.default_rng(0)
    for _ in range(50):
        velocity, rate, speed = rng.normal(0, 6, 3), rng.normal(0, 5, 3), rng.uniform(0, 1500, 4)
        force, torque = theirs.compute_body_wrench(rate, speed[OUR_ORDER], velocity)
        our_force, our_torque = vehicle.wrench(ours, velocity, rate, speed)
        np.testing.assert_allclose(our_force[0], force, atol=1e-12, rtol=1e-13)
        np.testing.assert_allclose(our_torque[0], torque, atol=1e-12, rtol=1e-13)


def test_the_state_derivative_agrees_to_rounding(pair):
    ours, theirs = pair
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = rotations.normalise(rng.normal(0, 1, 4))
        velocity, rate, wind = rng.normal(0, 5, 3), rng.normal(0, 4, 3), rng.normal(0, 2, 3)
        speed, command = rng.uniform(200, 1200, 4), rng.uniform(200, 1200, 4)
        # theirs: position, velocity, quaternion x y z w, rate, wind, rotor speeds
        state = np.concatenate([np.zeros(3), velocity, np.roll(q, -1), rate, wind, speed[OUR_ORDER]])
        slope = theirs._s_dot_fn(0.0, state, command[OUR_ORDER])
        row = np.concatenate([np.zeros(3), velocity, q, rate, speed])[None]
        world = integrate.world_row(tuple(wind), GRAVITY_M_S2, -np.inf, np.inf)
        mine = integrate._derive(ours, world, command[None], np.array([[16.0]]), row)[0][0]
        np.testing.assert_allclose(mine[3:6], slope[3:6], atol=1e-11)
        np.testing.assert_allclose(mine[6:10], np.roll(slope[6:10], 1), atol=1e-12)
        np.testing.assert_allclose(mine[10:13], slope[10:13], atol=1e-9, rtol=1e-12)
        np.testing.assert_allclose(mine[13:17], slope[16:20][OUR_ORDER], rtol=1e-12)


def test_the_kernel_flies_the_same_path(pair):
    from scipy.integrate import solve_ivp

    ours, theirs = pair
    command = vehicle.invert.hover(ours) + np.array([30.0, -20, 25, -30])
    start = np.concatenate([np.zeros(6), [0, 0, 0, 1.0], np.zeros(6), vehicle.invert.hover(ours)[OUR_ORDER]])
    path = solve_ivp(theirs._s_dot_fn, (0, 0.5), start, args=(command[OUR_ORDER],), rtol=1e-11, atol=1e-12)
    plant = vehicle.simulate.Plant(ours)
    plant.step(command, 0.5)
    # the kernel's quaternion is a unit one, theirs drifts a little
    np.testing.assert_allclose(plant.position_world_m, path.y[0:3, -1], atol=1e-7)
    np.testing.assert_allclose(plant.rate_body_rad_s, path.y[10:13, -1], atol=1e-7)
    assert dynamics.motor_response(ours, command[None], command[None], 16.0)[1] is not None
