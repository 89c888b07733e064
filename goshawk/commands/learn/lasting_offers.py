"""What lasted in the measured disturbance of flights, and the commands that take it into the vehicle file."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from flight import FlightLog
from goshawk import flown_with
from sysid.estimator.validation.lasting import Lasting, lasting
from vehicle import Vehicle

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
        path = flown_with.model_of(log, models)
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


def _lasting(flights: Mapping[str, FlightLog], model: Vehicle) -> Lasting:
    each = {name: flown_with.lasted(log, model) for name, log in flights.items()}
    return lasting({name: found for name, found in each.items() if found is not None}, model)


def _command(path: Path, values: Mapping[str, float]) -> str:
    said = " ".join(f"{name}={value:.5g}" for name, value in values.items())
    return f"goshawk vehicle set {shlex.quote(str(path))} {said} --dry-run"
