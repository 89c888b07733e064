"""Messages about recorded flights in the 3D view; see `protocol`."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command
from gcs_web.protocol.flights import ArrowScale

# --- from the server ---


class FlightMoment(msgspec.Struct, frozen=True, tag="flight_moment"):
    """The path of a flight was clicked in the 3D view: show this moment of its shifted time."""

    time_s: float


class FlightsShown(msgspec.Struct, frozen=True, tag="flights_shown"):
    """The flights that stand in the one 3D view: those of who asked last, of all who look at flights now."""

    author: str = ""
    """Id of that person; empty where no flights stand there."""
    flights: list[str] = []
    arrows: ArrowScale | None = None
    """How long the arrows are; None where there are none."""
    colour_reach: float | None = None
    """The residual, N or N m, at the upper end of the paths' colours; None for plain paths."""
    plan_too: bool = False
    """Whether the plan stands there as well, because not everybody looks at flights."""


# --- from the page ---


class ShowFlights(Command, frozen=True, tag="show_flights", kw_only=True):
    """Draw flights in the 3D view for this person, who looks at them until none are asked for; see `FlightsShown`."""

    flights: list[str]
    colour: Literal["", "F_x", "F_y", "F_z", "M_x", "M_y", "M_z"] = ""
    """The residual by which paths are coloured."""
    arrows: bool = True
    """Residual force and torque as arrows at the vehicles, where the comparison has them."""
    predicted_s: float | None = None
    """The first flight's vehicle as the model predicts it too, from its motion so much earlier, where compared: one of
    the comparison's `horizons_s`; None: not."""
    moved_s: dict[str, float] = msgspec.field(default_factory=dict)
    """By flight, what is added to its shifted time, of those that stand beside the first by hand or by alignment."""


class LookAtFlight(Command, frozen=True, tag="look_at_flight", kw_only=True):
    """Show a moment of the flights that are drawn, on the first one's shifted time; None hides the vehicles."""

    time_s: float | None


class Stretch(msgspec.Struct, frozen=True):
    """Part of a flight's shifted time."""

    flight: str
    from_s: float
    to_s: float


class ShowMoments(Command, frozen=True, tag="show_moments", kw_only=True):
    """Mark stretches on the paths of the flights that are drawn; none: no mark."""

    stretches: list[Stretch]
