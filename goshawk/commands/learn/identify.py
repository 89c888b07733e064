"""`goshawk identify`: the vehicle model from flights, with standard errors."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import Any

import click

import sysid
import vehicle
from flight import FlightLog, InputError, Progress
from goshawk.commands.learn import fit_options, kept
from goshawk.commands.learn.flights import load, refuse_repeated
from goshawk.terminal import console, outputs
from goshawk.terminal.screen import Screen
from sysid.estimator import segments
from sysid.estimator.fit_to_use import Cause, Chosen, fit_to_use, likely_cause
from sysid.estimator.predicts import Predicts
from sysid.estimator.stages import STAGES
from sysid.estimator.validation.better import predicts
from sysid.estimator.verdict import Use, Verdict, of_logs
from sysid.logs import repeated

SUMMARY = "Fit the vehicle model to flight logs."
KIND = "identification"
STAGES_SCHEMA_VERSION = 1

stage_options = [
    click.option(f"--{stage}", stage, multiple=True, type=click.Path(path_type=Path), help=said)
    for stage, said in (
        ("vertical", "Flight for the first of three stages. Repeatable."),
        ("horizontal", "Flight for the second stage. Repeatable."),
        ("rotation", "Flight for the third stage. Repeatable."),
    )
]


@dataclass(frozen=True, slots=True)
class Fits:
    """The fits; the final result is the last."""

    stages: Mapping[str, sysid.Identification]
    """One under the name "", or one per stage."""
    logs: Mapping[str, sysid.LogReport]
    trials: Sequence[sysid.Identification]
    predicts: Predicts | None = None
    """Of the answer, beside the vehicle as it was given; None where that was not asked."""
    cause: Cause | None = None
    """Why the answer is not to be used, by a trial."""
    said: tuple[str, ...] = ()
    """What differs from the options that were asked for, and which flights share poses."""

    @property
    def answer(self) -> sysid.Identification:
        return list(self.stages.values())[-1]

    @property
    def converged(self) -> bool:
        return all(fit.converged for fit in self.stages.values())

    @property
    def verdict(self) -> Verdict:
        """On all stages and logs together."""
        found = reduce(Verdict.beside, (fit.verdict for fit in self.stages.values()), of_logs(self.logs.values()))
        return replace(found, predicts=self.predicts)


def _with_stages(function: Any) -> Any:
    for option in reversed(stage_options):
        function = option(function)
    return function


@click.command()
@click.argument("flights", nargs=-1, type=click.Path(path_type=Path))
@console.vehicle_option
@console.path_option("--out", "out", "Vehicle file to write.", required=True)
@fit_options.held_out_option
@click.option("--add-effect", "added", multiple=True, metavar="NAME", help="Add this effect to the model. Repeatable.")
@fit_options.fit_options()
@_with_stages
@click.option("--trials", type=click.IntRange(2), help="FLIGHTS are this many repeated trials; fit each one too.")
@console.columns_option
@console.path_option("--report", "report_file", "HTML page to write: everything in one file.")
@console.path_option("--plots", "plots", "Folder for figures (SVG).")
@fit_options.anyway_option
@outputs.overwrite_option
@console.common_options
def command(
    flights: tuple[Path, ...],
    vehicle_file: Path,
    out: Path,
    held_out: tuple[Path, ...],
    added: tuple[str, ...],
    fit: fit_options.Chosen,
    trials: int | None,
    columns: Path | None,
    report_file: Path | None,
    plots: Path | None,
    anyway: bool,
    overwrite: bool,
    as_json: bool,
    **stages: tuple[Path, ...],
) -> int:
    """Fit the vehicle model to FLIGHTS: joint maximum likelihood over parameters and all states.

    \b
    goshawk identify flights/*.parquet --vehicle vehicle.toml --out fitted.toml --report fit.html
    goshawk identify flights/*.parquet --vehicle vehicle.toml --out with_drag.toml --add-effect rotor_drag_thrust
    goshawk identify flights/*.parquet --vehicle vehicle.toml --out f.toml --hold 'inertia_*'

    FLIGHTS are our own logs (.parquet), PX4's (.ulg), ROS recordings (.bag, .db3, .mcap) or CSV, the last two with
    --columns. Each is checked first; faults are reported with a fix, and no log is changed.

    NAME is a parameter as the vehicle file names it (rotor_drag_thrust.drag_s_m), an effect (motor_lag), or a pattern
    ('inertia_*'). The mass is given, not estimated: pose and rotor speed determine only ratios to it.

    Three stages instead of one joint fit, as in the paper; each fixes parameters that the next ones need:

    \b
    goshawk identify --vertical a.parquet --horizontal b.parquet --rotation c.parquet \\
        --vehicle vehicle.toml --out fitted.toml

    Repeated trials: the result is the joint fit; each trial is also fitted on its own and plotted for comparison:

    \b
    goshawk identify trial*.parquet --trials 8 --vehicle vehicle.toml --out f.toml --plots figures

    The first line is the verdict: usable, doubtful (the reasons name what to check), for prediction, not for design, or
    do not use (exit code 1). A model for prediction has impossible values, yet predicts --held-out flights (else
    FLIGHTS) clearly better than the file given; it is written and marked. One not to be used is only written with
    --anyway; report, figures and JSON are.

    Where --out is a vehicle file already, --overwrite makes this its next version; `goshawk vehicle undo` restores it.
    """
    _check_usage(flights, stages, trials, fit["free"], held_out)
    outputs.check(out, report_file, overwrite=overwrite, folders=[plots])
    believed = fit_options.at_place(fit, vehicle.load(vehicle_file))
    for effect in added:
        believed = believed.with_effect(effect)
    options = fit_options.read(fit, believed)
    asked = Asked(flights, stages, trials, held_out, both_gusts="gusts" not in fit_options.given(fit))
    groups = [flights, *(stages[stage] for stage in STAGES), held_out]
    first = next(path for group in groups for path in group)
    key = kept.key(groups, columns, [vehicle_file], (options, fit["gravity_m_s2"], added, trials))
    result = None if report_file or plots else kept.find(KIND, first, key)
    files: dict[str, Any] = {"report": None, "figures": []}
    if result is None:
        with console.progress() as progress:
            fits = fit_flights(asked, believed, options, columns, progress)
        further = _mends(fits.logs, vehicle_file, columns)
        further += _next(fits.cause, asked, vehicle_file, added, out, columns, fit_options.typed(fit))
        result = kept.Kept(_document(fits), _screen(fits), fits.answer.vehicle, {"next": further})
        kept.keep(KIND, first, key, result)
        files = write_figures(fits, report_file, plots, overwrite=overwrite)
    assert result.vehicle is not None
    usable = result.document["verdict"]["use"] != Use.REJECTED
    written = out if usable or anyway else None
    if written is not None:
        outputs.write_vehicle(written, result.vehicle, "identify", overwrite=overwrite)
    if as_json:
        document = {**result.document, "written": written and str(written), **files}
        console.show("", {}, as_json=True, document=document)
        return 0 if usable else 1
    result.screen.show()
    mark = vehicle.purpose.mark_sentence(result.vehicle)
    click.echo(f"written: {written}{mark and f', {mark}'}" if written else "no vehicle file written (see --anyway)")
    for line in result.more["next"]:
        click.echo(f"next: {line}")
    for path in (files["report"], *files["figures"]):
        if path:
            click.echo(f"written: {path}")
    return 0 if usable else 1


def _check_usage(
    flights: tuple[Path, ...],
    stages: Mapping[str, tuple[Path, ...]],
    trials: int | None,
    free: tuple[str, ...],
    held_out: tuple[Path, ...],
) -> None:
    if bool(flights) == any(stages.values()):
        raise InputError("give FLIGHTS for one joint fit, or --vertical, --horizontal and --rotation for three stages")
    if free and any(stages.values()):
        raise InputError("--free and the three stages exclude each other: each stage frees its own parameters")
    if trials and (any(stages.values()) or len(flights) % trials):
        raise InputError(
            f"--trials {trials}: expected {trials} groups of equally many FLIGHTS, got {len(flights)} flights"
        )
    for together in (flights, *stages.values()):  # the stages may share a flight
        refuse_repeated((*together, *held_out), "in one fit, or for fitting and held out")


@dataclass(frozen=True, slots=True)
class Asked:
    """Which flights are fitted, and how."""

    flights: tuple[Path, ...]
    stages: Mapping[str, tuple[Path, ...]] = field(default_factory=dict[str, tuple[Path, ...]])
    """Flights of each stage; all empty: one joint fit of `flights`."""
    trials: int | None = None
    """`flights` are so many repeated trials."""
    held_out: tuple[Path, ...] = ()
    both_gusts: bool = True
    """Whether disturbances may be treated in the other way where only that makes the fit one to use."""


def fit_flights(
    asked: Asked,
    believed: vehicle.Vehicle,
    options: sysid.Options,
    columns: Path | None,
    progress: Progress,
) -> Fits:
    """One joint fit of FLIGHTS, or three stages, or a joint fit and one of each trial; every log is checked first.

    The answer's predictions are judged by the held-out flights; without them, where something forbids its use, by the
    flights it was fitted to.
    """
    checked: dict[str, sysid.LogReport] = {}

    def read(paths: Iterable[Path]) -> list[FlightLog]:
        logs = {str(path): load(path, columns) for path in paths}
        for path, log in logs.items():
            checked[path] = _checked(path, log, believed)
        return list(logs.values())

    if any(asked.stages.values()):
        staged = {stage: read(asked.stages[stage]) for stage in STAGES}
        fits = Fits(sysid.identify_in_stages(staged, believed, options, progress=progress), checked, ())
        return replace(fits, predicts=_predicts(fits, read(asked.held_out), (), believed, options))
    logs, held_out, trials = read(asked.flights), read(asked.held_out), asked.trials
    shared = repeated.check((*logs, *held_out), [path.name for path in (*asked.flights, *asked.held_out)])
    if asked.both_gusts:
        made = fit_to_use(logs, believed, options, progress=progress)
    else:
        made = Chosen(sysid.identify(logs, believed, options, progress=progress), options)
    each = len(logs) // trials if trials else 1
    groups = [logs[i : i + each] for i in range(0, len(logs), each)] if trials else []
    # a parameter that one trial does not identify must not stop the other fits
    alone = replace(made.options, unseen="hold")
    own = [sysid.identify(g, believed, alone, progress=progress) for g in groups]
    fits = Fits({"": made.fit}, checked, own, said=(*made.said, *shared))
    fits = replace(fits, predicts=_predicts(fits, held_out, logs, believed, options))
    refused = fits.verdict.use is Use.REJECTED and not fits.verdict.misread
    return replace(fits, cause=likely_cause(logs, believed, made)) if refused else fits


def _predicts(
    fits: Fits,
    held_out: Sequence[FlightLog],
    fitted_to: Sequence[FlightLog],
    believed: vehicle.Vehicle,
    options: sysid.Options,
) -> Predicts | None:
    """How far the answer's predictions are off; None where nothing asks for it, or no flight can judge.

    Of flights too long to be fitted whole, the rest judges.
    """
    rest = not held_out and segments.are_long(fitted_to, options)
    judges = held_out or (fitted_to if rest or fits.verdict.against else ())
    if not judges:
        return None
    if rest:
        options = replace(options, segments="rest")
    models = {"given": believed, "fitted": fits.answer.vehicle}
    try:
        found = sysid.compare(judges, models, options)
    except InputError:
        if held_out:
            raise
        return None
    on = "held-out flights" if held_out else "held-out segments" if rest else "the flights it was fitted to"
    return predicts(found, "given", "fitted", on)


def _checked(path: str, log: FlightLog, believed: vehicle.Vehicle) -> sysid.LogReport:
    """Check a log; the findings are printed at once and returned with the options of this command."""
    found = fit_options.worded_report(sysid.check_log(log, believed))
    for finding in found.findings:
        click.echo(f"{path}: {finding.level}: {finding.sentence}; {finding.fix}", err=True)
    if _is_mendable(found):
        click.echo(f"{path}: `goshawk log fix` writes a log without that", err=True)
    return replace(found, name=path)


def _mends(logs: Mapping[str, sysid.LogReport], vehicle_file: Path, columns: Path | None) -> list[str]:
    """The command for each log that was misread and of which its checks know how to mend it."""
    reading = [*(["--columns", str(columns)] if columns else []), "--vehicle", str(vehicle_file)]
    mendable = [path for path, report in logs.items() if _is_mendable(report)]
    return [shlex.join(["goshawk", "log", "fix", path, *reading, "--out", "NEW.parquet"]) for path in mendable]


def _is_mendable(report: sysid.LogReport) -> bool:
    known = any(finding.repair for finding in report.findings if finding.level == "error")
    return known and of_logs([report]).misread


def _next(
    cause: Cause | None,
    asked: Asked,
    vehicle_file: Path,
    added: Sequence[str],
    out: Path,
    columns: Path | None,
    typed: str,
) -> list[str]:
    """The command that the trial calls for; none where no trial told."""
    if cause is None:
        return []
    named = [path for path in asked.flights if path.stem != cause.without and str(path) != cause.without]
    words = ["goshawk", "identify", *named, "--vehicle", vehicle_file, "--out", out]
    words += [word for path in asked.held_out for word in ("--held-out", path)]
    words += [word for name in added for word in ("--add-effect", name)]
    words += ["--columns", columns] if columns else []
    return [f"{shlex.join(str(word) for word in words)}{fit_options.with_cause(typed, cause)}"]


def write_figures(fits: Fits, report_file: Path | None, plots: Path | None, *, overwrite: bool) -> dict[str, Any]:
    """Write the page and the figures that are asked for, each whole or not at all; returns their paths."""
    figures: list[Path] = []
    if plots is not None:
        with outputs.pictures(plots, overwrite=overwrite) as drawn:
            figures = [drawn.placed(figure) for figure in _figures(fits, drawn.temporary)]
    if report_file is not None:
        result = dict(fits.stages) if len(fits.stages) > 1 else fits.answer
        with outputs.file(report_file, overwrite=overwrite) as temporary:
            sysid.report.write(temporary, result, logs=list(fits.logs.values()), trials=fits.trials)
    return {"report": report_file and str(report_file), "figures": [str(figure) for figure in figures]}


def _figures(fits: Fits, folder: Path) -> list[Path]:
    figures: list[Path] = []
    for stage, fit in fits.stages.items():
        figures += sysid.plots.identification(fit, folder / stage)
    if fits.trials:
        figures.append(sysid.plots.repeated(fits.trials, fits.answer.free_names, folder / "repeated.svg"))
    return figures


def _document(fits: Fits) -> dict[str, Any]:
    logs = {path: found.as_dict() for path, found in fits.logs.items()}
    if len(fits.stages) > 1:
        stages = {stage: fit.as_dict() for stage, fit in fits.stages.items()}
        head = {"schema": "goshawk-identification-stages", "version": STAGES_SCHEMA_VERSION}
        head |= {"verdict": fits.verdict.as_dict(), "converged": fits.converged}
        return head | {"stages": stages, "logs": logs}
    trials = [{key: fit.as_dict()[key] for key in ("converged", "parameters")} for fit in fits.trials]
    return (
        fits.answer.as_dict()
        | {"verdict": fits.verdict.as_dict(), "logs": logs}
        | ({"trials": trials} if trials else {})
    )


def _physical(fits: Fits) -> str:
    """Whether every parameter can be a vehicle's, in words."""
    mark = vehicle.purpose.mark_sentence(fits.answer.vehicle)
    return f"not physical: {mark}" if mark else "physical: every parameter is within what mass and size allow"


def _screen(fits: Fits) -> Screen:
    screen = Screen()
    screen.line(f"verdict: {fits.verdict.use}")
    for reason in fits.verdict.reasons:
        screen.line(f"  {fit_options.worded(reason)}")
    if fits.predicts is not None:
        screen.line(fits.predicts.sentence)
    screen.line(_physical(fits))
    if fits.cause is not None:
        screen.line(f"likely cause, by a trial: {fits.cause.sentence}")
    for sentence in fits.said:
        screen.line(f"note: {sentence}")
    for stage, fit in fits.stages.items():
        rows = [
            (
                e.name,
                f"{e.value:.5g}",
                f"{e.std_robust:.2g}" if e.status == "free" else e.status,
                e.unit,
                f"{e.start:.4g}",
            )
            for e in fit.parameters
            if not stage or e.status == "free"
        ]
        heads = ("parameter", "value", "robust std", "unit", "started from")
        screen.table(f"identified: {stage}" if stage else "identified", heads, rows)
        for finding in (f for f in fit.findings if f not in (*fit.verdict.against, *fit.verdict.doubts)):
            screen.line(f"note: {fit_options.worded(finding)}")
        steps = len(fit.solution.record)
        screen.line(f"converged in {steps} steps" if fit.converged else f"NOT converged in {steps} steps")
    failed = sum(not trial.converged for trial in fits.trials)
    if failed:
        screen.line(f"{failed} of {len(fits.trials)} trials did not converge")
    return screen
