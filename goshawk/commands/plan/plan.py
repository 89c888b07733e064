"""`goshawk plan`: waypoints or a recorded path to a checked trajectory."""

from collections import Counter
from dataclasses import asdict, replace
from math import isfinite
from pathlib import Path

import click
import numpy as np

import esdf
import mapping
import planner
import vehicle
from flight import FloatArray, InputError, cells, errors
from flight.mission import KeepIn, Mission
from goshawk.commands.plan import batch_mission, plan_batch, thin_obstacles, waypoints_file
from goshawk.commands.plan.batch_mission import Job
from goshawk.commands.plan.plan_options import Asked, plan_options
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import DefaultVerbGroup
from mapping.dense.confidence import NearestSurface
from planner.gate import could_hide
from planner.route import simplify

SUMMARY = "Plan a checked trajectory through waypoints, along a recorded path, or of many missions."
_THINNED = 0.1
"""Share of a tube's radius by which the line in its middle may differ from the recorded path."""

_OFF_THE_SURFACE_M = 0.15
"""The clearance is a lower bound, less than the distance to the surface by two or three voxels at most; a measured
surface that is farther away than this is not what the clearance is measured to."""


@click.command()
@click.argument("waypoints", type=click.Path(path_type=Path), required=False)
@console.path_option(
    "--path", "path", "Recorded path instead: CSV with x_m, y_m, z_m (a map's poses.csv), and yaw_deg to keep headings."
)
@click.option(
    "--simplify",
    "tolerance_m",
    default=0.10,
    show_default=True,
    help="Largest deviation from --path when it is simplified, metres.",
)
@console.path_option("--out", "out", "Trajectory file to write.", required=True)
@plan_options
@console.common_options
def one(waypoints: Path | None, path: Path | None, tolerance_m: float, out: Path, asked: Asked, as_json: bool) -> None:
    """Plan a trajectory through WAYPOINTS and check it over its whole length.

    \b
    goshawk plan waypoints.csv --map map --vehicle vehicle.toml --out lap.json
    goshawk plan --path map/poses.csv --map map --vehicle vehicle.toml --out walk.json
    goshawk plan batch --help        many missions in one map

    WAYPOINTS is a project's waypoints.json, or CSV with columns x_m, y_m, z_m and, optionally, yaw_deg (empty: free).
    The JSON may also ask for laps, stays, velocities, gates, speeds and jerks of legs, a tube, take-off and landing.
    The file is written only if the final gate passes. Exit code 1: there is no such trajectory; the message names
    where, why, and what to change.
    """
    if (waypoints is None) == (path is None):
        raise click.UsageError("give either WAYPOINTS or --path")
    drone = vehicle.load(asked.vehicle_file)
    job = asked.job(drone, out)
    area = asked.opened_map()
    if path is not None:
        plan_one(area, drone, job, path, tolerance_m, as_json=as_json)
    elif waypoints is not None:
        plan_one(area, drone, job, waypoints, None, as_json=as_json)


def plan_one(
    area: mapping.Map, drone: vehicle.Vehicle, job: Job, file: Path, tolerance_m: float | None, *, as_json: bool
) -> None:
    """Plan a file and write the trajectory.

    Args:
        tolerance_m: by how much the file, a recorded path, may be simplified; None: it is one of waypoints.
    """
    outputs.check(job.out, overwrite=job.overwrite)
    free = area.free_space()
    field = thin_obstacles.field_to_plan_in(area, free, job.thinnest_m)
    if job.thinnest_m is not None:
        kept = 100.0 * thin_obstacles.free_share(field, area)
        console.note(f"note: --thinnest {job.thinnest_m:g} leaves {kept:.0f} % of the map's free space free")
    if tolerance_m is not None:
        asked, left_out = mission_along(file, tolerance_m, field, job)
    else:
        asked, left_out = job.asked(waypoints_file.load_mission(file)), None
    options = thin_obstacles.priced(job.options, area, free, job.hidden_price)
    with console.progress() as report:
        plan = thin_obstacles.plan(asked, area, field, drone, options, free, job.thinnest_m, progress=report)
    with outputs.file(job.out, overwrite=job.overwrite) as temporary:
        planner.save_plan(temporary, plan, name=job.out.stem)
    surface = area.surface()
    nearest = None if surface is None else surface.nearest(np.array(plan.gate.clearance_point_world_m))
    _show(plan, drone, job.out, len(asked.waypoints.positions_world_m), left_out, nearest, as_json=as_json)


def mission_along(path: Path, tolerance_m: float, field: esdf.Field, job: Job) -> tuple[Mission, int]:
    """The mission that follows a recorded path, and how many of its positions were left out because nothing fits there.

    Args:
        tolerance_m: largest deviation from the recorded path when it is simplified.
    """
    recorded = read_path(path)
    walked, left_out = simplify.waypoints_along(recorded, tolerance_m, field, job.options, read_headings(path))
    tube = job.keep_in and tube_round(recorded, job.keep_in.radius_m)
    return replace(job, keep_in=tube).asked(Mission(walked)), left_out


