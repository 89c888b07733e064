"""Propose the next flight, fitted into the project's map: what `goshawk next-flight --map` does."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec.structs import replace

import mapping
import vehicle
from esdf.field import SampledField
from flight import InfeasibleError, InputError, Progress, results, trajectory, within
from flight.project import Project, part_name
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Kind
from gcs_web.learning import proposed
from gcs_web.planning import inputs
from gcs_web.protocol.next_flight import NextFlight
from goshawk.commands.learn import mapped_flight
from goshawk.commands.learn.mapped_flight import MappedRanking
from goshawk.station_jobs import flights
from goshawk.terminal import console
from sysid.diagnosis import diagnose
from sysid.diagnosis.experiment_design import next_flight
from sysid.report import words

PATH_POINTS = 200
"""Of the path in the picture."""


class Arguments(flights.Chosen):
    out: Annotated[str, msgspec.Meta(title="Trajectory", description="Name to save it under")] = "next-flight"
    margin_m: Annotated[float, msgspec.Meta(title="Margin", ge=0.0, le=10.0, extra_json_schema={"unit": "m"})] = 0.15
    accept_doubtful_map: Annotated[bool, msgspec.Meta(title="Propose although the map's verdict is doubtful")] = False
    overwrite: Annotated[bool, msgspec.Meta(title="Replace an existing trajectory (kept beside)")] = False


class Result(msgspec.Struct, frozen=True):
    name: str
    """Of the saved trajectory; empty where no flight in this map answers what is open."""
    candidates: list[str]
    sentence: str


def _written(project: Project, asked: Arguments) -> Path:
    return project.trajectory(part_name(asked.out))


def _check(project: Project, asked: Arguments) -> None:
    flights.check(project, asked)
    results.require_free(_written(project, asked), overwrite=asked.overwrite)
    if not project.map.is_dir():
        raise InputError("this project has no map; make one on the Map step, then propose the flight")


@flights.in_words_of(flights.BOXES)
def _run(folder: Path, asked: Arguments, progress: Progress) -> Result:
    project = Project(folder, "")
    map_hash = proposed.map_hash(project)  # first: an edit made meanwhile must show
    believed, area = vehicle.load(project.vehicle), mapping.open_map(project.map)
    area.require_not_refused()
    doubt = inputs.doubt(area)
    if doubt and not asked.accept_doubtful_map:
        raise InputError(f"{doubt} Make it again, or accept it as it is and propose again")
    stamp = NextFlight(
        "current",
        learn=sorted(asked.learn),
        held_out=sorted(asked.held_out),
        vehicle=vehicle.vehicle_hash(believed),
        logs=flights.contents(folder, asked),
        map=map_hash,
    )
    learn, held_out = flights.logs(folder, asked, progress)
    options = flights.diagnosis_options(asked)
    searching = within(progress, "what is open", 0.0, 0.5)
    found = diagnose(learn, believed, held_out=held_out, auto=True, options=options, progress=searching)
    question = next_flight.ask(found)
    try:
        ranked = mapped_flight.rank_in_map(
            question,
            area.field,
            believed,
            console.body_options(None, asked.margin_m),
            rng=np.random.default_rng(0),
            progress=within(progress, "fit into the map", 0.5, 1.0),
        )
    except InfeasibleError as error:
        proposed.save(folder, replace(stamp, refusal=str(error)))
        return Result("", [candidate.name for candidate in question.candidates], str(error))
    best, path = ranked.flights[0], _written(project, asked)
    path.parent.mkdir(exist_ok=True)
    with results.new_file(path, overwrite=asked.overwrite) as placing:
        trajectory.save(placing.temporary, best.file(asked.out))
    proposed.save(folder, _shown(stamp, asked.out, ranked, area.field))
    return Result(asked.out, list(ranked.candidates), best.sentence + (f". {doubt}" if doubt else ""))


def _shown(stamp: NextFlight, name: str, ranked: MappedRanking, field: SampledField) -> NextFlight:
    best = ranked.flights[0]
    path, middle_m = best.path_world_m, 0.5 * float(best.low_world_m[2] + best.high_world_m[2])
    drawn = path[np.linspace(0, len(path) - 1, min(len(path), PATH_POINTS)).astype(int)]
    return replace(
        stamp,
        name=name,
        manoeuvre=best.proposal.name.replace("_", " "),
        candidates=[words.effect(candidate) for candidate in ranked.candidates],
        size=best.size,
        heading_rad=best.heading_rad,
        duration_s=best.proposal.duration_s,
        top_speed_m_s=best.proposal.top_speed_m_s,
        clearance_m=best.gate.clearance_m,
        required_clearance_m=best.gate.required_clearance_m,
        known_log_odds=best.proposal.known_log_odds,
        expected_log_odds=best.proposal.expected_log_odds,
        needed_log_odds=mapped_flight.SETTLED_LOG_ODDS,
        path_m=drawn.ravel().tolist(),
        section=proposed.section(field, middle_m, best.gate.required_clearance_m),
    )


def _done(desk: Desk, result: Result) -> str:
    desk.show_files()
    if not result.name:
        return result.sentence
    return f"{result.sentence}. Saved as the checked trajectory {result.name}"


KIND = Kind("next_flight", "Propose the next flight", Arguments, _run, _done, flights.choices, _check, writes=_written)
