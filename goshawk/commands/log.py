"""`goshawk log`: what is in a flight log, and what is missing from it; fetched from the vehicle first if wanted."""

from pathlib import Path

import click
import numpy as np

import firmware_bridge
from flight import FlightLog, flight_log
from goshawk import console


@click.command()
@click.argument("flight", type=click.Path(path_type=Path))
@click.option("--download", is_flag=True, help="Fetch the vehicle's own log of its last flight into FLIGHT first.")
@console.url_option
@console.key_option
@console.json_option
def command(flight: Path, download: bool, url: str, key_file: Path | None, as_json: bool) -> None:
    """Show what FLIGHT holds: columns, rates, gaps, ranges.

    \b
    goshawk log demo-out/flights/walk.parquet
    goshawk log demo-out/flights/walk.parquet --json
    goshawk log last.parquet --download --vehicle-url udp://192.168.4.1:14550
    """
    if download:
        fetch(flight, url, key_file)
    log = flight_log.load(flight)
    document = describe(log)
    if as_json:
        console.show("", {}, as_json=True, document=document)
        return
    facts = {key: value for key, value in document.items() if key not in ("columns", "metadata")}
    console.show(f"{flight}", facts | document["metadata"], as_json=False)
    rows = [(name, c["smallest"], c["largest"], c["missing"]) for name, c in document["columns"].items()]
    console.table("columns", ("name", "smallest", "largest", "rows without"), rows)


def fetch(out: Path, url: str, key_file: Path | None) -> None:
    """Write the vehicle's on-board log to a file."""
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        flight_log.save(out, link.download_log(progress=report, cancel=cancel))


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
