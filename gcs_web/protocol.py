"""What page and server tell each other: JSON messages on one WebSocket, each a struct here and a type in the client.

`tools/page_types.py` writes `gcs_web/client/src/protocol.ts` from this file; a test proves that it is up to date.
Lengths in metres, times in seconds, positions in the map's world frame (z up). Angles are in degrees here, because
people read them; the server turns them into radians as they come in.
"""

from typing import Literal

import msgspec

from gcs_web.protocol_aligning import Aligned, AlignFlights
from gcs_web.protocol_base import Command, Edit
from gcs_web.protocol_compensation import Compensation, PrepareCompensation, SendCompensation
from gcs_web.protocol_consent import AgreeToEffectFile, DraftEffect, EffectFiles
from gcs_web.protocol_course import DropPath, RandomYaw, RecordedPath, Snap, TakePath, ThinPath
from gcs_web.protocol_flight_view import FlightMoment, FlightsShown, LookAtFlight, ShowFlights, ShowMoments
from gcs_web.protocol_flights import (
    Comparison,
    Diagnosis,
    DiscardFlight,
    DropTried,
    FixFlight,
    Flights,
    Incoming,
    Keep,
    ListFlights,
    Model,
    OpenedFlight,
    OpenFlights,
    ReadScatter,
    ReadStreams,
    RestoreFlight,
    ReturnTo,
    Scatter,
    SetRole,
    StreamPart,
    TakeLog,
)
from gcs_web.protocol_identified import Identification
from gcs_web.protocol_jobs import CancelJob, ForeseeJob, ForgetJob, Jobs, ListJobs, StartJob
from gcs_web.protocol_map import (
    AddMapEdit,
    ChangeMapEdit,
    DropMapEdits,
    MapPreview,
    MapShown,
    Measure,
    Measured,
    Paint,
    PreviewMapEdit,
    ShowMap,
)
from gcs_web.protocol_next_flight import NextFlight
from gcs_web.protocol_parts import (
    Aside,
    Colour,
    Held,
    Limit,
    MapEdit,
    Mission,
    Passing,
    Person,
    PlanSummary,
    Problem,
    SavedTrajectory,
    Segment,
    Series,
    Settings,
    Waypoint,
    YawMode,
)
from gcs_web.protocol_projects import ListProjects, OpenProject, Projects

PROTOCOL = 4
"""Raised when an old page could misread a new server."""


# --- from the server ---


class Welcome(msgspec.Struct, frozen=True, tag="welcome"):
    """First message on every connection."""

    protocol: int
    you: str
    """Id of this person."""
    project: str
    vehicle: bool
    """Whether a vehicle was given when the station was started."""
    station: str
    """Of the open project; another one after another project was opened: what the page shows is then of the old one."""


class Document(msgspec.Struct, frozen=True, tag="document"):
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


class Plan(msgspec.Struct, frozen=True, tag="plan"):
    """The answer to a revision of the document."""

    revision: int
    state: Literal["none", "planning", "checked", "refused", "void"]
    """`void`: the map or the vehicle changed since the check."""
    sentence: str
    """The verdict in words."""
    name: str = ""
    problem: Problem | None = None
    duration_s: float = 0.0
    top_speed_m_s: float = 0.0
    clearance_m: float = 0.0
    required_clearance_m: float = 0.0
    closest: tuple[float, float, float] | None = None
    """Where the path comes closest to an obstacle, world frame."""
    planning_ms: float = 0.0
    crc32: str = ""
    limits: list[Limit] = []
    segments: list[Segment] = []
    passings: list[Passing] = []
    series: Series | None = None


class Draft(msgspec.Struct, frozen=True, tag="draft"):
    """What is foreseen while a waypoint is dragged; the path itself is in the 3D view only."""

    waypoint: int | None
    """Id; None: it is not dragged any more."""
    sentence: str = ""
    """The figures in words, or why no path can reach the waypoint there."""
    state: Literal["clear", "too close", "refused", "checked"] = "clear"
    """`checked`: the plan that letting go here gives, worked out while the waypoint is held still."""


class Vehicle(msgspec.Struct, frozen=True, tag="vehicle"):
    """The vehicle as last heard; sent on every change and at least twice a second."""

    link: Literal["none", "fresh", "stale", "lost"]
    """Stale after 0.5 s, lost after 2 s."""
    name: str = ""
    age_s: float = 0.0
    mission: str = ""
    armed: bool = False
    holds: str = ""
    """Name of the active trajectory."""
    holds_crc32: str = ""
    battery_v: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    error_m: float | None = None
    """Distance from the set-point now, while a trajectory is flown."""
    largest_error_m: float | None = None
    reason: str = ""
    """Why the vehicle last changed its state, in its own words."""


class People(msgspec.Struct, frozen=True, tag="people"):
    people: list[Person]
    in_control: str
    """Id of the person whose orders the station passes on; empty for nobody."""


class Files(msgspec.Struct, frozen=True, tag="files"):
    trajectories: list[SavedTrajectory]
    flights: list[str]
    bin: list[Aside] = []
    """Trajectories that were discarded or replaced, newest first."""


class Notice(msgspec.Struct, frozen=True, tag="notice"):
    """One line at the foot of the page; stays until the next."""

    text: str
    level: Literal["fact", "caution", "danger"] = "fact"
    undo: bool = False
    """Whether undo takes back what it tells."""


