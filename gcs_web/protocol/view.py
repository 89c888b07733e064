"""Messages about what is selected and shown in the 3D view."""

from typing import Literal

from gcs_web.protocol.base import Command, Message, State

Colour = Literal["clearance", "could_hide", "speed", "thrust", "tilt", "rotor_margin"]


class Cursor(Message, frozen=True, tag="cursor"):
    """The 3D view was clicked on the path: show this moment everywhere."""

    time_s: float


class Shown(State, frozen=True, tag="shown"):
    """What the 3D view, which is the same for everybody, draws now."""

    colour: Colour
    author: str
    """Id of the person who chose it."""
    flights: bool = True
    """Whether the preflight's flights are drawn."""


class ViewScales(State, frozen=True, tag="view_scales"):
    """How much of the world the 3D views show, by their names: the height of the picture at the point looked at, m."""

    heights_m: dict[str, float]


class Selection(Message, frozen=True, tag="selection"):
    """Waypoints were selected in the 3D view."""

    waypoints: list[int]


class Select(Command, frozen=True, tag="select", kw_only=True):
    """Tell the 3D view which waypoints are selected on the page."""

    waypoints: list[int]


class Look(Command, frozen=True, tag="look", kw_only=True):
    """Show a moment of the plan in the 3D view; None hides the drawn vehicle."""

    time_s: float | None


class Show(Command, frozen=True, tag="show", kw_only=True):
    """What the 3D view draws."""

    colour: Colour = "clearance"
    flights: bool = True
    """Those of the preflight."""


class Follow(Command, frozen=True, tag="follow", kw_only=True):
    """Have the camera of one page's 3D view go with the vehicle, or look at everything again."""

    view: str
    """Its name, as in its address."""
    following: bool


class DrawPlainly(Command, frozen=True, tag="draw_plainly", kw_only=True):
    """A browser draws slowly: leave out shadows and light from all sides, for everybody, and triangles in its view."""

    view: str
    """Its 3D view's name, as in its address."""
    triangles: int
    """Of the map's mesh there, at the most."""
