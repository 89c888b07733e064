"""Messages about what the pilots edit together."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, Edit, State
from gcs_web.protocol.map import MapEdit


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
    leg_jerk_m_s3: float | None = None
    """The same of jerk."""
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


YawMode = Literal["along_path", "smooth", "steady", "fixed", "look_at", "free"]


class Settings(msgspec.Struct, frozen=True):
    """What the pilot asks of the planner."""

    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float | None
    """None: no limit but the vehicle's own."""
    margin_m: float
    yaw: YawMode
    method: Literal["fastest", "corridor"]
    heading_deg: float
    """Of yaw mode `fixed`."""
    look_at_m: tuple[float, float, float] | None
    """Of yaw mode `look_at`, world frame."""


class Document(State, frozen=True, tag="document"):
    """What the pilots edit together."""

    revision: int
    author: str
    """Name of who made this revision."""
    waypoints: list[Waypoint]
    settings: Settings
    mission: Mission
    map_edits: list[MapEdit]
    """In the order in which they were made; no-fly zones hold whatever comes after."""
    undo: str
    """What undo would take back, in words; empty for nothing."""
    redo: str


class Move(Edit, frozen=True, tag="move", kw_only=True):
    """Set coordinates of waypoints; None leaves one as it is."""

    waypoints: list[int]
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None


class Shift(Edit, frozen=True, tag="shift", kw_only=True):
    """Move waypoints together."""

    waypoints: list[int]
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0


class Turn(Edit, frozen=True, tag="turn", kw_only=True):
    """Set the heading of waypoints; None lets the planner choose."""

    waypoints: list[int]
    yaw_deg: float | None


class Ask(Edit, frozen=True, tag="ask", kw_only=True):
    """Set what is asked at waypoints; None leaves a request as it is, 0 drops it."""

    waypoints: list[int]
    stay_s: float | None = None
    fly_by_m: float | None = None
    leg_speed_m_s: float | None = None
    leg_jerk_m_s3: float | None = None


class Pass(Edit, frozen=True, tag="pass", kw_only=True):
    """Set the velocity to have at waypoints, world frame; None leaves it open."""

    waypoints: list[int]
    velocity_m_s: tuple[float, float, float] | None


class SetGate(Edit, frozen=True, tag="gate", kw_only=True):
    """Set the gate round a waypoint; what is left out stays, or is a metre, upright and along the way through it."""

    waypoint: int
    width_m: float | None = None
    height_m: float | None = None
    heading_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


class ClearGate(Edit, frozen=True, tag="clear_gate", kw_only=True):
    waypoint: int


class SetTube(Edit, frozen=True, tag="tube", kw_only=True):
    """Set the radius of the tube to keep in; a new one goes from waypoint to waypoint. None: no tube."""

    radius_m: float | None


class Insert(Edit, frozen=True, tag="insert", kw_only=True):
    """Add a waypoint after another (None: at the start); without coordinates half-way to the next one."""

    after: int | None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None


class Delete(Edit, frozen=True, tag="delete", kw_only=True):
    waypoints: list[int]


class Reverse(Edit, frozen=True, tag="reverse", kw_only=True):
    """Fly the waypoints in the other order."""


class Choose(Edit, frozen=True, tag="choose", kw_only=True):
    """Change settings; None leaves one as it is, a jerk of 0 drops its limit."""

    speed_m_s: float | None = None
    acceleration_m_s2: float | None = None
    jerk_m_s3: float | None = None
    margin_m: float | None = None
    yaw: YawMode | None = None
    method: Literal["fastest", "corridor"] | None = None
    heading_deg: float | None = None
    look_at_m: tuple[float, float, float] | None = None


class Loop(Edit, frozen=True, tag="loop", kw_only=True):
    """Fly waypoints as a closed loop; ids as in `Mission`."""

    laps: int
    lap_first: int | None = None
    lap_last: int | None = None


class SetGround(Edit, frozen=True, tag="ground", kw_only=True):
    """Set where the take-off or the landing is; coordinates that are left out stay, or are those below the waypoint."""

    end: Literal["take_off", "landing"]
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    climb_m_s: float | None = None


class ClearGround(Edit, frozen=True, tag="clear_ground", kw_only=True):
    """Begin or end in the air."""

    end: Literal["take_off", "landing"]


class Undo(Command, frozen=True, tag="undo", kw_only=True):
    pass


class Redo(Command, frozen=True, tag="redo", kw_only=True):
    pass
