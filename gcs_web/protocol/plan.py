"""Messages about the plan of the document."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, State


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


class Plan(State, frozen=True, tag="plan"):
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


class Draft(State, frozen=True, tag="draft"):
    """What is foreseen while a waypoint is dragged; the path itself is in the 3D view only."""

    waypoint: int | None
    """Id; None: it is not dragged any more."""
    sentence: str = ""
    """The figures in words, or why no path can reach the waypoint there."""
    state: Literal["clear", "too close", "refused", "checked"] = "clear"
    """`checked`: the plan that letting go here gives, worked out while the waypoint is held still."""


class SimulatedFlight(msgspec.Struct, frozen=True):
    """One flown path of a preflight; all lists are of one length, n."""

    x_m: list[float]
    y_m: list[float]
    z_m: list[float]
    clearance_m: list[float]
    """Of the vehicle's centre, as that of a plan; `PLENTY_M` where it is more, or nothing is counted (a landing)."""
    ends: int
    """Index of the sample from which on it touches something, or is lost; n where it does neither."""
    is_worst: bool
    """Among the worst of all flights; else among the first ones, which are any."""


PLENTY_M = 10.0


class Preflight(State, frozen=True, tag="preflight"):
    """What many simulated flights of the checked plan came to, or of the plan that was flown so before it."""

    state: Literal["none", "current", "stale"]
    stale: str = ""
    """What changed since: the plan, the map, the vehicle; empty while it is current."""
    verdict: Literal["go", "no_go", "not_shown"] = "not_shown"
    """`not_shown`: the flights leave open whether the risk is accepted."""
    sentence: str = ""
    decides: str = ""
    """What decides most, and its share; empty where the flights do not tell it."""
    remedy: str = ""
    flights: int = 0
    wind_m_s: float = 0.0
    """Largest mean wind of the flights, from anywhere."""
    assumed: list[str] = []
    """Sentences on what nobody told, and is not counted."""
    asked: dict[str, str | int | float] = {}
    """The job's arguments, to fly it so again."""
    paths: list[SimulatedFlight] = []
    """The worst first; empty where it is not current."""


class PlanAgain(Command, frozen=True, tag="plan_again", kw_only=True):
    """Plan and check the document as it is now, with the map and the vehicle as they are now."""
