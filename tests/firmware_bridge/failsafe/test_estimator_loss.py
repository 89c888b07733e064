"""Position, attitude or everything is lost, jumps, or is told to be poor."""

import numpy as np
import pytest
from judge import violations
from scenario import START, TABLE, TAKE_OFF, Fault, Kind, Loss, Reason, Scenario, State, circle, land, legs

BLIND_M_S = 2.5


def fast(*faults: Fault, speed_m_s: float = 5.0, **options) -> Scenario:
    path = circle(speed_m_s, radius_m=6.0, clearance_m=0.6)
    orders = (*TAKE_OFF, START, land(path.duration_s + 2.0, State.TRAJECTORY))
    return Scenario(orders=orders, path=path, faults=faults, **options)


def hover(*faults: Fault, land_s: float = 12.0, **options) -> Scenario:
    return Scenario(orders=(*TAKE_OFF, land(land_s)), faults=faults, **options)


def lost(seconds: float, loss: Loss = Loss.FROZEN) -> Fault:
    return Fault(Kind.POSITION_LOST, (loss,), 4.0, seconds, since=State.TRAJECTORY)


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN])
@pytest.mark.parametrize("gap_s", [0.05, 0.12, 0.5, 1.0])
def test_a_gap_without_position_at_speed_is_bridged(body, loss, gap_s):
    result = body.fly(fast(lost(gap_s, loss)))
    assert violations(result) == []
    assert State.EMERGENCY not in result.states
    assert result.had(Reason.FINISHED)
    assert result.largest_error_m < (0.3 if gap_s < 0.2 else 0.6)


@pytest.mark.parametrize("sensors", [{}, {"has_specific_force": 0}])
def test_a_short_gap_is_bridged_without_an_accelerometer_too(body, sensors):
    result = body.fly(fast(lost(0.12), sensors=sensors))
    assert violations(result) == []
    assert State.EMERGENCY not in result.states


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN])
@pytest.mark.parametrize("speed_m_s", [5.0, 8.0])
def test_three_seconds_without_position_brake_and_then_descend(body, loss, speed_m_s):
    result = body.fly(fast(lost(3.0, loss), speed_m_s=speed_m_s), trace_every=10)
    trace, at_s = result.trace, result.fault_times_s[0]
    after = np.argmin(abs(trace["time_s"] - at_s - 2.0))
    assert np.hypot(trace["vx"][after], trace["vy"][after]) < 0.4 * speed_m_s
    assert State.EMERGENCY in result.states
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("shift_m", [(0.3, 0.0, 0.0), (0.0, -0.2, 0.2), (0.5, 0.5, 0.0), (2.0, 0.0, 0.0)])
def test_a_relocalization_in_hover_is_no_jolt(body, shift_m):
    moved = Fault(Kind.RELOCALIZED, (*shift_m, 0.0), after_s=2.0)
    result = body.fly(hover(moved, land_s=8.0), trace_every=5)
    trace = result.trace
    soon = (trace["time_s"] > result.fault_times_s[0]) & (trace["time_s"] < result.fault_times_s[0] + 1.5)
    assert trace["tilt_rad"][soon].max() < 0.12
    assert violations(result) == []


def test_a_yaw_reset_does_not_turn_the_vehicle_quickly(body):
    moved = Fault(Kind.RELOCALIZED, (0.0, 0.0, 0.0, 0.5), after_s=2.0)
    result = body.fly(hover(moved, land_s=8.0), trace_every=1)
    trace = result.trace
    soon = (trace["time_s"] > result.fault_times_s[0]) & (trace["time_s"] < result.fault_times_s[0] + 1.0)
    assert abs(trace["wz"][soon]).max() < 0.8
    assert violations(result) == []


def test_a_small_relocalization_on_the_path_is_folded_in(body):
    moved = Fault(Kind.RELOCALIZED, (0.25, 0.1, 0.0), 4.0, since=State.TRAJECTORY)
    result = body.fly(fast(moved), trace_every=5)
    assert result.had(Reason.FINISHED)
    assert violations(result) == []
    trace = result.trace
    soon = (trace["time_s"] > result.fault_times_s[0]) & (trace["time_s"] < result.fault_times_s[0] + 0.5)
    assert trace["tilt_rad"][soon].max() < trace["tilt_rad"][~soon & (trace["state"] == State.TRAJECTORY)].max() + 0.08


@pytest.mark.parametrize(
    "moved",
    [Fault(Kind.RELOCALIZED, (1.5, 0.0, 0.0), 4.0, since=State.TRAJECTORY),
     Fault(Kind.RESET_MISSED, (0.3, 0.0, 0.0), 4.0, since=State.TRAJECTORY)],
)  # fmt: skip
def test_a_jump_beyond_the_clearance_or_of_unknown_size_stops_the_path(body, moved):
    result = body.fly(fast(moved))
    assert result.had(Reason.RELOCALIZED)
    assert not result.had(Reason.FINISHED)
    assert not result.had(Reason.TRACKING_LOST), "it stops and hovers; nothing has lost the path"
    assert violations(result) == []


