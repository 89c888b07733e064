"""What each command of the page does, one file a panel; a new panel is one new file and its line here."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk
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

Handler = Callable[[Desk, protocol.Person, Any], protocol.Reply | None]
"""Does a command; a reply only where it has something to say. Raises `FlightError` to refuse it."""

HANDLERS: dict[type, Handler] = {
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
