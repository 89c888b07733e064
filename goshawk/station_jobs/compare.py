"""Compare the project's vehicle with flights: what `goshawk compare` does."""

from pathlib import Path

import sysid
import vehicle
from flight import Progress, within
from flight.project import Project
from gcs_web.comparison import comparing, reports, residuals
from gcs_web.comparison.residuals import Compared
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Kind
from goshawk.commands.learn import lasting_offers
from goshawk.station_jobs import flights
from goshawk.station_jobs.flights import Chosen


@flights.in_words_of(flights.BOXES)
def _run(folder: Path, asked: Chosen, progress: Progress) -> Compared:
    believed = vehicle.load(Project(folder, "").vehicle)
    contents = flights.contents(folder, asked)
    learn, held_out = flights.logs(folder, asked, progress)
    options = flights.options(asked)
    comparison = within(progress, "compare", 0.0, 0.8)
    believed_hash = vehicle.vehicle_hash(believed)
    found, errors = residuals.made(learn, held_out, believed, believed_hash, contents, options, comparison)
    file = Project(folder, "").vehicle
    lasts, commands = lasting_offers.offers([*learn, *held_out], {file.relative_to(folder): believed})
    found = residuals.remarked(found, [*lasts, *(f"next, {command}" for command in commands)])
    progress("forces and torques", 0.8)
    wrench = sysid.wrench_errors(held_out or learn, {residuals.MODEL: believed}, options)
    report = reports.withdrawn(folder, "comparison")
    residuals.save(comparing.comparison_file(folder), found)
    progress("report", 0.9)
    sysid.report.write_comparison(report, errors, wrench)
    return found


def _done(desk: Desk, found: Compared) -> str:
    desk.comparing.take(found)
    desk.show_learning()
    worst = max(zip(found.shares, residuals.CHANNELS, strict=True), key=lambda row: max(row[0]))
    share, channel = max(worst[0]), worst[1]
    variable = found.variables[worst[0].index(share)]
    return f"{share:.0%} of the residual {channel} follow {variable}"


KIND = Kind("compare", "Compare the model with flights", Chosen, _run, _done, flights.choices, flights.check)
