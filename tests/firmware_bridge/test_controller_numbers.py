"""The C mathematics in float32 against plain float64: evaluation, flatness, mixer."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vehicle
from firmware_bridge import _controller, controller, wire
from flight import InputError, rotations

VEHICLE = vehicle.example("rigter2019")
PARAMETERS = controller.vector(controller.parameters_of(VEHICLE).parameters)


def _evaluate(trajectory, times_us):
    plan = wire.plan_from_trajectory(trajectory)
    return _controller.evaluate(plan.durations_us, plan.coefficients, times_us).astype(np.float64)


def test_evaluation_agrees_with_float64_to_a_tenth_of_a_millimetre(curves):
    for trajectory in (curves.figure_eight(), curves.vertical(), curves.general()):
        times_us = np.linspace(0, trajectory.duration_s * 1e6, 5001).astype(np.uint32)
        rows = _evaluate(trajectory, times_us)
        times_s = np.minimum(times_us * 1e-6, trajectory.duration_s)
        # Tolerances: the bar for accepted trajectories is 0.1 mm and 1 mm/s; each further derivative loses a decade.
        for order, tolerance in enumerate((1e-4, 1e-3, 2e-2, 0.5)):
            difference = rows[:, 3 * order : 3 * order + 3] - trajectory.position(times_s, order)
            # acceleration and beyond may jump at joins that are rounded to microseconds
            assert np.quantile(np.abs(difference), 1.0 if order < 2 else 0.99) < tolerance, order
        assert np.abs(rows[:, 15] - trajectory.evaluate(times_s)[:, 3]).max() < 1e-4
        assert np.abs(rows[:, 16] - trajectory.evaluate(times_s, 1)[:, 3]).max() < 1e-3


def test_evaluation_far_from_the_origin_keeps_its_precision(curves):
    base = curves.figure_eight()
    moved = base.coefficients.copy()
    moved[:, :3, 0] += [300.0, -200.0, 50.0]
    trajectory = type(base)(base.durations_s, moved)
    times_us = np.linspace(0, trajectory.duration_s * 1e6, 2001).astype(np.uint32)
    rows = _evaluate(trajectory, times_us)
    times_s = np.minimum(times_us * 1e-6, trajectory.duration_s)
    assert np.abs(rows[:, :3] - trajectory.position(times_s)).max() < 1e-4
    assert np.abs(rows[:, 3:6] - trajectory.position(times_s, 1)).max() < 1e-3


def test_a_time_beyond_the_end_stays_at_the_end(curves):
    trajectory = curves.straight()
    rows = _evaluate(trajectory, np.array([3_000_000, 4_000_000, 2**32 - 1], np.uint32))
    assert np.abs(rows[:, :3] - [3.0, 0.0, 1.5]).max() < 1e-5


def test_too_large_a_trajectory_is_refused(curves):
    many = curves.fitted(lambda t: np.stack([t, t, t, t], -1), np.full(257, 0.1))
    with pytest.raises(InputError, match="has 257 segments; the vehicle stores 256"):
        wire.plan_from_trajectory(many)


def _flat(force, force_rate, force_rate2, yaw, yaw_rate=0.0, yaw_acceleration=0.0):
    return np.concatenate([force, force_rate, force_rate2, [yaw, yaw_rate, yaw_acceleration]]).astype(np.float32)


vectors = st.tuples(*[st.floats(-8.0, 8.0) for _ in range(3)]).map(np.array)


@settings(max_examples=200)
@given(vectors, st.floats(-20.0, 20.0))
def test_attitude_points_the_thrust_and_keeps_the_heading(acceleration, yaw):
    force = 0.7 * (acceleration + np.array([0.0, 0.0, 12.0]))
    row = _controller.flatness(PARAMETERS, _flat(force, np.zeros(3), np.zeros(3), yaw)[None], 1e-3)[0]
    q = row[:4].astype(np.float64)
    axis = force / np.linalg.norm(force)
    twin = vehicle.flatness.hopf(axis[None], np.array([yaw]))[0]
    # float32: a few units in the last place of the quaternion, and of yaw
    assert min(np.abs(q - twin).max(), np.abs(q + twin).max()) < 3e-6
    assert np.abs(rotations.rotate(q, [0.0, 0.0, 1.0]) - axis).max() < 3e-6


def test_rates_are_the_derivatives_of_the_attitude():
    rng = np.random.default_rng(3)
    for _ in range(50):
        f0, f1, f2 = rng.uniform(-3, 3, (3, 3)) * [[1], [8], [30]] + [[0, 0, 8], [0, 0, 0], [0, 0, 0]]
        y0, y1, y2 = rng.uniform(-2, 2, 3)
        row = _controller.flatness(PARAMETERS, _flat(f0, f1, f2, y0, y1, y2)[None], 1e-3)[0]

        def attitude(t, f0=f0, f1=f1, f2=f2, y0=y0, y1=y1, y2=y2):
            force = f0 + f1 * t + 0.5 * f2 * t * t
            yaw = y0 + y1 * t + 0.5 * y2 * t * t
            return vehicle.flatness.hopf((force / np.linalg.norm(force))[None], np.array([yaw]))[0]

        def rate(t, h=1e-5, attitude=attitude):
            return rotations.log(rotations.multiply(rotations.conjugate(attitude(t - h)), attitude(t + h))) / (2 * h)

        bend = (rate(1e-4) - rate(-1e-4)) / 2e-4
        back = rotations.conjugate(row[:4].astype(np.float64))
        turning, turning_more = (rotations.rotate(back, row[k : k + 3].astype(np.float64)) for k in (4, 7))
        assert np.abs(turning - rate(0.0)).max() < 1e-4 * max(1.0, np.abs(rate(0.0)).max())
        assert np.abs(turning_more - bend).max() < 1e-3 * max(1.0, np.abs(bend).max())


@pytest.mark.parametrize("offset", [0.0, 0.02, 0.3])
def test_a_loop_turns_the_reference_no_faster_than_the_axis(offset):
    """Through a full loop, inverted included: each step at most 1.05 of the axis' own motion plus the yaw slew."""
    step_s, yaw_slew = 1e-3, controller.PARAMETERS["yaw_slew_rad_s"].preset
    angle = np.linspace(0, 2 * np.pi, 4000)
    axis = np.stack([np.sin(angle), offset * np.ones_like(angle), np.cos(angle)], -1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    inputs = np.zeros((len(angle), 12), np.float32)
    inputs[:, :3] = 6.87 * axis
    q = _controller.flatness(PARAMETERS, inputs, step_s)[:, :4].astype(np.float64)
    turn = rotations.angle_between(q[:-1], q[1:])
    motion = np.arccos(np.clip((axis[:-1] * axis[1:]).sum(1), -1, 1))
    assert (turn <= 1.05 * motion + yaw_slew * step_s + 1e-3).all()  # 1e-3 rad: float32 in the angle between two q


def test_free_fall_holds_the_axis():
    """Thrust fades to nothing and comes back along another direction: no jump anywhere."""
    t = np.linspace(0, 2, 2001)
    size = 6.87 * np.abs(1 - t)
    direction = np.where(t[:, None] < 1, [0.0, 0.0, 1.0], [0.6, 0.0, 0.8])
    inputs = np.zeros((len(t), 12), np.float32)
    inputs[:, :3] = size[:, None] * direction
    q = _controller.flatness(PARAMETERS, inputs, 1e-3)[:, :4].astype(np.float64)
    limit = controller.PARAMETERS["tilt_slew_rad_s"].preset * 1e-3
    assert rotations.angle_between(q[:-1], q[1:]).max() < limit + 1e-3
    assert np.abs(rotations.rotate(q[-1], [0.0, 0.0, 1.0]) - [0.6, 0.0, 0.8]).max() < 1e-5


def _mix(model, speed, air, rate, parameters=None):
    """Rotor speeds of the mixer for the wrench that `speed` makes, and the saturation bits."""
    force, torque = vehicle.wrench(model, air, rate, speed)
    wrench = np.column_stack([force[:, 2], torque]).astype(np.float32)
    table = PARAMETERS if parameters is None else parameters
    rows, reason = _controller.mixer(table, wrench, air.astype(np.float32), rate.astype(np.float32))
    assert reason == 0
    return rows[:, :4].astype(np.float64), rows[:, 4].astype(int)


@pytest.mark.parametrize(("slowest", "fastest", "tolerance"), [(255, 1795, 1e-5), (500, 1300, 3e-6)])
def test_the_mixer_inverts_the_rotor_equations_exactly(slowest, fastest, tolerance):
    """Any four speeds of the range, up to its limits: of full speed, and none of them called more than the rotors give.

    Left out are windmilling rotors that push less than 2 mN, for which eq. (2) has no inverse.
    """
    # Parasitic drag is not the mixer's business; everything else of the paper's model is.
    rotors = VEHICLE.without_effect("parasitic_drag")
    rng = np.random.default_rng(0)
    n = 20_000
    speed = rng.uniform(slowest, fastest, (n, 4))
    air, rate = rng.uniform([-12, -12, -3], [12, 12, 6], (n, 3)), rng.uniform(-6, 6, (n, 3))
    pushing = vehicle.forces.evaluate(rotors, air.T, rate.T, speed.T).thrust_n.min(axis=0) > 2e-3
    found, saturation = _mix(rotors, speed, air, rate)
    assert pushing.mean() > 0.99
    assert (saturation[pushing] == 0).all()
    assert (np.abs(found - speed)[pushing] / 1800.0).max() < tolerance


def test_an_unreachable_demand_costs_yaw_first_whatever_the_air():
    """Demands beyond the rotors: tilt torque and collective are kept unless reported, to the law's straightness."""
    rotors = VEHICLE.without_effect("parasitic_drag")
    rng = np.random.default_rng(5)
    n = 5000
    wrench = np.column_stack([rng.uniform(1, 24, n), rng.uniform(-0.9, 0.9, (n, 2)), rng.uniform(-0.12, 0.12, n)])
    air, rate = rng.uniform([-9, -9, -2], [9, 9, 4], (n, 3)), rng.uniform(-5, 5, (n, 3))
    arguments = (array.astype(np.float32) for array in (wrench, air, rate))
    rows, _ = _controller.mixer(PARAMETERS, *arguments)
    force, torque = vehicle.wrench(rotors, air, rate, rows[:, :4].astype(np.float64))
    saturation, bits = rows[:, 4].astype(int), controller.SATURATION
    tilt_kept = saturation & bits["tilt"] == 0
    lift_kept = tilt_kept & (saturation & bits["collective"] == 0)
    assert 0.5 < (saturation != 0).mean() < 0.95
    assert np.quantile(np.abs(torque - wrench[:, 1:])[tilt_kept, :2], 0.99) < 0.05  # of 0.9 N m
    assert np.quantile(np.abs(force[:, 2] - wrench[:, 0])[lift_kept], 0.99) < 0.2  # of 24 N


def test_the_mixer_knows_weak_rotors_lift_and_linear_inflow():
    model = vehicle.example("hummingbird").with_effect("weak_rotor", loss_0=0.1, loss_2=0.05)
    model = model.without_effect("parasitic_drag_speed").without_effect("rotor_drag_speed")
    table = controller.vector(controller.parameters_of(model).parameters)
    rng = np.random.default_rng(0)
    n = 1000
    speed = rng.uniform(300, 1300, (n, 4))
    air, rate = rng.uniform(-3, 3, (n, 3)), rng.uniform(-3, 3, (n, 3))
    found, saturation = _mix(model, speed, air, rate, table)
    free = saturation == 0
    assert free.mean() > 0.9
    assert (np.abs(found - speed)[free] / 1500.0).max() < 1e-5


@settings(max_examples=300)
@given(
    st.floats(-50, 200), st.tuples(*[st.floats(-20, 20)] * 3), st.tuples(*[st.floats(-40, 40)] * 3),
    st.tuples(*[st.floats(-30, 30)] * 3),
)  # fmt: skip
def test_the_mixers_commands_are_always_within_the_rotors_range(thrust, torque, air, rate):
    wrench = np.array([[thrust, *torque]], np.float32)
    rows, _ = _controller.mixer(PARAMETERS, wrench, np.array([air], np.float32), np.array([rate], np.float32))
    assert np.isfinite(rows).all()
    assert (rows[:, :4] >= 250.0).all()
    assert (rows[:, :4] <= 1800.0).all()


def test_saturation_gives_up_yaw_first_then_collective_then_tilt():
    still = np.zeros((1, 3))
    zero = np.zeros((1, 3), np.float32)

    def produced(thrust, torque):
        rows, _ = _controller.mixer(PARAMETERS, np.array([[thrust, *torque]], np.float32), zero, zero)
        model = VEHICLE.without_effect("parasitic_drag")
        force, moment = vehicle.wrench(model, still, still, rows[:, :4].astype(np.float64))
        return force[0, 2], moment[0], int(rows[0, 4])

    bits = controller.SATURATION
    thrust, moment, saturation = produced(6.9, (0.05, -0.04, 0.6))  # far more yaw than there is
    assert saturation & bits["yaw"]
    assert thrust == pytest.approx(6.9, rel=0.02)
    assert moment[:2] == pytest.approx([0.05, -0.04], abs=0.01)
    assert moment[2] > 0.02  # the guaranteed share
    thrust, moment, saturation = produced(40.0, (0.3, 0.0, 0.0))  # more lift than there is
    assert saturation & bits["collective"]
    assert moment[0] == pytest.approx(0.3, abs=0.03)
    _, moment, saturation = produced(10.0, (9.0, 3.0, 0.0))  # more tilt torque than there is
    assert saturation & bits["tilt"]
    assert moment[0] / moment[1] == pytest.approx(3.0, rel=0.1)  # scaled, direction kept


def test_singular_geometry_is_refused():
    base = controller.parameters_of(VEHICLE).parameters
    in_line = {**base, **{f"rotor{i}_y_m": 0.0 for i in range(4)}, "com_y_m": 0.0}
    same_spin = {**base, **{f"rotor{i}_spin": 1.0 for i in range(4)}}
    for values in (in_line, same_spin):
        with pytest.raises(controller.RefusedError, match="every wrench"):
            controller.Controller(controller.Configuration(values))
    with pytest.raises(controller.RefusedError, match="carry the mass"):
        controller.Controller(controller.Configuration({**base, "mass_kg": 5.0}))


def test_a_tilt_torque_that_asks_for_negative_thrusts_raises_the_collective():
    zero = np.zeros((1, 3), np.float32)
    rows, _ = _controller.mixer(PARAMETERS, np.array([[0.5, 0.3, 0.0, 0.0]], np.float32), zero, zero)
    model = VEHICLE.without_effect("parasitic_drag")
    force, moment = vehicle.wrench(model, np.zeros((1, 3)), np.zeros((1, 3)), rows[:, :4].astype(np.float64))
    assert int(rows[0, 4]) & controller.SATURATION["collective"]
    assert moment[0] == pytest.approx([0.3, 0.0, 0.0], abs=0.02)
    assert 1.7 < force[0, 2] < 4.3
