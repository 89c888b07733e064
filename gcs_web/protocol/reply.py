"""The answer to a command."""

from gcs_web.protocol.base import Message
from gcs_web.protocol.comparison import Scatter
from gcs_web.protocol.compensation import Compensation
from gcs_web.protocol.course import RecordedPath
from gcs_web.protocol.flights import Aligned, Incoming, OpenedFlight, Pairs, Spectrogram, Spectrum, StreamPart
from gcs_web.protocol.people import Invitation
from gcs_web.protocol.trajectories import PlanSummary
from gcs_web.protocol.vehicle import FoundVehicle, Held


class Reply(Message, frozen=True, tag="reply"):
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
    spectrum: Spectrum | None = None
    spectrogram: Spectrogram | None = None
    pairs: Pairs | None = None
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
    vehicles: list[FoundVehicle] = []
    """Of `look_for_vehicles`."""
    invitation: Invitation | None = None
    """Of `invite`."""
