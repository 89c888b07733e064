"""`goshawk next-flight`: the manoeuvre that best separates the candidate effects that earlier flights leave open."""

from pathlib import Path
from typing import Any

import click
import numpy as np

import sysid
import vehicle
from flight import FlightLog, InfeasibleError, InputError, project
from goshawk import console, outputs
from goshawk.flights import load
from sysid.diagnosis import diagnose, next_flight
from sysid.diagnosis.examined import examine
from sysid.diagnosis.next_flight import Proposal, Ranking
from sysid.diagnosis.procedure import while_searching
from sysid.diagnosis.rehearsal import Room
from vehicle import manoeuvres

SCHEMA_VERSION = 2


@click.command()
@click.argument("flights", nargs=-1, required=True, type=click.Path(path_type=Path))
@console.vehicle_option
@click.option("--candidate", "candidates", multiple=True, metavar="NAME", help="Effect in question. Repeatable.")
@click.option("--space", "space", required=True, metavar="X,Y,Z", help="Free volume for the vehicle's centre, metres.")
@click.option(
    "--corner",
    "corner",
    metavar="X,Y,Z",
    help="Lowest corner of --space [default: about the origin, 0.5 m up].",
)
@click.option("--manoeuvre", "library", multiple=True, metavar="NAME", help="Rank only this manoeuvre. Repeatable.")
@console.path_option("--out", "out", "Waypoints of the best flight to write, for goshawk plan.")
@console.columns_option
@outputs.overwrite_option
@console.json_option
def command(
    flights: tuple[Path, ...],
    vehicle_file: Path,
    candidates: tuple[str, ...],
    space: str,
    corner: str | None,
    library: tuple[str, ...],
    out: Path | None,
    columns: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Rank manoeuvres by expected evidence, per second, on candidate effects that FLIGHTS leave inconclusive.

    \b
    goshawk next-flight flights/*.parquet --vehicle vehicle.toml --space 6,6,3
    goshawk next-flight flights/*.parquet --vehicle vehicle.toml --space 6,6,3 \\
        --candidate rotor_drag_thrust --candidate rotor_drag_speed --out waypoints.json
    goshawk plan waypoints.json --map map --vehicle vehicle.toml --out next.json

    For two candidates or more the evidence is that which separates them; for one, that which determines its size.
    Without --candidate the flights are diagnosed first, and the candidates are those left inconclusive. Every manoeuvre
    is scaled to the space and simulated with the fitted vehicle, and its evidence is added to that of FLIGHTS.
    """
    outputs.check(out, overwrite=overwrite)
    size, low = _three("--space", space), _three("--corner", corner) if corner else None
    Room.of(size, low)
    for name in library:
        manoeuvres.make(name)
    believed = vehicle.load(vehicle_file)
    logs = [load(path, columns) for path in flights]
    with console.progress() as progress:
        ranking = next_flight.rank(
            _examined(logs, believed, progress)
            if candidates
            else diagnose(logs, believed, auto=True, progress=progress),
            candidates=candidates or None,
            free_volume_m=size,
            corner_world_m=low,
            library=library or None,
            rng=np.random.default_rng(0),
            progress=progress,
        )
    if not len(ranking):
        reasons = "; ".join(f"{name}: {why}" for name, why in ranking.skipped)
        raise InfeasibleError(f"no manoeuvre can be flown in {space} m: {reasons}")
    chosen = _write(ranking, out, overwrite=overwrite) if out is not None else ranking[0]
    then = f"goshawk plan {out} --map MAP --vehicle {vehicle_file} --out next.json" if out is not None else None
    _show(ranking, chosen, then, out, as_json)


def _three(option: str, text: str) -> tuple[float, float, float]:
    x, y, z = console.numbers(option, text, 3)
    return x, y, z


def _examined(logs: list[FlightLog], believed: vehicle.Vehicle, progress: Any) -> Any:
    return examine(sysid.identify(logs, believed, while_searching(sysid.Options()), progress=progress))


def _write(ranking: Ranking, out: Path, *, overwrite: bool) -> Proposal:
    """Write the waypoints of the best proposal that has any."""
    for proposal in ranking:
        try:
            waypoints = proposal.waypoints()
        except InputError:
            continue
        with outputs.file(out, overwrite=overwrite) as temporary:
            project.save_waypoints(temporary, waypoints)
        return proposal
    raise InputError("every manoeuvre that fits into the space hovers; there are no waypoints to write")


def _show(ranking: Ranking, chosen: Proposal, then: str | None, out: Path | None, as_json: bool) -> None:
    if as_json:
        document = {
            "schema": "goshawk-next-flight",
            "version": SCHEMA_VERSION,
            "candidates": list(ranking.candidates),
            "proposals": [proposal.as_dict() for proposal in ranking],
            "skipped": dict(ranking.skipped),
            "chosen": chosen.name,
            "written": str(out) if out is not None else None,
            "then": then,
        }
        console.show("", {}, as_json=True, document=document)
        return
    rows = [(p.name, p.duration_s, p.top_speed_m_s, p.expected_log_odds, p.per_second) for p in ranking]
    heads = ("manoeuvre", "seconds", "m/s at most", "log odds", "per second")
    console.table(f"next flight for {' or '.join(ranking.candidates)}", heads, rows)
    for name, why in ranking.skipped:
        click.echo(f"not {name}: {why}")
    click.echo(chosen.sentence)
    if out is not None:
        click.echo(f"written: {out}")
        click.echo(f"next: {then}")
