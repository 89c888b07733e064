"""The fit a diagnosis begins with, and the options all its fits share: which noise, which clock, what is held."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from flight import FlightLog, Progress
from sysid.estimator.flights.clocks import pose_is_late
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from sysid.estimator.result import NOT_SETTLED, Identification
from sysid.estimator.verdict import Use
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
    found = _to_be_used(logs, vehicle, First(identify(logs, vehicle, options, progress=progress), options, ()))
    if not pose_is_late(found.fit.clocks):
        return found
    # then that is an effect to be named, measured by the clock of the rotors
    options = replace(found.options, clock="rotor speed")
    return First(identify(logs, vehicle, options, near=found.fit), options, found.said)


def _to_be_used(logs: Sequence[FlightLog], vehicle: Vehicle, white: First) -> First:
    """The fit made again with lasting disturbances, as `identify` has them, where it is not to be used with white ones.

    Rotors that answer disturbances for long look like a heavy body then, and every candidate torque would be judged
    beside that. What did not settle is held for good: each fit of the search would find it out anew.
    """
    if white.options.gusts != "white" or not white.fit.converged or white.fit.verdict.use is not Use.REJECTED:
        return white
    options = replace(white.options, gusts="estimate")
    fit = identify(logs, vehicle, options, near=white.fit)
    if fit.noise.gusts is None or fit.verdict.use is Use.REJECTED:
        return white
    unsettled = [e for e in fit.parameters if e.status == NOT_SETTLED]
    said = (
        f"with disturbances taken for white noise the fit is not to be used ({white.fit.verdict.reasons[0]}); all fits "
        "were made with lasting disturbances among the states",
        *(
            f"{e.name} was held at {e.value:.4g} {e.unit} throughout: its estimate did not settle; the errors of what "
            "goes along with it do not allow for that"
            for e in unsettled
        ),
    )
    return First(fit, replace(options, held=(*options.held, *(e.name for e in unsettled))), said)
