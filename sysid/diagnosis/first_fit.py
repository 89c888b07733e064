"""The fit a diagnosis begins with, and the options all its fits share: which noise, which clock, what is held."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from flight import FlightLog, Progress
from sysid.estimator.flights.clocks import pose_is_late
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from sysid.estimator.result import NOT_SETTLED, Identification
from sysid.estimator.verdict import too_large_inertias
from vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class First:
    """The fit of the vehicle as it is."""

    fit: Identification
    options: Options
    """With which it was made, and the others are to be."""
    said: tuple[str, ...]
    """Sentences on what differs from the options that were asked for."""


def first_fit(logs: Sequence[FlightLog], vehicle: Vehicle, options: Options, progress: Progress) -> First:
    """The first fit, with disturbances and clock as these flights need them."""
    found = _of_possible_body(logs, vehicle, First(identify(logs, vehicle, options, progress=progress), options, ()))
    if not pose_is_late(found.fit.clocks):
        return found
    # then that is an effect to be named, measured by the clock of the rotors
    options = replace(found.options, clock="rotor speed")
    return First(identify(logs, vehicle, options, near=found.fit), options, found.said)


def _of_possible_body(logs: Sequence[FlightLog], vehicle: Vehicle, white: First) -> First:
    """The fit made again with lasting disturbances where white ones made a body of it that cannot be.

    Rotors that answer disturbances for long look like a heavy body then, and every candidate torque would be judged
    beside that. What did not settle is held for good: each fit of the search would find it out anew.
    """
    wrong = too_large_inertias(vehicle, white.fit.vehicle, white.fit.free_names)
    if white.options.gusts != "white" or not wrong:
        return white
    options = replace(white.options, gusts="estimate")
    fit = identify(logs, vehicle, options, near=white.fit)
    if fit.noise.gusts is None or too_large_inertias(vehicle, fit.vehicle, fit.free_names):
        return white
    unsettled = [e for e in fit.parameters if e.status == NOT_SETTLED]
    said = (
        f"with disturbances taken for white noise {' and '.join(wrong)} came out too large for any such vehicle; all "
        "fits were made with lasting disturbances among the states",
        *(
            f"{e.name} was held at {e.value:.4g} {e.unit} throughout: its estimate did not settle; the errors of what "
            "goes along with it do not allow for that"
            for e in unsettled
        ),
    )
    return First(fit, replace(options, held=(*options.held, *(e.name for e in unsettled))), said)
