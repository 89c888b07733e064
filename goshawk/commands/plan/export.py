"""`goshawk export`: a checked trajectory for other autopilots and planners, and as a page to read."""

import contextlib
from pathlib import Path

import click

import mapping
import vehicle
from flight import InputError, TrajectoryFile, trajectory
from goshawk.commands.plan import formats
from goshawk.terminal import console, outputs
from planner.gate import could_hide, gate, plan_report

SUMMARY = "Write a trajectory for other autopilots and planners, or as a page."


@click.command()
@click.argument("trajectory_file", metavar="TRAJECTORY", type=click.Path(path_type=Path))
@console.path_option("--crazyflie", "crazyflie", "CSV of at most 31 polynomials (poly4d) for the Crazyflie.")
@console.path_option("--mav-trajectory", "mav", "YAML of segments for mav_trajectory_generation.")
@console.path_option("--px4", "px4", "CSV of setpoints (NED) for PX4's offboard mode.")
@click.option("--step", "step_s", default=0.02, show_default=True, help="Seconds between setpoints for --px4.")
@console.path_option("--report", "report", "HTML page to write: the plan; needs --map and --vehicle.")
@console.path_option("--map", "map_folder", "Map folder, for --report.")
@console.path_option("--vehicle", "vehicle_file", "Vehicle file, for --report.")
@outputs.overwrite_option
@console.common_options
def command(
    trajectory_file: Path,
    crazyflie: Path | None,
    mav: Path | None,
    px4: Path | None,
    step_s: float,
    report: Path | None,
    map_folder: Path | None,
    vehicle_file: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write TRAJECTORY for other programs, or as a page.

    \b
    goshawk export lap.json --crazyflie lap.csv --mav-trajectory lap.yaml --px4 lap-setpoints.csv
    goshawk export lap.json --report lap.html --map map --vehicle vehicle.toml

    Only a trajectory that passed the gate is written for an autopilot; the page shows any. The Crazyflie holds 31
    pieces: a longer plan is fitted anew within 1 cm, which the file written is read back to measure, or refused.
    """
    written = {"crazyflie": crazyflie, "mav_trajectory_generation": mav, "px4": px4, "report": report}
    if not any(written.values()):
        raise click.UsageError("say what to write: --crazyflie, --mav-trajectory, --px4 or --report")
    if report is not None and (map_folder is None or vehicle_file is None):
        raise click.UsageError("--report needs --map and --vehicle")
    outputs.check(*written.values(), overwrite=overwrite)
    item = trajectory.load(trajectory_file)
    if not item.checked and any((crazyflie, mav, px4)):
        raise InputError(
            f"{trajectory_file} has not passed the gate; run `goshawk check --renew` on it, or plan it again"
        )
    if any((crazyflie, mav, px4)) and not item.as_checked:
        raise InputError(
            f"{trajectory_file} was changed after its check; run `goshawk check --renew` on it, or plan it again"
        )
    flown, near = item.trajectory, {}
    with contextlib.ExitStack() as files:  # all are put in place at the end, or none

        def new(path: Path) -> Path:
            return files.enter_context(outputs.file(path, overwrite=overwrite))

        if crazyflie is not None:
            held = formats.write_crazyflie(new(crazyflie), flown)
            near = {"crazyflie_pieces": len(held.trajectory.durations_s), "crazyflie_from_plan_m": held.largest_m}
            near |= {"crazyflie_yaw_error_rad": held.largest_rad}
            near |= {"crazyflie_acceleration_error_m_s2": held.largest_m_s2}
        if mav is not None:
            formats.write_mav_trajectory_generation(new(mav), flown)
        if px4 is not None:
            formats.write_px4(new(px4), flown, step_s)
        if report is not None and map_folder is not None and vehicle_file is not None:
            new(report).write_text(_page(item, map_folder, vehicle_file), encoding="utf-8")
    facts: dict[str, object] = {name: str(path) for name, path in written.items() if path is not None}
    facts |= near
    console.show(f"{trajectory_file} written as", facts, as_json=as_json)


def _page(item: TrajectoryFile, map_folder: Path, vehicle_file: Path) -> str:
    """The page of a plan in a map, checked for a vehicle."""
    area, drone, options = mapping.open_map(map_folder), vehicle.load(vehicle_file), gate.options_of(item)
    checked = gate.check_file(item, area.field, drone, options)
    checked = could_hide.add(checked, item.trajectory, area.free_space(), could_hide.asked_of(item))
    return plan_report.page(item, checked, area.field, drone, options.limits_for(drone))
