"""Probabilities with bounds that the number of flights supports, and shares of a variance."""

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flight import FloatArray

CONFIDENCE = 0.95
"""Of every upper bound, one-sided."""
QUANTILES = (0.5, 0.9, 0.99)
LEAST_SHARE = 0.02
"""Of a variance: less is chance."""
_NOTHING_NEW = 1e-12
"""Of a column's square, what is left of it without the columns before: rounding."""
_DIGITS = 11
"""Of a bound that are kept: the last of the C library's are each processor's own."""
_MOST_COLUMNS = 0.5
"""Of the values, from which on their share is noise."""
_FOR_POWERS = 40
"""Values for each column, from which on there are columns of higher powers: fewer fit those to chance."""
_LEAST = 30
"""Values, from which on a variance is decomposed."""


@dataclass(frozen=True, slots=True)
class Probability:
    """How often something happened, and the largest probability that this allows."""

    count: int
    flights: int
    upper: float
    """Exact bound (Clopper and Pearson 1934), confidence `CONFIDENCE`; 3 / n where it never happened."""

    @staticmethod
    def of(happened: np.ndarray) -> "Probability":
        """Of (n,) flights, whether it happened in each."""
        count, flights = int(np.count_nonzero(happened)), len(happened)
        return Probability(count, flights, upper_bound(count, flights))

    @property
    def estimate(self) -> float:
        return self.count / self.flights

    def as_dict(self) -> dict[str, float | int]:
        return {"count": self.count, "flights": self.flights, "estimate": self.estimate, "upper95": self.upper}

    def __str__(self) -> str:
        return f"{self.count} of {self.flights}: at most {self.upper:.1e}"


def upper_bound(count: int, flights: int, confidence: float = CONFIDENCE) -> float:
    """The largest probability with which `count` or fewer of that many flights have the chance 1 - `confidence`."""
    from scipy.special import betaincinv

    if count >= flights:
        return 1.0
    return float(f"{betaincinv(count + 1, flights - count, confidence):.{_DIGITS}g}")


def flights_for(risk: float, count: int = 0) -> int:
    """The fewest flights that, if it happens in `count` of them, show a risk to be met."""
    least = int(np.ceil(np.log(1.0 - CONFIDENCE) / np.log1p(-risk)))
    if count == 0:
        return least
    most = 2 * least
    while upper_bound(count, most) > risk:
        most *= 2
    return least + bisect_left(range(least, most), True, key=lambda n: upper_bound(count, n) <= risk)


def quantiles(values: FloatArray) -> dict[str, float]:
    """Quantiles of (n,) values by name, the finite ones alone."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return {}
    at = (0.0, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0)
    names = ("least", "q01", "q10", "median", "q90", "q99", "most")
    return dict(zip(names, (float(q) for q in np.quantile(finite, at)), strict=True))


def decomposable(values: FloatArray) -> bool:
    """Whether (n,) values, the finite ones, are enough and unlike enough to ask what their variance comes from."""
    used = values[np.isfinite(values)]
    return len(used) >= _LEAST and float(np.ptp(used)) > 0.0


def at_least_nil(shares: Mapping[str, float]) -> dict[str, float]:
    """Shares, the largest first."""
    return dict(sorted(((name, max(0.0, share)) for name, share in shares.items()), key=lambda item: -item[1]))


def adjusted_shares(values: FloatArray, factors: Mapping[str, FloatArray]) -> dict[str, float]:
    """The share of the variance of (n,) values that each factor alone explains.

    By chance a little below 0 as often as above, so that their sum is not too large.

    First-order indices by regression on a factor's draws (n, q), their products in pairs, and with enough values (of
    a yes or no: of the rarer) their powers up to the fifth: where rotors come to their limits, little is quadratic
    (Sobol indices of a polynomial chaos: Sudret 2008). Less what as many columns of noise would explain (adjusted R
    squared); none, 0, of a factor with half as many of those as values, or more: that would be noise.
    """
    used = np.isfinite(values)
    if not decomposable(values):
        return {}
    y = values[used] - values[used].mean()
    total = float((y * y).sum())
    told = _telling(values[used])
    return {name: _explained(y, draws[used], total, told) for name, draws in factors.items()}


def _telling(values: FloatArray) -> int:
    """How many of (n,) values tell something: all, or of two different ones the rarer."""
    low = int(np.count_nonzero(values == values.min()))
    high = int(np.count_nonzero(values == values.max()))
    return min(low, high) if low + high == len(values) else len(values)


def _explained(y: FloatArray, draws: FloatArray, total: float, told: int) -> float:
    """By orthogonal columns one by one (modified Gram-Schmidt), those without anything new left out: no BLAS, whose
    last bits are each processor's own."""
    q = draws.shape[1]
    rows, columns = np.triu_indices(q)
    squares, cubes = draws * draws, draws * draws * draws
    terms = np.column_stack([draws, draws[:, rows] * draws[:, columns]])
    if told >= _FOR_POWERS * (terms.shape[1] + 3 * q):
        terms = np.column_stack([terms, cubes, squares * squares, squares * cubes])
    terms = (terms - terms.mean(axis=0)).T.copy()
    left, kept = y.copy(), 0
    sizes = (terms * terms).sum(axis=1)
    for i, term in enumerate(terms):
        size = float((term * term).sum())
        if size <= _NOTHING_NEW * sizes[i]:
            continue
        left -= float((left * term).sum()) / size * term
        terms[i + 1 :] -= (terms[i + 1 :] * term).sum(axis=1, keepdims=True) / size * term
        kept += 1
    n = len(y)
    if kept >= _MOST_COLUMNS * n:
        return 0.0
    return 1.0 - float((left * left).sum()) / total * (n - 1) / (n - 1 - kept)
