"""One probability for the whole sentence of a diagnosis, and what else may be true: another name, or something unknown.

A sentence names effects, maybe a curve, and says by its silence that nothing more is missing. It is right if every name
is right, and the curve is, or nothing unknown is left where none is drawn. So the probabilities multiply.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.diagnosis.thresholds import THRESHOLDS


@dataclass(frozen=True, slots=True)
class Belief:
    """Probabilities that sum to one."""

    as_stated: float
    """The sentence is right as it stands."""
    something_unknown: float
    """The names are right, and something is missing that is no known effect and is not said, or is said wrongly."""
    otherwise: float
    """Another effect is missing, or one too many is named."""

    def as_dict(self) -> dict[str, float]:
        return {
            "as_stated": self.as_stated,
            "something_unknown": self.something_unknown,
            "otherwise": self.otherwise,
        }


def belief(names: Sequence[float], *, curve: float | None, left: float, most: float) -> Belief:
    """Of a sentence.

    Args:
        names: probability that each name is right; of a sentence without names, that none is missing.
        curve: probability that channel and variable of the curve that is drawn are right; None where none is.
        left: log odds, on blocks left out, of the best curve that nothing said explains.
        most: no sentence is believed more.
    """
    named = float(np.prod(names)) if len(names) else 1.0
    rest = curve if curve is not None else 1.0 - unknown_left(left)
    if not np.isfinite(named * rest):  # what is no number is not believed; `min` would take it for the most
        return Belief(0.0, 0.0, 1.0)
    stated = min(most, named * rest)
    unknown = min(named * (1.0 - rest), 1.0 - stated)
    return Belief(stated, unknown, 1.0 - stated - unknown)


def unknown_left(log_odds: float) -> float:
    """Probability that something unknown is missing, by the best curve that is not stated."""
    return 1.0 / (1.0 + (THRESHOLDS.even_odds_left / max(log_odds, 1e-9)) ** 2)


def supported(reduction: float, dispersion: float) -> float:
    """Probability that an effect which lowers the cost of judging flights by so much is there at all."""
    odds = max(reduction, 0.0) / max(dispersion, 1.0)
    return odds / (odds + THRESHOLDS.even_reduction)
