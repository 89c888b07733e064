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
    people,
    projects,
    trajectories,
    vehicle,
    view,
)
from gcs_web.panels.handlers import Handlers

PANELS = (
    document, course, projects, trajectories, view, jobs, map, flights, comparison, learning, vehicle, compensation,
    consent, people,
)  # fmt: skip
HANDLERS: Handlers = {command: handler for panel in PANELS for command, handler in panel.HANDLERS.items()}
