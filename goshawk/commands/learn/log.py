"""`goshawk log`: contents and faults of a flight log, the log with its faults fixed, and in other formats."""

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

import sysid
import vehicle
from firmware_bridge.airborne import IN_FREE_AIR, in_the_air
from flight import FlightLog
from goshawk.commands.learn import fit_options, flights, log_files, log_outputs
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import VerbGroup
from goshawk.terminal.words import named
from sysid.logs import manoeuvres
from sysid.logs.check import LogReport
from sysid.logs.motors import rotor_places
from sysid.logs.reading import DRAFTED
from sysid.logs.sensors import low_pass
from vehicle import Vehicle

SUMMARY = "Show, check, fix or convert a flight log; download the vehicle's log."
HIDDEN = ("fixes", "repairs", "lost", "events", "splits_s", "read", rotor_places.KEY, low_pass.KEY, DRAFTED)
"""Metadata that `goshawk log check` says in sentences."""
flight_argument = log_files.flight_argument
vehicle_option = console.path_option("--vehicle", "vehicle_file", "Vehicle file: its rotor order, spin and units too.")


@click.group(cls=VerbGroup)
def command() -> None:
    """Show a flight log, check it, fix it, and bring it into other formats.

    \b
    goshawk log show demo-out/flights/walk.parquet
    goshawk log check flight.csv --columns columns.toml --vehicle vehicle.toml

    Logs of PX4, ArduPilot, Betaflight, INAV, Crazyflie, ROS, EuRoC and TUM are told by their content. Columns of CSV
    and topics of ROS are drafted, and told; --columns corrects them.
    """


for verb in (log_files.export, log_files.bring, log_files.download, log_files.mark, log_files.draft_columns):
    command.add_command(verb)


@command.command()
@flight_argument
@console.columns_option
@console.common_options
def show(flight: Path, columns: Path | None, as_json: bool) -> None:
    """Show the contents of FLIGHT: columns, rates, gaps, ranges; of one without a pose, which manoeuvres suffice.

    \b
    goshawk log show demo-out/flights/walk.parquet
    goshawk log show flight.csv --columns columns.toml
    """
    log = flights.read(flight, columns)
    document = describe(log) | {"manoeuvres": [one.as_dict() for one in manoeuvres.found(log)]}
    if as_json:
        console.show("", {}, as_json=True, document=document)
    else:
        _show(str(flight), document)


@command.command()
@flight_argument
@vehicle_option
@console.path_option("--report", "report_file", "HTML page to write: every stream, with what the checks found.")
@console.columns_option
@outputs.overwrite_option
@console.common_options
def check(
    flight: Path,
    vehicle_file: Path | None,
    report_file: Path | None,
    columns: Path | None,
    overwrite: bool,
    as_json: bool,
) -> int:
    """Look for faults in FLIGHT; each finding names a fix. No log is changed.

    \b
    goshawk log check flight.parquet --vehicle vehicle.toml
    goshawk log check flight.csv --columns columns.toml --vehicle vehicle.toml --report flight.html

    Exit code 1: there is an error, not only a warning.
    """
    log_outputs.require_others(flight, report_file)
    outputs.check(report_file, overwrite=overwrite)
    log, believed = flights.read(flight, columns), _vehicle(vehicle_file)
    with console.progress() as report:
        checked = _named(sysid.check_log(_aloft(log, flight), believed, progress=report), flight)
        if report_file is not None:
            log_outputs.write_report(report_file, log, checked, overwrite=overwrite, progress=report)
    written = [str(report_file)] if report_file is not None else []
    given = [("--columns", columns), ("--vehicle", vehicle_file)]
    reading = [str(word) for option, file in given if file is not None for word in (option, file)]
    fixing = shlex.join(["goshawk", "log", "fix", str(flight), *reading, "--out", "NEW.parquet"])
    mendable = any(finding.repair is not None for finding in checked.findings)
    _tell(checked, {"written": written}, then=fixing if mendable else "", as_json=as_json)
    wrong = [finding.what for finding in checked.findings if finding.level == "error"]
    if wrong:
        click.echo(f"goshawk: {flight} has errors: {', '.join(dict.fromkeys(wrong))}", err=True)
    return 1 if wrong else 0


