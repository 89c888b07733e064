"""What the result of a preflight asks of the next plan: how much room, and how slow on which legs."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import vehicle
from flight import FormatError, InputError, file_format
from flight.mission import LegSpeed, Mission
from planner import LocalMargin
from preflight.result import SCHEMA, SCHEMA_VERSION

PLAN_AGAIN = "plan_again"
"""In a result: null, or the `margin_m` that a plan is to keep, the margins `near` parts of it, and speeds of `legs`."""


@dataclass(frozen=True, slots=True)
class Again:
    """What is to be kept."""

    margin_m: float
    """Everywhere."""
    near: tuple[LocalMargin, ...] = ()
    legs: tuple[LegSpeed, ...] = ()
    waypoints: int = 0
    """Of the plan that was flown, of which the legs are."""

    def of(self, mission: Mission) -> Mission:
        """The mission with these legs; all at the slowest's speed where its waypoints are not those of the plan, which
        has take-off, landing and laps in it too."""
        if not self.legs:
            return mission
        count = len(mission.waypoints.positions_world_m)
        same = self.waypoints == count and mission.laps is None
        slowest = LegSpeed(0, count - 1, min(leg.speed_m_s for leg in self.legs))
        return replace(mission, leg_speeds=(*mission.leg_speeds, *(self.legs if same else (slowest,))))

    def __str__(self) -> str:
        """What it asks for, in words."""
        most_m = max((each.margin_m for each in self.near), default=0.0)
        more = f", up to {most_m:.3f} m near {len(self.near)} parts of the plan" if most_m > self.margin_m else ""
        least = min((leg.speed_m_s for leg in self.legs), default=0.0)
        slower = f", at most {least:.2f} m/s on {len(self.legs)} legs" if self.legs else ""
        return f"{self.margin_m:.3f} m{more}{slower}"


def read(path: Path, map_hash: str, drone: vehicle.Vehicle) -> Again:
    """What the result of a preflight asks for in this map for this vehicle.

    Raises:
        InputError: no such file, it is of another map or vehicle, or it asks for none.
        FormatError: it is not the result of a preflight.
    """
    document = file_format.read_json(path, format=SCHEMA, version=SCHEMA_VERSION)
    wanted = (PLAN_AGAIN, "map_hash", "vehicle", "vehicle_hash", "reason")
    if missing := [name for name in wanted if name not in document]:
        raise FormatError(f"{path} is a damaged result: it has no {missing[0]}; preflight again")
    told: Any = document
    here = vehicle.vehicle_hash(drone)
    if told["map_hash"] != map_hash:
        raise InputError(
            f"{path} is of map {str(told['map_hash'])[:12]}, not {map_hash[:12]}; preflight the plan in this map, or "
            "say --margin"
        )
    if told["vehicle_hash"] != here:
        raise InputError(
            f"{path} is of {told['vehicle']} {str(told['vehicle_hash'])[:12]}, not of {drone.name} {here[:12]}; "
            "preflight the plan for it, or say --margin"
        )
    if told[PLAN_AGAIN] is None:
        raise InputError(
            f"{path} asks for no more room: {told['reason']}; plan without --preflown, or slower (--speed, "
            "--acceleration)"
        )
    return _again(told[PLAN_AGAIN], path)


def _again(asked: Any, path: Path) -> Again:
    margin_m = asked.get("margin_m") if isinstance(asked, dict) else None  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]
    if isinstance(margin_m, bool) or not isinstance(margin_m, int | float) or not 0.0 <= margin_m < 100.0:
        raise FormatError(f"{path} is a damaged result: the margin to plan with is {margin_m!r}")
    try:
        near = tuple(LocalMargin.from_dict(each) for each in asked.get("near", ()))
        legs = tuple(LegSpeed(int(e["first"]), int(e["last"]), float(e["speed_m_s"])) for e in asked.get("legs", ()))
        return Again(float(margin_m), near, legs, int(asked.get("waypoints", 0)))
    except (FormatError, KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{path} is a damaged result: {error}") from error
