"""Simulated flights, fleets and sensors."""

import numpy as np
import pytest

import vehicle
from flight import InfeasibleError, InputError, rotations
from flight.frames import GRAVITY_M_S2
from vehicle import flights, manoeuvres, simulate, tracking


def test_a_fleet_flies_as_its_members_would_alone():
    v = vehicle.example()
    rng = np.random.default_rng(0)
    mass, drag = rng.uniform(0.6, 0.8, 5), rng.uniform(0.0, 0.03, 5)
    states = [simulate.State(velocity_world_m_s=rng.normal(0, 3, 3)) for _ in range(5)]
    commands = rng.uniform(800, 1100, (5, 4))
    fleet = simulate.Fleet(v, states, values={"mass_kg": mass, "rotor_drag_thrust.drag_s_m": drag})
    fleet.step(commands, 0.5)
    for i in range(5):
        own = v.with_value("mass_kg", mass[i]).with_value("rotor_drag_thrust.drag_s_m", drag[i])
        plant = simulate.Plant(own, states[i])
        plant.step(commands[i], 0.5)
        np.testing.assert_allclose(fleet.position_world_m[i], plant.position_world_m, atol=1e-13)
        np.testing.assert_allclose(fleet.q_world_body[i], plant.q_world_body, atol=1e-13)


def test_a_fleet_refuses_values_that_do_not_fit():
    v, states = vehicle.example(), [simulate.State()] * 3
    with pytest.raises(InputError, match="3 finite values"):
        simulate.Fleet(v, states, values={"mass_kg": np.array([0.7, 0.8])})
    with pytest.raises(InputError, match="no parameter"):
        simulate.Fleet(v, states, values={"mass": np.ones(3)})
    with pytest.raises(InputError, match="at least one"):
        simulate.Fleet(v, [])
    with pytest.raises(InputError, match="shape"):
        simulate.Fleet(v, states).step(np.zeros((2, 4)), 0.01)


@pytest.mark.parametrize("name", [n for n in manoeuvres.LIBRARY if n != "long_hover"])
def test_a_manoeuvre_is_smooth_returns_and_is_flown(name):
    v, path = vehicle.example(), manoeuvres.make(name)
    for order in range(4):
        assert np.abs(path.join_jumps(order)).max(initial=0.0) < 1e-9
    np.testing.assert_allclose(path.evaluate(np.array([0.0])), path.evaluate(np.array([path.duration_s])), atol=0.1)
    truth = flights.fly_trajectory(v, path, period_s=0.01)
    np.testing.assert_allclose(truth.rows[:, 0, 0:3], path.position(truth.time_s), atol=0.15)


def test_the_tracker_keeps_a_vehicle_it_knows_badly_near_its_path():
    truth = vehicle.example()
    believed = truth.without_effect("rotor_drag_thrust").without_effect("parasitic_drag").with_value("mass_kg", 0.66)
    path = manoeuvres.make("fast_level")
    flown = flights.fly_trajectory(truth, path, believed=believed)
    error = np.linalg.norm(flown.rows[:, 0, 0:3] - path.position(flown.time_s), axis=1)
    assert 0.05 < error.max() < 1.0


def test_a_trajectory_out_of_reach_is_refused_before_the_flight():
    quick = manoeuvres.make("rotation").scale_time(0.5)
    with pytest.raises(InfeasibleError, match="cannot fly"):
        tracking.Tracker(vehicle.example(), quick)


def test_a_gusty_flight_repeats_with_its_seed():
    def fly(seed):
        wind, rng = simulate.Wind((1.0, 0, 0), 0.5), np.random.default_rng(seed)
        path = manoeuvres.make("doublets")
        return flights.fly_trajectory(vehicle.example(), path, wind=wind, rng=rng, period_s=0.01).rows

    np.testing.assert_array_equal(fly(1), fly(1))
    assert np.abs(fly(1) - fly(2)).max() > 1e-3


def ride(v, name="rotation"):
    return flights.fly_trajectory(v, manoeuvres.make(name), period_s=0.005)


