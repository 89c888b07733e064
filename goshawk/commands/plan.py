"""`goshawk plan`: waypoints or a recorded path to a checked trajectory."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import click
import numpy as np

import mapping
import planner
import vehicle
from flight import FloatArray, InputError, Trajectory, cells, project
from goshawk import console, outputs, waypoints_file
from planner import simplify


@click.command()
@click.argument("waypoints", type=click.Path(path_type=Path), required=False)
@console.path_option(
    "--path", "path", "Recorded path instead of waypoints: CSV with x_m, y_m, z_m (a map's poses.csv)."
)
@click.option(
    "--simplify",
    "tolerance_m",
    default=0.10,
    show_default=True,
    help="Largest deviation from --path when it is simplified, metres.",
)
@console.map_option
@console.vehicle_option
@console.path_option("--out", "out", "Trajectory file to write.", required=True)
@console.margin_option
@click.option("--speed", "speed_m_s", type=float, help="Fly no faster than this, m/s.")
@click.option("--acceleration", "acceleration_m_s2", type=float, help="Accelerate no harder than this, m/s2.")
@click.option(
    "--method",
    type=click.Choice(["fastest", "corridor"]),
    default="fastest",
    show_default=True,
    help="Least time, or least snap within a corridor of proven boxes (by OSQP; slower to fly).",
)
@outputs.overwrite_option
@console.json_option
def command(
    waypoints: Path | None,
    path: Path | None,
    tolerance_m: float,
    map_folder: Path,
    vehicle_file: Path,
    out: Path,
    margin_m: float | None,
    speed_m_s: float | None,
    acceleration_m_s2: float | None,
    method: Literal["fastest", "corridor"],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Plan a trajectory through WAYPOINTS and check it over its whole length.

    \b
    goshawk plan waypoints.csv --map map --vehicle vehicle.toml --out lap.json
    goshawk plan waypoints.json --map map --vehicle vehicle.toml --out lap.json
    goshawk plan --path map/poses.csv --map map --vehicle vehicle.toml --out walk.json

    WAYPOINTS is a project's waypoints.json, or CSV with columns x_m, y_m, z_m and, optionally, yaw_deg (empty: free).
    The file is written only if the final gate passes. Exit code 1: there is no such trajectory; the message names
    where, why, and what to change.
    """
    if (waypoints is None) == (path is None):
        raise click.UsageError("give either WAYPOINTS or --path")
    outputs.check(out, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    options = replace(options_from(vehicle_file, margin_m, speed_m_s, acceleration_m_s2), method=method)
    left_out = 0
    if path is not None:
        asked, left_out = waypoints_along(read_path(path), tolerance_m, area, options)
    else:
        assert waypoints is not None
        asked = waypoints_file.load(waypoints)
    with console.progress() as report:
        plan = planner.plan(asked, area.field, vehicle.load(vehicle_file), options, progress=report)
    with outputs.file(out, overwrite=overwrite) as temporary:
        planner.save_plan(temporary, plan, name=out.stem)
    facts = {
        "written": str(out),
        "waypoints": len(asked.positions_world_m),
        "recorded_positions_left_out": left_out,
        "segments": len(plan.trajectory.durations_s),
        "duration_s": plan.trajectory.duration_s,
        "clearance_m": plan.gate.clearance_m,
        "top_speed_m_s": top_speed_m_s(plan.trajectory),
    }
    console.show(f"trajectory {out.stem}", facts, as_json=as_json, document=facts | {"check": plan.gate.as_dict()})


def options_from(
    vehicle_file: Path,
    margin_m: float | None = None,
    speed_m_s: float | None = None,
    acceleration_m_s2: float | None = None,
) -> planner.PlanOptions:
    """The planner's options: the defaults, overridden by the command line."""
    options = planner.PlanOptions() if margin_m is None else planner.PlanOptions(margin_m=margin_m)
    asked = {"speed_m_s": speed_m_s, "acceleration_m_s2": acceleration_m_s2}
    slower = {name: value for name, value in asked.items() if value is not None}
    if not slower:
        return options
    own = vehicle.load(vehicle_file).limits
    for name, value in slower.items():
        if not 0.0 < value <= getattr(own, name):
            option, unit = {"speed_m_s": ("--speed", "m/s"), "acceleration_m_s2": ("--acceleration", "m/s2")}[name]
            limit = f"{getattr(own, name):g} {unit}, the vehicle's limit"
            raise InputError(f"{option} {value:g} must be above 0 and at most {limit}")
    return replace(options, limits=replace(own, **slower))


def waypoints_along(
    walked_world_m: FloatArray, tolerance_m: float, area: mapping.Map, options: planner.PlanOptions
) -> tuple[project.Waypoints, int]:
    """Waypoints along recorded positions (n, 3), headings free, and how many positions had to be left out.

    Whoever walked may have started with a wall, or with space that no camera saw, closer than the vehicle may come.
    Such positions are left out; between the others the planner finds its own way.

    Raises:
        InputError: fewer than two positions have room.
    """
    near_m = np.nan_to_num(area.field.distance(walked_world_m), nan=-np.inf)
    roomy = walked_world_m[near_m >= options.waypoint_clearance_m]
    if len(roomy) < 2:
        raise InputError(
            f"{len(roomy)} of {len(walked_world_m)} recorded positions keep {options.waypoint_clearance_m:.3f} m from "
            "obstacles and unknown space; lower --margin, or map with a wider view"
        )
    kept = simplify.rdp(roomy, tolerance_m, field=area.field, clearance_m=options.clearance_m)
    return project.Waypoints(roomy[kept], np.full(len(kept), np.nan)), len(walked_world_m) - len(roomy)


def read_path(path: Path) -> FloatArray:
    """Positions (n, 3) from a CSV file with columns x_m, y_m, z_m; other columns are ignored.

    Raises:
        InputError: no such file, a column is missing, a position is not finite, or fewer than two rows.
        FormatError: a cell does not hold a number.
    """
    import csv

    try:
        with open(path, newline="") as file:
            rows = list(enumerate(csv.DictReader(file), start=2))
        positions = np.array(
            [[cells.number(row[name], path, line, name) for name in ("x_m", "y_m", "z_m")] for line, row in rows]
        )
    except FileNotFoundError:
        raise InputError(f"{path} does not exist") from None
    except KeyError as error:
        raise InputError(f"{path} has no column {error}; expected columns x_m, y_m and z_m") from None
    except (UnicodeDecodeError, OSError, csv.Error) as error:
        raise InputError(f"{path} is not a CSV file of positions: {error}") from error
    if len(positions) < 2:
        raise InputError(f"{path} holds {len(positions)} positions; a path has at least two")
    if not np.isfinite(positions).all():
        row = int(np.flatnonzero(~np.isfinite(positions).all(axis=1))[0])
        raise InputError(f"{path}: position {row} is not finite")
    return positions


def top_speed_m_s(flown: Trajectory) -> float:
    return float(np.linalg.norm(flown.position(flown.sample(0.01), 1), axis=1).max())
