"""`goshawk next-flight`: the manoeuvre that best separates the candidate effects that earlier flights leave open."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

import mapping
import sysid
import vehicle
from flight import FlightLog, InfeasibleError, InputError, Progress, project, trajectory
from goshawk.commands.learn import kept, mapped_flight
from goshawk.commands.learn.flights import load, refuse_repeated
from goshawk.commands.plan import map_standing
from goshawk.terminal import console, outputs
from planner import PlanOptions
from sysid.diagnosis import diagnose
from sysid.diagnosis.evidence.candidates import require_missing, taken_out
from sysid.diagnosis.examined import examine
from sysid.diagnosis.experiment_design import next_flight
from sysid.diagnosis.experiment_design.next_flight import Proposal, Ranking
from sysid.diagnosis.experiment_design.rehearsal import Room
from sysid.diagnosis.procedure import while_searching
from vehicle import manoeuvres

SUMMARY = "Propose the manoeuvre that best separates the candidate effects."
SCHEMA_VERSION = 2


@click.command()
@click.argument("flights", nargs=-1, required=True, type=click.Path(path_type=Path))
@console.vehicle_option
@click.option("--candidate", "candidates", multiple=True, metavar="NAME", help="Effect in question. Repeatable.")
@click.option("--space", "space", metavar="X,Y,Z", help="Free volume for the vehicle's centre, metres.")
@click.option(
    "--corner",
    "corner",
    metavar="X,Y,Z",
    help="Lowest corner of --space [default: about the origin, 0.5 m up].",
)
@console.path_option("--map", "map_folder", "Map folder: to fit the flight into, in place of --space.")
@console.radius_option
@console.margin_option
@map_standing.accept_option
@click.option("--manoeuvre", "library", multiple=True, metavar="NAME", help="Rank only this manoeuvre. Repeatable.")
@console.path_option("--out", "out", "Waypoints of the best flight to write; with --map its checked trajectory.")
@console.columns_option
@outputs.overwrite_option
@console.common_options
def command(
    flights: tuple[Path, ...],
    vehicle_file: Path,
    candidates: tuple[str, ...],
    space: str | None,
    corner: str | None,
    map_folder: Path | None,
    radius_m: float | None,
    margin_m: float | None,
    accept_doubtful: bool,
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
    goshawk next-flight flights/*.parquet --vehicle vehicle.toml --map map --out next.json

    For two candidates or more the evidence is that which separates them; for one, that which determines its size.
    Without --candidate they are those that the diagnosis of FLIGHTS leaves inconclusive: the kept
    one, or one that is made first. Every manoeuvre is scaled to the space and simulated with the fitted vehicle, and
    its evidence is added to that of FLIGHTS.

    With --map, place, heading and size of every manoeuvre are searched for in the map, with the clearance of `goshawk
    plan`. The one with the most evidence is written as a trajectory that passed the gate.
    """
    outputs.check(out, overwrite=overwrite)
    _check_where(space, corner, map_folder, radius_m, margin_m)
    refuse_repeated(flights, "in FLIGHTS")
    believed = vehicle.load(vehicle_file)
    for name in library:
        manoeuvres.make(name)
    for name in candidates:
        require_missing(name, believed)
    if not candidates:
        candidates, believed = _kept_question(flights, vehicle_file, believed)
    asked = Question(flights, columns, believed, candidates, library)
    if map_folder is not None:
        area = mapping.open_map(map_folder)
        map_standing.require(area, accept_doubtful=accept_doubtful)
        ranked = _ranked_in_map(asked, area, console.body_options(radius_m, margin_m))
        if out is not None:
            with outputs.file(out, overwrite=overwrite) as temporary:
                trajectory.save(temporary, ranked.flights[0].file(out.stem))
        _show_in_map(ranked, out, f"goshawk upload {out}" if out is not None else None, as_json)
    elif space is not None:
        ranking = _ranked_in_space(asked, space, corner)
        chosen = _write(ranking, out, overwrite=overwrite) if out is not None else ranking[0]
        then = f"goshawk plan {out} --map MAP --vehicle {vehicle_file} --out next.json" if out is not None else None
        _show(ranking, chosen, then, out, as_json)