def test_a_position_marked_as_poor_is_not_used(body):
    poor = Fault(Kind.LARGE_STD, (3.0, 0.1), after_s=1.0)
    result = body.fly(Scenario(faults=(poor,)))
    assert State.EMERGENCY in result.states
    assert violations(result, touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN])
def test_without_attitude_it_stays_level_on_the_gyro_and_then_stops(body, loss):
    """From high up, so that the stated time ends in the air."""
    up = legs([(0, 0, 1.5), (0, 0, 30.0)], speed_m_s=6.0)
    blind = Fault(Kind.ATTITUDE_LOST, (loss,), after_s=up.duration_s + 1.0, since=State.TRAJECTORY)
    result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=up, faults=(blind,)), trace_every=5)
    trace, at_s = result.trace, result.fault_times_s[0]
    held = (trace["time_s"] > at_s) & (trace["time_s"] < at_s + 4.0)
    assert trace["tilt_rad"][held].max() < 0.35
    assert result.stop_s - at_s == pytest.approx(5.0, abs=0.4)
    assert result.at_rest


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN])
def test_attitude_that_comes_back_is_flown_on_or_landed(body, loss):
    for seconds in (0.05, 0.3, 1.0):
        blind = Fault(Kind.ATTITUDE_LOST, (loss,), 2.0, seconds)
        assert violations(body.fly(hover(blind)), touchdown_m_s=BLIND_M_S) == []


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN])
def test_with_everything_lost_the_rotors_stop(body, loss):
    result = body.fly(hover(Fault(Kind.ALL_LOST, (loss,), after_s=2.0)))
    assert violations(result, may_stop_in_air=True) == []
    assert result.stop_s - result.fault_times_s[0] < 0.5
    assert result.final_state in (State.FAULT, State.DISARMED)


@pytest.mark.parametrize("loss", [Loss.FROZEN, Loss.NOT_VALID, Loss.NAN])
def test_a_moment_without_any_estimate_is_bridged(body, loss):
    result = body.fly(fast(Fault(Kind.ALL_LOST, (loss,), 4.0, 0.04, since=State.TRAJECTORY)))
    assert violations(result) == []
    assert result.had(Reason.FINISHED)


@pytest.mark.parametrize("offset_s", [-0.3, 0.05, 1.0])
def test_a_pose_stamped_by_another_clock_does_not_crash(body, offset_s):
    result = body.fly(hover(Fault(Kind.STAMP_OFFSET, (offset_s,), 2.0)))
    assert violations(result, touchdown_m_s=BLIND_M_S, may_stop_in_air=offset_s < 0) == []


@pytest.mark.parametrize("after_s", [2.0, 2.5, 3.1])
def test_a_vehicle_that_had_to_brake_hard_still_leans_into_the_wind(body, after_s):
    """While it turns, the attitude does not follow: what the wind was is kept, or it drifts away with it."""
    up = legs([(0, 0, 1.5), (0, 1.0, 14.0), (0, 0.5, 13.0)], speed_m_s=6.0)
    lie = Fault(Kind.SPEED_WRONG, (0.0, -1.8, 0.0), after_s)
    for seed in range(3):
        orders = (*TAKE_OFF, START, land(30.0, State.TRAJECTORY))
        result = body.fly(
            Scenario(orders=orders, path=up, faults=(lie,), seed=seed, world={"wind_m_s": (2.5, 0.0, 0.0)})
        )
        assert violations(result, touchdown_m_s=BLIND_M_S) == []
        assert np.hypot(*result.end_position_m[:2]) < 8.0


@pytest.mark.parametrize("seed", [0, 1, 4, 6])
def test_vibration_is_no_fall_that_a_blind_descent_climbs_against(body, seed):
    """The sum of an accelerometer's noise grows with the root of time: 1 m/s in seconds of strong vibration."""
    shaken = Fault(Kind.VIBRATION, (12.0,), 1.0)
    blind = Fault(Kind.NO_VERTICAL_VELOCITY, after_s=0.1, since=State.LANDING)
    orders, world = (*TAKE_OFF, land(1.0)), TABLE | {"floor_m": -6.0}
    flight = Scenario(orders=orders, faults=(shaken, blind), seed=seed, tick_s=0.005, world=world)
    result = body.fly(flight, trace_every=5)
    after = result.trace["time_s"] > result.entered_s(State.EMERGENCY)
    height_m = result.trace["z"][after]
    assert height_m.max() - height_m[0] < 1.0
