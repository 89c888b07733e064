"""Messages about saved trajectories."""

import msgspec

from gcs_web.protocol.base import Command, State
from gcs_web.protocol.plan import Limit


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


class Files(State, frozen=True, tag="files"):
    trajectories: list[SavedTrajectory]
    flights: list[str]
    bin: list[Aside] = []
    """Trajectories that were discarded or replaced, newest first."""
    has_map: bool = True
    has_vehicle: bool = True


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
