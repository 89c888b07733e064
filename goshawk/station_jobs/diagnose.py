"""Find the effect that the project's vehicle lacks: what `goshawk diagnose` does."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

import vehicle
from flight import Progress, file_format, within
from flight.project import Project
from gcs_web import diagnosis_values, learning, protocol
from gcs_web.desk import Desk
from gcs_web.jobs import Kind
from goshawk.station_jobs import flights
from sysid.diagnosis import diagnose
from sysid.diagnosis.outlook import outlook


class Arguments(flights.Chosen):
    auto: Annotated[bool, msgspec.Meta(title="Repeat until no candidate is significant")] = True


def _run(folder: Path, asked: Arguments, progress: Progress) -> protocol.Diagnosis:
    believed = vehicle.load(Project(folder, "").vehicle)
    contents = flights.contents(folder, asked)
    learn, held_out = flights.logs(folder, asked, progress)
    options = flights.diagnosis_options(asked)
    searching = within(progress, "diagnose", 0.0, 0.9)
    found = diagnose(learn, believed, held_out=held_out, auto=asked.auto, options=options, progress=searching)
    progress("which flight would tell", 0.95)
    outlooks = outlook(found, rng=np.random.default_rng(0))
    shown = diagnosis_values.diagnosis(found, outlooks, vehicle.vehicle_hash(believed), contents)
    file_format.write_bytes(learning.diagnosis_file(folder), msgspec.json.encode(shown))
    return shown


def _done(desk: Desk, found: protocol.Diagnosis) -> str:
    desk.show_learning()
    return found.verdict


KIND = Kind("diagnose", "Find the missing effect", Arguments, _run, _done, flights.choices, flights.check)
