"""`goshawk log`: contents and faults of a flight log; with --download, of the vehicle's last flight."""

from dataclasses import replace
from pathlib import Path

import click
import numpy as np

import firmware_bridge
import sysid
import vehicle
from firmware_bridge.airborne import IN_FREE_AIR, in_the_air
from flight import FlightLog, InputError, flight_log
from goshawk.commands.learn import fit_options, log_outputs
from goshawk.commands.learn.flights import marked_file
from goshawk.terminal import console, outputs
from goshawk.terminal.words import named
from sysid.logs.payload import PAYLOAD_CARRIED


@click.command()
@click.argument("flight", type=click.Path(path_type=Path))
@click.option(
    "--payload",
    type=click.Choice(("carried", "left")),
    help="Write into FLIGHT (of another program's log, into a .parquet copy) whether the payload was on board.",
)
@click.option("--download", is_flag=True, help="First download the vehicle's log of its last flight into FLIGHT.")
@console.path_option("--report", "report_file", "Plot every stream with the checks' findings: one HTML page, offline.")
@console.path_option("--csv", "csv_file", "Write the log as CSV.")
@console.path_option("--mcap", "mcap_file", "Write the log as an MCAP recording of ROS 2 messages.")
@console.path_option(
    "--draft-columns",
    "draft_file",
    "Guess the columns of a foreign CSV, or the topics of a ROS recording: writes a map to check, for --columns.",
)
@click.option("--fix", "fixes", is_flag=True, help="Apply the fixes that the checks propose; needs --out.")
@console.path_option("--out", "out", "With --fix: the new log (.parquet); it records the fixes.")
@console.path_option("--vehicle", "vehicle_file", "Vehicle file: check rotor order, spin and units against it too.")
@console.columns_option
@console.url_option
@console.key_option
@outputs.overwrite_option
@console.json_option
def command(
    flight: Path,
    payload: str | None,
    download: bool,
    report_file: Path | None,
    csv_file: Path | None,
    mcap_file: Path | None,
    draft_file: Path | None,
    fixes: bool,
    out: Path | None,
    vehicle_file: Path | None,
    columns: Path | None,
    url: str,
    key_file: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Show the contents of FLIGHT (columns, rates, gaps, ranges) and its probable faults.

    Each finding names a fix; --fix writes a new log with those fixes that change the log. FLIGHT itself is changed by
    --payload only. It is a log of Goshawk (.parquet) or PX4 (.ulg), or with --columns CSV or a ROS recording.

    \b
    goshawk log demo-out/flights/walk.parquet
    goshawk log flight.csv --draft-columns map.toml
    goshawk log flight.csv --columns map.toml --vehicle vehicle.toml --report flight.html
    goshawk log flight.csv --columns map.toml --vehicle vehicle.toml --fix --out flight.parquet
    goshawk log last.parquet --download --vehicle-url udp://192.168.4.1:14550
    goshawk log lap.parquet --payload left
    """
    if fixes != (out is not None):
        raise click.UsageError("--fix and --out NEW.parquet go together: the new log is written, FLIGHT stays as it is")
    log_outputs.require_others(flight, report_file, csv_file, mcap_file, out, draft_file)
    if draft_file is not None:
        draft_columns(flight, draft_file, overwrite, as_json)
        return
    outputs.check(report_file, csv_file, mcap_file, out, overwrite=overwrite)
    if download:
        fetch(flight, url, key_file, overwrite=overwrite)
    if payload is not None:
        flight = mark(flight, columns, payload == "carried", overwrite=overwrite)
    log = sysid.read_log(flight, columns)
    believed = vehicle.load(vehicle_file) if vehicle_file is not None else None
    done: tuple[str, ...] = ()
    aloft = _aloft(log, flight)
    with console.progress() as report:
        if out is not None:
            log, done, checked = log_outputs.write_fixed(
                log, flight, out, believed, overwrite=overwrite, progress=report
            )
        else:
            checked = sysid.check_log(aloft, believed, progress=report)
        checked = replace(fit_options.worded_report(checked), name=str(out or flight))
        files = (report_file, csv_file, mcap_file)
        written = log_outputs.write(log, checked, files, overwrite=overwrite, progress=report)
    document = describe(log) | {"check": checked.as_dict()}
    if as_json:
        more = {"fixed": list(done), "written": [str(path) for path in (out, *written) if path is not None]}
        console.show("", {}, as_json=True, document=document | more)
        return
    _show(str(out or flight), document)
    for sentence in done:
        click.echo(f"fixed: {sentence}")
    if out is not None and not done:
        click.echo("no fix applied: no finding proposes a change of the log")
    for path in (out, *written):
        if path is not None:
            click.echo(f"written: {path}")


def _show(title: str, document: dict) -> None:
    facts = {key: value for key, value in document.items() if key not in ("columns", "metadata", "check")}
    console.show(
        title, facts | {k: v for k, v in document["metadata"].items() if k not in ("fixes", "lost")}, as_json=False
    )
    rows = [
        (*named(name), *(_cell(c[end]) for end in ("smallest", "largest")), c["missing"], name)
        for name, c in document["columns"].items()
    ]
    console.table("columns", ("quantity", "unit", "smallest", "largest", "rows without value", "column"), rows)
    findings = document["check"]["findings"]
    for finding in findings:
        click.echo(f"{finding['level']}: {finding['sentence']}; {finding['fix']}")
    for sentence in document["check"]["inconclusive"]:
        click.echo(f"inconclusive: {sentence}")
    for sentence in document["check"]["notes"]:
        click.echo(f"note: {sentence}")
    if not findings:
        click.echo("the checks found no fault")
    elif any(finding["fixable"] for finding in findings):
        click.echo("--fix --out NEW.parquet writes a log with these fixes")


def _cell(value: float | None) -> float | str:
    return "none" if value is None else value


def draft_columns(flight: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Write a first column map of a foreign CSV, or of a ROS recording."""
    from sysid.logs import draft_columns, draft_topics
    from sysid.logs.reading import is_recording

    outputs.check(out, overwrite=overwrite)
    drafted = (draft_topics if is_recording(flight) else draft_columns).draft(flight)
    with outputs.file(out, overwrite=overwrite) as temporary:
        temporary.write_text(drafted.text, encoding="utf-8")
    rows = [(g.name, ", ".join(g.columns or [g.entries["topic"]]), "; ".join(g.reasons)) for g in drafted.guesses]
    if as_json:
        entries = [{"name": g.name, "columns": g.columns, **g.entries, "reasons": g.reasons} for g in drafted.guesses]
        console.show(
            "", {}, as_json=True, document={"written": str(out), "guesses": entries, "unused": list(drafted.unused)}
        )
        return
    console.table(f"guesses about {flight}", ("quantity", "columns", "why"), rows)
    if drafted.unused:
        click.echo(f"not used: {', '.join(drafted.unused)}")
    click.echo(f"written: {out}; check it, then: goshawk log {flight} --columns {out}")


def _aloft(log: FlightLog, path: Path) -> FlightLog:
    """The rows in the air if the log has the mission state: standing on the ground is no fault."""
    aloft = log.has("mission_state") and np.isin(log.columns["mission_state"], IN_FREE_AIR).any()
    return in_the_air(log, str(path)) if aloft else log


def fetch(out: Path, url: str, key_file: Path | None, *, overwrite: bool) -> None:
    """Download the vehicle's on-board log to a file."""
    outputs.check(out, overwrite=overwrite)
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        log = link.download_log(progress=report, cancel=cancel)
    with outputs.file(out, overwrite=overwrite) as temporary:
        flight_log.save(temporary, log)


def mark(path: Path, columns: Path | None, carried: bool, *, overwrite: bool) -> Path:
    """Write into a log whether the payload was on board; of a foreign log, into one of ours beside it.

    The earlier version of a log in our format is kept beside it.

    Returns:
        The file that was marked.

    Raises:
        InputError: there is another log of that name beside it.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the log of one flight")
    own = marked_file(path)
    log = flight_log.load(path) if own == path else sysid.read_log(path, columns)
    if own != path and own.exists() and not overwrite:
        raise InputError(f"{own} exists; mark that one, or give --overwrite if it is not {path.name} in our own format")
    if own == path and log.metadata.get(PAYLOAD_CARRIED) is carried:
        return own
    with outputs.file(own, overwrite=own == path or overwrite) as temporary:
        flight_log.save(temporary, FlightLog(log.columns, {**log.metadata, PAYLOAD_CARRIED: carried}))
    instead = "" if own == path else f"; use it instead of {path} from now on"
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