def _kept_question(
    flights: tuple[Path, ...], vehicle_file: Path, believed: vehicle.Vehicle
) -> tuple[tuple[str, ...], vehicle.Vehicle]:
    """Candidates that a kept diagnosis of these flights leaves open, and the vehicle it fitted, without them.

    Without such a diagnosis: no candidates, and the vehicle as it is.
    """
    diagnosis = kept.newest("diagnosis", flights, vehicle_file)
    if diagnosis is None or diagnosis.vehicle is None or not diagnosis.more["in_doubt"]:
        return (), believed
    fitted = diagnosis.vehicle
    for name in diagnosis.more["in_doubt"]:
        if (effect := name.partition("[")[0]) in fitted.effects:
            fitted = taken_out(fitted, effect)
    return tuple(diagnosis.more["in_doubt"]), fitted


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of which flights."""

    flights: tuple[Path, ...]
    columns: Path | None
    believed: vehicle.Vehicle
    candidates: tuple[str, ...]
    """Effects in question; none: those that a diagnosis leaves inconclusive."""
    library: tuple[str, ...]
    """Manoeuvres to rank; none: all."""

    def logs(self) -> list[FlightLog]:
        return [load(path, self.columns) for path in self.flights]


def _ranked_in_map(asked: Question, area: mapping.Map, how: PlanOptions) -> mapped_flight.MappedRanking:
    """Manoeuvres with their place in a map, the one with the most evidence first."""
    logs = asked.logs()
    with console.progress() as progress:
        return mapped_flight.rank_in_map(
            next_flight.ask(_model(logs, asked, progress), asked.candidates or None),
            area.field,
            asked.believed,
            how,
            library=asked.library or None,
            rng=np.random.default_rng(0),
            progress=progress,
        )


def _ranked_in_space(asked: Question, space: str, corner: str | None) -> Ranking:
    """Manoeuvres scaled to a free volume, the one with the most evidence first.

    Raises:
        InputError: the volume is none.
        InfeasibleError: no manoeuvre can be flown in it.
    """
    size, low = _three("--space", space), _three("--corner", corner) if corner else None
    Room.of(size, low)
    logs = asked.logs()
    with console.progress() as progress:
        ranking = next_flight.rank(
            _model(logs, asked, progress),
            candidates=asked.candidates or None,
            free_volume_m=size,
            corner_world_m=low,
            library=asked.library or None,
            rng=np.random.default_rng(0),
            progress=progress,
        )
    if not len(ranking):
        reasons = "; ".join(f"{name}: {why}" for name, why in ranking.skipped)
        raise InfeasibleError(f"no manoeuvre can be flown in {space} m: {reasons}")
    return ranking


def _three(option: str, text: str) -> tuple[float, float, float]:
    x, y, z = console.numbers(option, text, 3)
    return x, y, z


def _check_where(
    space: str | None, corner: str | None, map_folder: Path | None, radius_m: float | None, margin_m: float | None
) -> None:
    if (space is None) == (map_folder is None):
        raise InputError("give either --space X,Y,Z or --map MAP: where the vehicle may fly")
    if map_folder is not None and corner is not None:
        raise InputError("--corner goes with --space; with --map the place is searched for")
    if map_folder is None and not (radius_m is None and margin_m is None):
        raise InputError("--radius and --margin go with --map; --space is for the vehicle's centre")


def _model(logs: list[FlightLog], asked: Question, progress: Progress) -> Any:
    """What the question is asked of: named candidates need no diagnosis."""
    if not asked.candidates:
        return diagnose(logs, asked.believed, auto=True, progress=progress)
    return examine(sysid.identify(logs, asked.believed, while_searching(sysid.Options()), progress=progress))


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


def _show_in_map(ranked: mapped_flight.MappedRanking, out: Path | None, then: str | None, as_json: bool) -> None:
    best = ranked.flights[0]
    document = {
        "schema": "goshawk-next-flight",
        "version": SCHEMA_VERSION,
        "candidates": list(ranked.candidates),
        "proposals": [each.as_dict() for each in ranked.flights],
        "skipped": dict(ranked.skipped),
        "chosen": best.proposal.name,
        "written": str(out) if out is not None else None,
        "then": then,
    }
    if as_json:
        console.show("", {}, as_json=True, document=document)
        return
    rows = [
        (p.name, f"{each.size:.0%}", f"{each.gate.clearance_m:.2f}", p.duration_s, p.expected_log_odds)
        for each in ranked.flights
        for p in (each.proposal,)
    ]
    heads = ("manoeuvre", "size", "clearance m", "seconds", "log odds")
    console.table(f"next flight in the map for {' or '.join(ranked.candidates)}", heads, rows)
    for name, why in ranked.skipped:
        click.echo(f"not {name}: {why}")
    click.echo(best.sentence)
    if out is not None:
        click.echo(f"written: {out}")
        click.echo(f"next: {then}")
