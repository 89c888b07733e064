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
from flight import FloatArray, InputError, cells, file_format
from flight.mission import KeepIn, Laps, Mission, Yaw
from goshawk.commands.plan import batch, batch_mission, map_standing, thin_obstacles, waypoints_file
from goshawk.terminal import console, outputs
from mapping.dense.confidence import NearestSurface
from planner.gate import could_hide
from planner.request import options
from planner.route import simplify

_THINNED = 0.1
"""Share of a tube's radius by which the line in its middle may differ from the recorded path."""

_SLOWER = {
    "speed_m_s": ("--speed", "m/s"),
    "acceleration_m_s2": ("--acceleration", "m/s2"),
    "jerk_m_s3": ("--jerk", "m/s3"),
}
"""Option and unit of each limit that the command line may lower."""
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
@console.map_option
@console.vehicle_option
@console.path_option("--out", "out", "Trajectory file to write.", required=True)
@console.radius_option
@console.margin_option
@click.option("--speed", "speed_m_s", type=float, help="Fly no faster than this, m/s.")
@click.option("--acceleration", "acceleration_m_s2", type=float, help="Accelerate no harder than this, m/s2.")
@click.option(
    "--jerk",
    "jerk_m_s3",
    type=float,
    help="Change the acceleration no faster than this, m/s3 [default: the vehicle's].",
)
@click.option(
    "--method",
    type=click.Choice(options.METHODS),
    default="fastest",
    show_default=True,
    help="fastest: least time. corridor: least time within a corridor of boxes proved free. bry: as Bry et al. (2015).",
)
@click.option(
    "--search",
    type=click.Choice(options.SEARCHES),
    default="grid",
    show_default=True,
    help="What finds a way round obstacles: a grid search, or one of OMPL's sampling planners.",
)
@click.option(
    "--starts",
    type=click.IntRange(1, options.MOST_STARTS),
    default=1,
    show_default=True,
    help="Starts of the descent, of which the fastest path is kept; as many at once as there are processors.",
)
@click.option("--seed", type=click.IntRange(1), default=1, show_default=True, help="Seed of a sampling planner.")
@click.option(
    "--yaw", type=click.Choice(options.YAW_MODES), help="Heading [default: as the waypoint file says, else along_path]."
)
@click.option(
    "--heading", "heading_deg", type=float, help="Keep this heading (degrees, from x towards y): --yaw fixed."
)
@click.option("--look-at", nargs=3, type=float, help="Face this point (metres): --yaw look_at.", metavar="X Y Z")
@click.option("--laps", type=click.IntRange(1), help="Fly the waypoints as a closed loop this many times.")
@click.option(
    "--keep-in",
    "keep_in_m",
    type=float,
    help="Stay within this many metres of --path, or else of the straight lines between the waypoints.",
)
@click.option(
    "--thinnest",
    "thinnest_m",
    type=float,
    help="Keep out of space where an obstacle this thick could hide, metres [default: not asked].",
)
@console.path_option("--batch", "missions", "Folder of waypoint files to plan instead; --out is then a folder.")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes for --batch.")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers plan the --batch instead.")
@map_standing.accept_option
@outputs.overwrite_option
@console.json_option
def command(
    waypoints: Path | None,
    path: Path | None,
    tolerance_m: float,
    map_folder: Path,
    vehicle_file: Path,
    out: Path,
    radius_m: float | None,
    margin_m: float | None,
    speed_m_s: float | None,
    acceleration_m_s2: float | None,
    jerk_m_s3: float | None,
    method: options.Method,
    search: options.Search,
    starts: int,
    seed: int,
    yaw: options.YawMode | None,
    heading_deg: float | None,
    look_at: tuple[float, float, float] | None,
    laps: int | None,
    keep_in_m: float | None,
    thinnest_m: float | None,
    missions: Path | None,
    jobs: int,
    scheduler: str | None,
    accept_doubtful: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Plan a trajectory through WAYPOINTS and check it over its whole length.

    \b
    goshawk plan waypoints.csv --map map --vehicle vehicle.toml --out lap.json
    goshawk plan waypoints.json --map map --vehicle vehicle.toml --out lap.json
    goshawk plan --path map/poses.csv --map map --vehicle vehicle.toml --out walk.json
    goshawk plan --batch missions --jobs 4 --map map --vehicle vehicle.toml --out plans

    WAYPOINTS is a project's waypoints.json, or CSV with columns x_m, y_m, z_m and, optionally, yaw_deg (empty: free).
    The JSON may also ask for laps, stays, velocities, gates, speeds and jerks of legs, a tube, take-off and landing
    (docs/missions.md).
    The file is written only if the final gate passes. Exit code 1: there is no such trajectory; the message names
    where, why, and what to change.
    """
    if sum(given is not None for given in (waypoints, path, missions)) != 1:
        raise click.UsageError("give either WAYPOINTS or --path or --batch")
    drone = vehicle.load(vehicle_file)
    wanted = options_from(drone, margin_m, speed_m_s, acceleration_m_s2, radius_m, jerk_m_s3)
    how = replace(wanted.sized(drone), method=method, starts=starts, search=search, search_seed=seed)
    repeated, turned = None if laps is None else Laps(laps), yaw_from(yaw, heading_deg, look_at)
    tube = None if keep_in_m is None else KeepIn(keep_in_m)
    job = batch.Job(map_folder, vehicle_file, how, out, repeated, turned, tube, thinnest_m, overwrite=overwrite)
    area = mapping.open_map(map_folder)
    map_standing.require(area, accept_doubtful=accept_doubtful)
    if missions is not None:
        plan_all(missions, job, jobs, scheduler, as_json=as_json)
    elif path is not None:
        plan_one(area, drone, job, path, tolerance_m, as_json=as_json)
    elif waypoints is not None:
        plan_one(area, drone, job, waypoints, None, as_json=as_json)


def plan_one(
    area: mapping.Map, drone: vehicle.Vehicle, job: batch.Job, file: Path, tolerance_m: float | None, *, as_json: bool
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
        click.echo(f"note: --thinnest {job.thinnest_m:g} leaves {kept:.0f} % of the map's free space free", err=True)
    if tolerance_m is not None:
        asked, left_out = mission_along(file, tolerance_m, field, job)
    else:
        asked, left_out = job.asked(waypoints_file.load_mission(file)), None
    with console.progress() as report:
        plan = thin_obstacles.plan(asked, area, field, drone, job.options, free, job.thinnest_m, progress=report)
    with outputs.file(job.out, overwrite=job.overwrite) as temporary:
        planner.save_plan(temporary, plan, name=job.out.stem)
    surface = area.surface()
    nearest = None if surface is None else surface.nearest(np.array(plan.gate.clearance_point_world_m))
    _show(plan, job.out, len(asked.waypoints.positions_world_m), left_out, nearest, as_json=as_json)


def mission_along(path: Path, tolerance_m: float, field: esdf.Field, job: batch.Job) -> tuple[Mission, int]:
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
    if nearest is not None:
        shown["measured surface"] = _surface(nearest)
        document["nearest_surface"] = asdict(nearest)
    console.show(f"trajectory {out.stem}", shown, as_json=as_json, document=document)
    if could_hide.worth_a_warning(plan.gate):
        click.echo(f"note: {could_hide.describe(plan.gate)}; {could_hide.advice(plan.gate)}", err=True)


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


def plan_all(folder: Path, job: batch.Job, jobs: int, scheduler: str | None, *, as_json: bool) -> None:
    """Plan every waypoint file in a folder; exit code 1 if one of them has no plan."""
    with console.progress() as report:
        rows = batch.run(batch.mission_files(folder), job, jobs=jobs, scheduler=scheduler, progress=report)
    if as_json:
        click.echo(file_format.json_text({"written": str(job.out), "missions": rows}), nl=False)
    else:
        heads = ("mission", "status", "duration, s", "clearance, m", "could hide", "reason")
        lines = [
            [row["name"], row["status"], row["duration_s"], row["clearance_m"], _could_hide(row), row["reason"]]
            for row in rows
        ]
        console.table(f"plans in {job.out}", heads, [["" if cell is None else cell for cell in line] for line in lines])
    missed = sum(row["status"] != "planned" for row in rows)
    if missed:
        where = job.out / batch.RESULTS
        click.echo(
            f"goshawk: {missed} of {len(rows)} missions have no plan; {where} gives the reason of each", err=True
        )
        raise click.exceptions.Exit(1)


def _could_hide(row: batch.Row) -> str | None:
    """How thick an obstacle could hide near a planned mission, as a cell; None where there is no plan."""
    if row["status"] != "planned":
        return None
    if row["could_hide_share"] is None:
        return "not known"
    thickness_m = row["could_hide_m"]
    return "of any thickness" if thickness_m is None else f"{1e3 * thickness_m:.0f} mm"


def yaw_from(
    mode: options.YawMode | None, heading_deg: float | None, look_at: tuple[float, float, float] | None
) -> Yaw | None:
    """The yaw record that the command line asks for; None if it does not.

    Raises:
        UsageError: two of the options contradict each other.
    """
    wanted = {"fixed": heading_deg is not None, "look_at": look_at is not None}
    given = [name for name, is_given in wanted.items() if is_given]
    if len(given) == 2 or (given and mode not in (None, given[0])):
        raise click.UsageError("--yaw, --heading and --look-at contradict each other: give one of them")
    if mode in wanted and not given:
        raise click.UsageError(f"--yaw {mode} needs {'--heading' if mode == 'fixed' else '--look-at'}")
    if given:
        mode = "fixed" if heading_deg is not None else "look_at"
    return None if mode is None else Yaw(mode, np.radians(heading_deg or 0.0), look_at)


def options_from(
    drone: vehicle.Vehicle,
    margin_m: float | None = None,
    speed_m_s: float | None = None,
    acceleration_m_s2: float | None = None,
    radius_m: float | None = None,
    jerk_m_s3: float | None = None,
) -> planner.PlanOptions:
    """The planner's options: the defaults, overridden by the command line."""
    options = console.body_options(radius_m, margin_m)
    asked = {"speed_m_s": speed_m_s, "acceleration_m_s2": acceleration_m_s2, "jerk_m_s3": jerk_m_s3}
    slower = {name: value for name, value in asked.items() if value is not None}
    if not slower:
        return options
    own = drone.limits
    for name, value in slower.items():
        most = own.as_dict().get(name)
        if most is None and not 0.0 < value < np.inf:
            raise InputError(f"--jerk {value:g} must be a positive, finite number of m/s3; leave it out for no limit")
        if most is not None and not 0.0 < value <= most:
            option, unit = _SLOWER[name]
            limit = f"{most:g} {unit}, the vehicle's limit"
            raise InputError(
                f"{option} {value:g} must be above 0 and at most {limit}; raise {name} under [limits] in the vehicle "
                "file if the vehicle can do more"
            )
    return replace(options, limits=replace(own, **slower))


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
        raise InputError(f"{path} does not exist") from None
    except KeyError as error:
        raise InputError(f"{path} has no column {error}; expected columns x_m, y_m and z_m") from None
    except (UnicodeDecodeError, OSError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path} is not a CSV file of positions: {reason}") from error
    if len(positions) < 2:
        raise InputError(f"{path} holds {len(positions)} positions; a path has at least two")
    if not np.isfinite(positions).all():
        row = int(np.flatnonzero(~np.isfinite(positions).all(axis=1))[0])
        raise InputError(f"{path}: position {row} is not finite")
    return positions
