"""What the result of a preflight asks of the next plan: how much room."""

from pathlib import Path
from typing import Any

import vehicle
from flight import FormatError, InputError, file_format
from preflight.result import SCHEMA, SCHEMA_VERSION

PLAN_AGAIN = "plan_again"
"""In a result: null, or the `margin_m` that a plan is to keep, and by which `segments` that is asked."""


def margin_of(path: Path, map_hash: str, drone: vehicle.Vehicle) -> float:
    """The margin that the result of a preflight asks for, in this map and for this vehicle.

    Raises:
        InputError: no such file, it is of another map or vehicle, or it asks for none.
        FormatError: it is not the result of a preflight.
    """
    document = file_format.read_json(path, format=SCHEMA, version=SCHEMA_VERSION)
    wanted = (PLAN_AGAIN, "map_hash", "vehicle", "vehicle_hash", "reason")
    if missing := [name for name in wanted if name not in document]:
        raise FormatError(f"{path} is a damaged result: it has no {missing[0]}; preflight again")
    told: Any = document
    if told["map_hash"] != map_hash:
        raise InputError(
            f"{path} is of map {str(told['map_hash'])[:12]}, not {map_hash[:12]}; preflight the plan in this map, or "
            "say --margin"
        )
    here = vehicle.vehicle_hash(drone)
    if told["vehicle_hash"] != here:
        raise InputError(
            f"{path} is of {told['vehicle']} {str(told['vehicle_hash'])[:12]}, not of {drone.name} {here[:12]}; "
            "preflight the plan for it, or say --margin"
        )
    asked = told[PLAN_AGAIN]
    if asked is None:
        raise InputError(
            f"{path} asks for no more room: {told['reason']}; plan without --preflown, or slower (--speed, "
            "--acceleration)"
        )
    margin_m = asked.get("margin_m") if isinstance(asked, dict) else None  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]
    if isinstance(margin_m, bool) or not isinstance(margin_m, int | float) or not 0.0 < margin_m < 100.0:
        raise FormatError(f"{path} is a damaged result: the margin to plan with is {margin_m!r}")
    return float(margin_m)
