"""The path clock follows the vehicle: rides out what the vehicle can, gives up what it cannot."""

import pytest
from judge import landed_by, violations
from scenario import START, TAKE_OFF, Fault, Kind, Reason, Scenario, State, circle, land, legs

CLEARANCE_M = 0.5


def on_path(*faults: Fault, speed_m_s: float = 5.0, **options) -> Scenario:
    path = circle(speed_m_s, radius_m=8.0, clearance_m=CLEARANCE_M)
    orders = (*TAKE_OFF, START, land(path.duration_s + 2.0, State.TRAJECTORY))
    return Scenario(orders=orders, path=path, faults=faults, **options)


def at(kind: Kind, *values: float, duration_s: float = 0.0) -> Fault:
    return Fault(kind, values, 4.0, duration_s, since=State.TRAJECTORY)


@pytest.mark.parametrize("seed", [1, 5])
@pytest.mark.parametrize("speed_m_s", [2.0, 5.0])
def test_a_blocked_vehicle_gives_the_path_up_and_lands(body, speed_m_s, seed):
    """Its acceleration tells of a delay below nothing (seeds 1 and 5): a pose is carried ahead, never back."""
    result = body.fly(on_path(at(Kind.BLOCKED), speed_m_s=speed_m_s, seed=seed))
    assert landed_by(result, Reason.TRACKING_LOST)
    assert result.entered_s(State.LANDING) - result.fault_times_s[0] < 6.0
    assert Reason.TRACKING_ERROR in result.limit_reasons
    assert violations(result) == []


def test_the_set_point_does_not_run_away_from_a_blocked_vehicle(body):
    """At 5 m/s: beyond the clearance for 0.3 s is 2 m."""
    result = body.fly(on_path(at(Kind.BLOCKED)))
    assert result.largest_error_m < 6 * CLEARANCE_M


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_at_eighty_percent_does_not_end_the_path(body, rotor):
    result = body.fly(on_path(at(Kind.ROTOR_HEALTH, rotor, 0.8)))
    assert result.had(Reason.FINISHED)
    assert violations(result) == []


@pytest.mark.parametrize("gust_m_s", [(5.0, 0.0, 0.0), (0.0, -5.0, 0.0), (0.0, 0.0, -3.0)])
def test_a_gust_does_not_end_the_path(body, gust_m_s):
    result = body.fly(on_path(at(Kind.GUST, *gust_m_s, duration_s=1.5)))
    assert result.had(Reason.FINISHED)
    assert violations(result) == []


def test_a_jump_of_three_tenths_does_not_end_the_path(body):
    result = body.fly(on_path(at(Kind.JUMP, 0.3, 0.0, 0.0)))
    assert result.had(Reason.FINISHED)
    assert violations(result) == []


def test_a_jump_of_many_metres_is_not_chased(body):
    result = body.fly(on_path(at(Kind.JUMP, 20.0, 0.0, 0.0)))
    assert result.largest_speed_m_s < 8.0
    assert not result.had(Reason.FINISHED)
    assert violations(result) == []


def test_a_storm_that_the_vehicle_cannot_stand_against_ends_the_path(body):
    blown = Fault(Kind.GUST, (0.0, 25.0, 0.0), 3.0, 8.0, since=State.TRAJECTORY)
    path = legs([(0, 0, 1.5), (0, 0, 6.0), (20, 0, 6.0)], speed_m_s=3.0, clearance_m=CLEARANCE_M)
    result = body.fly(Scenario(orders=(*TAKE_OFF, START), path=path, faults=(blown,), limit_s=90.0))
    assert landed_by(result, Reason.TRACKING_LOST)
    assert result.at_rest


def test_a_clean_flight_is_not_slowed(body):
    for speed in (2.0, 5.0, 8.0):
        path = circle(speed, radius_m=8.0, clearance_m=CLEARANCE_M)
        result = body.fly(on_path(speed_m_s=speed))
        assert result.path_end_s == pytest.approx(path.duration_s, abs=0.01)
        reached = result.entered_s(State.TRAJECTORY)
        finished = next(change.time_s for change in result.changes if change.reason == Reason.FINISHED)
        assert finished - reached == pytest.approx(path.duration_s, abs=0.02)
        assert result.largest_error_m < 0.1


@pytest.mark.parametrize("after_s", [0.4, 0.5, 0.6, 0.7])
def test_a_jump_beside_a_dive_does_not_turn_the_vehicle_over(body, after_s):
    """The path all but falls: what feedback asks for to the side must not be all that is left of the thrust."""
    path = legs([(0, 0, 1.5), (0, 3, 5.0), (0, 2.5, 0.6)], speed_m_s=20.0, acceleration_m_s2=9.0)
    top_s = 1e-6 * float(path.durations_us[0])
    missed = Fault(Kind.RESET_MISSED, (0.0, -0.2, 0.0), top_s + after_s, since=State.TRAJECTORY)
    orders = (*TAKE_OFF, START, land(8.0, State.TRAJECTORY))
    result = body.fly(Scenario(orders=orders, path=path, faults=(missed,), limit_s=40.0))
    assert result.largest_tilt_rad < 1.3
    assert violations(result) == []
