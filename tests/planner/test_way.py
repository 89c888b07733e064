"""How straight a request's way through the planner's modules is."""

import sys
from pathlib import Path
from types import CodeType, FrameType

import numpy as np
import pytest

import planner
from flight import Waypoints

PLACE = Path(planner.__file__).parent
INSIDE = {"<lambda>", "<listcomp>", "<setcomp>", "<dictcomp>", "<genexpr>", "<module>"}
"""Code within a function is read with it."""
MOST_STOPS, MOST_RETURNS = 40, 20


def way(work) -> list[str]:
    """The modules in which functions of the planner, properties among them, are called for the first time, in order.

    This is how one reads what happens: from call to call, each function once, whoever calls it again. Runs of one
    module are one stop; what generated code, NumPy or the compiled parts do is none.
    """
    seen: set[CodeType] = set()
    stops: list[str] = []

    def called(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event != "call" or code in seen or code.co_name in INSIDE or PLACE not in Path(code.co_filename).parents:
            return
        seen.add(code)
        module = Path(code.co_filename).relative_to(PLACE).with_suffix("").as_posix().replace("/", ".")
        if not stops or stops[-1] != module:
            stops.append(module)

    before = sys.getprofile()
    sys.setprofile(called)
    try:
        work()
    finally:
        sys.setprofile(before)
    return stops


def returns(stops: list[str]) -> int:
    """How many of the stops are at modules that the way has left before."""
    return len(stops) - len(set(stops))


@pytest.fixture(scope="module")
def stops(drone, pillar) -> list[str]:
    """Of two legs, the first of which has the pillar in its way, from waypoints to a plan that has passed the gate."""
    waypoints = Waypoints(np.array([[-2.0, 0.0, 1.5], [2.0, 0.3, 1.5], [4.0, -1.0, 1.2]]), np.full(3, np.nan))
    plans: list[planner.Plan] = []
    found = way(lambda: plans.append(planner.plan(waypoints, pillar, drone)))
    assert len(plans[0].route_world_m) > 3, "nothing was in the way"
    return found


def test_a_waypoint_makes_few_stops_on_its_way_through_the_planner_and_comes_back_to_few(stops):
    text = " > ".join(stops)
    assert len(stops) <= MOST_STOPS, text
    assert returns(stops) <= MOST_RETURNS, text


def test_the_way_leads_from_the_request_by_the_route_and_the_optimiser_to_the_gate(stops):
    rooms = ("planning", "request.inputs", "route.routes", "optimise.methods", "gate.gate")
    first = [stops.index(name) for name in rooms]
    assert first == sorted(first)


def test_a_stop_is_counted_when_a_function_is_entered_for_the_first_time(drone):
    """By hand: of two calls of a property and one of a method, in one module, and none of what is defined elsewhere."""
    options = planner.PlanOptions(radius_m=0.2)
    assert way(lambda: (options.clearance_m, options.clearance_m, len("elsewhere"))) == ["request.options"]
    there = way(
        lambda: (options.clearance_m, planner.Conditions().tube, options.limits_for(drone), options.clearance_m)
    )
    assert there == ["request.options", "request.conditions", "request.options"]
    assert returns(there) == 1
