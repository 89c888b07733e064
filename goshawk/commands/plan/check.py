"""`goshawk check`: the final gate for any trajectory, map and vehicle."""

from dataclasses import replace
from pathlib import Path

import click

import mapping
import planner
import vehicle
from flight import TrajectoryFile, trajectory
from flight.progress import within
from goshawk.commands.plan import thin_obstacles
from goshawk.terminal import console, outputs
from planner.gate import could_hide, gate
from planner.gate.limits import Check

SUMMARY = "Check a trajectory against a map and a vehicle."
LOWER_BOUNDS = ("clearance", "local margins", "slowest rotor")
"""Checks that need at least their bound."""


@click.command()
@click.argument("trajectory_file", metavar="TRAJECTORY", type=click.Path(path_type=Path))
@console.map_option
@console.vehicle_option
@click.option(
    "--margin",
    "margin_m",
    type=float,
    help="Clearance to keep beyond the vehicle's sphere, metres [default: the file's].",
)
@click.option(
    "--thinnest",
    "thinnest_m",
    type=float,
    help="Obstacle thickness, metres: fail where one could hide within the clearance [default: as planned].",
)
@click.option(
    "--renew", is_flag=True, help="If it passes, record it as checked for this map and vehicle; the old file is kept."
)
@console.common_options
def command(
    trajectory_file: Path,
    map_folder: Path,
    vehicle_file: Path,
    margin_m: float | None,
    thinnest_m: float | None,
    renew: bool,
    as_json: bool,
) -> int:
    """Check TRAJECTORY over its whole length: clearance, continuity, the vehicle's limits.

    \b
    goshawk check walk.json --map map --vehicle vehicle.toml
    goshawk check walk.json --map other-map --vehicle vehicle.toml --json
    goshawk check walk.json --map map --vehicle learned.toml --renew

    It is checked for what the file records: radius, margin, limits, control reserve, headings and its mission's
    requests. The vehicle's limits hold where they are stricter; --margin replaces that margin. How thin an obstacle
    could hide within the clearance is stated, and fails only where --thinnest asked for it.

    Exit code 0: it passes and may be flown. 1: it fails, and the table shows which check. A trajectory planned for
    another map or vehicle, or changed since its check, fails, unless it passes every other check and --renew records
    it for these.
    """
    item = trajectory.load(trajectory_file)
    options = gate.options_of(item)
    options = options if margin_m is None else replace(options, margin_m=margin_m)
    believed = vehicle.load(vehicle_file)
    options = replace(options, limits=options.limits and options.limits.stricter(believed.limits))
    with console.progress() as progress:
        stage = f"checking {trajectory_file.name}"
        progress(stage, 0.0)
        area = mapping.open_map(map_folder)
        field = area.field
        progress(stage, 0.2)
        checking = within(progress, stage, 0.2, 1.0)
        if renew:
            report = gate.check(
                item.trajectory,
                field,
                believed,
                options,
                waypoints_world_m=item.waypoints_world_m,
                yaw_rad=gate.headings_of(item),
                conditions=gate.asked_of(item),
                progress=checking,
            )
        else:
            report = gate.check_file(item, field, believed, options, progress=checking)
        thinnest_m = could_hide.asked_of(item) if thinnest_m is None else thinnest_m
        free = area.free_space()
        report = could_hide.add(report, item.trajectory, free, thinnest_m)
        report = replace(report, hidden=thin_obstacles.paid(item, free))
    if renew and report.passed:
        with outputs.file(trajectory_file, overwrite=True) as temporary:
            trajectory.save(temporary, renewed(item, report))
        if item.record_kept is False:
            click.echo(
                f"goshawk: the record of {trajectory_file} was changed since its check (conditions, limits or "
                "waypoints); it was checked and recorded for what it says now",
                err=True,
            )
    console.show(f"check of {trajectory_file}", _facts(report), as_json=as_json, document=report.as_dict())
    if not report.passed:
        failed = ", ".join(check.name for check in report.checks if not check.passed)
        click.echo(f"goshawk: {trajectory_file} may not be flown; it fails: {failed}", err=True)
        return 1
    return 0


def renewed(item: TrajectoryFile, report: planner.GateReport) -> TrajectoryFile:
    """The same trajectory as checked for the map and the vehicle of a report."""
    here = replace(item, map_hash=report.map_hash, vehicle_hash=report.vehicle_hash, check=report.as_dict())
    return trajectory.sealed(here)


def _facts(report: planner.GateReport) -> dict[str, object]:
    """One line a check: value, bound, verdict, and the reason where it fails; then how thin an obstacle could hide."""
    return {**{check.name: _fact(check) for check in report.checks}, "could hide": could_hide.describe(report)}


def _fact(check: Check) -> str:
    """Verdict, value and bound where they have a unit, and the reason of a failure."""
    parts = ["ok" if check.passed else "FAILS"]
    if check.unit:
        bound = "at least" if check.name in LOWER_BOUNDS else "at most"
        unit = "in SI units" if check.unit == "SI" else check.unit  # velocity, acceleration and jerk together
        parts.append(f"{check.value:.4g} {unit} ({bound} {check.bound:.4g})")
    if check.reason and (not check.passed or check.name == "record"):  # an older file has none to compare
        parts.append(check.reason)
    return "  ".join(parts)
