"""The controller's clock steps, sticks and jitters; KILL and DISARM act at the next tick all the same."""

import pytest
from judge import violations
from scenario import FROM_START, START, TAKE_OFF, Command, Fault, Kind, Order, Reason, Scenario, State, circle, land

TICK_S = 0.002
STEPS_S = [-5.0, -1.0, -0.05, -0.001, 0.015, 0.03, 0.5, 5.0, 60.0, 3600.0]


def fast(*faults: Fault, **options) -> Scenario:
    path = circle(8.0, radius_m=8.0)
    orders = (*TAKE_OFF, START, land(path.duration_s + 1.0, State.TRAJECTORY))
    return Scenario(orders=orders, path=path, faults=faults, **options)


@pytest.mark.parametrize("step_s", [-5.0, -0.5, 3.0])
@pytest.mark.parametrize("later_s", [0.002, 0.2, 1.0])
def test_kill_stops_the_rotors_at_the_next_tick_after_a_clock_step(body, step_s, later_s):
    step = Fault(Kind.CLOCK_STEP, (step_s,), after_s=1.0)
    kill = Order(Command.KILL, after_s=1.0 + later_s)
    result = body.fly(Scenario(orders=(*TAKE_OFF, kill), faults=(step,), limit_s=12.0))
    assert result.order_reasons[-1] == Reason.OK
    assert result.stop_s - result.order_times_s[-1] < 1.5 * TICK_S
    assert result.at_rest


def test_kill_stops_the_rotors_while_the_clock_is_stuck(body):
    stuck = Fault(Kind.CLOCK_STUCK, after_s=1.0)
    result = body.fly(Scenario(orders=(*TAKE_OFF, Order(Command.KILL, after_s=1.1)), faults=(stuck,), limit_s=12.0))
    assert 0 < result.stop_s < result.order_times_s[-1] + 1.5 * TICK_S


@pytest.mark.parametrize("fault", [Fault(Kind.CLOCK_STEP, (-5.0,), 0.5, since=FROM_START),
                                   Fault(Kind.CLOCK_STUCK, (), 0.5, since=FROM_START)])  # fmt: skip
def test_a_disarmed_vehicle_stands_still_whatever_the_clock_says(body, fault):
    orders = (Order(Command.ARM, 0, 0.3, FROM_START), Order(Command.DISARM, 0, 0.55, FROM_START))
    trace = body.fly(Scenario(orders=orders, faults=(fault,), limit_s=2.0), trace_every=1).trace
    after = trace["time_s"] > 0.56
    assert (trace["command0"][after] == 0).all()


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_clock_step_in_fast_flight_does_not_crash(body, step_s):
    for after_s in (2.0, 5.0):
        result = body.fly(fast(Fault(Kind.CLOCK_STEP, (step_s,), after_s, since=State.TRAJECTORY)))
        assert violations(result) == []
        assert State.FAULT not in result.states
        assert not result.had(Reason.LINK_LOST)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_clock_step_while_hovering_moves_the_vehicle_by_centimetres(body, step_s):
    step = Fault(Kind.CLOCK_STEP, (step_s,), after_s=1.0)
    result = body.fly(Scenario(orders=(*TAKE_OFF, land(4.0)), faults=(step,), limit_s=25.0), trace_every=5)
    trace = result.trace
    hover = (trace["state"] == State.HOLD) & (trace["time_s"] > result.entered_s(State.HOLD) + 0.5)
    assert abs(trace["z"][hover] - 1.5).max() < 0.1
    assert violations(result) == []


def test_a_clock_step_ends_neither_a_hold_nor_a_landing_early(body):
    """Timers run on the time that has really passed, so an hour is not a lost link nor the end of a timeout."""
    for step_s in (-5.0, 30.0, 3600.0):
        step = Fault(Kind.CLOCK_STEP, (step_s,), after_s=1.0)
        result = body.fly(Scenario(orders=(*TAKE_OFF, land(5.0)), faults=(step,), limit_s=30.0))
        assert result.reason_of(State.LANDING) == Reason.COMMANDED
        assert not result.had(Reason.LINK_LOST)
        assert violations(result) == []


@pytest.mark.parametrize("jitter_s", [0.0005, 0.0015, 0.004])
def test_clock_jitter_is_flown_through(body, jitter_s):
    result = body.fly(fast(Fault(Kind.CLOCK_JITTER, (jitter_s,), 1.0, since=State.TRAJECTORY)))
    assert violations(result) == []
    assert result.largest_error_m < 0.5


@pytest.mark.parametrize("stuck_s", [0.01, 0.1, 1.0])
def test_a_stuck_clock_is_flown_through(body, stuck_s):
    """The stamps stick with it: after a tenth of a second nothing tells that the estimate is still alive."""
    result = body.fly(fast(Fault(Kind.CLOCK_STUCK, (), 3.0, stuck_s, since=State.TRAJECTORY)))
    assert violations(result, may_stop_in_air=stuck_s > 0.1) == []
    assert not result.had(Reason.LINK_LOST)


@pytest.mark.parametrize("hang_s", [0.03, 0.06])
def test_a_short_hang_of_the_module_is_flown_through(body, hang_s):
    result = body.fly(fast(Fault(Kind.HANG, (), 3.0, hang_s, since=State.TRAJECTORY)))
    assert violations(result) == []
    assert result.had(Reason.FINISHED)
    assert not result.had(Reason.LINK_LOST)


@pytest.mark.parametrize("tick_s", [0.001, 0.004])
def test_other_control_rates_with_uneven_steps_fly(body, tick_s):
    result = body.fly(fast(tick_s=tick_s, tick_jitter=0.3))
    assert violations(result) == []
    assert result.largest_error_m < 0.3