class Cursor(msgspec.Struct, frozen=True, tag="cursor"):
    """The 3D view was clicked on the path: show this moment everywhere."""

    time_s: float


class Shown(msgspec.Struct, frozen=True, tag="shown"):
    """What the 3D view, which is the same for everybody, draws now."""

    colour: Colour
    author: str
    """Id of the person who chose it."""


class Selection(msgspec.Struct, frozen=True, tag="selection"):
    """Waypoints were selected in the 3D view."""

    waypoints: list[int]


class Reply(msgspec.Struct, frozen=True, tag="reply"):
    """Answer to one command."""

    serial: int
    error: str = ""
    """Why it was refused, with the way out; empty when it was done."""
    nonce: str = ""
    here: Held | None = None
    there: Held | None = None
    """Of `prepare_upload`."""
    name: str = ""
    """Of what was made: a flight, or a log that was moved aside."""
    flights: list[OpenedFlight] = []
    aligned: list[Aligned] = []
    """Of `align_flights`: each flight but the first."""
    parts: list[StreamPart] = []
    scatter: Scatter | None = None
    incoming: Incoming | None = None
    """Of `take_log`: what the columns of a foreign log may be."""
    compensation: Compensation | None = None
    """Of `prepare_compensation` and `send_compensation`."""
    plans: list[PlanSummary] = []
    """Of `compare_plans`."""
    words: str = ""
    """Of `foresee_job`: what it would do."""
    recorded_path: RecordedPath | None = None


ToPage = (
    Welcome | Document | Plan | Draft | Vehicle | People | Files | Jobs | Notice | Cursor | Shown | Selection | Reply
    | Projects | MapShown | Measured | MapPreview | Flights | Comparison | Diagnosis | Model | FlightMoment
    | EffectFiles | Identification | NextFlight | FlightsShown
)  # fmt: skip


# --- from the page ---


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
    """Change settings; None leaves one as it is."""

    speed_m_s: float | None = None
    acceleration_m_s2: float | None = None
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


class PlanAgain(Command, frozen=True, tag="plan_again", kw_only=True):
    """Plan and check the document as it is now, with the map and the vehicle as they are now."""


class Save(Command, frozen=True, tag="save", kw_only=True):
    """Write the checked plan into the project."""

    name: str
    overwrite: bool = False


class Open(Command, frozen=True, tag="open", kw_only=True):
    """Take the waypoints of a saved trajectory into the document (one change, undoable)."""

    name: str


class Discard(Command, frozen=True, tag="discard", kw_only=True):
    """Move a saved trajectory into the project's bin."""

    name: str


class Restore(Command, frozen=True, tag="restore", kw_only=True):
    """Take a trajectory out of the bin."""

    file: str


class ComparePlans(Command, frozen=True, tag="compare_plans", kw_only=True):
    """Check trajectories for the map and the vehicle as they are now; the reply has one summary each."""

    names: list[str]
    """Empty for the plan on the page."""


class Select(Command, frozen=True, tag="select", kw_only=True):
    """Tell the 3D view which waypoints are selected on the page."""

    waypoints: list[int]


class Look(Command, frozen=True, tag="look", kw_only=True):
    """Show a moment of the plan in the 3D view; None hides the drawn vehicle."""

    time_s: float | None


class Show(Command, frozen=True, tag="show", kw_only=True):
    """What the 3D view draws."""

    colour: Colour = "clearance"


class TakeControl(Command, frozen=True, tag="take_control", kw_only=True):
    """Ask to be the one person whose orders go to the vehicle."""

    force: bool = False
    """Also from someone who has it; they are told."""


class GiveUpControl(Command, frozen=True, tag="give_up_control", kw_only=True):
    pass


class PrepareUpload(Command, frozen=True, tag="prepare_upload", kw_only=True):
    """Compare the plan with what the vehicle holds; the reply has both and a nonce that `upload` uses up."""


class Upload(Command, frozen=True, tag="upload", kw_only=True):
    nonce: str


class PrepareOrder(Command, frozen=True, tag="prepare_order", kw_only=True):
    """Announce an order; the reply has the nonce that `order` uses up."""


class Order(Command, frozen=True, tag="order", kw_only=True):
    order: Literal["arm", "start", "pause", "resume", "land", "disarm"]
    nonce: str


class Abort(Command, frozen=True, tag="abort", kw_only=True):
    """Land at once. Needs neither control nor a nonce."""


FromPage = (
    Move | Shift | Turn | Ask | Pass | Insert | Delete | Reverse | Choose | Loop | SetGround | ClearGround
    | SetGate | ClearGate | SetTube | Snap | RandomYaw | ThinPath | DropPath | TakePath | ListProjects | OpenProject
    | Undo | Redo | PlanAgain | Save | Open | Discard | Restore | ComparePlans
    | Select | Look | Show | TakeControl | GiveUpControl | PrepareUpload | Upload | PrepareOrder | Order | Abort
    | ShowMap | Measure | Paint | PreviewMapEdit | AddMapEdit | ChangeMapEdit | DropMapEdits
    | StartJob | ForeseeJob | CancelJob | ForgetJob | ListJobs
    | ListFlights | SetRole | OpenFlights | AlignFlights | ReadStreams | ShowFlights | LookAtFlight | FixFlight
    | DiscardFlight | RestoreFlight | TakeLog | ReadScatter | Keep | DropTried | ReturnTo
    | PrepareCompensation | SendCompensation | AgreeToEffectFile | DraftEffect
    | ShowMoments
)  # fmt: skip
