"""`goshawk upload`: a checked trajectory into the vehicle, committed and read back."""

from pathlib import Path

import click

import firmware_bridge
import vehicle
from firmware_bridge import controller
from firmware_bridge.link import refuse_unfit
from firmware_bridge.parameters import difference
from flight import InputError, trajectory
from goshawk.terminal import console

SUMMARY = "Send a checked trajectory to the vehicle and read it back."


@click.command()
@click.argument("trajectory_file", metavar="TRAJECTORY", type=click.Path(path_type=Path))
@console.url_option
@console.key_option
@console.take_over_option
@console.path_option("--map", "map_folder", "Map folder: refuse unless it was checked in this map.")
@console.path_option(
    "--vehicle",
    "vehicle_file",
    "Vehicle file: refuse unless it was checked for it, and the controller has its parameters.",
)
@click.option(
    "--other-parameters", is_flag=True, help="With --vehicle: only warn if the controller's parameters differ."
)
@console.common_options
def command(
    trajectory_file: Path,
    url: str,
    key_file: Path | None,
    map_folder: Path | None,
    vehicle_file: Path | None,
    other_parameters: bool,
    take_over: bool,
    as_json: bool,
) -> None:
    """Send TRAJECTORY to the vehicle, commit it, read it back and compare.

    \b
    goshawk upload walk.json
    goshawk upload walk.json --map map --vehicle vehicle.toml --url udp://192.168.4.1:14550

    A trajectory is refused if it has not passed the final gate, or was checked for another map or vehicle. So it is if
    the controller's parameters do not match the vehicle (`goshawk params set --vehicle VEHICLE`). After any failure the
    vehicle keeps its active trajectory. Ctrl-C stops the upload and shows which one that is.
    """
    item = trajectory.load(trajectory_file)
    map_hash = None
    if map_folder is not None:
        import mapping

        map_hash = mapping.open_map(map_folder).hash
    believed = vehicle.load(vehicle_file) if vehicle_file is not None else None
    vehicle_hash = vehicle.vehicle_hash(believed) if believed is not None else None
    refuse_unfit(item, map_hash, vehicle_hash, False)
    if item.record_kept is None:
        click.echo(
            f"warning: {trajectory_file} is of file version 1, which does not show whether its limits and conditions "
            "were changed after its check; `goshawk check --renew` writes the present version",
            err=True,
        )
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        if believed is not None and (said := set_otherwise(link.parameters(), believed)):
            if not other_parameters:
                raise InputError(
                    f"{said}; run `goshawk params set --vehicle {vehicle_file}` first, or give --other-parameters"
                )
            click.echo(f"warning: {said}", err=True)
        link.take_control(force=take_over)
        outcome = link.upload(item, map_hash=map_hash, vehicle_hash=vehicle_hash, progress=report, cancel=cancel)
        line = link.statistics
    facts = {
        "uploaded": item.name,
        "segments": outcome.segments,
        "datagrams": outcome.datagrams,
        "datagrams_received": line.counts.received,
        "datagrams_refused": line.counts.refused + line.counts.damaged,
        "vehicle_restarts": outcome.restarts,
        "duration_s": outcome.duration_s,
        "read_back_equal": True,
    }
    console.show(f"upload to {url}", facts, as_json=as_json)


def set_otherwise(present: dict[str, float], believed: vehicle.Vehicle) -> str:
    """The controller's parameters that differ from this vehicle's, as a sentence; empty if none does."""
    differing = difference(present, dict(controller.parameters_of(believed).parameters))
    if not differing:
        return ""
    first = [f"{name} {before:g} (model {after:g})" for name, (before, after) in list(differing.items())[:3]]
    more = f" and {len(differing) - 3} more" if len(differing) > 3 else ""
    return f"the controller's parameters differ from {believed.name}'s: {', '.join(first)}{more}"
