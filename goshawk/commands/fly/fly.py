"""`goshawk fly`: take off, fly the uploaded trajectory, land; write the flight log."""

from pathlib import Path

import click

import firmware_bridge
from firmware_bridge.airborne import slowed, tracking
from flight import FlightLog, flight_log, trajectory
from goshawk.terminal import console, outputs

SUMMARY = "Fly the uploaded trajectory and record a flight log."


@click.command()
@console.path_option("--out", "out", "Flight log to write.", required=True)
@console.path_option("--trajectory", "trajectory_file", "Refuse to fly unless this is the vehicle's active trajectory.")
@console.url_option
@console.key_option
@console.take_over_option
@outputs.overwrite_option
@console.common_options
def command(
    out: Path,
    trajectory_file: Path | None,
    url: str,
    key_file: Path | None,
    take_over: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Fly the vehicle's active trajectory, and write the flight log.

    \b
    goshawk fly --out flights/walk.parquet
    goshawk fly --trajectory walk.json --out flights/walk.parquet

    Refused on the ground: a start too far away, a tilted or moving vehicle, a low battery, no estimate, the geofence.
    Ctrl-C brakes along the path and lands. The log of a flight that ends early is written too.
    """
    outputs.check(out, overwrite=overwrite)

    def write(log: FlightLog) -> None:
        with outputs.file(out, overwrite=overwrite) as temporary:
            flight_log.save(temporary, log)
        if "ended_early" in log.metadata:
            click.echo(f"note: wrote the log as far as it goes to {out}", err=True)

    item = trajectory.load(trajectory_file) if trajectory_file is not None else None
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        link.take_control(force=take_over)
        log = link.fly(item, progress=report, cancel=cancel, ended_early=write)
    write(log)
    planned = {"planned_s": item.trajectory.duration_s} if item is not None else {}
    facts = {"written": str(out), "rows": len(log), **planned, **tracking(log)}
    why = slowed(log)
    console.show("flight", facts, as_json=as_json, document=facts | {"slowed": why})
    if not as_json and why:
        click.echo(f"note: {why}")