def _show(
    plan: planner.Plan,
    drone: vehicle.Vehicle,
    out: Path,
    waypoints: int,
    left_out: int | None,
    nearest: NearestSurface | None,
    *,
    as_json: bool,
) -> None:
    """The facts of a plan, and a note where an obstacle could hide near it.

    Args:
        left_out: recorded positions that were left out; None if no path was given.
        nearest: to the point of least clearance; None in a map without measured surface.
    """
    facts = {
        "written": str(out),
        "waypoints": waypoints,
        **({"recorded_positions_left_out": left_out} if left_out is not None else {}),
        "segments": len(plan.trajectory.durations_s),
        "duration_s": plan.trajectory.duration_s,
        "converged": plan.converged,
        "residual": plan.residual if isfinite(plan.residual) else None,
        "spread_of_starts": plan.spread if isfinite(plan.spread) else None,
        "active_limits": [list(optimum.active) for optimum in plan.optima],
        "clearance_m": plan.gate.clearance_m,
        "top_speed_m_s": batch_mission.top_speed_m_s(plan.trajectory),
    }
    shown = {"clearance" if name == "clearance_m" else name: value for name, value in facts.items()}
    shown |= {"converged": _converged(plan), "active limits": _active(plan)}
    del shown["residual"], shown["active_limits"], shown["spread_of_starts"]
    shown |= {"clearance": _clearance(plan.gate, nearest), "could hide": could_hide.describe(plan.gate)}
    checked = plan.gate.as_dict()
    jerks = [check for check in plan.gate.checks if check.name in ("jerk", "jerk of legs")]
    shown |= {check.name: f"{check.value:.1f} of {check.bound:g} {check.unit}" for check in jerks}
    document = facts | {"could_hide": checked["could_hide"], "check": checked}
    document |= {vehicle.purpose.KEY: vehicle.purpose.not_for_design(drone)}
    if plan.gate.hidden is not None:
        paid_m = plan.gate.hidden.paid_m
        shown["price of hidden space"] = f"{paid_m:.1f} m, by which the way counts as longer than it is"
        document["hidden_price_paid_m"] = paid_m
    if nearest is not None:
        shown["measured surface"] = _surface(nearest)
        document["nearest_surface"] = asdict(nearest)
    console.show(f"trajectory {out.stem}", shown, as_json=as_json, document=document)
    if mark := vehicle.purpose.mark_sentence(drone):
        console.note(f"note: the rotor margins rest on a model {mark}")
    if could_hide.worth_a_warning(plan.gate):
        console.note(f"note: {could_hide.describe(plan.gate)}. To be certain: {could_hide.advice(plan.gate)}")


def _converged(plan: planner.Plan) -> str:
    if plan.converged:
        spread = f"; starts end within {plan.spread:.2%} of each other" if isfinite(plan.spread) else ""
        return f"yes (residual {plan.residual:.0e} of the flight time{spread})"
    if {"corridor", "bry"} & set(plan.method.split("+")):
        return f"no: method {plan.method} does not look for the least time"
    return "no: a descent stopped at its bound on iterations, or the whole path was slowed down for a limit"


def _active(plan: planner.Plan) -> str:
    """Which limits hold the flight back, the most frequent first."""
    limits = Counter(limit for optimum in plan.optima for limit in optimum.active if limit)
    if not limits:
        return "none"
    total = sum(len(optimum.active) for optimum in plan.optima)
    return ", ".join(f"{limit} in {count}" for limit, count in limits.most_common()) + f" of {total} segments"


def _clearance(report: planner.GateReport, nearest: NearestSurface | None) -> str:
    """The clearance, and from what it is where the measured surface tells."""
    proved = f"{report.clearance_m:.2f} m"
    if nearest is None:
        return proved
    unknown = nearest.distance_m > report.clearance_m + _OFF_THE_SURFACE_M
    return f"{proved}, to {'unknown space' if unknown else 'the measured surface'}"


def _surface(nearest: NearestSurface) -> str:
    """How far the measured surface is from the point of least clearance, and how well it is known there."""
    away = f"{nearest.distance_m:.2f} m from where the clearance is least"
    if nearest.deviation_m is None:
        return f"{away}; its standard deviation is not known"
    images = f"{nearest.images} image{'s' * (nearest.images != 1)}"
    return f"{away}, standard deviation {1e3 * nearest.deviation_m:.0f} mm, measured by {images}"


def tube_round(walked_world_m: FloatArray, radius_m: float) -> KeepIn:
    """A tube round recorded positions (n, 3): round fewer of them by as much as it is narrower."""
    if not radius_m > 0.0:
        raise InputError(f"--keep-in {radius_m:g} must be positive")
    kept = simplify.rdp(walked_world_m, _THINNED * radius_m)
    return KeepIn(
        (1.0 - _THINNED) * radius_m, tuple((float(x), float(y), float(z)) for x, y, z in walked_world_m[kept])
    )


def read_headings(path: Path) -> FloatArray | None:
    """Headings (n,) from the column yaw_deg or yaw_rad of a recorded path, NaN where empty; None without such a column.

    Raises:
        FormatError: a cell does not hold a number.
    """
    import csv

    with open(path, newline="") as file:
        rows = list(enumerate(csv.DictReader(file), start=2))
    for name, unit in (("yaw_rad", 1.0), ("yaw_deg", np.pi / 180.0)):
        if rows and name in rows[0][1]:
            return unit * np.array([cells.number(row[name], path, line, name) for line, row in rows])
    return None


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
        raise errors.missing(path, "positions in the columns x_m, y_m, z_m") from None
    except KeyError as error:
        raise InputError(f"{path} has no column {error}; expected columns x_m, y_m and z_m") from None
    except (UnicodeDecodeError, OSError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path} is not a CSV file of positions: {reason}") from error
    if len(positions) < 2:
        raise InputError(f"{path} holds {len(positions)} positions; a path has at least two")
    if not np.isfinite(positions).all():
        row = int(np.flatnonzero(~np.isfinite(positions).all(axis=1))[0])
        raise InputError(f"{path}: position {row + 1} is not finite")
    return positions


command = DefaultVerbGroup("plan", own=one, commands=[plan_batch.command])
