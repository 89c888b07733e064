"""Compare the project's vehicle with flights: what `goshawk compare` does."""

from pathlib import Path

import vehicle
from flight import Progress
from flight.project import Project
from gcs_web import comparing, residuals
from gcs_web.desk import Desk
from gcs_web.jobs import Kind
from gcs_web.residuals import Compared
from goshawk.station_jobs import flights
from goshawk.station_jobs.flights import Chosen


def _run(folder: Path, asked: Chosen, progress: Progress) -> Compared:
    believed = vehicle.load(Project(folder, "").vehicle)
    contents = flights.contents(folder, asked)
    learn, held_out = flights.logs(folder, asked, progress)
    options = flights.options(asked)
    found = residuals.made(learn, held_out, believed, vehicle.vehicle_hash(believed), contents, options, progress)
    residuals.save(comparing.comparison_file(folder), found)
    return found


def _done(desk: Desk, found: Compared) -> str:
    desk.comparing.take(found)
    desk.show_learning()
    worst = max(zip(found.shares, residuals.CHANNELS, strict=True), key=lambda row: max(row[0]))
    share, channel = max(worst[0]), worst[1]
    variable = found.variables[worst[0].index(share)]
    return f"{share:.0%} of the residual {channel} follow {variable}"


KIND = Kind("compare", "Compare the model with flights", Chosen, _run, _done, flights.choices, flights.check)
