"""Messages about many waypoints at once: snapping, headings, and waypoints along a recorded path."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, Edit


class Place(Edit, frozen=True, kw_only=True):
    """Put each waypoint to a place of its own; what `Snap` comes to."""

    waypoints: list[int]
    positions_m: list[tuple[float, float, float]]
    label: str


class Snap(Edit, frozen=True, tag="snap", kw_only=True):
    """Put waypoints onto a grid, to a height above what is below them, or away from obstacles."""

    waypoints: list[int]
    to: Literal["grid", "height", "clearance"]
    by_m: float
    """Spacing of the grid, the height, or the clearance of the vehicle's centre."""


class RandomYaw(Edit, frozen=True, tag="random_yaw", kw_only=True):
    """Give waypoints random headings: a flight to learn the vehicle from should turn."""

    waypoints: list[int]


class RecordedPath(msgspec.Struct, frozen=True):
    """Waypoints along a recorded path, before they are taken."""

    source: str
    positions: int
    """Recorded ones."""
    left_out: int
    """Of those: too close to obstacles or unknown space for a waypoint."""
    waypoints: int


class ThinPath(Command, frozen=True, tag="thin_path", kw_only=True):
    """Find waypoints along a recorded path, and draw them; the reply says how many."""

    source: str
    """Name of a flight; empty for the walk of the map's images."""
    tolerance_m: float
    """How far the straight lines between them may be from the recorded path."""


class DropPath(Command, frozen=True, tag="drop_path", kw_only=True):
    """Stop drawing what `ThinPath` found."""


class TakePath(Command, frozen=True, tag="take_path", kw_only=True):
    """Replace all waypoints by those, as one change."""

    source: str
    tolerance_m: float
