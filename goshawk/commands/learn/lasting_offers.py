"""What lasted in the measured disturbance of flights, and the commands that take it into the vehicle file."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import vehicle
from firmware_bridge import controller
from flight import FlightLog, InputError
from sysid.estimator.validation.lasting import Lasting, lasting
from sysid.estimator.validation.steady import Steady, steady
from vehicle import Vehicle

HASH = "vehicle_hash"
"""Of the model that the flight was planned for and its controller flew with, in the log's metadata."""
TOLD = "measured disturbance"


def offers(logs: Sequence[FlightLog], models: Mapping[Path, Vehicle]) -> tuple[list[str], list[str]]:
    """Sentences, and commands; none where no log holds a measured disturbance.

    Args:
        logs: rows in the air alone.
        models: by their files. The observer's force is relative to the model that was flown with; flights of another
            one are named, and say nothing of these.
    """
    said, commands, foreign = [], [], []
    of_model: dict[Path, dict[str, FlightLog]] = {path: {} for path in models}
    for i, log in enumerate(log for log in logs if log.has("observer_state")):
        name = str(log.metadata.get("name", f"flight {i + 1}"))
        path = flown_with(log, models)
        if path is None:
            foreign.append(name)
        else:
            of_model[path][name] = log
    for path, flights in of_model.items():
        found = _lasting(flights, models[path])
        said += [f"{TOLD}: {sentence}" for sentence in found.sentences]
        commands += [f"if {meaning}: {_command(path, values)}" for meaning, values in found.changes]
    if foreign:
        said.append(f"{TOLD}: {', '.join(foreign)} flew with another model than these files, so nothing is offered")
    return said, commands


def named(log: FlightLog) -> str:
    """The beginning of the hash of the model that a flight was flown with; empty where the log does not tell."""
    return str(log.metadata.get(HASH, "")).rstrip("0")  # zeros: the plan was not checked for a vehicle


def flown_with(log: FlightLog, models: Mapping[Path, Vehicle]) -> Path | None:
    """The file of the model that a flight was flown with; the first where the log does not tell, None: another one."""
    matching = [path for path, model in models.items() if vehicle.vehicle_hash(model).startswith(named(log))]
    return matching[0] if matching else None


def _lasting(flights: Mapping[str, FlightLog], model: Vehicle) -> Lasting:
    each = {name: of_flight(log, model) for name, log in flights.items()}
    return lasting({name: found for name, found in each.items() if found is not None}, model)


def of_flight(log: FlightLog, model: Vehicle) -> Steady | None:
    """What lasted on a flight with this model; None where no observer of ours told it."""
    try:
        unknown = controller.parameters_of(model).not_compensated
    except InputError:
        return None  # a model that no controller of ours can have flown with
    flown = model
    for effect in unknown:
        flown = flown.without_effect(effect)
    return steady(log, model, flown)


def _command(path: Path, values: Mapping[str, float]) -> str:
    said = " ".join(f"{name}={value:.5g}" for name, value in values.items())
    return f"goshawk vehicle set {shlex.quote(str(path))} {said} --dry-run"
