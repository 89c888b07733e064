"""`goshawk compare`: predictions of vehicle models against measured flights."""

from pathlib import Path

import click

import sysid
import vehicle
from flight import InputError
from goshawk import console, outputs
from goshawk.flights import load
from goshawk.model_change import prediction_error
from sysid.estimator.comparison import HORIZONS_S


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
@console.columns_option
@console.path_option("--report", "report_file", "HTML page to write: tables and figures in one file.")
@console.path_option("--plots", "plots", "Folder for figures (SVG).")
@outputs.overwrite_option
@console.json_option
def command(
    flights: tuple[Path, ...],
    vehicle_files: tuple[Path, ...],
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

    From many points of each flight the model is integrated with the measured rotor speeds; the table shows its error
    after 0.1 to 1 s. Figures and report show the residual force and torque: over time with a confidence band, against
    the variable that explains them, and along the path.
    """
    outputs.check(report_file, overwrite=overwrite, folders=[plots])
    models = {path.stem: vehicle.load(path) for path in vehicle_files}
    if len(models) < len(vehicle_files):
        raise InputError("two vehicle files have the same name; rename one: the table names models by their files")
    with console.progress() as report:
        result = sysid.compare([load(path, columns) for path in flights], models, progress=report)
    figures: list[Path] = []
    if plots is not None:
        with outputs.pictures(plots, overwrite=overwrite) as drawn:
            figures = [drawn.placed(figure) for figure in sysid.plots.comparison(result, drawn.temporary)]
    if report_file is not None:
        with outputs.file(report_file, overwrite=overwrite) as temporary:
            sysid.report.write_comparison(temporary, result)
    if as_json:
        document = result.as_dict() | {"figures": [str(f) for f in figures]}
        document |= {"report": report_file and str(report_file)}
        console.show("", {}, as_json=True, document=document)
        return
    heads = ("model", "error of", *(f"after {h:g} s" for h in HORIZONS_S))
    rows = [
        (model, quantity, *(prediction_error(quantity, error) for error in errors))
        for model in models
        for quantity, errors in result.errors[model].items()
    ]
    console.table(f"open-loop prediction error, rms of {result.predictions} predictions", heads, rows)
    for remark in result.remarks:
        click.echo(f"note: {remark}")
    for figure in figures:
        click.echo(f"figure: {figure}")
    if report_file is not None:
        click.echo(f"written: {report_file}")
