"""From waypoints to a checked trajectory: the fastest smooth path the vehicle can fly, clear of everything mapped."""

from planner import mission
from planner._planner import StopFlag
from planner.drafting import Draft
from planner.gate.gate import GateReport
from planner.gate.limits import Check
from planner.planning import Plan, checked_file, plan, save_plan, trajectory_file
from planner.request.conditions import Conditions
from planner.request.local_margins import LocalMargin
from planner.request.options import Gap, PlanCancelledError, PlanInfeasibleError, PlanOptions
from planner.session import Planner

__all__ = [
    "Check",
    "Conditions",
    "Draft",
    "Gap",
    "GateReport",
    "LocalMargin",
    "Plan",
    "PlanCancelledError",
    "PlanInfeasibleError",
    "PlanOptions",
    "Planner",
    "StopFlag",
    "checked_file",
    "mission",
    "plan",
    "save_plan",
    "trajectory_file",
]
