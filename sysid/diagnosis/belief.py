"""One probability for the whole sentence of a diagnosis, and what else may be true: another name, or something unknown.

A sentence names effects, maybe a curve, and says by its silence that nothing more is missing. It is right if every name
is right, and the curve is, or nothing unknown is left where none is drawn. So the probabilities multiply. All of them
hold within the flown envelope: of what acts only beyond it flights say nothing.
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

    def sentence(self, *, named: bool) -> str:
        """Each probability with what it is of.

        Args:
            named: whether the diagnosis says that anything is missing.
        """
        if named:
            right, unknown, other = (
                "this is right and nothing else is missing within the flown envelope",
                "something unknown is missing too",
                "another known effect is missing or a name is wrong",
            )
        else:
            right, unknown, other = (
                "nothing is missing within the flown envelope",
                "something unknown is missing",
                "a known effect is missing",
            )
        return (
            f"probability {self.as_stated:.0%} that {right}, {self.something_unknown:.0%} that {unknown}, "
            f"{self.otherwise:.0%} that {other}"
        )

    def as_dict(self) -> dict[str, float]:
        return {
            "as_stated": self.as_stated,
            "something_unknown": self.something_unknown,
            "otherwise": self.otherwise,
        }


def belief(names: Sequence[float], *, curve: float | None, left: float, most: float) -> Belief:
    """Of a sentence.

    Args:
        names: probability that each name is right, and that no effect is missing that the sentence says nothing of.
        curve: probability that channel and variable of the curve that is drawn are right; None where none is.
        left: log odds, on blocks left out, of the best curve that is of no name's form: a name does not claim the exact
            form of its law.
        most: no sentence is believed more.
    """
    named = float(np.prod(names)) if len(names) else 1.0
    rest = curve if curve is not None else 1.0 - curve_is_there(left)
    if not np.isfinite(named * rest):  # what is no number is not believed; `min` would take it for the most
        return Belief(0.0, 0.0, 1.0)
    stated = min(most, named * rest)
    unknown = min(named * (1.0 - rest), 1.0 - stated)
    return Belief(stated, unknown, 1.0 - stated - unknown)


def curve_is_there(log_odds: float) -> float:
    """Probability that a curve which blocks left out favour by so much is there at all; others may be as good."""
    return rising(log_odds, THRESHOLDS.even_odds_curve, 4)


def supported(reduction: float, dispersion: float) -> float:
    """Probability that an effect which lowers the cost of judging flights by so much is there at all."""
    return rising(reduction / max(dispersion, 1.0), THRESHOLDS.even_reduction, 2)


def rising(size: float, even: float, power: int) -> float:
    """From 0 over 0.5 at `even` to 1; of log odds, slower than the logistic curve that exact ones would mean."""
    return 1.0 / (1.0 + (even / max(size, 1e-9)) ** power)
