"""`goshawk preflight batch`: plans, vehicles and winds, each combination flown many times in simulation."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import click

import vehicle
from flight import file_format
from goshawk.commands.plan import batch
from goshawk.commands.plan.batch_work import Row
from goshawk.commands.preflight import case
from goshawk.commands.preflight.options import Asked, preflight_options
from goshawk.terminal import console


@click.command("batch")
@click.argument("plans", nargs=-1, required=True, type=click.Path(path_type=Path))
@console.map_option
@click.option(
    "--vehicle",
    "vehicle_files",
    type=click.Path(path_type=Path),
    multiple=True,
    required=True,
    help="Vehicle file; may be given again.",
)
@console.path_option("--out", "out", "Folder of results to write.", required=True)
@click.option(
    "--wind",
    "winds",
    multiple=True,
    help="Steady wind: its speed, from anywhere, or x,y,z, m/s [default: none, or as of --like]; may be given again.",
)
@preflight_options
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes that work at a time.")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers do the work instead.")
@console.common_options
def command(
    plans: tuple[Path, ...],
    map_folder: Path,
    vehicle_files: tuple[Path, ...],
    out: Path,
    winds: tuple[str, ...],
    jobs: int,
    scheduler: str | None,
    asked: Asked,
    as_json: bool,
) -> int:
    """Preflight every plan in the folders PLANS, for the vehicle that it was checked for, in each wind.

    \b
    goshawk preflight batch plans --map map --vehicle vehicle.toml --wind 0 --wind 3 --out preflown
    goshawk preflight batch plans --scheduler tcp://192.168.1.10:8786 --map map --vehicle vehicle.toml --out preflown

    What is flown already, of the same files and options, is not flown again: the same command goes on after an
    interruption. Exit code 1: a case is no go; results.json in --out gives the reason of each.
    """
    alone = jobs == 1 and scheduler is None
    like = asked.like({path: vehicle.load(path) for path in vehicle_files}, winds[0] if winds else None)
    options = replace(asked.flown(like=like), threads=None if alone else 1)
    job = case.Job(map_folder, options, out, asked.overwrite, like=like)
    cases = case.cases_of(plans, vehicle_files, list(dict.fromkeys(winds or (f"{like.wind_m_s:.3g}",))))
    with console.progress() as report:
        rows = batch.run(cases, job, jobs=jobs, scheduler=scheduler, progress=report)
    if as_json:
        click.echo(file_format.json_text({"written": str(out), "preflights": rows, **job.beside()}), nl=False)
    else:
        heads = ("plan", "vehicle", "wind", "", "lost", "risk at most", "1 % clearance, m", "decides most, or why not")
        console.table(f"preflights in {out}", heads, [_line(row) for row in rows])
    for path in vehicle_files:
        if mark := vehicle.purpose.mark_sentence(vehicle.load(path)):
            console.note(f"note: {path.name} is a model {mark}")
    counted = Counter(row["status"] for row in rows)
    if counted[case.GO] < len(rows):
        missed = len(rows) - counted[case.GO]
        where = out / batch.RESULTS
        click.echo(f"goshawk: {missed} of {len(rows)} are no go; {where} gives the reason of each", err=True)
        return 1
    return 0


def _line(row: Row) -> list[object]:
    """A row of the summary."""
    begun = [row["plan"], row["vehicle"], row["wind"], row["status"]]
    if row["flights"] is None:
        return [*begun, "", "", "", row["reason"]]
    near = row["clearance_q01_m"]
    share = row["dominating_share"]
    decides = "" if share is None else f"{row['dominating']} {100.0 * share:.0f} %"
    lost = "by levels" if row["lost"] is None else f"{row['lost']} of {row['flights']}"
    return [*begun, lost, f"{row['risk_upper95']:.1e}", "" if near is None else f"{near:.3f}", decides]
