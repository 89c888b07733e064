"""Fit the vehicle's model to flights of the project: what `goshawk identify` does."""

from pathlib import Path
from typing import Annotated

import msgspec

import vehicle
from flight import InputError, Progress
from flight.project import Project, part_name
from gcs_web.desk import Desk
from gcs_web.flights import reading
from gcs_web.jobs.jobs import Choices, Kind
from gcs_web.learning import identified
from goshawk.commands.learn import fit_options
from goshawk.commands.learn.identify import Asked, fit_flights, write_figures
from goshawk.station_jobs.flights import in_words_of
from goshawk.terminal import outputs
from sysid.estimator.options import Options
from sysid.estimator.verdict import Use

BOXES = {
    "gaps='split'": 'the box "Fit the pieces between gaps"',
    "robust=True": 'the box "Less weight for outliers of the pose"',
}
"""Arguments that the library's messages name, and what the job's form has in their place."""


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    flights: Annotated[list[str], msgspec.Meta(title="Flights", min_length=1)]
    out: Annotated[str, msgspec.Meta(title="New vehicle file", description="Name in the project; its report too")] = (
        "fitted"
    )
    split_gaps: Annotated[bool, msgspec.Meta(title="Fit the pieces between gaps")] = False
    hold_unidentifiable: Annotated[bool, msgspec.Meta(title="Hold what these flights do not identify")] = True
    robust: Annotated[bool, msgspec.Meta(title="Less weight for outliers of the pose")] = False
    estimate_command_delay: Annotated[
        bool, msgspec.Meta(title="Estimate how late commands are", description="If another recorder stamped them")
    ] = False
    trials: Annotated[bool, msgspec.Meta(title="Fit each flight alone too", description="To compare the fits")] = False
    overwrite: Annotated[bool, msgspec.Meta(title="Replace existing results (kept beside)")] = False


class Result(msgspec.Struct, frozen=True):
    verdict: str
    reasons: list[str]
    written: list[str]


def _paths(folder: Path, out: str) -> tuple[Path, Path]:
    return folder / f"{part_name(out)}.toml", folder / f"{out}.html"


def _choices(project: Project) -> Choices:
    return {"flights": [path.stem for path in project.flights()]}


def _check(project: Project, asked: Arguments) -> None:
    missing = sorted(set(asked.flights) - {path.stem for path in project.flights()})
    if missing:
        raise InputError(f"there is no flight {missing[0]!r} in this project")
    if asked.out == "project":
        raise InputError("project.toml is the project's own file; give another name")
    outputs.check(*_paths(project.folder, asked.out), overwrite=asked.overwrite)


@in_words_of(BOXES)
def _run(folder: Path, asked: Arguments, progress: Progress) -> Result:
    project = Project(folder, "")
    believed = vehicle.load(project.vehicle)
    options = Options(
        gaps="split" if asked.split_gaps else "refuse",
        unseen="hold" if asked.hold_unidentifiable else "refuse",
        robust=asked.robust,
        estimate_command_delay=asked.estimate_command_delay,
    )
    names = list(dict.fromkeys(asked.flights))
    flights = tuple(project.flight(name) for name in names)
    contents = reading.contents(project, names)
    trials = len(names) if asked.trials and len(names) > 1 else None
    fits = fit_flights(Asked(flights, trials=trials), believed, options, None, progress)
    out, report = _paths(folder, asked.out)
    usable = fits.verdict.use is not Use.REJECTED
    write_figures(fits, report, None, overwrite=asked.overwrite)
    if usable:
        outputs.write_vehicle(out, fits.answer.vehicle, "identify", overwrite=asked.overwrite)
    files = [out.name, report.name] if usable else [report.name]
    mark = vehicle.purpose.mark_sentence(fits.answer.vehicle)
    extra = (fits.predicts and fits.predicts.sentence, mark, fits.cause and f"likely cause: {fits.cause.sentence}")
    reasons = [fit_options.worded(str(reason), BOXES) for reason in (*fits.verdict.reasons, *filter(None, extra))]
    shown = identified.shown(
        fits.answer,
        fits.trials,
        names,
        vehicle_hash=vehicle.vehicle_hash(believed),
        contents=contents,
        written=files,
        use=fits.verdict.use,
        reasons=reasons,
    )
    identified.save(folder, shown)
    return Result(str(fits.verdict.use), reasons, files)


def _done(desk: Desk, result: Result) -> str:
    desk.show_learning()
    because = f": {'; '.join(result.reasons)}" if result.reasons else ""
    return f"{result.verdict}{because}. Written: {', '.join(result.written)}"


def _written(project: Project, asked: Arguments) -> Path:
    return _paths(project.folder, asked.out)[0]


KIND = Kind("identify", "Identify the vehicle from flights", Arguments, _run, _done, _choices, _check, writes=_written)
