"""Find the effect that the project's vehicle lacks: what `goshawk diagnose` does."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

import vehicle
from flight import Progress, file_format, within
from flight.project import Project
from gcs_web.comparison import reports
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Kind
from gcs_web.learning import diagnosis_values, learning
from gcs_web.protocol.learning import Diagnosis
from goshawk.commands.learn import what_next
from goshawk.commands.learn.what_next import DiagnoseCall
from goshawk.station_jobs import flights
from sysid.diagnosis import diagnose
from sysid.diagnosis.experiment_design.outlook import outlook
from sysid.report import diagnosis_page

HOW_TO_GO_ON = "(on the page's step Learn, or in the project's folder by these commands)"
"""Before the next steps of the report."""


class Arguments(flights.Chosen):
    auto: Annotated[bool, msgspec.Meta(title="Repeat until no candidate is significant")] = True


@flights.in_words_of(flights.BOXES)
def _run(folder: Path, asked: Arguments, progress: Progress) -> Diagnosis:
    project = Project(folder, "")
    believed = vehicle.load(project.vehicle)
    contents = flights.contents(folder, asked)
    learn, held_out = flights.logs(folder, asked, progress)
    options = flights.diagnosis_options(asked)
    searching = within(progress, "diagnose", 0.0, 0.85)
    found = diagnose(learn, believed, held_out=held_out, auto=asked.auto, options=options, progress=searching)
    progress("which flight would tell", 0.85)
    outlooks = outlook(found, rng=np.random.default_rng(0))
    shown = diagnosis_values.diagnosis(found, outlooks, vehicle.vehicle_hash(believed), contents)
    report = reports.withdrawn(folder, "diagnosis")
    file_format.write_bytes(learning.diagnosis_file(folder), msgspec.json.encode(shown))
    progress("report", 0.9)
    further = what_next.lines(found, _call(project, asked), outlooks)
    further = [HOW_TO_GO_ON, *further] if further else []
    diagnosis_page.write(report, found, further=further, outlooks=outlooks)
    return shown


def _call(project: Project, asked: Arguments) -> DiagnoseCall:
    """The verb that does the same in the project's folder."""
    learn, held_out = (
        [project.flight(name).relative_to(project.folder) for name in names] for names in (asked.learn, asked.held_out)
    )
    model, gaps = project.vehicle.relative_to(project.folder), " --split-gaps" if asked.split_gaps else ""
    return DiagnoseCall(learn, model, held_out, auto=asked.auto, fit=gaps)


def _done(desk: Desk, found: Diagnosis) -> str:
    desk.show_learning()
    return found.verdict


KIND = Kind("diagnose", "Find the missing effect", Arguments, _run, _done, flights.choices, flights.check)