@command.command()
@flight_argument
@console.path_option("--out", "out", "Flight log (.parquet) to write; it records the fixes.", required=True)
@vehicle_option
@click.option("--leave", multiple=True, metavar="KIND", help="Leave what is found of this kind as it is. Repeatable.")
@console.columns_option
@outputs.overwrite_option
@console.common_options
def fix(
    flight: Path,
    out: Path,
    vehicle_file: Path | None,
    leave: tuple[str, ...],
    columns: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a new log with the fixes that `goshawk log check` proposes, where they change the log.

    \b
    goshawk log fix flight.parquet --vehicle vehicle.toml --out fixed.parquet
    goshawk log fix flight.csv --columns columns.toml --vehicle vehicle.toml --out flight.parquet
    goshawk log fix flight.parquet --leave "attitude jump" --out fixed.parquet

    FLIGHT itself is never changed; the new log names it, its SHA-256 and every change.
    """
    log_outputs.require_others(flight, out)
    outputs.check(out, overwrite=overwrite)
    log, believed = flights.read(flight, columns), _vehicle(vehicle_file)
    with console.progress() as report:
        fixed = log_outputs.write_fixed(log, flight, out, believed, leave=leave, overwrite=overwrite, progress=report)
    fitting = log_outputs.identifying(fixed, out, vehicle_file) if vehicle_file is not None else ""
    told = {"fixed": list(fixed.done), "written": [str(out)]}
    _tell(_named(fixed.report, out), told, then=fitting, as_json=as_json)


def _vehicle(file: Path | None) -> Vehicle | None:
    return None if file is None else vehicle.load(file)


def _named(checked: LogReport, path: Path) -> LogReport:
    """What was found, as a report of this file, with options of the verbs instead of arguments."""
    return replace(fit_options.worded_report(checked), name=str(path))


def _tell(checked: LogReport, more: dict[str, Any], *, then: str, as_json: bool) -> None:
    """What was found and done, and the command that comes next, if any."""
    if as_json:
        console.show("", {}, as_json=True, document={"check": checked.as_dict()} | more)
        return
    for finding in checked.findings:
        click.echo(f"{finding.level}: {finding.sentence}; {finding.fix}")
    for sentence in checked.inconclusive:
        click.echo(f"inconclusive: {sentence}")
    for sentence in checked.notes:
        click.echo(f"note: {sentence}")
    for sentence in more.get("fixed", []):
        click.echo(f"fixed: {sentence}")
    if more.get("fixed") == []:
        click.echo("no fix applied: no finding proposes a change of the log")
    for path in more["written"]:
        click.echo(f"written: {path}")
    if not checked.findings:
        click.echo(f"the checks found no fault in {checked.name}")
    if then:
        click.echo(f"next: {then}")


def _show(title: str, document: dict[str, Any]) -> None:
    facts = {key: value for key, value in document.items() if key not in ("columns", "metadata", "manoeuvres")}
    facts |= {key: value for key, value in document["metadata"].items() if key not in HIDDEN}
    console.show(title, facts, as_json=False)
    for sentence in document["metadata"].get("read", ()):
        click.echo(f"read: {sentence}")
    for one in document["manoeuvres"]:
        click.echo(f"flown: {one['sentence']}")
    rows = [
        (*named(name), *(_cell(c[end]) for end in ("smallest", "largest")), c["missing"], name)
        for name, c in document["columns"].items()
    ]
    console.table("columns", ("quantity", "unit", "smallest", "largest", "rows without value", "column"), rows)


def _cell(value: float | None) -> float | str:
    return "none" if value is None else value


def _aloft(log: FlightLog, path: Path) -> FlightLog:
    """The rows in the air if the log has the mission state: standing on the ground is no fault."""
    aloft = log.has("mission_state") and np.isin(log.columns["mission_state"], IN_FREE_AIR).any()
    return in_the_air(log, str(path)) if aloft else log


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
