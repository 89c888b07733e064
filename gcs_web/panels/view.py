"""What the 3D view shows: selection, the moment of the cursor, colours."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk


def _select(desk: Desk, _: protocol.Person, select: protocol.Select) -> None:
    desk.view.select(select.waypoints)


def _look(desk: Desk, _: protocol.Person, look: protocol.Look) -> None:
    desk.view.look(look.time_s)


def _show(desk: Desk, person: protocol.Person, show: protocol.Show) -> None:
    desk.view.show(show.colour)
    desk.hub.publish(protocol.Shown(show.colour, person.id))


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], None]] = {
    protocol.Select: _select,
    protocol.Look: _look,
    protocol.Show: _show,
}
