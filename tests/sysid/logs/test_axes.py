"""Axes that do not match: headings, mounting, z down. What is planted is named, and the fix brings the log back."""

import numpy as np
import pytest

from flight import FlightLog, frames, rotations
from flight.flight_log import COLUMNS
from sysid.logs.check import check_log
from sysid.logs.fix import fix
from sysid.logs.motion import kinematics

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
    log = campaign[1]
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
