"""`goshawk diagnose`: which effect the vehicle model lacks: one of the catalogue, none, or an unknown one."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

import vehicle
from flight import FlightLog, InputError
from goshawk.commands.learn import diagnosis_screen, fit_options, kept, what_next
from goshawk.commands.learn.flights import load, refuse_repeated
from goshawk.commands.learn.what_next import DiagnoseCall
from goshawk.terminal import console, outputs
from sysid.diagnosis import Diagnosis, diagnose, from_imu
from sysid.diagnosis.experiment_design import next_flight
from sysid.diagnosis.experiment_design.outlook import Outlook, outlook
from sysid.estimator.options import Options
from sysid.estimator.verdict import Use
from sysid.report import diagnosis_figures as figures
from sysid.report import diagnosis_page as report

SUMMARY = "Find which effect the vehicle model lacks, from measured flights."
KIND, KIND_IMU = "diagnosis", "diagnosis-imu"
_OUT = Path("OUT.toml")
"""In the next steps that are kept, the vehicle file that a call asks for."""


@click.command()
@click.argument("flights", nargs=-1, required=True, type=click.Path(path_type=Path))
@console.vehicle_option
@fit_options.held_out_option
@fit_options.fit_options()
@click.option("--auto", is_flag=True, help="Repeat until no candidate effect is significant.")
@console.path_option("--out", "out", "Vehicle file to write: the fitted model with the added effects.")
@fit_options.anyway_option
@outputs.overwrite_option
@console.columns_option
@console.path_option("--report", "report_file", "HTML page to write: verdict, evidence and figures in one file.")
@console.path_option("--plots", "plots", "Folder for figures (SVG).")
@click.option("--details", is_flag=True, help="Also print every candidate, attempt and note.")
@console.common_options
def command(
    flights: tuple[Path, ...],
    vehicle_file: Path,
    held_out: tuple[Path, ...],
    auto: bool,
    fit: fit_options.Chosen,
    out: Path | None,
    anyway: bool,
    overwrite: bool,
    columns: Path | None,
    report_file: Path | None,
    plots: Path | None,
    details: bool,
    as_json: bool,
) -> int:
    """Find the effect that the vehicle model lacks on FLIGHTS, its size and the confidence.

    \b
    goshawk diagnose a.parquet b.parquet --vehicle vehicle.toml --held-out c.parquet
    goshawk diagnose a.parquet b.parquet --vehicle vehicle.toml --held-out c.parquet \\
        --auto --out better.toml --report diagnosis.html

    The model is fitted to FLIGHTS; then every effect of the catalogue that it lacks is a candidate:

    \b
    present       added and fitted; held-out flights confirm it
    useful proxy  added, because held-out errors fall; another law is missing
    excluded      at most the given bound (95 %), which is too small to matter
    inconclusive  these flights cannot decide; a flight that can is proposed

    If a free curve explains more than any candidate, the verdict is "no known effect", with the force or torque and
    the variable that it depends on.

    --details prints all candidates, also later: the diagnosis is kept, and the same call reads it.

    Hold out whole flights (--held-out), preferably of another kind; without them flights are cross-validated. One
    step adds at most one effect; --auto repeats it. A few flights of half a minute take about a minute.

    --out may be the file of --vehicle if --overwrite is given: the result becomes its next version, and `goshawk
    vehicle undo` restores the old one. A fit with the verdict `do not use` is only written with --anyway; one that
    clearly predicts better than the file given is written and marked "for prediction, not for design".

    Flights without a pose (gyro, accelerometer and motor commands) are diagnosed by what an IMU shows: a weak rotor,
    unequal motors, the centre of mass, a late gyro.

    Exit code 0 whatever the diagnosis; 1 if the verdict on the fit is `do not use`, 2 for invalid input.
    """
    refuse_repeated((*flights, *held_out), "for fitting or held out")
    outputs.check(out, report_file, overwrite=overwrite, folders=[plots])
    given = fit_options.at_place(fit, vehicle.load(vehicle_file))
    options = fit_options.read(fit, given)
    if "gusts" not in fit_options.given(fit):  # the search itself goes over to lasting ones where a fit needs them
        options = replace(options, gusts="white")
    call = DiagnoseCall(flights, vehicle_file, held_out, columns, None, auto, fit_options.typed(fit))
    key = kept.key((flights, held_out), columns, [vehicle_file], (options, fit["gravity_m_s2"], call))
    result, found, outlooks = None, None, {}
    if not (report_file or plots):
        result = kept.find(KIND, flights[0], key) or kept.find(KIND_IMU, flights[0], key)
    if result is None:
        training, evaluation = ([_read(path, columns) for path in paths] for paths in (flights, held_out))
        if not _has_pose(training):
            result = _of_imu(training, given, options, call, drawn=bool(report_file or plots))
        else:
            with console.progress() as progress:
                found = diagnose(training, given, held_out=evaluation, auto=auto, options=options, progress=progress)
                outlooks = outlook(found, rng=np.random.default_rng(0))
            result = _result(found, outlooks, call)
        kept.keep(KIND if found else KIND_IMU, flights[0], key, result)
    usable = result.document["fit"]["use"] != Use.REJECTED
    written = out if usable or anyway else None
    refused = None if written else out
    further = _further(result, written, refused)
    if written is not None and result.vehicle is not None:
        added = [*result.document["additions"], *result.document.get("proxies", ())]
        outputs.write_vehicle(written, result.vehicle, "diagnose", effect=" + ".join(added), overwrite=overwrite)
    files: dict[str, Any] = {"report": None, "figures": []}
    if found is not None:
        files = _write(found, report_file, plots, further, outlooks, overwrite)
    if as_json:
        document = {**result.document, "next": further, "written": written and str(written), **files}
        console.show("", {}, as_json=True, document=document)
        return 0 if usable else 1
    result.screen.show()
    if details:
        result.details.show()
    mark = "" if result.vehicle is None or written is None else vehicle.purpose.mark_sentence(result.vehicle)
    _tell_next(
        further if details else first(further, writes=out is not None),
        [written and f"{written}{mark and f', {mark}'}", files["report"], *files["figures"]],
        refused,
    )
    return 0 if usable else 1


def _result(found: Diagnosis, outlooks: Mapping[str, Outlook], call: DiagnoseCall) -> kept.Kept:
    """What is kept of a diagnosis: its next steps too, for each fate of a vehicle file that may be asked for."""
    worth_flying = [name for name, view in outlooks.items() if view.would_tell]
    try:
        in_doubt = list(next_flight.in_doubt(found, worth_flying))
    except InputError:
        in_doubt = []
    fates = {"next": call, "written": replace(call, out=_OUT), "refused": replace(call, refused=_OUT)}
    more = {fate: what_next.lines(found, each, outlooks) for fate, each in fates.items()} | {"in_doubt": in_doubt}
    more |= kept.about(call.flights, call.vehicle_file)
    document = found.as_dict() | {"outlook": {name: view.as_dict() for name, view in outlooks.items()}}
    details = diagnosis_screen.details(found, outlooks)
    return kept.Kept(document, diagnosis_screen.short(found), found.vehicle, more, details)


def _has_pose(logs: Sequence[FlightLog]) -> bool:
    return any(log.has("position_world_m") and log.has("q_world_body") for log in logs)


def _of_imu(
    logs: Sequence[FlightLog], given: vehicle.Vehicle, options: Options, call: DiagnoseCall, *, drawn: bool
) -> kept.Kept:
    """What is kept of a diagnosis of flights without a pose.

    Args:
        drawn: whether figures are asked for.
    """
    if call.held_out:
        raise InputError("held-out flights judge a predicted motion, and no flight has a pose; leave --held-out out")
    if drawn:
        raise InputError("a report of a diagnosis needs a pose; of flights without one, goshawk identify has a report")
    with console.progress() as progress:
        found = from_imu.diagnose(logs, given, options=options, progress=progress)
    fates = {"next": call, "written": replace(call, out=_OUT), "refused": replace(call, refused=_OUT)}
    more = {fate: what_next.lines_of_imu(found, each) for fate, each in fates.items()}
    more |= kept.about(call.flights, call.vehicle_file)
    screen, details = diagnosis_screen.short_of_imu(found), diagnosis_screen.details_of_imu(found)
    return kept.Kept(found.as_dict(), screen, found.vehicle, more, details)


def first(further: Sequence[str], *, writes: bool = False) -> list[str]:
    """The first command, with the remarks and the marking of logs before it; how many more there are is told by the
    details.

    Args:
        writes: whether a vehicle file was asked for, which the same call would find there the next time.
    """
    before = ("(", "goshawk log mark ")
    ends = next((i + 1 for i, line in enumerate(further) if not line.startswith(before)), len(further))
    more = len(further) - ends
    how = "--details, without --out" if writes else "--details"
    return [*further[:ends], *([f"({more} more with {how})"] if more else [])]


def _tell_next(further: Sequence[str], written: Sequence[Path | str | None], refused: Path | None) -> None:
    """What to do next, what was written, and what was not."""
    for line in further:
        click.echo(f"next: {line}")
    for path in written:
        if path:
            click.echo(f"written: {path}")
    if refused is not None:
        click.echo(f"not written: {refused}, as the fit is not to be used (see --anyway)")


def _further(result: kept.Kept, written: Path | None, refused: Path | None) -> list[str]:
    """The next steps of this call."""
    fate, file = ("written", written) if written else ("refused", refused) if refused else ("next", _OUT)
    return [line.replace(str(_OUT), shlex.quote(str(file))) for line in result.more[fate]]


def _read(path: Path, columns: Path | None) -> FlightLog:
    log = load(path, columns)
    return FlightLog(log.columns, {**log.metadata, "name": path.stem})


def _write(
    found: Diagnosis,
    report_file: Path | None,
    plots: Path | None,
    further: Sequence[str],
    outlooks: Mapping[str, Outlook],
    overwrite: bool,
) -> dict[str, Any]:
    """Write the requested files, each whole or not at all; returns their paths for the document."""
    if report_file is not None:
        with outputs.file(report_file, overwrite=overwrite) as temporary:
            report.write(temporary, found, further=further, outlooks=outlooks)
    placed: list[str] = []
    if plots is not None:
        with outputs.pictures(plots, overwrite=overwrite) as drawn:
            placed = [str(drawn.placed(figure)) for figure in figures.write(found, drawn.temporary)]
    return {"report": report_file and str(report_file), "figures": placed}
