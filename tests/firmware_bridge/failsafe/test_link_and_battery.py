"""Link, battery and parameters in flight: each failsafe with its reason, each ending on the ground."""

import pytest
from judge import landed_by, violations
from scenario import (
    FROM_START,
    START,
    TABLE,
    TAKE_OFF,
    Command,
    Fault,
    Kind,
    Order,
    Policy,
    Reason,
    Scenario,
    State,
    land,
    legs,
)

BATTERY = {"battery_arm_v": 14.0, "battery_warn_v": 13.6, "battery_land_v": 13.2}
WARNING_BATTERY = 1
EIGHT_M = [(0, 0, 1.5), (8, 0, 1.5)]


@pytest.mark.parametrize("floor_m", [0.0, -3.0])
def test_a_low_battery_lands(body, floor_m):
    world = TABLE | {"floor_m": floor_m} if floor_m < 0 else {}
    path = legs(EIGHT_M, speed_m_s=2.0)
    low = Fault(Kind.BATTERY, (12.9,), 4.0, since=State.TRAJECTORY)
    scenario = Scenario(
        orders=(*TAKE_OFF, START),
        path=path,
        faults=(low,),
        world=world,
        parameters=BATTERY,
        sensors={"battery_v": 15.0},
    )
    result = body.fly(scenario)
    assert landed_by(result, Reason.BATTERY_LOW)
    assert result.warnings & WARNING_BATTERY
    assert violations(result) == []


def test_a_sagging_battery_warns_and_flies_on(body):
    sag = Fault(Kind.BATTERY, (13.4,), 1.0)
    result = body.fly(
        Scenario(orders=(*TAKE_OFF, land(8.0)), faults=(sag,), parameters=BATTERY, sensors={"battery_v": 15.0})
    )
    assert result.warnings & WARNING_BATTERY
    assert result.reason_of(State.LANDING) == Reason.COMMANDED
    assert violations(result) == []


def test_a_dip_of_the_voltage_does_not_land(body):
    dip = Fault(Kind.BATTERY, (12.9,), 2.0, 0.1)
    result = body.fly(
        Scenario(orders=(*TAKE_OFF, land(8.0)), faults=(dip,), parameters=BATTERY, sensors={"battery_v": 15.0})
    )
    assert result.reason_of(State.LANDING) == Reason.COMMANDED


def test_arming_is_refused_on_a_low_battery(body):
    result = body.fly(Scenario(parameters=BATTERY, sensors={"battery_v": 13.8}, limit_s=3.0))
    assert result.order_reasons[0] == Reason.BATTERY_LOW
    assert not result.flew


def test_a_lost_link_holds_and_then_lands(body):
    lost = Fault(Kind.LINK_LOST, after_s=1.0)
    result = body.fly(Scenario(faults=(lost,), parameters={"link_hold_s": 5.0}))
    assert landed_by(result, Reason.LINK_LOST)
    assert result.entered_s(State.LANDING) - result.fault_times_s[0] == pytest.approx(5.0, abs=1.0)
    assert violations(result) == []


def test_a_link_that_comes_back_in_time_changes_nothing(body):
    gap = Fault(Kind.LINK_LOST, (), 1.0, 4.0)
    result = body.fly(Scenario(orders=(*TAKE_OFF, land(12.0)), faults=(gap,), parameters={"link_hold_s": 8.0}))
    assert result.reason_of(State.LANDING) == Reason.COMMANDED


def test_a_path_that_is_to_be_finished_without_a_link_is(body):
    path = legs(EIGHT_M, speed_m_s=2.0, policy=Policy.FINISH)
    lost = Fault(Kind.LINK_LOST, (), 1.0, since=State.TRAJECTORY)
    scenario = Scenario(orders=(*TAKE_OFF, START), path=path, faults=(lost,), parameters={"link_hold_s": 3.0})
    result = body.fly(scenario)
    assert result.had(Reason.FINISHED)
    assert landed_by(result, Reason.LINK_LOST)
    assert violations(result) == []


def test_a_path_to_be_finished_that_is_paused_lands_without_a_link(body):
    """Nobody is there to resume it, and paused it comes to no end."""
    path = legs(EIGHT_M, speed_m_s=2.0, policy=Policy.FINISH)
    pause = Order(Command.PAUSE, after_s=1.0, since=State.TRAJECTORY)
    lost = Fault(Kind.LINK_LOST, (), 1.0, since=State.PAUSED)
    scenario = Scenario(orders=(*TAKE_OFF, START, pause), path=path, faults=(lost,), parameters={"link_hold_s": 3.0})
    result = body.fly(scenario)
    assert landed_by(result, Reason.LINK_LOST)
    assert not result.had(Reason.FINISHED)
    assert violations(result) == []


@pytest.mark.parametrize(("mass_kg", "reasons"), [
    (0.75, {Reason.OK}),
    (1.4, {Reason.CHANGE_TOO_LARGE, Reason.CANNOT_HOVER}),
    (0.2, {Reason.CHANGE_TOO_LARGE}),
    (40.0, {Reason.CHANGE_TOO_LARGE, Reason.CANNOT_HOVER}),
])  # fmt: skip
def test_a_mass_that_cannot_be_flown_now_is_refused_in_the_air(body, mass_kg, reasons):
    change = Fault(Kind.PARAMETER, (mass_kg,), 2.0, parameter="mass_kg")
    result = body.fly(Scenario(orders=(*TAKE_OFF, land(6.0)), faults=(change,)))
    assert result.fault_reasons[0] in reasons
    assert violations(result) == []


def test_gains_change_in_the_air_and_geometry_does_not(body):
    changes = (
        Fault(Kind.PARAMETER, (7.0,), 1.0, parameter="kp_xy_1_s2"),
        Fault(Kind.PARAMETER, (0.2,), 1.5, parameter="rotor0_x_m"),
        Fault(Kind.PARAMETER, (0.6,), 2.0, parameter="landing_m_s"),
    )
    result = body.fly(Scenario(orders=(*TAKE_OFF, land(5.0)), faults=changes))
    assert result.fault_reasons == (Reason.OK, Reason.ONLY_WHEN_DISARMED, Reason.OK)
    assert violations(result) == []


def test_kill_in_flight_stops_at_once_and_stays_off(body):
    orders = (*TAKE_OFF, Order(Command.KILL, after_s=1.0), Order(Command.ARM, 0, 6.5, FROM_START))
    result = body.fly(Scenario(orders=orders))
    assert violations(result, may_stop_in_air=True) == []
    assert result.order_reasons[-1] == Reason.WRONG_STATE
