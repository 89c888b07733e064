"""Messages about the projects beside this one."""

import msgspec

from gcs_web.protocol.base import Command, State


class ProjectEntry(msgspec.Struct, frozen=True):
    """A project in the folder that this one is in."""

    folder: str
    """Name of its folder, by which it is opened."""
    name: str
    current: bool
    trajectories: int
    flights: int
    problem: str
    """Why it cannot be opened; empty where it can."""


class Projects(State, frozen=True, tag="projects"):
    projects: list[ProjectEntry]


class ListProjects(Command, frozen=True, tag="list_projects", kw_only=True):
    """Look again."""


class OpenProject(Command, frozen=True, tag="open_project", kw_only=True):
    """Close this project and open another one in its place, for everybody who has the page open."""

    folder: str
