"""`goshawk plan batch`: every waypoint file of a folder to a checked trajectory."""

from pathlib import Path

import click

import vehicle
from flight import file_format
from goshawk.commands.plan import batch, batch_work
from goshawk.commands.plan.plan_options import Asked, plan_options
from goshawk.terminal import console


@click.command("batch")
@click.argument("missions", type=click.Path(path_type=Path))
@console.path_option("--out", "out", "Folder of trajectories and results to write.", required=True)
@plan_options
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes that work at a time.")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers do the work instead.")
@console.common_options
def command(missions: Path, out: Path, asked: Asked, jobs: int, scheduler: str | None, as_json: bool) -> int:
    """Plan every waypoint file in the folder MISSIONS.

    \b
    goshawk plan batch missions --jobs 4 --map map --vehicle vehicle.toml --out plans
    goshawk plan batch missions --scheduler tcp://192.168.1.10:8786 --map map --vehicle vehicle.toml --out plans

    What is planned already, of the same file, map, vehicle and options, is not planned again: the same command goes on
    after an interruption. Exit code 1: a mission has no plan; results.json in --out gives the reason of each.
    """
    drone = vehicle.load(asked.vehicle_file)
    job = asked.job(drone, out)
    asked.opened_map()
    with console.progress() as report:
        rows = batch.run(batch.mission_files(missions), job, jobs=jobs, scheduler=scheduler, progress=report)
    if as_json:
        mark = {vehicle.purpose.KEY: vehicle.purpose.not_for_design(drone)}
        click.echo(file_format.json_text({"written": str(job.out), "missions": rows, **mark}), nl=False)
    else:
        heads = ("mission", "status", "duration, s", "clearance, m", "could hide", "reason")
        lines = [
            [row["name"], row["status"], row["duration_s"], row["clearance_m"], _could_hide(row), row["reason"]]
            for row in rows
        ]
        console.table(f"plans in {job.out}", heads, [["" if cell is None else cell for cell in line] for line in lines])
    if mark := vehicle.purpose.mark_sentence(drone):
        console.note(f"note: the rotor margins rest on a model {mark}")
    missed = sum(row["status"] != "planned" for row in rows)
    if missed:
        where = job.out / batch.RESULTS
        click.echo(
            f"goshawk: {missed} of {len(rows)} missions have no plan; {where} gives the reason of each", err=True
        )
        return 1
    return 0


def _could_hide(row: batch_work.Row) -> str | None:
    """How thick an obstacle could hide near a planned mission, as a cell; None where there is no plan."""
    if row["status"] != "planned":
        return None
    if row["could_hide_share"] is None:
        return "not known"
    thickness_m = row["could_hide_m"]
    return "of any thickness" if thickness_m is None else f"{1e3 * thickness_m:.0f} mm"
