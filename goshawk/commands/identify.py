"""`goshawk identify`: the vehicle model from flights, with standard errors."""

from pathlib import Path

import click

import sysid
import vehicle
from goshawk import console
from goshawk.flights import load


@click.command()
@click.argument("flights", nargs=-1, required=True, type=click.Path(path_type=Path))
@console.vehicle_option
@console.path_option("--out", "out", "Vehicle file to write.", required=True)
@click.option("--add-effect", "added", multiple=True, help="Add this effect to the model first. Repeatable.")
@click.option("--hold", "held", multiple=True, help="Keep this parameter as it is. Repeatable.")
@click.option("--split-gaps", is_flag=True, help="Fit the pieces between gaps as separate flights.")
@click.option("--hold-unseen", is_flag=True, help="Hold what these flights cannot show, instead of refusing.")
@console.columns_option
@console.path_option("--plots", "plots", "Folder for figures.")
@console.json_option
def command(
    flights: tuple[Path, ...],
    vehicle_file: Path,
    out: Path,
    added: tuple[str, ...],
    held: tuple[str, ...],
    split_gaps: bool,
    hold_unseen: bool,
    columns: Path | None,
    plots: Path | None,
    as_json: bool,
) -> int:
    """Fit the vehicle model to FLIGHTS: joint maximum likelihood over parameters and all states.

    \b
    goshawk identify flights/*.parquet --vehicle vehicle.toml --out fitted.toml
    goshawk identify flights/*.parquet --vehicle vehicle.toml --add-effect rotor_drag_thrust --out with_drag.toml

    FLIGHTS are our own logs (.parquet), PX4's (.ulg), or CSV with --columns. Each is checked first; what looks wrong
    is said, with the fix, and nothing is changed.

    The mass is given, not estimated: pose and rotor speed show only ratios to it. Exit code 1: the fit did not
    converge, and nothing was written.
    """
    believed = vehicle.load(vehicle_file)
    for effect in added:
        believed = believed.with_effect(effect)
    options = sysid.Options(
        held=held, gaps="split" if split_gaps else "refuse", unseen="hold" if hold_unseen else "refuse"
    )
    with console.progress() as report:
        logs = [load(path, columns) for path in flights]
        findings = {str(path): sysid.check_log(log, believed) for path, log in zip(flights, logs, strict=True)}
        for path, found in findings.items():
            for finding in found.findings:
                click.echo(f"{path}: {finding.level}: {finding.sentence}; {finding.fix}", err=True)
        result = sysid.identify(logs, believed, options, progress=report)
    if result.converged:
        vehicle.save(out, result.vehicle)
    figures = sysid.plots.identification(result, plots) if plots is not None else []
    _show(result, out, figures, as_json)
    return 0 if result.converged else 1


def _show(result: sysid.Identification, out: Path, figures: list[Path], as_json: bool) -> None:
    written = str(out) if result.converged else None
    document = result.as_dict() | {"written": written, "figures": [str(f) for f in figures]}
    if as_json:
        console.show("", {}, as_json=True, document=document)
        return
    rows = [
        (e.name, f"{e.value:.5g}", f"{e.std_robust:.2g}" if e.status == "free" else e.status, e.unit, f"{e.start:.4g}")
        for e in result.parameters
    ]
    console.table("identified", ("parameter", "value", "robust std", "unit", "started from"), rows)
    for finding in result.findings:
        click.echo(f"note: {finding}")
    steps = len(document["iterations"])
    click.echo(
        f"converged in {steps} steps; written: {out}" if written else f"NOT converged in {steps} steps; not written"
    )
    for figure in figures:
        click.echo(f"figure: {figure}")
