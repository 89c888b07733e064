"""Axes that do not match: headings, mounting, z down. What is planted is named, and the fix brings the log back."""

import numpy as np
import pytest

from flight import FlightLog, flight_log, frames, rotations
from flight.flight_log import COLUMNS
from flight.frames import GRAVITY_M_S2
from sysid.logs.check import check_log
from sysid.logs.checks import attitude, mounting
from sysid.logs.checks.finding import Finding
from sysid.logs.checks.motion import kinematics
from sysid.logs.fix import fix

POSITION, ATTITUDE, GYRO = "position_world_m", "q_world_body", "rate_body_rad_s"


def _with(log: FlightLog, quantity: str, values: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **dict(zip(COLUMNS[quantity], values.T, strict=True))}, log.metadata)


def _heading(log: FlightLog, degrees: float) -> FlightLog:
    """The positions turned about the vertical, the attitude not."""
    turn = rotations.exp(np.array([0.0, 0.0, np.deg2rad(degrees)]))
    return _with(log, POSITION, rotations.rotate(turn, log.vector(POSITION)))


def _body(log: FlightLog, turn_deg: tuple[float, float, float]) -> FlightLog:
    """The attitude's body axes turned."""
    turn = rotations.exp(np.deg2rad(np.array(turn_deg)))
    return _with(log, ATTITUDE, rotations.multiply(log.vector(ATTITUDE), turn))


def _apart_deg(log: FlightLog, other: FlightLog) -> float:
    return float(np.rad2deg(np.median(rotations.angle_between(log.vector(ATTITUDE), other.vector(ATTITUDE)))))


@pytest.mark.parametrize("degrees", [35.0, 90.0, 180.0, -90.0])
def test_an_attitude_of_another_heading_than_the_positions_is_turned_back(campaign, truth, degrees):
    turned = _heading(campaign[1], degrees)
    fixed = fix(turned, truth)
    assert fixed.left == ()
    assert len(fixed.done) == 1
    right = rotations.multiply(rotations.exp(np.array([0.0, 0.0, np.deg2rad(degrees)])), turned.vector(ATTITUDE))
    assert _apart_deg(fixed.log, _with(turned, ATTITUDE, right)) < 2.0


def test_positions_in_ned_beside_an_attitude_in_enu_are_flipped_and_the_heading_turned(campaign, truth):
    log = _heading(campaign[1], 90.0)
    mixed = _with(log, POSITION, frames.flip_vector(log.vector(POSITION)))
    (finding,) = check_log(mixed, truth).findings
    assert "heading" in finding.sentence
    assert "z of one points down" in finding.sentence
    fixed = fix(mixed, truth)
    assert fixed.left == ()
    assert [done.rsplit(": ", 1)[1].split(" ")[0] for done in fixed.done] == ["turned", "turned"]
    assert np.abs(fixed.log.vector(POSITION) - log.vector(POSITION)).max() < 1e-9


@pytest.mark.parametrize("turn_deg", [(0.0, 0.0, 90.0), (0.0, 0.0, 180.0)])
def test_a_pose_of_a_body_mounted_turned_is_told_from_an_imu_mounted_turned(log, truth, turn_deg):
    fixed = fix(_body(log, turn_deg), truth)
    assert "the attitude's body axes" in fixed.done[0]
    assert fixed.left == ()
    assert _apart_deg(fixed.log, log) < 3.0
    rate = rotations.rotate(rotations.exp(np.deg2rad(np.array(turn_deg))), log.vector(GYRO))
    fixed = fix(_with(log, GYRO, rate), truth)
    assert "the rotors follow the attitude" in fixed.done[0]
    assert fixed.left == ()
    assert _apart_deg(fixed.log, log) < 1e-6
    assert np.abs(fixed.log.vector(GYRO) - log.vector(GYRO)).std() < 0.1 * log.vector(GYRO).std()


@pytest.mark.parametrize(("before", "words"), [(True, "world axes"), (False, "body axes")])
def test_an_attitude_with_z_down_of_one_frame_alone_is_turned(campaign, truth, before, words):
    log, half = campaign[1], rotations.exp(np.array([np.pi, 0.0, 0.0]))
    q = log.vector(ATTITUDE)
    turned = _with(log, ATTITUDE, rotations.multiply(half, q) if before else rotations.multiply(q, half))
    fixed = fix(turned, truth)
    assert words in fixed.done[0]
    assert fixed.left == ()
    assert _apart_deg(fixed.log, log) < 1e-6


@pytest.mark.parametrize("matrix", [np.diag([1.0, -1.0, 1.0]), np.eye(3)[[1, 0, 2]]])
def test_no_fix_is_proposed_for_left_handed_positions(campaign, truth, matrix):
    log = campaign[1]
    findings = check_log(_with(log, POSITION, log.vector(POSITION) @ matrix), truth).findings
    assert [f.what for f in findings] == ["frame"]
    assert findings[0].repair is None
    assert "order and signs" in findings[0].fix


