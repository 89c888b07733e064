"""`goshawk compare`: predictions of vehicle models against measured flights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

import sysid
import vehicle
from flight import FlightLog, FloatArray, InputError, Progress
from goshawk.commands.learn import fit_options, kept, lasting_offers
from goshawk.commands.learn.flights import load, refuse_repeated
from goshawk.commands.learn.model_change import prediction_error
from goshawk.terminal import console, outputs
from goshawk.terminal.screen import Screen
from sysid.estimator.result import CHANNELS, SPAN_S
from sysid.estimator.validation.better import predicts
from sysid.estimator.validation.comparison import HORIZONS_S, QUANTITIES
from sysid.estimator.validation.protocol import KNOWS, PROTOCOLS

SUMMARY = "Compare vehicle models with measured flights."
KIND = "comparison"
READING = ("split_gaps", "robust", "gravity_m_s2", "most_steps", "most_nodes")
"""Options that matter where nothing is refitted: they say how flights are read and smoothed."""


@click.command()
@click.argument("flights", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--vehicle",
    "vehicle_files",
    multiple=True,
    required=True,
    type=click.Path(path_type=Path),
    help="Vehicle file; give several to compare them side by side.",
)
@click.option(
    "--protocol",
    "protocol_name",
    type=click.Choice(sorted(PROTOCOLS)),
    help="Also the figures that publications give: mean absolute error 0.1 s (h10) or 0.5 s (h50) after every state.",
)
@click.option(
    "--train",
    "training",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Refit the models to this flight first; predictors that learn, learn from it too. Repeatable.",
)
@fit_options.fit_options()
@console.columns_option
@console.path_option("--report", "report_file", "HTML page to write: tables and figures in one file.")
@console.path_option("--plots", "plots", "Folder for figures (SVG).")
@outputs.overwrite_option
@console.common_options
def command(
    flights: tuple[Path, ...],
    vehicle_files: tuple[Path, ...],
    protocol_name: str | None,
    training: tuple[Path, ...],
    fit: fit_options.Chosen,
    columns: Path | None,
    report_file: Path | None,
    plots: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Compare models with FLIGHTS, preferably held-out ones.

    \b
    goshawk compare flights/walk.parquet --vehicle fitted.toml
    goshawk compare flights/walk.parquet --vehicle fitted.toml --vehicle with_drag.toml --report compare.html
    goshawk compare flights/*.parquet --vehicle fitted.toml --protocol h50

    From many points of each flight the model is integrated with the measured rotor speeds; the table shows its error
    after 0.1 to 1 s. Figures and report show the residual force and torque: over time with a confidence band, against
    the variable that explains them, and along the path.

    --protocol h50 adds the figures that publications give: the mean absolute error 0.5 s after every measured state.
    Each model stands beside simple predictors: velocity and rate held (zero), or the model's force with the rate held.
    Those that learn (past carried, closed loop) learn from the other flights, or from --train.

    With --train, models are refitted to those flights before they are compared, with the options of `goshawk identify`.
    No flight may be among both.
    """
    outputs.check(report_file, overwrite=overwrite, folders=[plots])
    files = {path: fit_options.at_place(fit, vehicle.load(path)) for path in vehicle_files}
    models = {path.stem: model for path, model in files.items()}
    if len(models) < len(vehicle_files):
        raise InputError("two vehicle files have the same name; rename one: the table names models by their files")
    _check_options(fit, training)
    refuse_repeated((*flights, *training), "in FLIGHTS or with --train")
    key = kept.key((flights, training), columns, vehicle_files, (sorted(fit.items()), protocol_name))
    result = None if report_file or plots else kept.find(KIND, flights[0], key)
    figures: list[Path] = []
    if result is None:
        logs, taught = ([load(path, columns) for path in paths] for paths in (flights, training))
        options = {name: fit_options.read(fit, model) for name, model in models.items()}
        with console.progress() as report:
            found = _compare(logs, taught, models, options, protocol_name, report)
        lasts = lasting_offers.offers(logs, files)
        result = kept.Kept(_document(found) | {"lasting": lasts[0], "next": lasts[1]}, _screen(found, *lasts))
        kept.keep(KIND, flights[0], key, result)
        figures = _write(found, report_file, plots, overwrite=overwrite)
    written = {"figures": [str(figure) for figure in figures], "report": report_file and str(report_file)}
    if as_json:
        console.show("", {}, as_json=True, document={**result.document, **written})
        return
    result.screen.show()
    for path in (*figures, report_file):
        if path is not None:
            click.echo(f"written: {path}")


@dataclass(frozen=True, slots=True)
class Found:
    """Everything that was found about the models."""

    errors: sysid.Comparison
    wrench: sysid.WrenchErrors
    judged: sysid.Judged | None
    """By the protocol; None where none was asked for."""
    fits: Mapping[str, sysid.Identification]
    """Of the models to the flights of --train; empty without."""


