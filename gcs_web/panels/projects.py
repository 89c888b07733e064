"""The projects beside this one: listed, and opened in its place."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk


def _list(desk: Desk, _: protocol.Person, __: protocol.ListProjects) -> None:
    desk.show_projects()


def _open(desk: Desk, person: protocol.Person, wanted: protocol.OpenProject) -> None:
    desk.open_project(wanted.folder, person)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], None]] = {
    protocol.ListProjects: _list,
    protocol.OpenProject: _open,
}
