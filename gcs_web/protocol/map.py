"""Messages about the map."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, Edit, State


class Shape(msgspec.Struct, frozen=True):
    """A body in the map, world frame; of the fields only those count that the form has."""

    form: Literal["box", "sphere", "prism", "stroke", "other"]
    """`other`: made by `goshawk map edit`; it can be dropped here, not changed."""
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of a prism: its middle height."""
    size_m: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Edges of a box; of a prism its height counts."""
    radius_m: float = 0.5
    corners_m: list[tuple[float, float]] = []
    """x, y of a prism's polygon."""
    points_m: list[tuple[float, float, float]] = []
    """Of a brush's stroke: the line that its ball was drawn along."""


MapAction = Literal["add", "no-fly", "clear", "remove"]


class MapEdit(msgspec.Struct, frozen=True):
    """One change of the map; see `esdf.Edit`."""

    id: int
    action: MapAction
    name: str
    shape: Shape
    words: str
    """What it is: "box, 2.0 m³"."""


SliceAxis = Literal["x", "y", "z", "oblique"]


SliceOf = Literal["distance", "unknown", "could_hide", "surface_std"]


Layer = Literal["mesh", "cameras", "points", "edits", "axes", "heights"]


class Slice(msgspec.Struct, frozen=True):
    """A plane through the map: its normal, and where it is along it from the origin."""

    axis: SliceAxis
    """Its normal; `oblique`: that of the two angles."""
    at_m: float
    of: SliceOf = "distance"
    heading_deg: float = 0.0
    """Horizontal direction of an oblique one's normal, from x towards y."""
    tilt_deg: float = 0.0
    """How far that normal points upwards."""


class MapFacts(msgspec.Struct, frozen=True):
    """How good the map is."""

    images: int
    images_placed: int
    reprojection_px: float | None
    """Mean error; None where the map does not say."""
    free_m3: float
    """Space known to be free, edits applied."""
    standing: str
    """good or doubtful."""
    doubt: str = ""
    """Why it is doubtful, as a sentence."""
    hash: str = ""


class MapShown(State, frozen=True, tag="map_shown"):
    """What the 3D view draws of the map, and what it is: the same for everybody."""

    slice: Slice | None
    layers: list[Layer]
    low_m: tuple[float, float, float]
    """Corners of the mapped box, world frame."""
    high_m: tuple[float, float, float]
    facts: MapFacts
    author: str


class MapSection(State, frozen=True, tag="map_section"):
    """The map from above, at one height: for the map that is drawn without WebGL."""

    image: str
    """PNG, base64, its top at the largest y; empty without a map."""
    low_m: tuple[float, float] = (0.0, 0.0)
    """x and y of its corners, world frame."""
    high_m: tuple[float, float] = (0.0, 0.0)
    at_m: float = 0.0
    """Height, world z."""
    of: SliceOf | None = None
    """Of the slice that is shown, where that is level; None: obstacles, what is near them and what is unknown."""


class Measured(State, frozen=True, tag="measured"):
    """Points that were clicked to measure, at most two."""

    active: bool
    """Whether the next click in the 3D view is taken for one."""
    points_m: list[tuple[float, float, float]] = []
    clearances_m: list[float | None] = []
    """Distance of each to the nearest obstacle or unknown space; None outside the map."""
    distance_m: float | None = None


class MapPreview(State, frozen=True, tag="map_preview"):
    """What an edit of the map would change, before anybody makes it."""

    author: str
    """Id of who looks at it; empty where nobody does."""
    edit: int | None = None
    """Id of the edit that would be another one; None for a new one."""
    shape: Shape | None = None
    closed_m3: float = 0.0
    """Space that would no longer be free."""
    opened_m3: float = 0.0
    """Space that would be free."""
    voxels: int = 0
    drawn: bool = False
    """Whether the shape comes from a handle or the brush, so that its author's numbers follow it."""


class ShowMap(Command, frozen=True, tag="show_map", kw_only=True):
    """What the 3D view draws of the map."""

    slice: Slice | None
    layers: list[Layer]


class Measure(Command, frozen=True, tag="measure", kw_only=True):
    """Take the next clicks in the 3D view for points to measure; or stop, and forget those."""

    active: bool


class Paint(Command, frozen=True, tag="paint", kw_only=True):
    """Take drags over the mesh for strokes of a brush, shown as a preview until one is applied; or stop."""

    active: bool
    action: MapAction = "no-fly"
    radius_m: float = 0.2


class PreviewMapEdit(Command, frozen=True, tag="preview_map_edit", kw_only=True):
    """Draw what an edit of the map would change, and change nothing; a shape of None ends it."""

    action: MapAction = "no-fly"
    shape: Shape | None = None
    edit: int | None = None
    """Id of an edit that would be replaced."""


class AddMapEdit(Edit, frozen=True, tag="add_map_edit", kw_only=True):
    """Change the map; every plan before is void."""

    action: MapAction
    name: str
    """A no-fly zone must have one."""
    shape: Shape


class ChangeMapEdit(Edit, frozen=True, tag="change_map_edit", kw_only=True):
    """Give an edit of the map another shape, name or action; None leaves one as it is."""

    edit: int
    action: MapAction | None = None
    name: str | None = None
    shape: Shape | None = None


class DropMapEdits(Edit, frozen=True, tag="drop_map_edits", kw_only=True):
    edits: list[int]