def test_positions_of_which_z_alone_points_down_are_turned(log, truth):
    """With an accelerometer, which reads what the motion makes."""
    motion = kinematics(log)
    assert motion is not None
    force = rotations.rotate(rotations.conjugate(motion.q), motion.specific_force_world_m_s2)
    read = np.column_stack([np.interp(log.time_s, motion.time_s, column) for column in force.T])
    log = _with(log, "specific_force_body_m_s2", read)
    fixed = fix(_with(log, POSITION, log.vector(POSITION) * [1.0, 1.0, -1.0]), truth)
    assert fixed.left == ()
    assert np.abs(fixed.log.vector(POSITION) - log.vector(POSITION)).max() < 1e-9


def test_where_neither_vertical_motion_nor_gyro_decides_both_readings_are_named(campaign):
    """Level flight without gyro, accelerometer or rotors: a heading turned by half is as good as z down."""
    log = campaign[2]
    position = log.vector(POSITION) * [1.0, 1.0, 0.0]
    kept = FlightLog({n: log.columns[n] for n in ("time_s", *COLUMNS[POSITION], *COLUMNS[ATTITUDE])}, log.metadata)
    findings = check_log(_heading(_with(kept, POSITION, position), 180.0)).findings
    (finding,) = (f for f in findings if f.what == "frame")
    assert finding.fix.startswith("either ")
    assert finding.repair is None


def test_headings_that_agree_give_no_finding_whatever_the_heading(campaign, truth):
    for log in campaign:
        motion = kinematics(log)
        assert motion is not None
        turn = rotations.exp(np.array([0.0, 0.0, 2.0]))
        both = _with(_heading(log, float(np.rad2deg(2.0))), ATTITUDE, rotations.multiply(turn, log.vector(ATTITUDE)))
        assert check_log(both, truth).findings == ()


def _swinging(roll_rad: float, pitch_rad: float, yaw_rad: float, gyro_noise_rad_s: float = 0.02) -> FlightLog:
    """Six seconds in place at 100 Hz, the body swinging at 3.8, 3.8 and 0.4 Hz, with a gyro."""
    rng, time_s = np.random.default_rng(3), np.arange(600) / 100.0
    swing = 2.0 * np.pi * np.array([3.8, 3.8, 0.4])[:, None] * time_s
    angle = np.array([roll_rad, pitch_rad, yaw_rad]) * np.sin(swing + np.array([[0.0], [1.2], [0.0]])).T
    noise = 1e-3 * rng.standard_normal(angle.shape)
    q, later = rotations.exp(angle), rotations.exp(np.roll(angle, -1, axis=0))
    rate = 100.0 * rotations.log(rotations.multiply(rotations.conjugate(q), later))
    rate[-1] = rate[-2]
    vectors = {
        POSITION: 1e-3 * rng.standard_normal((len(time_s), 3)),
        ATTITUDE: rotations.multiply(q, rotations.exp(noise)),
        GYRO: rate + gyro_noise_rad_s * rng.standard_normal(rate.shape),
    }
    return flight_log.from_vectors(time_s, vectors)


def _mounting(log: FlightLog) -> list[Finding]:
    motion = kinematics(log)
    assert motion is not None
    return mounting.check(log, motion, None)


def test_a_gyro_of_a_swinging_body_is_not_called_turned_by_half_though_half_a_period_later_it_would_be():
    """A real flight of a small quadrotor swung so, its gyro 10 ms early."""
    log = _swinging(0.14, 0.06, 0.05)
    gyro = log.vector(GYRO)
    for early in (-3, -1, 0, 1, 3):
        assert _mounting(_with(log, GYRO, np.roll(gyro, early, axis=0))) == []
    log = _swinging(0.14, 0.06, 0.5)
    (finding,) = _mounting(_with(log, GYRO, log.vector(GYRO) * [-1.0, -1.0, 1.0]))
    assert "180 deg" in finding.sentence


def test_turning_about_one_axis_alone_shows_no_turn_about_it():
    for seed in range(6):
        log = _swinging(0.3, 0.0, 0.0)
        noise = 0.05 * np.random.default_rng(seed).standard_normal((len(log), 3))
        assert _mounting(_with(log, GYRO, log.vector(GYRO) + noise)) == []
        assert _mounting(_with(log, GYRO, log.vector(GYRO)[:, [1, 0, 2]] * [1.0, -1.0, 1.0] + noise)) == []


def _pose(position_world_m: np.ndarray, angle_rad: np.ndarray) -> FlightLog:
    time_s = np.arange(len(angle_rad)) / 100.0
    return flight_log.from_vectors(time_s, {POSITION: position_world_m, ATTITUDE: rotations.exp(angle_rad)})


