"""`goshawk compare`: predictions of vehicle models against measured flights."""

from pathlib import Path

import click

import sysid
import vehicle
from flight import InputError
from goshawk import console, fit_options, outputs
from goshawk.flights import load, refuse_repeated
from goshawk.model_change import prediction_error
from sysid.estimator.comparison import HORIZONS_S, QUANTITIES
from sysid.estimator.protocol import KNOWS, PROTOCOLS
from sysid.estimator.result import CHANNELS, SPAN_S

READING = ("split_gaps", "robust", "most_steps")
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
    help="Predict as published: h50 is 0.5 s from every state, mean absolute error; zero and rate held beside.",
)
@click.option(
    "--train",
    "training",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Flight to learn from: models are refitted to these first, and what predictors learn is learned here.",
)
@fit_options.fit_options(hold_unidentifiable=True)
@console.columns_option
@console.path_option("--report", "report_file", "HTML page to write: tables and figures in one file.")
@console.path_option("--plots", "plots", "Folder for figures (SVG).")
@outputs.overwrite_option
@console.json_option
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

    --protocol h50 adds the figures that publications give: 0.5 s from every measured state, mean absolute error, beside
    a model that holds velocity and rate (zero) and the model's force with the rate held. Predictors that learn (past
    carried, closed loop) learn from the other flights, or from --train.

    With --train, models are refitted to those flights before they are compared, with the options of `goshawk identify`.
    No flight may be among both.
    """
    outputs.check(report_file, overwrite=overwrite, folders=[plots])
    models = {path.stem: vehicle.load(path) for path in vehicle_files}
    if len(models) < len(vehicle_files):
        raise InputError("two vehicle files have the same name; rename one: the table names models by their files")
    _check_options(fit, training)
    refuse_repeated((*flights, *training), "in FLIGHTS or with --train")
    logs, taught = ([load(path, columns) for path in paths] for paths in (flights, training))
    options = {name: fit_options.read(fit, model) for name, model in models.items()}
    fits: dict[str, sysid.Identification] = {}
    with console.progress() as report:
        if taught:
            fits = {n: sysid.identify(taught, v, options[n], progress=report) for n, v in models.items()}
            models = {name: found.vehicle for name, found in fits.items()}
        reading = next(iter(options.values()))
        result = sysid.compare(logs, models, reading, progress=report)
        wrench = sysid.wrench_errors(logs, models, reading)
        judged = None
        if protocol_name is not None:
            protocol = PROTOCOLS[protocol_name]
            judged = sysid.judge(logs, models, protocol, reading, training=taught, progress=report)
    figures: list[Path] = []
    if plots is not None:
        with outputs.pictures(plots, overwrite=overwrite) as drawn:
            figures = [drawn.placed(figure) for figure in sysid.plots.comparison(result, drawn.temporary)]
    if report_file is not None:
        with outputs.file(report_file, overwrite=overwrite) as temporary:
            sysid.report.write_comparison(temporary, result, wrench, judged)
    if as_json:
        document = result.as_dict() | {"figures": [str(f) for f in figures]}
        document |= {"report": report_file and str(report_file), "protocol": judged and judged.as_dict()}
        document["wrench"] = wrench.as_dict()
        document["refitted"] = {name: found.verdict.as_dict() for name, found in fits.items()}
        console.show("", {}, as_json=True, document=document)
        return
    heads = ("model", "error of", *(f"after {h:g} s" for h in HORIZONS_S))
    rows = [
        (model, quantity, *(prediction_error(quantity, error) for error in errors))
        for model in models
        for quantity, errors in result.errors[model].items()
    ]
    console.table(f"open-loop prediction error, rms of {result.predictions} predictions", heads, rows)
    _show_wrench(wrench)
    if judged is not None:
        _show_protocol(judged)
    for name, found in fits.items():
        click.echo(f"{name}: the fit to --train is {found.verdict.sentence}")
    for remark in dict.fromkeys((*result.remarks, *result.left_out, *(judged.findings if judged else ()))):
        click.echo(f"note: {remark}")
    for figure in figures:
        click.echo(f"figure: {figure}")
    if report_file is not None:
        click.echo(f"written: {report_file}")


def _check_options(fit: fit_options.Chosen, training: tuple[Path, ...]) -> None:
    """Refuse what has no meaning: without a refit no parameter is estimated."""
    context = click.get_current_context()
    idle = [name for name in fit_options.given(fit) if name not in READING]
    if idle and not training:
        options = {p.name: p.opts[0] for p in context.command.params}
        raise InputError(f"only a refit reads {' and '.join(options[n] for n in idle)}; give --train FLIGHT too")


def _show_wrench(wrench: sysid.WrenchErrors) -> None:
    heads = ("model", *(f"{channel} ({'N' if channel[0] == 'F' else 'mN m'})" for channel in CHANNELS))
    scale = [1.0 if channel[0] == "F" else 1e3 for channel in CHANNELS]
    rows = [("none (measured)", *(f"{s * size:.3g}" for s, size in zip(scale, wrench.size, strict=True)))]
    for model, rmse in wrench.rmse.items():
        both = zip(scale, rmse, wrench.explained[model], strict=True)
        rows.append((model, *(f"{s * error:.3g} ({share:.0%})" for s, error, share in both)))
    by = "accelerometer" if wrench.accelerometer else "measured velocity"
    console.table(f"rms error of force (by {by}) and moment, means over {SPAN_S:g} s (share explained)", heads, rows)


def _show_protocol(judged: sysid.Judged) -> None:
    heads = ("predictor", *(f"{quantity} ({unit})" for quantity, unit in QUANTITIES.items()))
    rows = [(way.name, *(f"{error:.3f}" for error in judged.pooled(way).values())) for way in judged.errors]
    horizon_s, starts = judged.protocol.horizon_s, sum(judged.starts)
    console.table(f"after {horizon_s:g} s from {starts} measured states, mean absolute error", heads, rows)
    click.echo(f"what each knows: {KNOWS}")
