"""Messages about the proposed next flight."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import State


class Section(msgspec.Struct, frozen=True):
    """A level cut through the map: where the vehicle's centre keeps the required clearance."""

    low_m: tuple[float, float]
    """x and y of the corner where the rows begin, world."""
    height_m: float
    cell_m: float
    rows: list[str]
    """Along x, the lowest y first; a cell is `.` where there is room, `#` where there is none or nobody knows."""


class NextFlight(State, frozen=True, tag="next_flight"):
    """The flight that was proposed last, or why none was."""

    state: Literal["none", "current", "old"]
    """`old`: the vehicle, a flight or the map has changed since."""
    refusal: str = ""
    """Why no flight in this map would answer what is open; empty where one is proposed."""
    name: str = ""
    """Of the saved trajectory."""
    manoeuvre: str = ""
    candidates: list[str] = []
    """Between which it decides, or of which it shows the size."""
    size: float = 0.0
    """Share of the size that the manoeuvre is designed for."""
    heading_rad: float = 0.0
    """By how much it is turned."""
    duration_s: float = 0.0
    top_speed_m_s: float = 0.0
    clearance_m: float = 0.0
    required_clearance_m: float = 0.0
    known_log_odds: float = 0.0
    """Of the true candidate against its rival, from the flights so far."""
    expected_log_odds: float = 0.0
    """By how much this flight is expected to raise them."""
    needed_log_odds: float = 0.0
    """With so many the question is answered."""
    path_m: list[float] = []
    """x, y, z of points along it, one after the other, world."""
    section: Section | None = None
    """At the middle height of the path."""
    learn: list[str] = []
    held_out: list[str] = []
    """Flights that it was found from."""
    vehicle: str = ""
    logs: str = ""
    map: str = ""
    """Hashes of what it was found for."""
