"""What each command of the page does, one file a panel; a new panel is one new file and its line here."""

from gcs_web.panels import (
    compensation,
    consent,
    course,
    editing,
    flights,
    jobs,
    learning,
    map,
    projects,
    trajectories,
    vehicle_orders,
    view,
)
from gcs_web.panels.handlers import Handlers

HANDLERS: Handlers = {
    **editing.HANDLERS,
    **course.HANDLERS,
    **projects.HANDLERS,
    **trajectories.HANDLERS,
    **view.HANDLERS,
    **jobs.HANDLERS,
    **map.HANDLERS,
    **flights.HANDLERS,
    **learning.HANDLERS,
    **vehicle_orders.HANDLERS,
    **compensation.HANDLERS,
    **consent.HANDLERS,
}
