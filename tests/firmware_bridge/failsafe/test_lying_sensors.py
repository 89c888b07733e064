"""Sensors that lie under fresh stamps, or tell the truth about a vehicle that must not be armed."""

import math

import numpy as np
import pytest
from judge import violations
from scenario import (
    FROM_START,
    START,
    TAKE_OFF,
    Command,
    Fault,
    Kind,
    Loss,
    Order,
    Reason,
    Scenario,
    State,
    circle,
    land,
)

BLIND_M_S = 2.5


def hover(*faults: Fault, land_s: float = 15.0, **options) -> Scenario:
    return Scenario(orders=(*TAKE_OFF, land(land_s)), faults=faults, **options)


def away_m(result) -> float:
    return math.hypot(*result.end_position_m[:2])


@pytest.mark.parametrize("age_s", [0.15, 0.5, 1.9, -1.2])
def test_a_pose_that_stays_old_or_ahead_of_the_clock_counts_as_none(body, age_s):
    """The time-out counts how long there has been no usable sample, not how old the samples are."""
    wind = {"wind_m_s": (2.0, 0.0, 0.0)}
    result = body.fly(hover(Fault(Kind.POSE_AGE, (age_s,), 1.0), land_s=40.0, world=wind))
    assert result.entered_s(State.EMERGENCY) - result.fault_times_s[0] < 2.5
    assert away_m(result) < 8.0
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("force", [1, 0])
@pytest.mark.parametrize("jump_rad", [1.5, -2.0, 3.1])
def test_a_heading_that_jumps_in_hover_ends_nearby(body, jump_rad, force):
    sensors = {"has_specific_force": force}
    result = body.fly(hover(Fault(Kind.HEADING_JUMP, (jump_rad,), 1.0), land_s=30.0, sensors=sensors))
    assert away_m(result) < 3.0
    assert result.had(Reason.POSE_HEADING)
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


def test_a_heading_that_jumped_does_not_take_the_height_with_it(body):
    """The descent is at the landing speed, not blind."""
    for seed in range(4):
        faults = (Fault(Kind.HEADING_JUMP, (-1.9,), 1.0), Fault(Kind.FLOOR, (-15.0,)))
        result = body.fly(hover(*faults, land_s=60.0, limit_s=90.0, world={"gust_std_m_s": 0.8}, seed=seed))
        assert result.reason_of(State.EMERGENCY) == Reason.POSE_HEADING
        assert violations(result, touchdown_m_s=1.3) == []


@pytest.mark.parametrize("seed", range(4))
def test_a_height_is_believed_on_the_ground_after_a_heading_that_jumped(body, seed):
    """Without an accelerometer nothing else tells the touchdown: no attempt to unload makes it doubtful anew."""
    faults = (Fault(Kind.NO_SPECIFIC_FORCE), Fault(Kind.HEADING_JUMP, (-1.7,), 1.0))
    world = {"gust_std_m_s": 0.8, "wind_m_s": (-1.4, 1.1, 0.0)}
    result = body.fly(hover(*faults, land_s=60.0, limit_s=90.0, world=world, seed=seed))
    assert result.stop_s - result.first_touchdown_s < 5.0
    assert violations(result) == []


@pytest.mark.parametrize(
    "before",
    [
        (Fault(Kind.POSITION_LOST, (Loss.FROZEN,), 1.0),),
        (Fault(Kind.POSITION_LOST, (Loss.NOT_VALID,), 1.0), Fault(Kind.RELOCALIZED, (0.1, 0.0, 0.0, 0.0), 1.2)),
    ],
)
def test_a_heading_that_jumps_without_a_position_is_found(body, before):
    """Else it turns, and leans against the wind where the wind does not come from. Nor does a relocalization before it,
    told and not yet followed, explain the jump."""
    result = body.fly(
        hover(*before, Fault(Kind.HEADING_JUMP, (-2.1,), 2.0), land_s=30.0, world={"wind_m_s": (-0.7, 4.0, 0.0)}),
        trace_every=10,
    )
    assert 2.0 * np.abs(np.arctan2(result.trace["qz"], result.trace["qw"])).max() < 0.2
    assert away_m(result) < 3.0
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


