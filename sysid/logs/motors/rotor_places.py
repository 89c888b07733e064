"""Where the motors of a firmware sit, and so which of a log's columns is which rotor of a vehicle file."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flight import FlightLog
from vehicle import Vehicle

KEY = "rotor_places"
"""Of a log's metadata: in words, the place of rotor 0, 1, 2, 3."""
CRAZYFLIE = ("front right", "rear right", "rear left", "front left")
BETAFLIGHT = ("rear right", "front right", "rear left", "front left")
"""Of QUADX."""
ARDUPILOT = ("front right", "rear left", "front left", "rear right")
"""Of FRAME_CLASS 1 (quadrotor), FRAME_TYPE 1 (X)."""
APART = 0.2
"""A hub closer to an axis than this share of its arm is beside it."""


def told(log: FlightLog, places: tuple[str, ...]) -> FlightLog:
    """The log with what its firmware tells of the places of its motors."""
    return FlightLog(log.columns, {**log.metadata, KEY: list(places)})


def reordered(metadata: Mapping[str, Any], order: tuple[int, ...]) -> Mapping[str, Any]:
    """A log's metadata, its columns taken in that order."""
    places = metadata.get(KEY)
    return {**metadata, KEY: [places[k] for k in order]} if isinstance(places, list) else metadata


def order(log: FlightLog, vehicle: Vehicle) -> tuple[int, ...] | None:
    """Which column is rotor 0, 1, 2, 3 of the vehicle file; None where log or file does not tell the places."""
    places, own = log.metadata.get(KEY), of_vehicle(vehicle)
    if not isinstance(places, list) or sorted(places) != sorted(own):
        return None
    return tuple(places.index(place) for place in own)


def of_vehicle(vehicle: Vehicle) -> tuple[str, ...]:
    """In words; a hub on an axis of the body has only one."""
    found = []
    for hub in vehicle.hub_body_m[:, :2]:
        x, y = np.where(np.abs(hub) > APART * np.linalg.norm(hub), np.sign(hub), 0.0)
        along, across = {1.0: "front", -1.0: "rear", 0.0: ""}[x], {1.0: "left", -1.0: "right", 0.0: ""}[y]
        found.append(f"{along} {across}".strip())
    return tuple(found)