def _attitude(log: FlightLog) -> list[Finding]:
    motion = kinematics(log)
    assert motion is not None
    return attitude.check(log, motion)


def test_a_few_seconds_give_no_finding_about_heading_or_which_way_z_points(campaign):
    for log in campaign:
        for start_s in np.arange(2.0, 12.0, 2.0):
            for length_s in (1.5, 3.0, 5.0):
                assert [f for f in _attitude(log.slice(start_s, start_s + length_s)) if f.level == "error"] == []


@pytest.mark.parametrize("gain", [-0.15, 0.05])
def test_tilts_that_answer_gusts_show_no_heading(gain):
    """Where the wind is held by tilting, little of the tilt is left in the acceleration, and of either sign."""
    rng, time_s = np.random.default_rng(2), np.arange(2000) / 100.0
    frequency = 2.0 * np.pi * np.array([0.4, 0.53])
    tilt = 0.1 * np.sin(time_s[:, None] * frequency)
    level = gain * GRAVITY_M_S2 * tilt / -(frequency**2)
    position = np.column_stack([level[:, 1], -level[:, 0], 0.0 * time_s])
    angle = np.column_stack([tilt, 0.0 * time_s])
    log = _pose(position + 1e-4 * rng.standard_normal((2000, 3)), angle)
    assert [f for f in _attitude(log) if f.repair is not None] == []


@pytest.mark.parametrize(("slope", "down"), [(-0.04, False), (-1.0, True), (1.0, False)])
def test_only_thrust_that_accelerates_as_thrust_does_shows_which_way_z_points(slope, down):
    """A controller that answers gusts makes more thrust while they press down, but not gravity's share of it."""
    time_s, frequency = np.arange(2000) / 100.0, 2.0 * np.pi * 0.7
    wave = np.sin(frequency * time_s)
    position = np.column_stack([0.0 * time_s, 0.0 * time_s, -1.0 / frequency**2 * wave])
    log = _pose(position + 1e-4 * np.random.default_rng(4).standard_normal((2000, 3)), np.zeros((2000, 3)))
    speed = 900.0 * np.sqrt(1.0 + slope * wave / GRAVITY_M_S2)
    log = _with(log, "rotor_speed_rad_s", np.tile(speed[:, None], 4))
    motion = kinematics(log)
    assert motion is not None
    assert attitude._points_up(log, motion) is (None if abs(slope) < 0.1 else not down)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres")])
def test_positions_in_another_unit_than_metres_are_scaled(campaign, truth, factor, unit):
    log = campaign[1]
    fixed = fix(_with(log, POSITION, factor * log.vector(POSITION)), truth)
    assert unit in fixed.done[0]
    assert fixed.left == ()
    assert np.abs(fixed.log.vector(POSITION) - log.vector(POSITION)).max() < 1e-9


def test_a_gyro_in_world_axes_is_named(log):
    world = rotations.rotate(log.vector(ATTITUDE), log.vector(GYRO))
    (finding,) = _mounting(_with(log, GYRO, world))
    assert "world axes" in finding.sentence
    assert _mounting(log) == []


def test_a_right_accelerometer_is_not_turned_along_with_a_gyro(log, truth):
    motion = kinematics(log)
    assert motion is not None
    force = rotations.rotate(rotations.conjugate(motion.q), motion.specific_force_world_m_s2)
    read = np.column_stack([np.interp(log.time_s, motion.time_s, column) for column in force.T])
    log = _with(log, "specific_force_body_m_s2", read)
    quarter = rotations.exp(np.array([0.0, 0.0, np.pi / 2.0]))
    turned = _with(log, GYRO, rotations.rotate(quarter, log.vector(GYRO)))
    (repair,) = (f.repair for f in mounting.check(turned, motion, truth))
    assert repair is not None
    assert repair.columns == COLUMNS[GYRO]
    both = _with(turned, "specific_force_body_m_s2", rotations.rotate(quarter, read))
    (repair,) = (f.repair for f in mounting.check(both, motion, truth))
    assert repair is not None
    assert repair.columns == (*COLUMNS[GYRO], *COLUMNS["specific_force_body_m_s2"])


def test_without_a_gyro_a_body_mounted_turned_gives_no_other_rotor_order(log, truth):
    kept = FlightLog({n: v for n, v in log.columns.items() if n not in COLUMNS[GYRO]}, log.metadata)
    for turn_deg in (90.0, 180.0):
        for finding in check_log(_body(kept, (0.0, 0.0, turn_deg)), truth).findings:
            assert finding.repair is None or finding.repair.action != "rotor order"


