"""Which model a flight was flown with, and what lasted in the disturbance that its observer measured beside it."""

from collections.abc import Mapping
from pathlib import Path

import vehicle
from firmware_bridge import controller
from flight import FlightLog, InputError
from sysid.estimator.validation.steady import Steady, steady
from vehicle import Vehicle

HASH = "vehicle_hash"
"""Of the model that the flight was planned for and its controller flew with, in the log's metadata."""


def named(log: FlightLog) -> str:
    """The beginning of the hash of the model that a flight was flown with; empty where the log does not tell."""
    return str(log.metadata.get(HASH, "")).rstrip("0")  # zeros: the plan was not checked for a vehicle


def model_of(log: FlightLog, models: Mapping[Path, Vehicle]) -> Path | None:
    """The file of the model that a flight was flown with; the first where the log does not tell, None: another one."""
    matching = [path for path, model in models.items() if vehicle.vehicle_hash(model).startswith(named(log))]
    return matching[0] if matching else None


def lasted(log: FlightLog, model: Vehicle) -> Steady | None:
    """What lasted on a flight with this model; None where no observer of ours told it."""
    try:
        unknown = controller.parameters_of(model).not_compensated
    except InputError:
        return None  # a model that no controller of ours can have flown with
    flown = model
    for effect in unknown:
        flown = flown.without_effect(effect)
    return steady(log, model, flown)
