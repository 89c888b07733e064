"""Are these flights of one vehicle? Two groups, each fitted by itself, against one model of all with what was added."""

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog, InputError
from flight.rotations import FloatArray
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from sysid.estimator.result import Identification
from vehicle import Vehicle

logger = logging.getLogger(__name__)

LEFT_APART = 0.8
"""Of two vehicles are flights of which two groups apart leave less than this share of what is left together. Of one
vehicle they leave no less, however much its model lacks: apart, they have no more effects than the file."""
WORTH_A_TRIAL = 100.0
"""Log likelihood that groups must gain by parameters of their own before they are fitted apart, which takes seconds."""


def of_two_vehicles(
    logs: Sequence[FlightLog], given: Vehicle, together: Identification, options: Options
) -> str | None:
    """A sentence that names the flights of each, or None.

    The groups are those whose parameters differ most.

    Args:
        given: the vehicle as the user gave it; each group is fitted with its effects alone.
        together: the last model of all flights, with everything that was added.
    """
    if len(logs) < 2:
        return None
    gain, one = _group(together, len(logs))
    if gain < WORTH_A_TRIAL:
        return None
    one = one if one[0] else ~one
    groups = [[log for log, inside in zip(logs, mask, strict=True) if inside] for mask in (one, ~one)]
    try:
        fits = [identify(group, given, options) for group in groups]
    except InputError as error:
        logger.info("flights apart could not be fitted: %s", error)
        return None
    share = _left(fits) / float(np.exp(np.log(together.noise.process).mean()))
    if share >= LEFT_APART:
        return None
    first, second = (", ".join(dict.fromkeys(f.name for f in fit.flights)) for fit in fits)
    return (
        f"the flights {first} and the flights {second} are not of one vehicle, load or set of propellers: fitted "
        f"apart, they leave {share:.0%} of what all together leave. Diagnose each group by itself"
    )


def _group(fit: Identification, logs: int) -> tuple[float, NDArray[np.bool_]]:
    """(logs,) the group that gains most, to first order, by parameters of its own; first, how much."""
    size = len(fit.unknowns.model)
    pull, information = np.zeros((logs, size)), np.zeros((logs, size, size))
    for flight, scores, known in zip(fit.flights, fit.solution.scores, fit.solution.information, strict=True):
        pull[flight.log_index] += np.sum([block for _, block in scores], axis=0)[:size]
        information[flight.log_index] += known[:size, :size]
    found = [_grown(start, pull, information) for start in np.eye(logs, dtype=bool)]
    return max(((_gain(mask, pull, information), mask) for mask in found), key=lambda pair: pair[0])


def _grown(mask: NDArray[np.bool_], pull: FloatArray, information: FloatArray) -> NDArray[np.bool_]:
    """The group after every change of one flight that lets it gain more."""
    while True:
        others = [mask ^ one for one in np.eye(len(mask), dtype=bool) if 0 < (mask ^ one).sum() < len(mask)]
        best = max(others, key=lambda other: _gain(other, pull, information), default=mask)
        if _gain(best, pull, information) <= _gain(mask, pull, information):
            return mask
        mask = best


def _gain(mask: NDArray[np.bool_], pull: FloatArray, information: FloatArray) -> float:
    """Log likelihood that a group and the rest gain together by moving to their own optimum."""
    own = pull[mask].sum(axis=0)
    spread = np.sum([np.linalg.pinv(information[part].sum(axis=0), rcond=1e-10) for part in (mask, ~mask)], axis=0)
    return float(0.5 * own @ spread @ own)


def _left(fits: Sequence[Identification]) -> float:
    """Unexplained acceleration of all groups, the geometric mean over its six channels."""
    time_s = [sum(float(f.step_s.sum()) for f in fit.flights) for fit in fits]
    square = np.average([np.square(fit.noise.process) for fit in fits], axis=0, weights=time_s)
    return float(np.exp(0.5 * np.log(square).mean()))
