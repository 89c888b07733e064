"""Where the motors of a firmware sit, and so which of a log's columns is which rotor of a vehicle file."""

from collections.abc import Mapping
from typing import Any

from flight import FlightLog
from vehicle import Vehicle, commented

KEY = "rotor_places"
"""Of a log's metadata: in words, the place of rotor 0, 1, 2, 3."""
CRAZYFLIE = ("front right", "rear right", "rear left", "front left")
BETAFLIGHT = ("rear right", "front right", "rear left", "front left")
"""Of QUADX, the mixer that it has unless told otherwise."""
ARDUPILOT = ("front right", "rear left", "front left", "rear right")
"""Of FRAME_CLASS 1 (quadrotor), FRAME_TYPE 1 (X)."""


def with_places(log: FlightLog, places: tuple[str, ...]) -> FlightLog:
    """The log with what its firmware tells of the places of its motors."""
    return FlightLog(log.columns, {**log.metadata, KEY: list(places)})


def reordered(metadata: Mapping[str, Any], order: tuple[int, ...]) -> Mapping[str, Any]:
    """A log's metadata, its columns taken in that order."""
    places = _told(metadata)
    return {**metadata, KEY: [places[k] for k in order]} if places else metadata


def order(log: FlightLog, vehicle: Vehicle) -> tuple[int, ...] | None:
    """Which column is rotor 0, 1, 2, 3 of the vehicle file; None where log or file does not tell the places."""
    places, own = _told(log.metadata), of_vehicle(vehicle)
    return tuple(places.index(place) for place in own) if sorted(places) == sorted(own) else None


def of_vehicle(vehicle: Vehicle) -> tuple[str, ...]:
    """In words; a hub on an axis of the body has only one."""
    return tuple(commented.place(hub) for hub in vehicle.hub_body_m)


def _told(metadata: Mapping[str, Any]) -> list[str]:
    """The places of four motors, or none."""
    places = metadata.get(KEY)
    return places if isinstance(places, list) and len(places) == 4 and all(isinstance(p, str) for p in places) else []
