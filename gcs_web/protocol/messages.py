"""All messages of both directions, and the reply to a command."""

import msgspec

from gcs_web.protocol.aligning import Aligned, AlignFlights
from gcs_web.protocol.compensation import Compensation, PrepareCompensation, SendCompensation
from gcs_web.protocol.consent import AgreeToEffectFile, DraftEffect, EffectFiles
from gcs_web.protocol.course import DropPath, RandomYaw, RecordedPath, Snap, TakePath, ThinPath
from gcs_web.protocol.document import (
    Ask,
    Choose,
    ClearGate,
    ClearGround,
    Delete,
    Document,
    Insert,
    Loop,
    Move,
    Pass,
    Redo,
    Reverse,
    SetGate,
    SetGround,
    SetTube,
    Shift,
    Turn,
    Undo,
)
from gcs_web.protocol.flight_view import FlightMoment, FlightsShown, LookAtFlight, ShowFlights, ShowMoments
from gcs_web.protocol.flights import (
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
from gcs_web.protocol.identified import Identification
from gcs_web.protocol.jobs import CancelJob, ForeseeJob, ForgetJob, Jobs, ListJobs, StartJob
from gcs_web.protocol.map import (
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
from gcs_web.protocol.next_flight import NextFlight
from gcs_web.protocol.people import Notice, People, Welcome
from gcs_web.protocol.plan import Draft, Plan, PlanAgain
from gcs_web.protocol.projects import ListProjects, OpenProject, Projects
from gcs_web.protocol.trajectories import ComparePlans, Discard, Files, Open, PlanSummary, Restore, Save
from gcs_web.protocol.vehicle import (
    Abort,
    GiveUpControl,
    Held,
    Order,
    PrepareOrder,
    PrepareUpload,
    TakeControl,
    Upload,
    Vehicle,
)
from gcs_web.protocol.view import Cursor, Look, Select, Selection, Show, Shown

PROTOCOL = 4
"""Raised when an old page could misread a new server."""


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
