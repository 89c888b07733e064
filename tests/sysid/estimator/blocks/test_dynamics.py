"""The hand-chained derivatives against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

import vehicle
from flight import rotations
from sysid.estimator.blocks import accelerometer, motion, pose
from sysid.estimator.blocks.accelerometer import BLOCK as ACCELEROMETER
from sysid.estimator.blocks.base import At
from sysid.estimator.blocks.gyro import BLOCK as GYRO
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.blocks.pose import BLOCK as POSE
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights import clocks
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Signal
from sysid.estimator.joint_problem.problem import Point, located
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import along, slopes_along
from sysid.estimator.trajectory.states import States

NAMES = ("inertia_xx_kg_m2", "thrust_bem.k1_n_s2", "centre_of_mass.x_m", "parasitic_drag.drag_xy_kg_m")

MOTION = motion.Motion()
NOISE = Noise({block.name: np.array(block.usual) for block in (POSE, GYRO, ACCELEROMETER)})


def stream(values: np.ndarray) -> Signal:
    """Samples from well before to well after the flight."""
    return Signal.through(np.linspace(-0.03, 0.1, len(values)), values)


@pytest.fixture(scope="module", params=["white", "gusts"])
def scene(request) -> tuple[Flight, States, vehicle.Vehicle]:
    rng = np.random.default_rng(4)
    n = 6
    time_s = np.cumsum(rng.uniform(0.004, 0.012, n))
    rate = rng.uniform(-4.0, 4.0, (n, 3))
    q = rotations.multiply(rotations.exp([0.3, -0.2, 0.7]), rotations.exp(np.cumsum(0.008 * rate, axis=0)))
    gust = rng.uniform(-3.0, 3.0, (n, 6)) if request.param == "gusts" else None
    states = States(rng.standard_normal((n, 3)), rng.uniform(-6.0, 6.0, (n, 3)), q, rate, gust)
    flight = Flight(
        name="random",
        log_index=0,
        time_s=time_s,
        readings={
            "position_world_m": rng.standard_normal((n, 3)),
            "q_world_sensor": rotations.multiply(q, rotations.exp(0.01 * rng.standard_normal((n, 3)))),
            "rate_body_rad_s": rate + 0.1,
            "specific_force_body_m_s2": rng.uniform(-2.0, 12.0, (n - 1, 3)),
        },
        rotor_speed_rad_s=rng.uniform(700.0, 1200.0, (n - 1, 4)),
        rotor_acceleration_rad_s2=np.zeros((n - 1, 4)),
        rotor_command_rad_s=np.full((n - 1, 4), np.nan),
        battery_v=np.full(n - 1, np.nan),
        streams={
            clocks.GYRO: stream(rng.uniform(-4.0, 4.0, (9, 3))),
            clocks.ACCELEROMETER: stream(rng.uniform(-2.0, 12.0, (9, 3))),
            clocks.ROTOR_SPEED: stream(rng.uniform(700.0, 1200.0, (9, 4))),
        },
    )
    wind = vehicle.example().with_value("centre_of_mass.y_m", -2e-3)
    return flight, states, wind


def _defects(flight, states, model):
    mid = middle(flight, states)
    return motion.defects(states, mid, along(model, flight, mid))


def test_defect_derivatives_match_finite_differences(scene):
    flight, states, model = scene
    mid = middle(flight, states)
    before, after, _ = motion.defect_jacobians(states, mid, slopes_along(model, NAMES, flight, mid))
    assert before.shape[2] == (12 if states.gust is None else 18)
    for column in range(before.shape[2]):
        step = 1e-6
        for moved_nodes, jacobian in ((slice(0, 1), before[0]), (slice(1, 2), after[0])):
            change = np.zeros((len(flight), before.shape[2]))
            change[moved_nodes, column] = step
            high, low = (_defects(flight, states.moved(s * change), model)[0] for s in (1.0, -1.0))
            # the attitude part is exact to first order in the turn over one interval, 0.05 rad here
            np.testing.assert_allclose(jacobian[:, column], (high - low) / (2.0 * step), rtol=4e-3, atol=3e-4)


def test_parameter_columns_match_finite_differences(scene):
    flight, states, model = scene
    mid = middle(flight, states)
    _, _, border = motion.defect_jacobians(states, mid, slopes_along(model, NAMES, flight, mid))
    for j, name in enumerate(NAMES):
        step = 1e-5 * abs(model.value(name))
        high, low = (
            _defects(flight, states, model.with_value(name, model.value(name) + s * step)) for s in (1.0, -1.0)
        )
        expected = (high - low) / (2.0 * step)
        np.testing.assert_allclose(border[:, :, j], expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


def test_accelerometer_derivatives_match_finite_differences(scene):
    flight, states, _ = scene
    before, after = accelerometer.jacobians(states, middle(flight, states))
    step = 1e-6
    for column in range(12):
        for node, jacobian in ((0, before[0]), (1, after[0])):
            change = np.zeros((len(flight), 18))
            change[node, column] = step
            high, low = (
                accelerometer.residual(flight, moved, middle(flight, moved), np.zeros(3))[0]
                for moved in (states.moved(change), states.moved(-change))
            )
            np.testing.assert_allclose(jacobian[:, column], (high - low) / (2.0 * step), rtol=4e-3, atol=0.2)


@pytest.mark.parametrize("delay_s", [0.0, 0.012])
def test_sensor_derivatives_match_finite_differences(scene, delay_s):
    """Pose, gyro and accelerometer as blocks: by the state, by their parameters, biases and delays."""
    flight, states, model = scene
    gyro, force = GYRO.bias_names(0), ACCELEROMETER.bias_names(0)
    values = dict(zip(pose.PARAMETERS, (0.09, -0.02, 0.03, 0.02, -0.05, 0.1, delay_s), strict=True))
    values |= dict(zip(gyro, (0.01, 0.02, 0.03), strict=True)) | dict(zip(force, (0.1, 0.2, 0.3), strict=True))
    values |= {clocks.delay_name(q, 0): d for q, d in ((clocks.GYRO, delay_s), (clocks.ACCELEROMETER, -delay_s))}
    # the derivative by the state takes neighbours as given: all nodes are moved alike here, which leaves them so
    _, seen = PoseSensor.at(values).reading(states, flight.time_s)
    flight = replace(flight, readings={**flight.readings, "q_world_sensor": seen})
    point = Point(model, values, (states,))

    def at(where: States, sensors: dict[str, float]) -> At:
        return located(flight, where, replace(point, sensors=sensors), NOISE)

    for block in (POSE, GYRO, ACCELEROMETER):
        linear = block.linear(at(states, values))
        by_state = sum(linear.by_state)  # all nodes are moved alike
        step = 1e-6
        for column in range(12):
            change = np.zeros((len(flight), 18))
            change[:, column] = step
            high, low = (block.residual(at(states.moved(s * change), values)) for s in (1.0, -1.0))
            np.testing.assert_allclose(by_state[:, :, column], (high - low) / (2.0 * step), atol=0.2)
        for i, name in enumerate(linear.shared):
            high, low = (block.residual(at(states, values | {name: values[name] + s * step})) for s in (1.0, -1.0))
            np.testing.assert_allclose(linear.by_shared[:, :, i], (high - low) / (2.0 * step), rtol=0.02, atol=0.02)


@pytest.mark.parametrize("delay_s", [0.0, 0.012])
def test_the_column_of_a_late_rotor_speed_matches_finite_differences(scene, delay_s):
    """With rotor inertia in the model, so that the delayed acceleration of the rotors counts, too."""
    flight, states, model = scene
    model = model.with_effect("rotor_acceleration_torque", rotor_inertia_kg_m2=1e-5)
    name, step = clocks.delay_name(clocks.ROTOR_SPEED, 0), 1e-6
    noise = Noise({**NOISE.levels, "motion": np.ones(6)})

    def at(delay_s: float) -> At:
        return located(flight, states, Point(model, {name: delay_s}, (states,)), noise, NAMES)

    linear = MOTION.linear(at(delay_s))
    assert linear.shared == (*NAMES, name)
    high, low = (MOTION.residual(at(delay_s + s * step)) for s in (1.0, -1.0))
    expected = (high - low) / (2.0 * step)
    np.testing.assert_allclose(linear.by_shared[:, :, -1], expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("delay_s", [0.0, 0.012])
def test_with_its_curvature_the_cost_of_a_late_rotor_speed_has_the_second_derivative_of_finite_differences(
    scene, delay_s
):
    flight, states, model = scene
    model = model.with_effect("rotor_acceleration_torque", rotor_inertia_kg_m2=1e-5)
    name, step = clocks.delay_name(clocks.ROTOR_SPEED, 0), 1e-4
    noise = Noise({**NOISE.levels, "motion": np.ones(6)})

    def at(delay_s: float) -> At:
        return located(flight, states, Point(model, {name: delay_s}, (states,)), noise, NAMES)

    low, now, high = (0.5 * (MOTION.white_residual(at(delay_s + s * step), False) ** 2).sum() for s in (-1, 0, 1))
    gauss_newton = (MOTION.white(at(delay_s), False).by_shared[:, :, -1] ** 2).sum()
    left_out = MOTION.curvature(at(delay_s))[name]
    assert abs(left_out) > 0.01 * gauss_newton
    assert gauss_newton + left_out == pytest.approx((high - 2.0 * now + low) / step**2, rel=0.01)
