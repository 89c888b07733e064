"""Reports for download: what `goshawk compare --report` and `goshawk diagnose --report` write."""

import tempfile
from pathlib import Path

import numpy as np

import sysid
import vehicle
from flight import Progress, file_format, within
from flight.project import Project
from gcs_web import reports
from gcs_web.desk import Desk
from gcs_web.jobs import Kind
from goshawk.station_jobs import flights
from goshawk.station_jobs.flights import Chosen
from sysid.diagnosis import diagnose
from sysid.diagnosis.outlook import outlook
from sysid.report import diagnosis_page


def _comparison(folder: Path, asked: Chosen, progress: Progress) -> str:
    """On the held-out flights, if there are any."""
    project = Project(folder, "")
    models = {project.vehicle.stem: vehicle.load(project.vehicle)}
    learn, held_out = flights.logs(folder, asked, progress)
    judging = held_out or learn
    options = flights.options(asked)
    errors = sysid.compare(judging, models, options, progress=within(progress, "compare", 0.0, 0.9))
    wrench = sysid.wrench_errors(judging, models, options)
    progress("draw", 0.95)
    with tempfile.TemporaryDirectory() as made:
        page = sysid.report.write_comparison(Path(made) / "report.html", errors, wrench)
        file_format.write_bytes(reports.report_file(folder, "comparison"), page.read_bytes())
    return "comparison"


def _diagnosis(folder: Path, asked: Chosen, progress: Progress) -> str:
    """Repeated until no candidate is significant."""
    believed = vehicle.load(Project(folder, "").vehicle)
    learn, held_out = flights.logs(folder, asked, progress)
    options = flights.diagnosis_options(asked)
    searching = within(progress, "diagnose", 0.0, 0.85)
    found = diagnose(learn, believed, held_out=held_out, auto=True, options=options, progress=searching)
    progress("which flight would tell", 0.9)
    outlooks = outlook(found, rng=np.random.default_rng(0))
    progress("draw", 0.95)
    with tempfile.TemporaryDirectory() as made:
        page = diagnosis_page.write(Path(made) / "report.html", found, outlooks=outlooks)
        file_format.write_bytes(reports.report_file(folder, "diagnosis"), page.read_bytes())
    return "diagnosis"


def _done(_: Desk, what: str) -> str:
    return f"The {what}'s report can be downloaded"


COMPARISON = Kind(
    "comparison_report", "Report of the comparison", Chosen, _comparison, _done, flights.choices, flights.check
)
DIAGNOSIS = Kind(
    "diagnosis_report", "Report of the diagnosis", Chosen, _diagnosis, _done, flights.choices, flights.check
)
