"""Add an effect to the project's vehicle, refit, judge: what `goshawk vehicle effect add` does, but nothing is kept."""

from pathlib import Path
from typing import Annotated

import msgspec

import vehicle
from flight import InputError, Progress, file_format
from flight.project import Project, part_name
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Kind
from gcs_web.learning import diagnosis_values, learning
from gcs_web.learning.learning import KeptTrial
from goshawk.station_jobs import flights
from sysid.estimator.validation import changes
from sysid.estimator.validation.changes import Flights
from vehicle import Vehicle


class Arguments(flights.Chosen):
    effect: Annotated[
        str, msgspec.Meta(title="Effect", description="Of the catalogue, or NAME.py in the folder effects")
    ] = ""


def _check(project: Project, asked: Arguments) -> None:
    flights.check(project, asked)
    _with_effect(project, vehicle.load(project.vehicle), asked.effect)


def _with_effect(project: Project, present: Vehicle, effect: str) -> tuple[str, Vehicle]:
    """The effect's name, and the vehicle with it.

    Raises:
        FlightError: there is none, the vehicle has it, or nobody agreed to run its file.
    """
    if effect.endswith(".py"):
        file = learning.own_effects(project.folder) / part_name(effect.removesuffix(".py"))
        found = vehicle.effects.load_file(file.with_name(f"{file.name}.py"))
    else:
        found = vehicle.effects.find(effect)
    if found.name in present.effects:
        raise InputError(f"the vehicle has {found.name} already")
    own = vehicle.effects.origin(found.name)
    changed = present.with_effect(found.name, source="assumed") if own is None else present.with_effect_file(own)
    return found.name, changed


@flights.in_words_of(flights.BOXES)
def _run(folder: Path, asked: Arguments, progress: Progress) -> KeptTrial:
    project = Project(folder, "")
    file_sha256 = file_format.file_hash(project.vehicle)  # first: a change during the fit must show
    present = vehicle.load(project.vehicle)
    name, changed = _with_effect(project, present, asked.effect)
    learn, held_out = flights.logs(folder, asked, progress)
    chosen = Flights(
        dict(zip(map(project.flight, asked.learn), learn, strict=True)),
        dict(zip(map(project.flight, asked.held_out), held_out, strict=True)),
    )
    gaps = "split" if asked.split_gaps else "refuse"
    change = changes.refitted(present, changed, chosen, gaps=gaps, progress=progress)
    kept = KeptTrial(diagnosis_values.tried(present, name, change, asked.held_out), change.held_out, file_sha256)
    learning.save_trial(folder, change.vehicle, kept)
    return kept


def _done(desk: Desk, kept: KeptTrial) -> str:
    desk.show_learning()
    return f"{kept.shown.title}: {kept.shown.verdict}"


KIND = Kind("try_effect", "Try an effect", Arguments, _run, _done, flights.choices, _check)
