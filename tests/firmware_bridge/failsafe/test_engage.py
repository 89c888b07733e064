"""Another controller flies the body; this one watches, takes over, and gives back."""

import numpy as np
import pytest
from judge import violations
from scenario import FROM_START, Command, Fault, Kind, Order, Reason, Scenario, State, land

SHADOW = Order(Command.SHADOW, after_s=0.5, since=FROM_START)
ENGAGE = Order(Command.ENGAGE, after_s=2.0, since=FROM_START)


def piloted(*orders: Order, speed_m_s: float = 0.0, climb_m_s: float = 0.0, **options) -> Scenario:
    moving = (speed_m_s, 0.0, climb_m_s)
    return Scenario(orders=orders, start_m=(0.0, 0.0, 8.0), start_m_s=moving, pilot_m_s=moving, **options)


@pytest.mark.parametrize("first", [(), (SHADOW,)])
@pytest.mark.parametrize(("speed_m_s", "climb_m_s"), [(0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (0.0, -1.5), (2.0, 1.0)])
def test_engaging_in_the_air_is_bumpless_brakes_and_holds(body, first, speed_m_s, climb_m_s):
    scenario = piloted(*first, ENGAGE, land(4.0), speed_m_s=speed_m_s, climb_m_s=climb_m_s)
    result = body.fly(scenario, trace_every=1)
    assert result.order_reasons == (Reason.OK,) * (len(first) + 2)
    trace = result.trace
    held = trace["state"] == State.HOLD
    assert np.hypot(trace["vx"], trace["vy"])[held][-1] < 0.1
    start = np.argmax(held)
    command = np.stack([trace[f"command{i}"] for i in range(4)])
    step = abs(command[:, start] - command[:, start - 1]).max()
    assert step < 150.0, f"the rotors' first command jumps by {step:.0f} rad/s"
    assert trace["tilt_rad"][start : start + 500].max() < 0.7
    assert violations(result) == []


def test_the_shadow_commands_nothing(body):
    result = body.fly(piloted(SHADOW, limit_s=4.0), trace_every=5)
    watching = result.trace["state"] == State.SHADOW
    assert watching.sum() > 100
    assert (result.trace["in_command"][watching] == 0).all()
    assert abs(result.trace["z"] - 8.0).max() < 0.1


def test_a_release_gives_the_vehicle_back_and_it_can_be_taken_again(body):
    release = Order(Command.RELEASE, after_s=2.0)
    again = Order(Command.ENGAGE, after_s=6.0, since=FROM_START)
    last = land(9.0, FROM_START)
    result = body.fly(piloted(SHADOW, ENGAGE, release, again, last, speed_m_s=1.0))
    assert result.order_reasons == (Reason.OK,) * 5
    assert [c.after for c in result.changes[:4]] == [State.SHADOW, State.HOLD, State.SHADOW, State.HOLD]
    assert violations(result) == []


@pytest.mark.parametrize("problem", ["fast", "early", "tumbling", "blind"])
def test_engaging_outside_the_stated_limits_is_refused(body, problem):
    faults, engage, speed_m_s = (), ENGAGE, 0.0
    if problem == "fast":
        speed_m_s = 8.0
    elif problem == "early":
        engage = Order(Command.ENGAGE, after_s=0.3, since=FROM_START)
    elif problem == "tumbling":
        faults = (Fault(Kind.KICK, (0.0, 0.0, 0.0, 8.0), after_s=1.99, since=FROM_START),)
    else:
        faults = (Fault(Kind.POSITION_LOST, (1.0,), 1.2, since=FROM_START),)
    result = body.fly(piloted(SHADOW, engage, speed_m_s=speed_m_s, faults=faults, limit_s=3.0))
    assert result.order_reasons[1] in (Reason.NOT_ENGAGEABLE, Reason.ESTIMATE_STALE, Reason.WRONG_STATE)
    assert State.HOLD not in result.states
