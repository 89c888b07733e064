"""What each command of the page does, one file a panel; a new panel is one new file and its line here."""

from gcs_web.panels import (
    comparison,
    compensation,
    consent,
    course,
    document,
    flights,
    jobs,
    learning,
    map,
    projects,
    trajectories,
    vehicle,
    view,
)
from gcs_web.panels.handlers import Handlers

HANDLERS: Handlers = {
    **document.HANDLERS,
    **course.HANDLERS,
    **projects.HANDLERS,
    **trajectories.HANDLERS,
    **view.HANDLERS,
    **jobs.HANDLERS,
    **map.HANDLERS,
    **flights.HANDLERS,
    **comparison.HANDLERS,
    **learning.HANDLERS,
    **vehicle.HANDLERS,
    **compensation.HANDLERS,
    **consent.HANDLERS,
}
