"""Propose the next flight, fitted into the project's map: what `goshawk next-flight --map` does."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

import mapping
import vehicle
from flight import InputError, Progress, results, trajectory, within
from flight.project import Project, part_name
from gcs_web import inputs
from gcs_web.desk import Desk
from gcs_web.jobs import Kind
from goshawk import console, mapped_flight
from goshawk.station_jobs import flights
from sysid.diagnosis import diagnose, next_flight
from sysid.estimator.options import Options


class Arguments(flights.Chosen):
    out: Annotated[str, msgspec.Meta(title="Trajectory", description="Name to save it under")] = "next-flight"
    margin_m: Annotated[float, msgspec.Meta(title="Margin", ge=0.0, le=10.0, extra_json_schema={"unit": "m"})] = 0.15
    accept_doubtful_map: Annotated[bool, msgspec.Meta(title="Propose although the map's verdict is doubtful")] = False
    overwrite: Annotated[bool, msgspec.Meta(title="Replace an existing trajectory (kept beside)")] = False


class Result(msgspec.Struct, frozen=True):
    name: str
    candidates: list[str]
    sentence: str


def _check(project: Project, asked: Arguments) -> None:
    flights.check(project, asked)
    results.require_free(project.trajectory(part_name(asked.out)), overwrite=asked.overwrite)
    if not project.map.is_dir():
        raise InputError("this project has no map; make one on the Map step, then propose the flight")


def _run(folder: Path, asked: Arguments, progress: Progress) -> Result:
    project = Project(folder, "")
    believed, area = vehicle.load(project.vehicle), mapping.open_map(project.map)
    area.require_not_refused()
    doubt = inputs.doubt(area)
    if doubt and not asked.accept_doubtful_map:
        raise InputError(f"{doubt} Make it again, or accept it as it is and propose again")
    learn, held_out = flights.logs(folder, asked, progress)
    options = Options(unseen="hold", gusts="white", gaps="split" if asked.split_gaps else "refuse")
    searching = within(progress, "what is open", 0.0, 0.5)
    found = diagnose(learn, believed, held_out=held_out, auto=True, options=options, progress=searching)
    ranked = mapped_flight.rank_in_map(
        next_flight.ask(found),
        area.field,
        believed,
        console.body_options(None, asked.margin_m),
        rng=np.random.default_rng(0),
        progress=within(progress, "fit into the map", 0.5, 1.0),
    )
    best, path = ranked.flights[0], project.trajectory(asked.out)
    path.parent.mkdir(exist_ok=True)
    with results.new_file(path, overwrite=asked.overwrite) as placing:
        trajectory.save(placing.temporary, best.file(asked.out))
    return Result(asked.out, list(ranked.candidates), best.sentence + (f". {doubt}" if doubt else ""))


def _done(desk: Desk, result: Result) -> str:
    desk.show_files()
    return f"{result.sentence}. Saved as the checked trajectory {result.name}"


KIND = Kind("next_flight", "Propose the next flight", Arguments, _run, _done, flights.choices, _check)
