"""Messages about flights that are moved to stand side by side; see `gcs_web.protocol`."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command

AlignBy = Literal["trajectory", "take_off", "motion", "speed", "height"]
"""Two flights stand side by side by an event of both, or by the correlation of a stream."""


class Aligned(msgspec.Struct, frozen=True):
    """How far a flight is moved to stand beside the first one, on their shifted times."""

    flight: str
    by_s: float | None
    """None where that cannot be told."""
    words: str
    """By what, and how sure it is; or why it cannot be told."""


class AlignFlights(Command, frozen=True, tag="align_flights", kw_only=True):
    """Ask how far to move flights beside the first of them; the reply has `aligned`."""

    flights: list[str]
    by: AlignBy
