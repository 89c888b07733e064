"""What the result of a preflight asks of the next plan: how much room, and how slow on which legs."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import vehicle
from flight import FloatArray, FormatError, InputError, file_format
from flight.mission import LegSpeed, Mission
from planner import LocalMargin
from preflight.result import SCHEMA, SCHEMA_VERSION

PLAN_AGAIN = "plan_again"
"""In a result: null, or the `margin_m` that a plan is to keep, the margins `near` parts of it, and speeds of `legs`."""


_SAME_M = 1e-3
"""Waypoints so near to each other are the same."""


@dataclass(frozen=True, slots=True)
class Leg:
    """The largest speed from one waypoint of the plan that was flown to the next."""

    from_world_m: tuple[float, float, float]
    to_world_m: tuple[float, float, float]
    speed_m_s: float
    slowed: bool
    """Whether it is to be slower than it was flown; else it was asked of that plan too."""

    def within(self, points_world_m: FloatArray) -> list[LegSpeed]:
        """For each leg between these waypoints (n, 3) that is this one."""
        begins, ends = (
            np.linalg.norm(points_world_m - end, axis=1) < _SAME_M for end in (self.from_world_m, self.to_world_m)
        )
        return [LegSpeed(i, i + 1, self.speed_m_s) for i in np.flatnonzero(begins[:-1] & ends[1:]).tolist()]


@dataclass(frozen=True, slots=True)
class Again:
    """What is to be kept."""

    margin_m: float
    """Everywhere."""
    near: tuple[LocalMargin, ...] = ()
    legs: tuple[Leg, ...] = ()

    def of(self, mission: Mission) -> Mission:
        """The mission with these legs, where it has them; all at the slowest's speed where it lacks one to be slowed,
        as one from the last waypoint of a lap to the first."""
        points = mission.waypoints.positions_world_m
        speeds = [leg.within(points) for leg in self.legs]
        lacking = [leg.speed_m_s for leg, found in zip(self.legs, speeds, strict=True) if leg.slowed and not found]
        everywhere = [LegSpeed(0, len(points) - 1, min(lacking))] if lacking else []
        more = (*(speed for found in speeds for speed in found), *everywhere)
        return replace(mission, leg_speeds=(*mission.leg_speeds, *more)) if more else mission

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
        return Again(float(margin_m), near, tuple(_leg(each) for each in asked.get("legs", ())))
    except (FormatError, KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{path} is a damaged result: {error}") from error


def _leg(told: Any) -> Leg:
    begin, end = (tuple(float(x) for x in told[name]) for name in ("from_world_m", "to_world_m"))
    (a, b, c), (x, y, z), speed_m_s = begin, end, float(told["speed_m_s"])
    if not np.isfinite((a, b, c, x, y, z)).all() or not 0.0 < speed_m_s < np.inf:
        raise ValueError(f"a leg is {told}")
    return Leg((a, b, c), (x, y, z), speed_m_s, bool(told["slowed"]))