def test_the_log_holds_the_pose_sensors_pose():
    v = vehicle.example().with_value("pose_sensor_rotation_z_rad", 0.3)
    truth = ride(v)
    log = flights.measure(truth, noise=flights.QUIET, rng=np.random.default_rng(0))
    q = truth.rows[:, 0, 6:10]
    place = np.array([0.0901, 0.0063, 0.0142])
    np.testing.assert_allclose(
        log.vector("position_world_m"), truth.rows[:, 0, 0:3] + rotations.rotate(q, place), atol=1e-12
    )
    turned = rotations.multiply(rotations.conjugate(q), log.vector("q_world_body"))
    np.testing.assert_allclose(rotations.log(turned), [[0, 0, 0.3]] * len(q), atol=1e-12)


def test_a_delayed_pose_is_the_earlier_pose():
    v = vehicle.example()
    late = v.with_effect("pose_delay", delay_s=0.01)
    quiet = {"noise": flights.QUIET, "rng": np.random.default_rng(0)}
    truth = ride(v)
    now = flights.measure(truth, **quiet)
    old = flights.measure(flights.Truth(late, *[getattr(truth, n) for n in flights.Truth.__slots__[1:]]), **quiet)
    np.testing.assert_allclose(old.vector("position_world_m")[2:], now.vector("position_world_m")[:-2], atol=1e-9)


def test_the_accelerometer_reads_gravity_at_rest_and_the_rotation_of_its_arm():
    truth = ride(vehicle.example().with_effect("imu_errors", place_x_m=0.1))
    log = flights.measure(truth, noise=flights.QUIET, rng=np.random.default_rng(0))
    np.testing.assert_allclose(truth.specific_force_body_m_s2[0, 0], [0, 0, GRAVITY_M_S2], atol=1e-6)
    rate = truth.rows[:, 0, 10:13]
    turn = np.gradient(rate, truth.time_s, axis=0)
    arm = np.array([0.1, 0.0, 0.0])
    extra = np.cross(turn, arm) + np.cross(rate, np.cross(rate, arm))
    difference = log.vector("specific_force_body_m_s2") - truth.specific_force_body_m_s2[:, 0]
    np.testing.assert_allclose(difference, extra, atol=1e-9)


def test_noise_has_the_standard_deviation_it_is_given():
    truth = ride(vehicle.example())
    noise = flights.Noise()
    noisy = flights.measure(truth, noise=noise, rng=np.random.default_rng(0))
    quiet = flights.measure(truth, noise=flights.QUIET, rng=np.random.default_rng(0))
    for quantity, std in (
        ("position_world_m", noise.position_m),
        ("rotor_speed_rad_s", noise.rotor_speed_rad_s),
        ("rate_body_rad_s", noise.gyroscope_rad_s),
        ("specific_force_body_m_s2", noise.accelerometer_m_s2),
    ):
        assert (noisy.vector(quantity) - quiet.vector(quantity)).std() == pytest.approx(std, rel=0.05)
    turned = rotations.angle_between(noisy.vector("q_world_body"), quiet.vector("q_world_body"))
    assert np.sqrt((turned**2).mean() / 3) == pytest.approx(noise.attitude_rad, rel=0.05)


def test_integrated_specific_force_is_the_change_of_velocity():
    truth = ride(vehicle.example(), "vertical_weave")
    q, force = truth.rows[:, 0, 6:10], truth.specific_force_body_m_s2[:, 0]
    world = rotations.rotate(q, force) - np.array([0, 0, GRAVITY_M_S2])
    step = np.diff(truth.time_s)[:, None]
    travelled = np.cumsum(0.5 * (world[1:] + world[:-1]) * step, axis=0)
    np.testing.assert_allclose(travelled, truth.rows[1:, 0, 3:6] - truth.rows[0, 0, 3:6], atol=0.02)


def test_bad_legs_and_names_are_refused():
    with pytest.raises(InputError, match="positive duration"):
        manoeuvres.from_legs(x=[(0.0, 1.0)])
    with pytest.raises(InputError, match="at least one leg"):
        manoeuvres.from_legs()
    with pytest.raises(InputError, match="fast_level"):
        manoeuvres.make("looping")


def test_a_scaled_manoeuvre_starts_where_it_did_and_goes_as_much_further():
    path = manoeuvres.make("oblique")
    small = manoeuvres.scaled(path, 0.25)
    t = np.linspace(0, path.duration_s, 30)
    start = path.position(np.zeros(1))
    np.testing.assert_allclose(small.position(t) - start, 0.25 * (path.position(t) - start), atol=1e-9)
