"""One request to the planner: what is asked for, of which vehicle, in which space; and the gate that judges answers."""

from collections.abc import Callable
from dataclasses import dataclass

from flight import Trajectory, Waypoints
from planner import gate, space
from planner._planner import StopFlag
from planner.conditions import Conditions
from planner.gate import GateReport
from planner.limits import Known
from planner.options import PlanOptions
from vehicle import Limits, Vehicle

AskGate = Callable[[Trajectory, Known | None], GateReport]
"""From a trajectory, and what is known of another one, to the gate's report."""


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What a trajectory is planned for."""

    waypoints: Waypoints
    field: space.DistanceField
    vehicle: Vehicle
    options: PlanOptions
    conditions: Conditions
    stop: StopFlag | None = None
    """Set from another thread, ends the work."""

    @property
    def limits(self) -> Limits:
        """Limits to plan within."""
        return self.options.limits_for(self.vehicle)

    def gate(self, trajectory: Trajectory, known: Known | None = None) -> GateReport:
        """What the gate says of an answer. Raises as `gate.check`."""
        return gate.check(
            trajectory,
            self.field,
            self.vehicle,
            self.options,
            waypoints_world_m=self.waypoints.positions_world_m,
            yaw_rad=self.waypoints.yaw_rad,
            conditions=self.conditions,
            known=known,
            stop=self.stop,
        )
