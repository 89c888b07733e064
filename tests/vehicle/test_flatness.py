"""Flatness: the model's accelerations at the flat state are those of the path."""

import numpy as np
import pytest

import vehicle
from flight import Trajectory, rotations
from flight.frames import GRAVITY_M_S2
from vehicle import flatness, native


def wavy(seed=0):
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 2.0, 1.5, 0.6, 0.25, 0.1, 0.05, 0.02])
    return Trajectory(np.array([1.2, 0.9]), rng.normal(0, 1, (2, 4, 8)) * scale)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_the_accelerations_of_flatness_are_those_of_the_model(name):
    v = vehicle.example(name)
    flat = flatness.state(v, wavy(), wavy().sample(0.01)[:-1])
    velocity = rotations.rotate(rotations.conjugate(flat.q_world_body), flat.velocity_world_m_s)
    specific, turn = vehicle.acceleration(v, velocity, flat.rate_body_rad_s, flat.rotor_speed_rad_s)
    world = rotations.rotate(flat.q_world_body, specific) - np.array([0, 0, GRAVITY_M_S2])
    np.testing.assert_allclose(world, flat.acceleration_world_m_s2, atol=1e-8)
    np.testing.assert_allclose(turn, flat.rate_derivative_body_rad_s2, atol=1e-7)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_compiled_and_plain_flatness_agree(name):
    v, times = vehicle.example(name), wavy().sample(0.05)[:-1]
    fast = flatness.state(v, wavy(), times)
    slow = flatness._state_numpy(v, times, flatness._sample(wavy(), times), -np.inf)
    np.testing.assert_allclose(fast.q_world_body, slow.q_world_body, atol=1e-10)
    np.testing.assert_allclose(fast.rate_body_rad_s, slow.rate_body_rad_s, atol=1e-8)
    np.testing.assert_allclose(fast.torque_n_m, slow.torque_n_m, atol=1e-7)
    np.testing.assert_allclose(fast.rotor_speed_rad_s, slow.rotor_speed_rad_s, atol=1e-3)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_an_attitude_that_did_not_settle_has_no_rotor_speeds_and_one_within_the_speed_limit_settles(name, monkeypatch):
    v, rng, count = vehicle.example(name), np.random.default_rng(0), 1500
    velocity, acceleration = (rng.normal(size=(count, 1, 3)) * scale for scale in ([8.0, 8.0, 1.7], [5.0, 5.0, 1.7]))
    yaw, still, pace = rng.uniform(-3.0, 3.0, (count, 1)), (np.zeros((1, 1)),) * 2, np.ones(count)
    fast = flatness.at_nodes(v, velocity, acceleration, yaw, still, pace)[:, 0]
    monkeypatch.setattr(native, "compiled", lambda _: None)
    slow = flatness.at_nodes(v, velocity, acceleration, yaw, still, pace)[:, 0]
    flown = np.linalg.norm(velocity[:, 0], axis=1) < v.limits.speed_m_s
    settled = [np.isfinite(values).all(axis=1) for values in (fast, slow)]
    assert settled[0][flown].all()
    assert settled[1][flown].all()
    assert not settled[1].all()
    assert name == "rigter2019" or not settled[0].all()
    both = settled[0] & settled[1]
    np.testing.assert_allclose(fast[both], slow[both], rtol=0.0, atol=5e-3)


@pytest.mark.parametrize("compiled", [True, False])
def test_of_no_pieces_there_are_no_values(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(native, "compiled", lambda _: None)
    none, operators = np.zeros((0, 12, 3)), (np.zeros((12, 12)),) * 2
    found = flatness.at_nodes(vehicle.example(), none, none, np.zeros((0, 12)), operators, np.zeros(0))
    assert found.shape == (0, 12, 8)


# Speed-scaled rotor drag depends on each rotor, hence on torque, hence on the fourth derivative of the path: rates
# then neglect how that share of the drag changes in time. Thrust-scaled drag has no such chain.
@pytest.mark.parametrize(("name", "tolerance"), [("rigter2019", 1e-5), ("hummingbird", 0.05)])
def test_rates_are_the_derivative_of_the_attitude(name, tolerance):
    v, path, h = vehicle.example(name), wavy(), 1e-5
    times = np.linspace(0.1, 1.1, 7)
    flat = flatness.state(v, path, times)
    before, after = flatness.state(v, path, times - h), flatness.state(v, path, times + h)
    turned = rotations.multiply(rotations.conjugate(before.q_world_body), after.q_world_body)
    np.testing.assert_allclose(rotations.log(turned) / (2 * h), flat.rate_body_rad_s, atol=tolerance)


def test_hover_is_level_and_even():
    v = vehicle.example()
    still = Trajectory(np.array([1.0]), np.zeros((1, 4, 1)))
    flat = flatness.state(v, still, np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(flat.q_world_body, [[1, 0, 0, 0]] * 3, atol=1e-12)
    np.testing.assert_allclose(flat.rotor_speed_rad_s, [vehicle.invert.hover(v)] * 3, atol=1e-6)


def test_free_fall_has_no_attitude():
    falling = Trajectory(np.array([0.5]), np.array([[[0, 0, 0], [0, 0, 0], [10.0, 0, -GRAVITY_M_S2 / 2], [0, 0, 0]]]))
    flat = flatness.state(vehicle.example(), falling, np.array([0.2]))
    assert np.isnan(flat.rotor_speed_rad_s).all()
