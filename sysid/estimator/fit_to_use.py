"""A fit that may be used, if one of the two ways to treat disturbances gives one; and why none may be, by trials."""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from sysid.estimator import verdict as verdicts
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from sysid.estimator.result import NOT_SETTLED, Identification
from sysid.estimator.verdict import Use
from vehicle import Vehicle

logger = logging.getLogger(__name__)

TREATED = {"white": "taken for white noise", "estimate": "estimated as lasting"}
"""What the options do with disturbances, in words."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """A fit, and how it was made."""

    fit: Identification
    options: Options
    """With which it was made, and others beside it are to be."""
    said: tuple[str, ...] = ()
    """Sentences on what differs from the options that were asked for."""


@dataclass(frozen=True, slots=True)
class Cause:
    """What a trial found to be the likely reason why a fit is not to be used."""

    sentence: str
    held: tuple[str, ...] = ()
    """Parameters to hold ..."""
    without: str = ""
    """... or the flight to leave out ..."""
    steps: int = 0
    """... or the iterations to allow; 0: as before."""


def fit_to_use(logs: Sequence[FlightLog], vehicle: Vehicle, options: Options, *, progress: Progress = silent) -> Chosen:
    """The fit as the options have it, or, where only that may be used, with disturbances treated the other way.

    Rotors that answer disturbances for long look like a heavy body where these are taken for white noise; lasting ones
    can take up a force that is the model's. What did not settle is held for good: later fits would find it out anew.
    """
    first = identify(logs, vehicle, options, progress=progress)
    if not first.converged or first.verdict.use is not Use.REJECTED:
        return Chosen(first, options)
    other = replace(options, gusts="estimate" if options.gusts == "white" else "white")
    fit = identify(logs, vehicle, other, near=first)
    if (other.gusts == "estimate" and fit.noise.gusts is None) or fit.verdict.use is Use.REJECTED:
        return Chosen(first, options)
    unsettled = [e for e in fit.parameters if e.status == NOT_SETTLED]
    said = (
        f"with disturbances {TREATED[options.gusts]} the fit is not to be used ({first.verdict.reasons[0]}); they were "
        f"{TREATED[other.gusts]}",
        *(
            f"{e.name} was held at {e.value:.4g} {e.unit} throughout: its estimate did not settle; the errors of what "
            "goes along with it do not allow for that"
            for e in unsettled
        ),
    )
    return Chosen(fit, replace(other, held=(*options.held, *(e.name for e in unsettled))), said)


def likely_cause(logs: Sequence[FlightLog], vehicle: Vehicle, made: Chosen) -> Cause | None:
    """The first change with which the fit may be used, by trial; None where none of them helps.

    Tried are: more iterations, the file's value for each parameter that is not physical, and the flights without the
    one that is explained worst.
    """
    for cause, options, kept in _changes(logs, made):
        try:
            fit = identify(kept, vehicle, options, near=made.fit if len(kept) == len(logs) else None)
        except InputError as error:
            logger.info("trial of %s: %s", cause, error)
            continue
        if fit.converged and fit.verdict.use is not Use.REJECTED:
            return replace(cause, sentence=f"{cause.sentence} the fit is {fit.verdict.use}")
    return None


def _changes(logs: Sequence[FlightLog], made: Chosen) -> Iterator[tuple[Cause, Options, Sequence[FlightLog]]]:
    """Each change in words, with the options and flights of its trial."""
    fit, options = made.fit, made.options
    if not fit.converged:
        steps = 2 * options.max_iterations
        yield Cause(f"with {steps} steps", steps=steps), replace(options, max_iterations=steps), logs
    held = tuple(n for n in fit.verdict.unphysical if n != verdicts.THRUST)
    if held:
        said = f"with the vehicle file's {' and '.join(held)}"
        yield Cause(said, held=held), replace(options, held=(*options.held, *held)), logs
    if len(logs) > 1:
        worst = _worst_flight(fit)
        name = str(logs[worst].metadata.get("name", f"flight {worst + 1}"))
        kept = [log for i, log in enumerate(logs) if i != worst]
        yield Cause(f"without {name}", without=name), options, kept


def _worst_flight(fit: Identification) -> int:
    """Which log the model explains worst, by the mean square of the whitened defects."""
    worst = max(
        zip(fit.flights, fit.solution.residuals, strict=True), key=lambda pair: float(np.square(pair[1][0]).mean())
    )
    return worst[0].log_index