def _compare(
    logs: Sequence[FlightLog],
    taught: Sequence[FlightLog],
    models: Mapping[str, vehicle.Vehicle],
    options: Mapping[str, sysid.Options],
    protocol: str | None,
    report: Progress,
) -> Found:
    """Refit the models to `taught` where there are any, and compare them on `logs`."""
    fits = {n: sysid.identify(taught, v, options[n], progress=report) for n, v in models.items()} if taught else {}
    models = {name: found.vehicle for name, found in fits.items()} or models
    reading = next(iter(options.values()))
    errors = sysid.compare(logs, models, reading, progress=report)
    wrench = sysid.wrench_errors(logs, models, reading)
    judged = None
    if protocol is not None:
        judged = sysid.judge(logs, models, PROTOCOLS[protocol], reading, training=taught, progress=report)
    return Found(errors, wrench, judged, fits)


def _write(found: Found, report_file: Path | None, plots: Path | None, *, overwrite: bool) -> list[Path]:
    """Write the requested files, each whole or not at all; returns the figures."""
    figures: list[Path] = []
    if plots is not None:
        with outputs.pictures(plots, overwrite=overwrite) as drawn:
            figures = [drawn.placed(figure) for figure in sysid.plots.comparison(found.errors, drawn.temporary)]
    if report_file is not None:
        with outputs.file(report_file, overwrite=overwrite) as temporary:
            sysid.report.write_comparison(temporary, found.errors, found.wrench, found.judged)
    return figures


def _document(found: Found) -> dict[str, Any]:
    return found.errors.as_dict() | {
        "protocol": found.judged and found.judged.as_dict(),
        "wrench": found.wrench.as_dict(),
        "refitted": {name: fit.verdict.as_dict() for name, fit in found.fits.items()},
    }


def _screen(found: Found, lasting: Sequence[str], commands: Sequence[str]) -> Screen:
    screen = Screen()
    heads = ("model", "error of", *(f"after {h:g} s" for h in HORIZONS_S))
    rows = [
        (model, quantity, *(prediction_error(quantity, error) for error in errors))
        for model, quantities in found.errors.errors.items()
        for quantity, errors in quantities.items()
    ]
    screen.table(f"open-loop prediction error, rms of {found.errors.predictions} predictions", heads, rows)
    _show_verdicts(screen, found)
    _show_wrench(screen, found.wrench, found.errors.disturbance_rms())
    for sentence in lasting:
        screen.line(sentence)
    for command in commands:
        screen.line(f"next, {command}")
    if commands:
        screen.line("(a preview; without --dry-run it is written, and `goshawk vehicle undo` takes it back)")
    if found.judged is not None:
        _show_protocol(screen, found.judged)
    for name, fit in found.fits.items():
        screen.line(f"{name}: the fit to --train is {fit.verdict.sentence}")
    judged = found.judged.findings if found.judged is not None else ()
    own = (*found.errors.remarks, *found.errors.left_out, *found.wrench.not_converged)
    for remark in dict.fromkeys((*own, *judged)):
        screen.line(f"note: {remark}")
    return screen


def _show_verdicts(screen: Screen, found: Found) -> None:
    """How each model predicts beside the first, and what it is not for."""
    first, *others = found.errors.models
    for name in others:
        judged = predicts(found.errors, first, name, "these flights")
        screen.line(f"{name} {judged.sentence.replace('the model given', first)}")
    for name, model in found.errors.models.items():
        if mark := vehicle.purpose.mark_sentence(model):
            screen.line(f"{name} is {mark}")


def _check_options(fit: fit_options.Chosen, training: tuple[Path, ...]) -> None:
    """Refuse what has no meaning: without a refit no parameter is estimated."""
    context = click.get_current_context()
    idle = [name for name in fit_options.given(fit) if name not in READING]
    if idle and not training:
        options = {p.name: p.opts[0] for p in context.command.params}
        raise InputError(f"only a refit reads {' and '.join(options[n] for n in idle)}; give --train FLIGHT too")


def _show_wrench(screen: Screen, wrench: sysid.WrenchErrors, disturbance: FloatArray | None) -> None:
    heads = ("model", *(f"{channel} ({'N' if channel[0] == 'F' else 'mN m'})" for channel in CHANNELS))
    scale = [1.0 if channel[0] == "F" else 1e3 for channel in CHANNELS]
    rows = [("none (measured)", *(f"{s * size:.3g}" for s, size in zip(scale, wrench.size, strict=True)))]
    for model, rmse in wrench.rmse.items():
        both = zip(scale, rmse, wrench.explained[model], strict=True)
        rows.append((model, *(f"{s * error:.3g} ({share:.0%})" for s, error, share in both)))
    if disturbance is not None:
        rows.append(("measured disturbance", *(f"{s * size:.3g}" for s, size in zip(scale, disturbance, strict=True))))
    by = "accelerometer" if wrench.accelerometer else "measured velocity"
    screen.table(
        f"rms error of force (by {by}) and moment, means over {SPAN_S:g} s (share of the variance explained; "
        "negative: worse than the mean)",
        heads,
        rows,
    )


def _show_protocol(screen: Screen, judged: sysid.Judged) -> None:
    heads = ("predictor", *(f"{quantity} ({unit})" for quantity, unit in QUANTITIES.items()))
    rows = [(way.name, *(f"{error:.3f}" for error in judged.pooled(way).values())) for way in judged.errors]
    horizon_s, starts = judged.protocol.horizon_s, sum(judged.starts)
    screen.table(f"after {horizon_s:g} s from {starts} measured states, mean absolute error", heads, rows)
    screen.line(f"predictors: {KNOWS}")
