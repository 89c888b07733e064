"""`goshawk log`: what is in a flight log, and what is wrong with it; fetched from the vehicle first if wanted."""

from pathlib import Path

import click
import numpy as np

import firmware_bridge
import sysid
import vehicle
from flight import FlightLog, InputError, flight_log
from goshawk import console
from goshawk.flights import IN_FREE_AIR, in_the_air, marked_file
from sysid.flight_data import PAYLOAD_CARRIED


@click.command()
@click.argument("flight", type=click.Path(path_type=Path))
@click.option(
    "--payload",
    type=click.Choice(("carried", "left")),
    help="Write into FLIGHT whether the payload was on board; a foreign log gets one of ours (.parquet) beside it.",
)
@click.option("--download", is_flag=True, help="Fetch the vehicle's own log of its last flight into FLIGHT first.")
@console.path_option("--vehicle", "vehicle_file", "Vehicle file: check rotor order, spin and units against it too.")
@console.columns_option
@console.url_option
@console.key_option
@console.json_option
def command(
    flight: Path,
    payload: str | None,
    download: bool,
    vehicle_file: Path | None,
    columns: Path | None,
    url: str,
    key_file: Path | None,
    as_json: bool,
) -> None:
    """Show what FLIGHT holds (columns, rates, gaps, ranges) and what looks wrong with it.

    Each finding comes with a fix; the log stays as it is, but for what --payload says. FLIGHT is our own log, PX4's
    (.ulg), or CSV or a ROS recording with --columns.

    \b
    goshawk log demo-out/flights/walk.parquet
    goshawk log flight.csv --columns map.toml --vehicle vehicle.toml --json
    goshawk log last.parquet --download --vehicle-url udp://192.168.4.1:14550
    goshawk log lap.parquet --payload left
    """
    if download:
        fetch(flight, url, key_file)
    if payload is not None:
        flight = mark(flight, columns, payload == "carried")
    log = sysid.read_log(flight, columns)
    believed = vehicle.load(vehicle_file) if vehicle_file is not None else None
    document = describe(log) | {"check": sysid.check_log(_aloft(log, flight), believed).as_dict()}
    if as_json:
        console.show("", {}, as_json=True, document=document)
        return
    facts = {key: value for key, value in document.items() if key not in ("columns", "metadata", "check")}
    console.show(f"{flight}", facts | document["metadata"], as_json=False)
    rows = [(name, c["smallest"], c["largest"], c["missing"]) for name, c in document["columns"].items()]
    console.table("columns", ("name", "smallest", "largest", "rows without"), rows)
    for finding in document["check"]["findings"]:
        click.echo(f"{finding['level']}: {finding['sentence']}; {finding['fix']}")
    if not document["check"]["findings"]:
        click.echo("the checks found nothing wrong")


def _aloft(log: FlightLog, path: Path) -> FlightLog:
    """The part in the air when the log says which: standing still on the floor is no fault."""
    aloft = log.has("mission_state") and np.isin(log.columns["mission_state"], IN_FREE_AIR).any()
    return in_the_air(log, str(path)) if aloft else log


def fetch(out: Path, url: str, key_file: Path | None) -> None:
    """Write the vehicle's on-board log to a file."""
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        flight_log.save(out, link.download_log(progress=report, cancel=cancel))


def mark(path: Path, columns: Path | None, carried: bool) -> Path:
    """Write into a log whether the payload was on board; of a foreign log, into one of ours beside it.

    Returns:
        The file that was marked.

    Raises:
        InputError: there is another log of that name beside it.
    """
    own = marked_file(path)
    log = flight_log.load(path) if own == path else sysid.read_log(path, columns)
    if own != path and own.exists():
        raise InputError(f"{own} exists; mark that one, or move it away if it is not {path.name} in our own format")
    flight_log.save(own, FlightLog(log.columns, {**log.metadata, PAYLOAD_CARRIED: carried}))
    instead = "" if own == path else f"; give it instead of {path} from now on"
    click.echo(f"written: {own}{instead}", err=True)
    return own


def describe(log: FlightLog) -> dict:
    """Facts about a log, JSON-able."""
    steps = np.diff(log.time_s)
    typical = float(np.median(steps)) if steps.size else float("nan")
    gaps = np.flatnonzero(steps > 5.0 * typical) if steps.size else np.empty(0, dtype=int)
    columns = {}
    for name, values in log.columns.items():
        known = values[np.isfinite(values)]
        columns[name] = {
            "smallest": float(known.min()) if known.size else None,
            "largest": float(known.max()) if known.size else None,
            "missing": int(len(values) - known.size),
        }
    return {
        "rows": len(log),
        "duration_s": float(log.time_s[-1] - log.time_s[0]) if len(log) else 0.0,
        "rate_hz": 1.0 / typical if steps.size else None,
        "gaps": len(gaps),
        "longest_gap_s": float(steps[gaps].max()) if gaps.size else 0.0,
        "columns": columns,
        "metadata": dict(log.metadata),
    }