def test_a_second_fix_changes_nothing(log, truth):
    quarter = rotations.exp(np.array([0.0, 0.0, np.pi / 2.0]))
    for fault in (
        _with(_heading(log, 70.0), POSITION, 100.0 * _heading(log, 70.0).vector(POSITION)),
        _with(_body(log, (0.0, 0.0, 180.0)), GYRO, np.rad2deg(log.vector(GYRO))),
        _with(_heading(log, 90.0), GYRO, rotations.rotate(quarter, log.vector(GYRO))),
    ):
        assert fix(fix(fault, truth).log, truth).done == ()


ACCELEROMETER = "specific_force_body_m_s2"


def _with_accelerometer(log: FlightLog, axes: np.ndarray) -> FlightLog:
    """What the motion makes, with noise and a bias, along axes of the sensor's own."""
    motion = kinematics(log)
    assert motion is not None
    force = rotations.rotate(rotations.conjugate(motion.q), motion.specific_force_world_m_s2)
    read = np.column_stack([np.interp(log.time_s, motion.time_s, column) for column in force.T])
    read += [0.3, -0.2, 0.1] + 0.3 * np.random.default_rng(2).standard_normal(read.shape)
    return _with(log, ACCELEROMETER, read @ axes.T)


@pytest.mark.parametrize("axes", [[(0, 1, 0), (-1, 0, 0), (0, 0, 1)], [(0, 0, 1), (0, 1, 0), (-1, 0, 0)]])
def test_an_accelerometer_alone_that_is_mounted_turned_is_turned_back(log, truth, axes):
    right, turned = (_with_accelerometer(log, matrix) for matrix in (np.eye(3), np.array(axes, dtype=float)))
    fixed = fix(turned, truth)
    assert "specific_force_body" in fixed.done[0]
    assert fixed.left == ()
    assert np.abs(fixed.log.vector(ACCELEROMETER) - right.vector(ACCELEROMETER)).max() < 1e-9


def test_swapped_axes_of_an_accelerometer_are_found_and_left_to_the_user(log, truth):
    (finding,) = check_log(_with_accelerometer(log, np.eye(3)[[1, 0, 2]]), truth).findings
    assert "the body's x is its y, y is its x, z is its z" in finding.sentence
    assert finding.repair is None


def test_an_accelerometer_along_the_body_axes_gives_no_finding(campaign, truth):
    for flown in campaign:
        assert check_log(_with_accelerometer(flown, np.eye(3)), truth).findings == ()


@pytest.mark.parametrize(("marker_z_m", "sensor_z_m"), [(0.05, -0.03), (0.02, -0.02), (-0.05, 0.03)])
@pytest.mark.parametrize("hz", [1.0, 3.0])
def test_an_accelerometer_below_the_markers_is_not_called_turned_by_doublets_in_hover(marker_z_m, sensor_z_m, hz):
    """There is no drag then, and what turning makes of the arms has opposite signs."""
    time_s = np.arange(0.0, 20.0, 0.005)
    rng = np.random.default_rng(0)
    waves = np.sin(2.0 * np.pi * hz * np.outer(time_s, [1.0, 1.1, 0.71, 1.37]) + rng.uniform(0.0, 6.0, 4))
    q = rotations.exp(np.deg2rad(8.0) * np.column_stack([waves[:, :2] + 0.5 * waves[:, 2:], 0.0 * time_s]))
    thrust = rotations.rotate(q, np.array([0.0, 0.0, GRAVITY_M_S2])) - [0.0, 0.0, GRAVITY_M_S2]
    velocity = np.cumsum(0.005 * (thrust - thrust.mean(axis=0)), axis=0)
    position = np.cumsum(0.005 * (velocity - velocity.mean(axis=0)), axis=0)
    rate = 2.0 * rotations.multiply(rotations.conjugate(q), np.gradient(q, 0.005, axis=0))[:, 1:]
    arm = np.array([0.0, 0.0, sensor_z_m])
    at_sensor = np.cross(np.gradient(rate, 0.005, axis=0), arm) + np.cross(rate, np.cross(rate, arm))
    force = np.array([0.2, -0.1, GRAVITY_M_S2]) + at_sensor + 0.3 * rng.standard_normal(rate.shape)
    values = {
        POSITION: position + rotations.rotate(q, np.array([0.0, 0.0, marker_z_m])),
        ATTITUDE: q,
        ACCELEROMETER: force,
    }
    columns = {name: column for what, v in values.items() for name, column in zip(COLUMNS[what], v.T, strict=True)}
    hover = FlightLog({"time_s": time_s, **columns}, {"name": "hover"})
    motion = kinematics(hover)
    assert motion is not None
    assert mounting.check_accelerometer(hover, motion) == []


def test_a_flight_too_short_to_show_a_heading_says_so(campaign, truth):
    short = campaign[1].slice(0.0, 6.0)
    assert any("heading" in sentence for sentence in check_log(short, truth).inconclusive)
    assert not any("heading" in sentence for sentence in check_log(campaign[1], truth).inconclusive)
