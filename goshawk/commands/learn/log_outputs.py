"""Output files of `goshawk log check` and `fix`: the page of a log, and the corrected log."""

import shlex
from collections.abc import Collection
from pathlib import Path

from firmware_bridge.airborne import aloft_s
from flight import FlightLog, InputError, Progress, file_format, flight_log, silent
from goshawk.commands.learn import log_report
from goshawk.terminal import outputs, words
from sysid.logs import fix as fixes
from sysid.logs.check import LogReport
from sysid.logs.events.event import EVENTS, SPLITS
from vehicle import Vehicle


def write_report(
    path: Path, log: FlightLog, checked: LogReport, *, overwrite: bool, progress: Progress = silent
) -> None:
    """Write the page of a log."""
    progress("drawing the report", 0.0)
    with outputs.file(path, overwrite=overwrite) as temporary:
        temporary.write_text(log_report.page(log, checked, _facts(log, checked)), encoding="utf-8")


def _facts(log: FlightLog, checked: LogReport) -> dict[str, str]:
    """Rows of the table at the top of the page."""
    duration_s = float(log.time_s[-1] - log.time_s[0]) if len(log) else 0.0
    facts = {"rows": str(len(log)), "duration": f"{duration_s:.2f} s"}
    if checked.duration_s < duration_s:
        facts["checked, in the air"] = f"{checked.duration_s:.2f} s"
    facts["rate"] = f"{checked.rate_hz:.1f} Hz"
    stored = {
        str(key): value
        for key, value in log.metadata.items()
        if key not in ("name", fixes.FIXES, fixes.REPAIRS, EVENTS, SPLITS)
    }
    for key, value in stored.items():
        title, unit = words.named(key)
        facts[key if title in facts else title] = f"{value} {unit}".rstrip()
    return facts | {f"fix {i + 1}": str(done) for i, done in enumerate(log.metadata.get(fixes.FIXES, []))}


def require_others(source: Path, *files: Path | None) -> None:
    """
    Raises:
        InputError: one of the files to write is the log itself.
    """
    for file in files:
        if file is not None and file.exists() and source.exists() and file.samefile(source):
            raise InputError(f"{file} is the log itself, which is never changed; give another name")


def write_fixed(
    log: FlightLog,
    source: Path,
    out: Path,
    believed: Vehicle | None,
    *,
    leave: Collection[str] = (),
    overwrite: bool,
    progress: Progress = silent,
) -> fixes.Fixed:
    """Write the log with every fix that the checks propose, but for kinds to leave.

    Raises:
        InputError: `out` is the log itself or no .parquet.
    """
    if out.suffix != ".parquet":
        raise InputError(f"--out {out}: a corrected log is written in our own format; call it {out.stem}.parquet")
    require_others(source, out)
    fixed = fixes.fix(log, believed, aloft=aloft_s(log), leave=leave, progress=progress)
    from_hash = {"fixed_from_sha256": file_format.file_hash(source)} if source.is_file() else {}
    corrected = FlightLog(fixed.log.columns, {**fixed.log.metadata, "fixed_from": source.name, **from_hash})
    with outputs.file(out, overwrite=overwrite) as temporary:
        flight_log.save(temporary, corrected)
    return fixed


def identifying(fixed: fixes.Fixed, out: Path, vehicle_file: Path) -> str:
    """The command that fits a vehicle to the log that was written, its pieces where fixes left gaps."""
    left_gaps = any(repair["action"] == "blank" for repair in fixed.log.metadata.get(fixes.REPAIRS, []))
    gaps = ["--split-gaps"] if left_gaps else []
    return shlex.join(["goshawk", "identify", str(out), "--vehicle", str(vehicle_file), *gaps, "--out", "FITTED.toml"])
