"""What a preflight rests on: the weather that was asked for, and what plan and map say of themselves."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

import mapping
import preflight
import vehicle
from firmware_bridge import wire
from firmware_bridge.link import refuse_unfit
from flight import FormatError, InputError, TrajectoryFile, file_format
from goshawk.terminal import console
from mapping.map_folder import read_report
from preflight import margins
from preflight.result import SCHEMA, SCHEMA_VERSION

DEFAULT = preflight.Uncertainty()
risk_option = click.option(
    "--risk", type=float, default=1e-3, show_default=True, help="Probability of a loss that is accepted."
)
localization_option = click.option(
    "--localization",
    "localization_std_m",
    type=click.FloatRange(0.0, 1.0),
    default=DEFAULT.localization_std_m,
    show_default=True,
    help="Standard deviation of the pose in the map, metres.",
)
seed_option = click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True, help="Seed: of all noise."
)
_SAMPLES = 50
"""Of a segment, for the room that the plan has in it."""
PLAN_AGAIN = "plan_again"
"""In a result: null, or the `margin_m` that a plan is to keep, and by which `segments` that is asked."""


def blowing(wind: str) -> preflight.Uncertainty:
    """The wind of `--wind`: a speed from anywhere, or x,y,z.

    Raises:
        InputError: it is neither.
    """
    if "," not in wind:
        return replace(DEFAULT, wind_m_s=console.numbers("--wind", wind, 1)[0])
    x, y, z = console.numbers("--wind", wind, 3)
    size = math.sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        return DEFAULT
    return replace(DEFAULT, wind_m_s=size, wind_direction=(x / size, y / size, z / size))


def radius_m(item: TrajectoryFile, believed: vehicle.Vehicle) -> float:
    """Of the sphere that the plan was checked for; to the farthest propeller tip where the file does not tell."""
    told = item.check.get("body_radius_m")
    if isinstance(told, int | float) and math.isfinite(told) and told > 0.0:
        return float(told)
    return believed.reach_m


def of_map(area: mapping.Map, uncertainty: preflight.Uncertainty) -> preflight.Uncertainty:
    """With what the map says of itself: its scale's standard deviation, and its voxels' on top of the surfaces'.

    Raises:
        FormatError: its report does not hold sources of scale as `goshawk map build` writes them.
    """
    voxel = max(area.field.grid.voxel_m) / math.sqrt(12.0)  # of a surface anywhere in its voxel
    surface = math.hypot(uncertainty.map_error_std_m, voxel)
    scale = scale_std(read_report(area.folder).get("scale_witnesses")) or uncertainty.map_scale_std_ratio
    return replace(uncertainty, map_scale_std_ratio=scale, map_error_std_m=surface)


def scale_std(witnesses: Any) -> float:
    """Of a map's scale by its sources: the first's, and how far beyond their own the others are off it.

    0 if there are none, or the first tells none.
    """
    try:
        stds = [float(witness.get("std") or 0.0) for witness in witnesses or ()]
        ratios = [float(witness.get("ratio") or 1.0) for witness in witnesses or ()]
    except (TypeError, ValueError, AttributeError) as error:
        raise FormatError("the map's report.json holds no list of scale_witnesses; build the map again") from error
    if not stds or not stds[0] > 0.0:
        return 0.0
    beyond = [max((ratio - 1.0) ** 2 - std**2, 0.0) for ratio, std in zip(ratios, stds, strict=True)]
    return math.sqrt(stds[0] ** 2 + max(beyond))


def body_of(item: TrajectoryFile, believed: vehicle.Vehicle) -> tuple[float, float]:
    """`radius_m` and `clearance_m` of `preflight.fly`, as the plan was checked."""
    return radius_m(item, believed), wire.proved_clearance_m(item)


def require_fit(item: TrajectoryFile, area: mapping.Map, believed: vehicle.Vehicle) -> None:
    """Check that a trajectory was checked in this map for this vehicle, and that the map was not refused.

    Raises:
        InputError: it was not.
        MapError: the map was refused.
    """
    area.require_not_refused()
    refuse_unfit(item, area.hash, vehicle.vehicle_hash(believed), False)


def document(
    item: TrajectoryFile,
    area: mapping.Map,
    believed: vehicle.Vehicle,
    seed: int,
    result: preflight.Result,
    replay: preflight.Replay | None,
) -> dict[str, Any]:
    """The whole result, as plain JSON values."""
    return result.as_dict() | {
        "trajectory": item.name,
        "map_hash": area.hash,
        "vehicle": believed.name,
        "seed": seed,
        PLAN_AGAIN: plan_again(item, area, believed, result),
        "worst": [] if replay is None else [track.as_dict(item.trajectory) for track in replay.worst],
    }


def plan_again(
    item: TrajectoryFile, area: mapping.Map, believed: vehicle.Vehicle, result: preflight.Result
) -> dict[str, Any] | None:
    """The margin to plan with so that fewer flights are lost; None if more room is not what is missing.

    Where flights touch it is the room that the plan has in that segment, and what they are short of; where they are
    given up the plan's margin, which the controller allows them, and more.
    """
    segments = margins.needed(result)
    if not segments:
        return None
    proved_m, size_m = wire.proved_clearance_m(item), radius_m(item, believed)
    asked: list[dict[str, Any]] = []
    for each in segments:
        positions = item.trajectory.position(np.linspace(each.from_s, each.to_s, _SAMPLES))
        room_m = float(np.min(area.field.distance(positions))) - size_m if each.touching else proved_m
        asked.append(each.as_dict() | {"margin_m": math.ceil(1e3 * (room_m + each.extra_m)) / 1e3})
    return {"margin_m": max(each["margin_m"] for each in asked), "segments": asked}


def margin_of(path: Path, map_hash: str, vehicle_name: str) -> float:
    """The margin that the result of a preflight asks for, in this map and for this vehicle.

    Raises:
        InputError: no such file, it is of another map or vehicle, or it asks for none.
        FormatError: it is not the result of a preflight.
    """
    document = file_format.read_json(path, format=SCHEMA, version=SCHEMA_VERSION)
    if missing := [name for name in (PLAN_AGAIN, "map_hash", "vehicle", "reason") if name not in document]:
        raise FormatError(f"{path} is a damaged result: it has no {missing[0]}; preflight again")
    told: Any = document
    if told["map_hash"] != map_hash:
        raise InputError(
            f"{path} is of map {str(told['map_hash'])[:12]}, not {map_hash[:12]}; preflight the plan in this map, or "
            "say --margin"
        )
    if told["vehicle"] != vehicle_name:
        raise InputError(
            f"{path} is of {told['vehicle']}, not {vehicle_name}; preflight the plan for it, or say --margin"
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
