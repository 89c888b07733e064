"""Whether a flight carried the vehicle's payload: what its log says, and the vehicle without it."""

from flight import FlightLog, InputError
from vehicle import Vehicle

PAYLOAD = "payload"
"""The one effect that a flight may be without."""
PAYLOAD_CARRIED = "payload_carried"
"""Key of a log's metadata that says whether the payload was on board."""


def carries_payload(log: FlightLog) -> bool | None:
    """What the log's metadata say under `payload_carried`; None if nothing.

    Raises:
        InputError: something else than true or false.
    """
    said = log.metadata.get(PAYLOAD_CARRIED)
    if said is not None and not isinstance(said, bool):
        name = log.metadata.get("name", "the log")
        raise InputError(f"{name}: {PAYLOAD_CARRIED} in its metadata is {said!r}; it must be true or false")
    return said


def as_flown(vehicle: Vehicle, carries_payload: bool | None) -> Vehicle:
    """The vehicle of one flight: without its payload where that stayed behind."""
    if carries_payload is not False or PAYLOAD not in vehicle.effects:
        return vehicle
    return vehicle.with_value(f"{PAYLOAD}.added_kg", 0.0)
