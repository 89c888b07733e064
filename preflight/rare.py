"""A loss too rare to count: subset simulation of the numbers that flights are made of."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, Progress, portable
from preflight import remedies, subset
from preflight.core import FINISHED, WITHIN
from preflight.draws import Drawn
from preflight.luck import Luck
from preflight.record import OVERTURNED_RAD, Record
from preflight.statistics import LEAST_SHARE, Probability
from preflight.subset import Found, Points

FLIGHTS = 1000
"""Of a level, unless told otherwise."""
LEAST_FLIGHTS, MOST_FLIGHTS = 200, 100_000
_GIVEN_UP = 0.05
"""Margin, relative to that of other flights, of those that the controller gave up."""
_LEAST_LOST = 10
_CHANCE = 10.0
"""Relative entropy that numbers of as many flights show by chance, times the flights: those of a chain are alike."""
_PARTS = {"wind direction": "wind", "start heading": "start"}
"""Inputs that are part of a factor of another name."""

Fly = Callable[[Mapping[str, FloatArray], Luck], Record]
"""The flights that are made of given numbers and luck."""


@dataclass(frozen=True, slots=True)
class Risk(Probability):
    """A probability by subset simulation; `count`, the flights of the last level in which it happened."""

    chance: float
    """The estimate; of the last level, which is larger, where the event was not reached."""
    reached: bool
    levels: int

    @property
    def estimate(self) -> float:
        return self.chance

    def as_dict(self) -> dict[str, float | int]:
        return {
            "count": self.count, "flights": self.flights, "estimate": self.chance, "upper95": self.upper,
            "levels": self.levels, "reached": self.reached,
        }  # fmt: skip

    def __str__(self) -> str:
        about = f"about {self.chance:.1e}, " if self.reached else ""
        return f"{about}at most {self.upper:.1e} by {self.levels} levels, {self.flights} flights"


def assumed(record: Record) -> str:
    """A sentence on what the levels do not look for, with the bound of counting the first level's flights."""
    counted = Probability.of(record.lost)
    return (
        "levels find a loss that less clearance, more tilt or more strain of the controller leads to; any other is, by "
        f"the first {counted.flights} flights, at most {counted.upper:.1e}"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Rare:
    """What the levels came to."""

    risk: Risk
    worst: Record
    """Of the last level's flights."""
    shares: Mapping[str, float]
    """Of what makes a flight lost, by factor, the largest first; empty where no lost flight was reached."""
    cut_off: bool
    """Whether Ctrl-C ended it."""

    def with_luck(self, of_clearance: Mapping[str, float], counted: Mapping[str, float]) -> dict[str, float]:
        """The shares, and that of what comes anew in every flight, which is what they leave.

        Args:
            of_clearance: shares of its variance, the largest first: they tell what comes anew at all.
            counted: shares of loss among the first flights; empty where too few of those were lost. They tell noise,
                gusts and drop-outs apart, which the lost flights' numbers do not: they are then returned.
        """
        if counted:
            return dict(counted)
        kinds = [name for name, share in of_clearance.items() if name in WITHIN and share > LEAST_SHARE]
        if not self.shares or not kinds:
            return dict(self.shares)
        left = max(1.0 - sum(self.shares.values()), 0.0)
        shares = dict(self.shares)
        together = remedies.OR.join(kinds)
        shares[together] = shares.get(together, 0.0) + left
        return dict(sorted(shares.items(), key=lambda item: -item[1]))


@dataclass(frozen=True, slots=True)
class Margin:
    """How far flights were from being lost, as a share of the middle flight's.

    The least of clearance, tilt and what keeps the controller from giving up. A flight that was given up is not lost
    yet, and nearer to it than one that was not, unless that one all but touched something.
    """

    clearance_m: float
    tilt_rad: float
    strain: float

    @staticmethod
    def of(record: Record) -> "Margin":
        known = record.clearance_m[np.isfinite(record.clearance_m)]
        middle = float(np.median(known)) if known.size else 0.0
        tilt_rad, strain = OVERTURNED_RAD - np.nanmedian(record.tilt_rad), 1.0 - np.nanmedian(record.strain)
        return Margin(middle if middle > 0.0 else 1.0, max(float(tilt_rad), 0.1), max(float(strain), 0.1))

    def __call__(self, record: Record) -> FloatArray:
        """(n,) below zero for those lost, and for no others."""
        value = np.minimum(record.clearance_m / self.clearance_m, (OVERTURNED_RAD - record.tilt_rad) / self.tilt_rad)
        kept = np.minimum(value, np.maximum((1.0 - record.strain) / self.strain, _GIVEN_UP))
        value = np.where(record.ending == FINISHED, kept, _GIVEN_UP * value)
        value = np.where(np.isfinite(value), value, np.inf)
        return np.where(record.lost & (value >= 0.0), -1.0, value)


def find(record: Record, drawn: Drawn, fly: Fly, *, seed: int, enough: float, progress: Progress) -> Rare:
    """Go on from flights that were drawn independently.

    Args:
        record: of all of them, as many as `drawn`.
        enough: the risk that is to be shown.
    """
    margin, records = Margin.of(record), [record]
    names, widths = list(drawn.inputs), [value.shape[1] for value in drawn.inputs.values()]
    levels = 1

    def score(points: Points) -> FloatArray:
        flown = sum(len(part) for part in records) - len(record)
        done = flown / ((1.0 - subset.SHARE) * len(record)) - (levels - 1)
        progress(f"level {levels + 1}", min(max(done, 0.0), 1.0))
        parts = np.split(points.normal, np.cumsum(widths)[:-1], axis=1)
        records.append(fly(dict(zip(names, parts, strict=True)), points.luck))
        return margin(records[-1])

    def ended(count: int, probability: float) -> None:
        nonlocal levels
        levels = count

    first = Points.independent(np.concatenate(list(drawn.inputs.values()), axis=1))
    found = subset.run(score, first, margin(record), seed=seed, enough=enough, level=ended)
    worst = Record.joined(records)[found.points.number]
    risk = Risk(found.count, found.samples, found.upper, found.estimate, found.reached, found.levels)
    normal = dict(zip(names, np.split(found.points.normal, np.cumsum(widths)[:-1], axis=1), strict=True))
    return Rare(risk, worst, _shares(found, normal, drawn), found.cut_off)


def _shares(found: Found, normal: Mapping[str, FloatArray], drawn: Drawn) -> dict[str, float]:
    """How much of what the lost flights differ in is in a factor's numbers: their relative entropy.

    That of all numbers together is -log of the probability; that of one is taken as a normal number's of the same mean
    and variance, less what as few flights show by chance.
    """
    lost = found.score < 0.0
    if not (found.reached and np.count_nonzero(lost) >= _LEAST_LOST) or found.estimate >= 0.5:
        return {}
    whole, chance = -float(portable.logarithm(found.estimate)), _CHANCE / np.count_nonzero(lost)
    shares = dict.fromkeys(drawn.factors, 0.0)
    for name, value in normal.items():
        factor = _factor(name, drawn.factors)
        if factor is not None:
            shares[factor] += float(np.maximum(_entropy(value[lost]) - chance, 0.0).sum()) / whole
    return dict(sorted(((name, min(share, 1.0)) for name, share in shares.items()), key=lambda item: -item[1]))


def _entropy(value: FloatArray) -> FloatArray:
    """(columns,) of (n, columns) numbers, relative to standard normal ones."""
    mean, variance = value.mean(axis=0), np.maximum(value.var(axis=0), 1e-6)
    return 0.5 * (mean * mean + variance - 1.0 - portable.logarithm(variance))


def _factor(name: str, factors: Mapping[str, FloatArray]) -> str | None:
    name = _PARTS.get(name, name)
    return next((factor for factor in factors if name in factor.split(" with ")), None)
