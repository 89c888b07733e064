"""What a fitted model is for: it may predict flights well while some value of it is no property of the vehicle.

Such a model is marked in its provenance, and what designs by its values (margins, compensation in flight) says so.
"""

from collections.abc import Mapping
from dataclasses import replace

from vehicle.model import Vehicle

KEY = "not_for_design"
"""In the provenance: a table of parameter, or `EVERY`, to what is known all the same."""
EVERY = "every parameter"
IDENTIFIED = "identified"
"""How the source of an estimated value begins; a mark is of that value and ends with it."""


def marked(vehicle: Vehicle, doubtful: Mapping[str, str]) -> Vehicle:
    """The vehicle with this mark in place of any before; without one if nothing is doubtful.

    Args:
        doubtful: parameters that are not physical, or `EVERY`, each with what is known all the same, in words.
    """
    provenance = {key: value for key, value in vehicle.provenance.items() if key != KEY}
    return replace(vehicle, provenance=provenance | ({KEY: dict(doubtful)} if doubtful else {}))


def not_for_design(vehicle: Vehicle) -> dict[str, str]:
    """The mark: parameters whose values are for prediction alone, with what is known all the same; empty without one.

    A value that was set or measured since is no longer the fit's.
    """
    mark = vehicle.provenance.get(KEY, {})
    held = {name for name, p in vehicle.parameters.items() if p.source.startswith(IDENTIFIED)}
    return {str(name): str(known) for name, known in dict(mark).items() if name == EVERY or name in held}


def mark_sentence(vehicle: Vehicle) -> str:
    """The mark in words; empty without one."""
    doubtful = not_for_design(vehicle)
    return f"for prediction, not for design: {', '.join(_said(*one) for one in doubtful.items())}" if doubtful else ""


def _said(name: str, known: str) -> str:
    return f"{name} ({known})" if known else name
