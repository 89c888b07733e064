"""What the 3D view shows: selection, the moment of the cursor, colours."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.people import Person
from gcs_web.protocol.view import DrawPlainly, Follow, Look, Select, Show, Shown


def _select(desk: Desk, _: Person, select: Select) -> None:
    desk.view.select(select.waypoints)


def _look(desk: Desk, _: Person, look: Look) -> None:
    desk.view.look(look.time_s)


def _show(desk: Desk, person: Person, show: Show) -> None:
    desk.view.show(show.colour, flights=show.flights)
    desk.hub.publish(Shown(show.colour, person.id, show.flights))


def _follow(desk: Desk, _: Person, wanted: Follow) -> None:
    desk.view.follow(wanted.view, following=wanted.following)


def _plainly(desk: Desk, _: Person, wanted: DrawPlainly) -> None:
    desk.view.draw_plainly(wanted.view, wanted.triangles)


HANDLERS: Handlers = {
    Select: _select,
    Look: _look,
    Show: _show,
    Follow: _follow,
    DrawPlainly: _plainly,
}
