"""The controller's compensation: what the vehicle flies with, what the kept model asks for, and setting that.

By the same functions as `goshawk params set --vehicle VEHICLE`.
"""

import hashlib

import vehicle
from firmware_bridge import controller, parameters
from flight import InputError, LinkError
from flight.project import Project
from gcs_web.protocol.compensation import Compensation, ControllerParameter, NotCompensated
from gcs_web.vehicle.watch import Watch
from sysid.report import words
from vehicle import Vehicle, history


def read(watch: Watch, opened: Project) -> Compensation:
    """Read the vehicle's parameters, beside those that follow from the project's vehicle file.

    Raises:
        FlightError: the vehicle does not answer, or lacks a parameter; the vehicle file cannot be read, or gives a
            value that the controller cannot take.
    """
    believed = vehicle.load(opened.vehicle)
    wanted = controller.parameters_of(believed).parameters
    present = watch.parameters()
    parameters.refuse_unknown(wanted, present)
    here, there = parameters.shortest(wanted), parameters.shortest(present)
    return Compensation(
        believed.name,
        max(0, history.read(opened.vehicle).current),
        [_row(name, value, here[name]) for name, value in there.items() if name in here],
        _not_compensated(believed),
        vehicle.purpose.mark_sentence(believed),
    )


def changes(found: Compensation) -> dict[str, tuple[float, float]]:
    """By name, what the vehicle flies with and what it would get, where they differ."""
    return {row.name: (row.flies_with, row.model) for row in found.parameters if row.flies_with != row.model}


def purpose(found: Compensation) -> str:
    """What a nonce for these changes is good for: them and no others."""
    return f"compensation {hashlib.sha256(repr(changes(found)).encode()).hexdigest()}"


def send(watch: Watch, opened: Project, shown: Compensation, accepted_mark: str) -> Compensation:
    """Set what differs as one block, and read it back.

    Args:
        accepted_mark: the mark of the model that the pilot has accepted.

    Raises:
        InputError: nothing differs, or the model has a mark that nobody accepted.
        LinkError: another station has control of the vehicle, or it refused (nothing was changed then), or what was
            read back is not what was sent.
    """
    changed = changes(shown)
    if not changed:
        raise InputError("the vehicle flies with these values already; nothing was sent")
    if shown.mark not in ("", accepted_mark):
        raise InputError(f"the model is {shown.mark}; accept that first, nothing was sent")
    watch.set_parameters({name: after for name, (_, after) in changed.items()})
    now = read(watch, opened)
    if left := changes(now):
        raise LinkError(f"what was read back is not what was sent: {', '.join(left)}; compare again before flying")
    return now


def _row(name: str, flies_with: float, model: float) -> ControllerParameter:
    known = controller.PARAMETERS[name]
    return ControllerParameter(name, known.unit, flies_with, model, known.in_flight)


def _not_compensated(believed: Vehicle) -> list[NotCompensated]:
    every = controller.compensations(believed)
    return [NotCompensated(words.effect(name), how) for name, (done, how) in every.items() if not done]
