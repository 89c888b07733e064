"""Many waypoints at once: snapped, turned, and taken from a recorded path."""

import numpy as np

from flight import FloatArray, InputError, Waypoints, project
from gcs_web.desk import Desk
from gcs_web.document.document import MOST_WAYPOINTS
from gcs_web.panels.document import edit
from gcs_web.panels.handlers import Handlers
from gcs_web.planning import snapping
from gcs_web.protocol.course import DropPath, Place, RandomYaw, RecordedPath, Snap, TakePath, ThinPath
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply
from planner.route import simplify


def _snap(desk: Desk, person: Person, wanted: Snap) -> None:
    content = desk.session.content
    points = [content.points[content.number_of(waypoint)] for waypoint in wanted.waypoints]
    before = np.array([point.position_world_m for point in points]).reshape(-1, 3)
    field = desk.parts.map(desk.inputs).field
    if wanted.to == "grid":
        after, label = snapping.onto_grid(before, wanted.by_m), f"snapped to a grid of {wanted.by_m:g} m"
    elif wanted.to == "height":
        after = snapping.above_ground(before, wanted.by_m, field)
        label = f"put {wanted.by_m:g} m above what is below"
    else:
        after = snapping.away_from_obstacles(before, wanted.by_m, field)
        label = f"put at least {wanted.by_m:g} m away from obstacles"
    places = [(round(float(x), 3), round(float(y), 3), round(float(z), 3)) for x, y, z in after]
    edit(
        desk,
        person,
        Place(
            serial=wanted.serial,
            revision=wanted.revision,
            waypoints=wanted.waypoints,
            positions_m=places,
            label=label,
        ),
    )


def _thin(desk: Desk, _: Person, wanted: ThinPath) -> Reply:
    recorded = _recorded(desk, wanted.source)
    found, left_out = _along(desk, recorded, wanted.tolerance_m)
    desk.view.draw_recorded(found.positions_world_m)
    told = RecordedPath(wanted.source, len(recorded), left_out, len(found.positions_world_m))
    return Reply(wanted.serial, recorded_path=told)


def _drop(desk: Desk, _: Person, __: DropPath) -> None:
    desk.view.draw_recorded(None)


def _take(desk: Desk, person: Person, wanted: TakePath) -> None:
    found, _ = _along(desk, _recorded(desk, wanted.source), wanted.tolerance_m)
    label = f"waypoints along {wanted.source or 'the walk of the map'}"
    desk.session.take(found, label, person.name)
    desk.view.draw_recorded(None)
    desk.notice(f"{label[0].upper()}{label[1:]}.", undo=True)


def _recorded(desk: Desk, source: str) -> FloatArray:
    """Positions (n, 3) of a flight, or of the vehicle as the map's images were taken."""
    if source:
        return desk.flights.recorded.path(project.part_name(source)).position_world_m
    walked = desk.parts.map(desk.inputs).T_world_body
    if len(walked) < 2:
        raise InputError("this map does not say where its images were taken; choose a flight")
    return np.asarray(walked)[:, :3, 3]


def _along(desk: Desk, recorded_world_m: FloatArray, tolerance_m: float) -> tuple[Waypoints, int]:
    field = desk.parts.map(desk.inputs).field
    found, left_out = simplify.waypoints_along(recorded_world_m, tolerance_m, field, desk.planned_with())
    if len(found.positions_world_m) > MOST_WAYPOINTS:
        raise InputError(f"{len(found.positions_world_m)} waypoints would be too many; allow a larger tolerance")
    return found, left_out


HANDLERS: Handlers = {
    Snap: _snap,
    RandomYaw: edit,
    ThinPath: _thin,
    DropPath: _drop,
    TakePath: _take,
}
