"""What is flown: by which vehicle, along what, past what."""

from dataclasses import dataclass

from flight import Trajectory
from preflight.clearance import DistanceField
from vehicle import Vehicle


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """All that a preflight is about, besides what is not known of it (`Uncertainty`)."""

    vehicle: Vehicle
    """As it is believed to be."""
    trajectory: Trajectory
    field: DistanceField | None
    """Of distances; None asks no map: risk is then that of falling alone."""
    radius_m: float | None = None
    """Of the sphere that holds the vehicle; None: to the farthest propeller tip."""
    clearance_m: float = 0.0
    """Room for the tracking error, as the plan states it to the vehicle; 0: not stated."""

    @property
    def size_m(self) -> float:
        """The radius."""
        return self.vehicle.reach_m if self.radius_m is None else self.radius_m