def test_a_heading_that_jumps_without_a_position_brings_no_old_one_back(body):
    """It has braked by then: the velocity from before the position was lost would send it backwards."""
    lost = Fault(Kind.POSITION_LOST, (Loss.NOT_VALID,), 2.0, since=State.TRAJECTORY)
    jump = Fault(Kind.HEADING_JUMP, (-1.0,), 2.9, since=State.TRAJECTORY)
    trace = body.fly(
        Scenario(orders=(*TAKE_OFF, START), path=circle(4.0, radius_m=5.0, turns=1.0), faults=(lost, jump)),
        trace_every=10,
    ).trace
    since = trace["state"] == State.EMERGENCY
    assert np.hypot(trace["vx"], trace["vy"])[since].max() < 0.8


@pytest.mark.parametrize("up_m_s", [2.9, -2.9])
@pytest.mark.parametrize("seed", range(3))
def test_a_vertical_speed_that_lies_is_found_without_a_horizontal_position(body, seed, up_m_s):
    """The height is judged alone: a descent by that speed would fall."""
    lost = Fault(Kind.POSITION_LOST, (Loss.NO_XY,), 1.0)
    wrong = Fault(Kind.SPEED_WRONG, (0.0, 0.0, up_m_s), 3.3, 1.0)
    result = body.fly(hover(lost, wrong, land_s=60.0, limit_s=90.0, seed=seed))
    assert violations(result) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_pose_that_is_stuck_is_found_without_a_vertical_speed(body, seed):
    """Else it goes on braking by the speed that it had."""
    path = circle(8.0, radius_m=11.0, clearance_m=0.6)
    faults = (
        Fault(Kind.NO_VERTICAL_VELOCITY, (), 4.0, since=State.TRAJECTORY),
        Fault(Kind.STUCK, (), 4.4, since=State.TRAJECTORY),
    )
    result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=path, faults=faults, seed=seed), trace_every=1)
    first = int((result.trace["state"] == State.EMERGENCY).argmax())
    assert math.hypot(result.trace["vx"][first], result.trace["vy"][first]) < 2.0
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("jump_m", [(2.0, 0.0, 0.0), (0.0, -5.0, 0.0)])
def test_a_position_that_jumps_in_hover_is_not_followed(body, jump_m):
    result = body.fly(hover(Fault(Kind.JUMP, jump_m, 1.0), land_s=30.0))
    assert away_m(result) < 1.5
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


def test_a_pose_that_is_stuck_is_found_in_hover(body):
    result = body.fly(hover(Fault(Kind.STUCK, (), 1.0), land_s=30.0, world={"wind_m_s": (1.0, 0.0, 0.0)}))
    assert result.had(Reason.POSE_FROZEN)
    assert result.entered_s(State.EMERGENCY) - result.fault_times_s[0] < 3.0
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_pose_that_is_stuck_in_a_landing_without_accelerometer_is_no_ground(body, seed):
    faults = (Fault(Kind.NO_SPECIFIC_FORCE), Fault(Kind.STUCK, (), 0.5, since=State.LANDING))
    result = body.fly(hover(*faults, land_s=5.0, seed=seed, limit_s=90.0))
    assert result.stop_clearance_m < 0.15
    assert result.had(Reason.POSE_FROZEN)


def test_a_pose_that_is_stuck_is_found_at_speed(body):
    path = circle(5.0, radius_m=6.0, clearance_m=0.6)
    stuck = Fault(Kind.STUCK, (), 4.0, since=State.TRAJECTORY)
    result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=path, faults=(stuck,)))
    assert Reason.DEAD_RECKONING in result.limit_reasons
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


