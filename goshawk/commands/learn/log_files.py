"""`goshawk log export|import|download|mark|draft-columns`: flight logs from and for other programs."""

from pathlib import Path

import click

import firmware_bridge
from flight import FlightLog, InputError, flight_log
from flight.units import RAD_S_PER_RPM
from goshawk.commands.learn import flights, log_exports, log_outputs
from goshawk.commands.learn.flights import marked_file
from goshawk.terminal import console, outputs
from sysid.logs.checks.payload import PAYLOAD_CARRIED
from sysid.logs.motors.full_throttle import with_command_speeds

flight_argument = click.argument("flight", type=click.Path(path_type=Path))


@click.command()
@flight_argument
@console.path_option("--csv", "csv_file", "CSV to write.")
@console.path_option("--mcap", "mcap_file", "MCAP recording of ROS 2 messages to write.")
@console.columns_option
@outputs.overwrite_option
@console.common_options
def export(
    flight: Path, csv_file: Path | None, mcap_file: Path | None, columns: Path | None, overwrite: bool, as_json: bool
) -> None:
    """Write FLIGHT for other programs.

    \b
    goshawk log export flight.parquet --csv flight.csv
    goshawk log export flight.ulg --mcap flight.mcap
    """
    if csv_file is None and mcap_file is None:
        raise click.UsageError("say what to write: --csv or --mcap")
    log_outputs.require_others(flight, csv_file, mcap_file)
    outputs.check(csv_file, mcap_file, overwrite=overwrite)
    log = flights.read(flight, columns)
    with console.progress() as report:
        for path, write in ((csv_file, log_exports.write_csv), (mcap_file, log_exports.write_mcap)):
            if path is not None:
                with outputs.file(path, overwrite=overwrite) as temporary:
                    write(temporary, log, report)
    written = [str(path) for path in (csv_file, mcap_file) if path is not None]
    console.show("export", {"written": ", ".join(written)}, as_json=as_json, document={"written": written})


@click.command("import")
@click.argument("flight", type=click.Path(path_type=Path), required=False)
@console.path_option("--pose", "pose", "In place of FLIGHT: the file of the poses ...")
@console.path_option("--imu", "imu", "... and that of the IMU, stamped by the same clock.")
@click.option("--align", is_flag=True, help="Two clocks stamped --pose and --imu: align them by how both turn.")
@console.path_option("--out", "out", "Flight log (.parquet) to write.", required=True)
@console.columns_option
@click.option("--full-throttle", "full_rpm", type=float, help="Rotor speed at full throttle, rpm.")
@outputs.overwrite_option
@console.common_options
def bring(
    flight: Path | None,
    pose: Path | None,
    imu: Path | None,
    align: bool,
    out: Path,
    columns: Path | None,
    full_rpm: float | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write another program's log in Goshawk's own format, as it is.

    \b
    goshawk log import flight.ulg --out flight.parquet
    goshawk log import LOG00001.BFL --full-throttle 24000 --out flight.parquet
    goshawk log import --pose poses.tum --imu imu.csv --out flight.parquet
    goshawk log import --pose poses.tum --imu LOG00001.BFL --align --out flight.parquet

    `goshawk log fix` does the same and applies the fixes that its checks propose.
    """
    if out.suffix != ".parquet":
        raise InputError(f"--out {out}: our own format is written; call it {out.stem}.parquet")
    if (flight is None) == (pose is None and imu is None) or (pose is None) != (imu is None):
        raise click.UsageError("give FLIGHT, or both --pose FILE and --imu FILE")
    if align and imu is None:
        raise click.UsageError("--align is for --pose FILE and --imu FILE")
    first = flight or pose
    assert first is not None
    for source in (first, imu or first):
        log_outputs.require_others(source, out)
    outputs.check(out, overwrite=overwrite)
    log = flights.read(first, columns, imu=imu, align=align)
    if full_rpm is not None:
        log = with_command_speeds(log, full_rpm * RAD_S_PER_RPM)
    with outputs.file(out, overwrite=overwrite) as temporary:
        flight_log.save(temporary, log)
    console.show("import", {"rows": len(log), "written": str(out)}, as_json=as_json)


@click.command()
@console.path_option("--out", "out", "Flight log (.parquet) to write.", required=True)
@console.url_option
@console.key_option
@outputs.overwrite_option
@console.common_options
def download(out: Path, url: str, key_file: Path | None, overwrite: bool, as_json: bool) -> None:
    """Download the vehicle's own log of its last flight.

    \b
    goshawk log download --out last.parquet
    goshawk log download --out last.parquet --url udp://192.168.4.1:14550
    """
    outputs.check(out, overwrite=overwrite)
    with (
        console.cancel_by_ctrl_c() as cancel,
        firmware_bridge.connect(url, key=key_file) as link,
        console.progress() as report,
    ):
        log = link.download_log(progress=report, cancel=cancel)
    with outputs.file(out, overwrite=overwrite) as temporary:
        flight_log.save(temporary, log)
    console.show("download", {"rows": len(log), "written": str(out)}, as_json=as_json)


@click.command()
@flight_argument
@click.option("--payload", type=click.Choice(("carried", "left")), required=True, help="Was the payload on board?")
@console.columns_option
@outputs.overwrite_option
@console.common_options
def mark(flight: Path, payload: str, columns: Path | None, overwrite: bool, as_json: bool) -> None:
    """Write into FLIGHT, or into a .parquet copy of another program's log, whether the payload was on board.

    \b
    goshawk log mark lap.parquet --payload left
    goshawk log mark lap.csv --columns columns.toml --payload carried

    The earlier version of a log in our format is kept beside it.
    """
    own = _marked(flight, columns, payload == "carried", overwrite=overwrite)
    facts = {"payload": payload, "written": str(own)}
    console.show("mark", facts, as_json=as_json)
    if own != flight:
        console.note(f"use {own} instead of {flight} from now on")


def _marked(path: Path, columns: Path | None, carried: bool, *, overwrite: bool) -> Path:
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
    log = flight_log.load(path) if own == path else flights.read(path, columns)
    if own != path and own.exists() and not overwrite:
        raise InputError(f"{own} exists; mark that one, or give --overwrite if it is not {path.name} in our own format")
    if own == path and log.metadata.get(PAYLOAD_CARRIED) is carried:
        return own
    with outputs.file(own, overwrite=own == path or overwrite) as temporary:
        flight_log.save(temporary, FlightLog(log.columns, {**log.metadata, PAYLOAD_CARRIED: carried}))
    return own


@click.command("draft-columns")
@flight_argument
@console.path_option("--out", "out", "Column map (.toml) to write, to be checked by you.", required=True)
@outputs.overwrite_option
@console.common_options
def draft_columns(flight: Path, out: Path, overwrite: bool, as_json: bool) -> None:
    """Guess the columns of a foreign CSV, or the topics of a ROS recording: a first map for --columns.

    \b
    goshawk log draft-columns flight.csv --out columns.toml
    goshawk log check flight.csv --columns columns.toml
    """
    from sysid.logs import reading

    log_outputs.require_others(flight, out)
    outputs.check(out, overwrite=overwrite)
    drafted = reading.draft(flight)
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
    click.echo(f"written: {out}; check it, then: goshawk log check {flight} --columns {out}")
