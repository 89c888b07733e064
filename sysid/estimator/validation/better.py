"""Whether one model predicts better than another on the same flights: the ratio of errors, with its interval."""

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import IndexArray
from sysid.estimator.predicts import Predicts
from sysid.estimator.validation.comparison import HORIZONS_S, JUDGED_S, Comparison, Deviation

BLOCK_S = 3.0
"""Errors are taken as independent between stretches of this length."""
LEAST_BLOCKS = 3
"""With fewer the interval is not known."""
MOST_M = 1e3
"""Predictions that are farther off than this, or no number, are just wrong."""


def predicts(found: Comparison, given: str, fitted: str, on: str) -> Predicts:
    """The errors of two models of a comparison, and the 90 % interval of their ratio.

    Args:
        given, fitted: names of the models.
        on: in words, what the flights are.
    """
    both = np.stack([_squares(found.deviations[name]) for name in (given, fitted)], axis=1)
    sums = np.stack([np.bincount(_blocks(found.deviations[given]), weights=squares) for squares in both.T], axis=1)
    errors = np.sqrt(sums.sum(axis=0) / len(both))
    return Predicts(JUDGED_S, float(errors[0]), float(errors[1]), ratio90(sums), on)


def ratio90(sums: FloatArray) -> tuple[float, float]:
    """90 % interval of the ratio of root mean square errors, by a jackknife over blocks; 0 to infinity for too few.

    Args:
        sums: (b, 2) sum of squares of each block, under the given model and under the fitted one.
    """
    from scipy.special import stdtrit

    count = len(sums)
    if count < LEAST_BLOCKS:
        return 0.0, np.inf
    total = sums.sum(axis=0)
    tiny = 1e-12 * float(total.max()) + 1e-300

    def half_log(s: FloatArray) -> FloatArray:
        return 0.5 * np.log((s[..., 1] + tiny) / (s[..., 0] + tiny))

    left = half_log(total - sums)
    sigma = np.sqrt((count - 1) / count * float(((left - left.mean()) ** 2).sum()))
    half = float(stdtrit(count - 1, 0.95)) * sigma
    middle = float(half_log(total))
    return float(np.exp(middle - half)), float(np.exp(min(middle + half, 700.0)))


def _squares(deviations: tuple[tuple[Deviation, ...], ...]) -> FloatArray:
    """(k,) squared position errors at the judged horizon, flight after flight."""
    at = HORIZONS_S.index(JUDGED_S)
    errors = np.concatenate([np.linalg.norm(d[at].pose[:, :3], axis=1) for d in deviations])
    return np.minimum(np.nan_to_num(errors, nan=MOST_M, posinf=MOST_M), MOST_M) ** 2


def _blocks(deviations: tuple[tuple[Deviation, ...], ...]) -> IndexArray:
    """(k,) the block that each prediction is in, counted through all flights."""
    found: list[IndexArray] = []
    for per_horizon in deviations:
        time_s = per_horizon[HORIZONS_S.index(JUDGED_S)].time_s
        first = found[-1][-1] + 1 if found else 0
        found.append(first + ((time_s - time_s[0]) / BLOCK_S).astype(np.intp))
    return np.concatenate(found)