def test_a_pose_that_is_late_is_believed_at_the_touchdown(body):
    """It still falls when the accelerometer has stopped."""
    late = Fault(Kind.STAMP_OFFSET, (0.028,), since=FROM_START)
    for seed in range(4):
        scenario = hover(late, land_s=2.0, sensors={"delay_s": 0.038, "vibration_m_s2": 3.0}, seed=seed)
        trace = body.fly(scenario, trace_every=10).trace
        flies = trace["state"] >= State.TAKE_OFF
        assert trace["reckoning_s"][flies].max() == 0.0


def test_a_position_that_drifts_from_its_velocity_ends_in_a_landing(body):
    result = body.fly(hover(Fault(Kind.DRIFT, (0.25, 0.0, 0.0), 1.0), land_s=40.0))
    assert result.reason_of(State.LANDING) == Reason.POSE_DRIFTS
    assert result.entered_s(State.LANDING) - result.fault_times_s[0] < 6.0
    assert away_m(result) < 3.5


def test_one_gyro_axis_that_is_no_number_does_not_stop_the_rotors(body):
    for axis in range(3):
        for seconds in (0.11, 0.4):
            path = circle(5.0, radius_m=6.0, clearance_m=0.6)
            lost = Fault(Kind.GYRO_AXIS, (axis,), 4.0, seconds, since=State.TRAJECTORY)
            orders = (*TAKE_OFF, START, land(path.duration_s + 2.0, State.TRAJECTORY))
            result = body.fly(Scenario(orders=orders, path=path, faults=(lost,)))
            assert result.had(Reason.FINISHED)
            assert violations(result) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_speed_that_lies_for_good_does_not_keep_the_rotors_turning_on_the_ground(body, seed):
    """The position, which stands, tells that it slides nowhere."""
    wrong = Fault(Kind.SPEED_WRONG, (0.1, -0.7, 0.0), 1.0)
    result = body.fly(hover(wrong, land_s=20.0, limit_s=60.0, seed=seed))
    assert result.stop_s - result.last_airborne_s < 5.0
    assert violations(result) == []


@pytest.mark.parametrize("seed", range(4))
def test_a_pose_that_comes_seldom_is_believed_under_strong_vibration(body, seed):
    """It is carried to the tick by an acceleration that has no noise of its own."""
    shaken = Fault(Kind.VIBRATION, (12.0,), 1.0)
    sensors = {"pose_rate_hz": 50.0, "delay_s": 0.015}
    trace = body.fly(hover(shaken, land_s=12.0, sensors=sensors, seed=seed), trace_every=5).trace
    hovers = trace["state"] == State.HOLD
    assert trace["reckoning_s"][hovers].max() == 0.0


