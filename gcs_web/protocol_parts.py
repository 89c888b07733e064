"""Parts of the messages between page and server; see `gcs_web.protocol`."""

from typing import Literal

import msgspec


class Person(msgspec.Struct, frozen=True):
    """Someone who has the page open."""

    id: str
    name: str


class Gate(msgspec.Struct, frozen=True):
    """The opening round a waypoint that is passed forwards."""

    width_m: float
    height_m: float
    heading_deg: float
    """Horizontal direction in which it is passed, from x towards y."""
    pitch_deg: float
    """How far that direction points upwards."""
    roll_deg: float
    """Turned about that direction, clockwise as seen by who flies through."""


class Waypoint(msgspec.Struct, frozen=True):
    """A point to fly through."""

    id: int
    """Stays with the waypoint however its number changes."""
    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float | None = None
    """Heading, None where the planner may choose."""
    stay_s: float = 0.0
    """How long to hover here."""
    fly_by_m: float = 0.0
    """Radius within which it is enough to pass; 0: the waypoint itself."""
    leg_speed_m_s: float | None = None
    """Largest speed from here to the next waypoint; None: that of the settings."""
    velocity_m_s: tuple[float, float, float] | None = None
    """Velocity to have here, world frame; None where it is open."""
    gate: Gate | None = None


class Ground(msgspec.Struct, frozen=True):
    """Where the vehicle's centre is while it stands before take-off or after landing."""

    x_m: float
    y_m: float
    z_m: float
    climb_m_s: float
    """Vertical speed at which the path is joined, or left."""


class Mission(msgspec.Struct, frozen=True):
    """What is asked of the whole path."""

    laps: int
    """Times that the loop is flown; 0: the path is open."""
    lap_first: int | None
    """Id of the waypoint where the loop begins and closes; None: the first one."""
    lap_last: int | None
    """Id of the loop's last waypoint; None: the last one."""
    take_off: Ground | None
    landing: Ground | None
    keep_in_m: float | None
    """Radius of the tube to keep in; None: there is none."""
    keep_in_recorded: bool
    """Whether that tube has a polyline of its own, instead of straight lines from waypoint to waypoint."""


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
Layer = Literal["mesh", "cameras", "points", "edits"]


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


Colour = Literal["clearance", "could_hide", "speed", "thrust", "tilt", "rotor_margin"]
YawMode = Literal["along_path", "smooth", "steady", "fixed", "look_at", "free"]


class Settings(msgspec.Struct, frozen=True):
    """What the pilot asks of the planner."""

    speed_m_s: float
    acceleration_m_s2: float
    margin_m: float
    yaw: YawMode
    method: Literal["fastest", "corridor"]
    heading_deg: float
    """Of yaw mode `fixed`."""
    look_at_m: tuple[float, float, float] | None
    """Of yaw mode `look_at`, world frame."""


class Limit(msgspec.Struct, frozen=True):
    """How much of a limit the plan uses."""

    name: str
    value: float
    bound: float
    sense: Literal["<=", ">="]
    unit: str
    share: float
    """Of the limit that is used, 0 to 1; above 1 it is exceeded."""
    time_s: float
    """When it is used most."""


class Segment(msgspec.Struct, frozen=True):
    """A stretch between two waypoints, as flown."""

    start_s: float
    end_s: float
    start: int | None
    """Id of the waypoint it begins at; None: the ground of a take-off."""
    end: int | None
    binding: str
    """Name of the limit of which most is used there."""
    share: float
    worst_s: float
    """When it is used most."""


class Passing(msgspec.Struct, frozen=True):
    """How the plan passes a waypoint; in laps one passing for each, in the order of time."""

    waypoint: int | None
    """Id; None: the ground of a take-off or landing."""
    time_s: float
    speed_m_s: float
    clearance_m: float


class Series(msgspec.Struct, frozen=True):
    """The plan sampled at equal steps of time; all lists are of one length, but where they say otherwise."""

    time_s: list[float]
    x_m: list[float]
    y_m: list[float]
    z_m: list[float]
    speed_m_s: list[float]
    acceleration_m_s2: list[float]
    clearance_m: list[float]
    tilt_deg: list[float]
    rotor_slowest_rad_s: list[float]
    rotor_fastest_rad_s: list[float]
    yaw_rate_deg_s: list[float]
    thrust_n: list[float]
    """Of all rotors together."""
    rotor_margin_percent: list[float]
    """What is left between the rotor that is nearest to one of its speed limits and that limit, in thrust; of the
    range between both."""
    q_world_body: list[float]
    """Attitudes one after another, four numbers each (w x y z)."""
    could_hide_mm: list[float] = []
    """How thick an obstacle could hide within the required clearance; 100 where it is more, or no image looked; empty
    where the map has no images."""


class Problem(msgspec.Struct, frozen=True):
    """Why there is no plan, and the way out."""

    reason: str
    remedy: str
    waypoint: int | None
    """Id of the waypoint in question."""


class SavedTrajectory(msgspec.Struct, frozen=True):
    """A trajectory file of the project."""

    name: str
    duration_s: float
    checked: bool
    """By the final gate, for the map and the vehicle as they are now."""
    saved_at: str
    """ISO 8601, UTC."""


class Aside(msgspec.Struct, frozen=True):
    """A trajectory file in the bin: it was discarded, or replaced by a newer one of the same name."""

    file: str
    """Name by which it is restored."""
    name: str
    duration_s: float
    """0 where the file cannot be read."""
    moved_at: str
    """ISO 8601, UTC."""


class PlanSummary(msgspec.Struct, frozen=True):
    """What trajectories are compared by, for the map and the vehicle as they are now."""

    name: str
    passes: bool
    """The final gate."""
    failures: list[str]
    """Names of the checks that fail."""
    duration_s: float
    length_m: float
    top_speed_m_s: float
    limits: list[Limit]
    """Clearance among them; that of which most is used first."""


class Held(msgspec.Struct, frozen=True):
    """A trajectory as shown before an upload: what the vehicle has, or what it would get."""

    name: str
    duration_s: float
    segments: int
    room_m: float
    """What is left between the vehicle's surface and every obstacle: room for its tracking error."""
    crc32: str


class Job(msgspec.Struct, frozen=True):
    """Background work of the station."""

    id: int
    kind: str
    title: str
    state: Literal["waiting", "running", "done", "failed", "cancelled"]
    author: str
    """Name of who started it."""
    stage: str = ""
    """What is being done."""
    share: float = 0.0
    """Of the stage, 0 to 1."""
    left_s: float | None = None
    """Until the stage is done; None where it cannot be told yet."""
    elapsed_s: float = 0.0
    words: str = ""
    """What came of it, or why it failed."""


class JobField(msgspec.Struct, frozen=True):
    """One argument of a kind of job."""

    name: str
    title: str
    says: str
    form: Literal["text", "choice", "several", "number", "integer", "flag"]
    """`several`: any of the choices."""
    default: str | float | bool | list[str]
    choices: list[str]
    unit: str = ""


class JobKind(msgspec.Struct, frozen=True):
    name: str
    title: str
    fields: list[JobField]
