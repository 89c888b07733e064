"""The projects beside this one: listed, and opened in its place."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.people import Person
from gcs_web.protocol.projects import ListProjects, NewProject, OpenProject


def _list(desk: Desk, _: Person, __: ListProjects) -> None:
    desk.show_projects()


def _open(desk: Desk, person: Person, wanted: OpenProject) -> None:
    desk.open_project(wanted.folder, person)


def _new(desk: Desk, person: Person, wanted: NewProject) -> None:
    desk.new_project(wanted.name, person)


HANDLERS: Handlers = {
    ListProjects: _list,
    NewProject: _new,
    OpenProject: _open,
}