@pytest.mark.parametrize("axis", range(3))
def test_a_gyro_axis_may_be_missing_for_a_while_without_an_attitude(body, axis):
    faults = (Fault(Kind.ATTITUDE_LOST, (Loss.FROZEN,), 1.0), Fault(Kind.GYRO_AXIS, (axis,), 1.5, 0.3))
    for seed in range(3):
        result = body.fly(hover(*faults, land_s=20.0, world={"gust_std_m_s": 0.3}, seed=seed))
        assert result.reason_of(State.EMERGENCY) == Reason.GYRO_ONLY
        assert violations(result, touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("observer", [1.0, 0.0])
@pytest.mark.parametrize("sensors", [{}, {"pose_rate_hz": 30.0, "delay_s": 0.03}])
def test_a_gyro_axis_that_is_gone_for_good_ends_in_a_soft_landing(body, sensors, observer):
    """The axis is told by torque over inertia, corrected by the attitude: without a lag to oscillate by."""
    for axis in range(3):
        for seed in (1, 2):
            lost = Fault(Kind.GYRO_AXIS, (axis,), 1.0)
            parameters = {"observer": observer}
            result = body.fly(hover(lost, land_s=30.0, sensors=sensors, parameters=parameters, seed=seed))
            assert result.reason_of(State.LANDING) == Reason.GYRO_AXIS
            assert result.largest_tilt_rad < 0.3
            assert violations(result) == []


def test_a_gyro_axis_may_be_lost_on_a_gusty_path_under_a_wrong_inertia(body):
    path = circle(5.0, radius_m=6.0, clearance_m=0.6)
    orders = (*TAKE_OFF, START, land(path.duration_s + 2.0, State.TRAJECTORY))
    wrong = {"inertia_xx": 0.7 * 0.00306, "inertia_yy": 0.7 * 0.00442}
    for axis in range(3):
        lost = Fault(Kind.GYRO_AXIS, (axis,), 4.0, since=State.TRAJECTORY)
        gusts = {"gust_std_m_s": 1.0}
        result = body.fly(Scenario(orders=orders, path=path, faults=(lost,), world=gusts, parameters=wrong))
        assert violations(result) == []


@pytest.mark.parametrize("speed", [math.nan, math.inf, -math.inf, -500.0, 1e30])
def test_a_measured_rotor_speed_that_cannot_be_changes_nothing(body, speed):
    wrong = Fault(Kind.ROTOR_SPEED, (1, speed), 1.0)
    result = body.fly(hover(wrong, land_s=3.0, parameters={"rotor_drag_kg": 1e-5, "rotor_lag_s": 0.02}))
    assert violations(result) == []


@pytest.mark.parametrize("tumbling", [0.0, 2.0])
def test_a_vehicle_that_is_carried_is_neither_armed_nor_taken_off(body, tumbling):
    hand = Fault(Kind.CARRIED, (0.6, 0.0, 0.3, tumbling), 0.0, since=100)
    orders = (Order(Command.ARM, 0, 0.6, 100), Order(Command.TAKE_OFF, 1.5, 1.0, 100))
    result = body.fly(Scenario(orders=orders, faults=(hand,), limit_s=2.0))
    assert result.order_reasons[0] in (Reason.MOVING, Reason.TILT_ERROR)
    hand = Fault(Kind.CARRIED, (0.6, 0.0, 0.3, tumbling), 0.6, since=100)
    orders = (Order(Command.ARM, 0, 0.5, 100), Order(Command.TAKE_OFF, 1.5, 1.0, 100))
    result = body.fly(Scenario(orders=orders, faults=(hand,), limit_s=2.0))
    assert result.order_reasons[0] == 0
    assert result.order_reasons[1] in (Reason.MOVING, Reason.TILT_ERROR)


def test_a_vehicle_that_falls_is_not_armed(body):
    """By the accelerometer too: 20 ms suffice, long before the fall is fast."""
    for after_s in (0.04, 0.5, 1.07):
        fall = Scenario(orders=(Order(Command.ARM, 0, after_s, 100),), start_m=(0, 0, 30.0), falling=True, limit_s=2.0)
        assert body.fly(fall).order_reasons[0] in (Reason.FALLING, Reason.MOVING)


@pytest.mark.parametrize("lie", [Fault(Kind.SPEED_WRONG, (-1.0, -1.1, 0.0), 3.7, since=State.TRAJECTORY),
                                 Fault(Kind.STUCK, (), 3.7, since=State.TRAJECTORY)])  # fmt: skip
def test_dead_reckoning_without_an_accelerometer_knows_its_own_feedback(body, lie):
    """Else an error of the velocity is flown against for ever, ever faster."""
    path = circle(8.0, radius_m=11.0, clearance_m=0.6)
    for seed in range(3):
        faults = (Fault(Kind.NO_SPECIFIC_FORCE), lie)
        result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=path, faults=faults, seed=seed), trace_every=1)
        blind = result.trace["time_s"] > result.fault_times_s[1]
        assert max(map(math.hypot, result.trace["vx"][blind], result.trace["vy"][blind])) < 9.5
        assert away_m(result) < 22.0 + 20.0
        assert violations(result, touchdown_m_s=BLIND_M_S) == []
