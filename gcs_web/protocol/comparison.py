"""Messages about recorded flights beside plan and model, as numbers and in the 3D view."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, Message, State


class ArrowScale(msgspec.Struct, frozen=True):
    """Of the arrows at the vehicles: so much for each metre of their length."""

    force_n_per_m: float
    torque_n_m_per_m: float


class ChannelResidual(msgspec.Struct, frozen=True):
    """What the model leaves unexplained in one axis, and what that depends on."""

    channel: str
    unit: str
    rms: float
    """Of the residual, means over 0.1 s of all flights."""
    shares: list[float]
    """By variable, the share of its mean square that a curve of the variable predicts, 0 to 1."""


class VariableName(msgspec.Struct, frozen=True):
    name: str
    unit: str
    words: str


class HorizonError(msgspec.Struct, frozen=True):
    """Root mean square prediction error on the flights that judge, after each horizon."""

    quantity: str
    unit: str
    values: list[float]


class Scatter(msgspec.Struct, frozen=True):
    """A residual against a variable: one point for each mean over 0.1 s."""

    channel: str
    unit: str
    variable: VariableName
    share: float
    x: list[float]
    y: list[float]
    flight: list[int]
    """Which of `flights` each point is of."""
    time_s: list[float]
    """On the flight's shifted time, the middle of the mean."""
    flights: list[str]
    held_out: list[bool]
    """By flight."""
    bin_x: list[float]
    bin_mean: list[float]
    bin_band: list[float]
    """Half of the 95 % band of the bin's mean."""
    span_s: float
    """Over which a point is the mean."""


class Comparison(State, frozen=True, tag="comparison"):
    """Where the model fails on the flights."""

    state: Literal["none", "current", "old"]
    """`old`: the vehicle, the flights or what they are for have changed since."""
    learn: list[str] = []
    held_out: list[str] = []
    judged_how: str = ""
    """On what the shares are judged, in words."""
    variables: list[VariableName] = []
    channels: list[ChannelResidual] = []
    horizons_s: list[float] = []
    errors: list[HorizonError] = []
    predictions: int = 0
    remarks: list[str] = []
    has_report: bool = False


class ReadScatter(Command, frozen=True, tag="read_scatter", kw_only=True):
    """Ask for a residual against a variable; the reply has `scatter`."""

    channel: str
    variable: str


class FlightMoment(Message, frozen=True, tag="flight_moment"):
    """The path of a flight was clicked in the 3D view: show this moment of its shifted time."""

    time_s: float


class FlightsShown(State, frozen=True, tag="flights_shown"):
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
