"""`goshawk upload`: a checked trajectory into the vehicle, committed and read back."""

from pathlib import Path

import click

import firmware_bridge
import vehicle
from flight import trajectory
from goshawk import console


@click.command()
@click.argument("trajectory_file", metavar="TRAJECTORY", type=click.Path(path_type=Path))
@console.url_option
@console.key_option
@console.path_option("--map", "map_folder", "Refuse unless it was checked in this map.")
@console.path_option("--vehicle", "vehicle_file", "Refuse unless it was checked for this vehicle.")
@console.json_option
def command(
    trajectory_file: Path,
    url: str,
    key_file: Path | None,
    map_folder: Path | None,
    vehicle_file: Path | None,
    as_json: bool,
) -> None:
    """Send TRAJECTORY to the vehicle, commit it, read it back and compare.

    \b
    goshawk upload walk.json
    goshawk upload walk.json --map map --vehicle vehicle.toml --vehicle-url udp://192.168.4.1:14550

    A trajectory that never passed the final gate is refused, and so is one for another map or vehicle. Whatever goes
    wrong, the vehicle keeps what it held. Ctrl-C stops the upload and says what that is.
    """
    item = trajectory.load(trajectory_file)
    map_hash = None
    if map_folder is not None:
        import mapping

        map_hash = mapping.open_map(map_folder).hash
    vehicle_hash = vehicle.vehicle_hash(vehicle.load(vehicle_file)) if vehicle_file is not None else None
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
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
