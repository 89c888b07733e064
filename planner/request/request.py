"""One request to the planner: what is asked for, of which vehicle, in which space."""

from dataclasses import dataclass

from flight import Waypoints
from planner._planner import StopFlag
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.options import PlanOptions
from vehicle import Limits, Vehicle


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
