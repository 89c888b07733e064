"""Messages about the projects beside this one."""

import msgspec

from gcs_web.protocol.base import Command, State


class ProjectEntry(msgspec.Struct, frozen=True):
    """A project in the folder that this one is in, or one that was opened before."""

    folder: str
    """Name of its folder, or a key where that is elsewhere; by it it is opened."""
    name: str
    current: bool
    trajectories: int
    flights: int
    problem: str
    """Why it cannot be opened; empty where it can."""
    where: str = ""
    """Name of the folder that it is in; empty for that of this project."""


class Projects(State, frozen=True, tag="projects"):
    projects: list[ProjectEntry]


class ListProjects(Command, frozen=True, tag="list_projects", kw_only=True):
    """Look again."""


class NewProject(Command, frozen=True, tag="new_project", kw_only=True):
    """Make an empty project in the folder that this one is in, and open it in its place."""

    name: str


class OpenProject(Command, frozen=True, tag="open_project", kw_only=True):
    """Close this project and open another one in its place, for everybody who has the page open."""

    folder: str
