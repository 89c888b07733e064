"""From waypoints to a checked trajectory: the fastest smooth path the vehicle can fly, clear of everything mapped."""

from planner import mission
from planner._planner import StopFlag
from planner.conditions import Conditions
from planner.gate import GateReport
from planner.limits import Check
from planner.options import PlanCancelledError, PlanInfeasibleError, PlanOptions
from planner.planning import Plan, plan, save_plan, trajectory_file

__all__ = [
    "Check",
    "Conditions",
    "GateReport",
    "Plan",
    "PlanCancelledError",
    "PlanInfeasibleError",
    "PlanOptions",
    "StopFlag",
    "mission",
    "plan",
    "save_plan",
    "trajectory_file",
]
