"""A price on space where an obstacle could hide that the map does not show: of two ways as long, the seen one is taken.

It stands beside the margin, which no price can buy off. A map tells what its images resolve, and the planner does not
know what a map is: it takes anything with `hidden_share(points)`.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from flight import FloatArray, FormatError, InputError, Trajectory, TrajectoryFile

MOST = 100.0
"""Largest price: beyond it a way through hidden space is never shorter than one round the map."""
_STEP_M = 0.05
_STEP_S = 0.01


class SeenSpace(Protocol):
    """What knows how well each place was seen."""

    def hidden_share(self, points_world_m: FloatArray) -> FloatArray: ...


@dataclass(frozen=True, slots=True, eq=False)
class HiddenPrice:
    """By how much a way is dearer where something could hide."""

    price: float
    """Metres that a metre counts more in space where anything could hide; in well-seen space it counts one."""
    space: SeenSpace
    """How much could hide at a place, 0 to 1."""

    def __post_init__(self) -> None:
        require_price(self.price)

    def per_metre(self, points_world_m: FloatArray) -> FloatArray:
        """(n,) what a metre costs more at each point (n, 3)."""
        return self.price * self.space.hidden_share(points_world_m)

    def of_lines_m(self, starts_world_m: FloatArray, ends_world_m: FloatArray) -> FloatArray:
        """(n,) what straight lines between points (n, 3) cost more than their lengths."""
        lengths_m = np.linalg.norm(ends_world_m - starts_world_m, axis=1)
        if not len(lengths_m):
            return lengths_m
        count = 1 + int(np.ceil(lengths_m.max() / _STEP_M))
        share = (np.arange(count) + 0.5)[:, None, None] / count
        points = starts_world_m + share * (ends_world_m - starts_world_m)
        return lengths_m * self.per_metre(points.reshape(-1, 3)).reshape(count, -1).mean(axis=0)

    def cost_m(self, polyline_world_m: FloatArray) -> float:
        """What a polyline (n, 3) costs: its length, and the price of it."""
        starts, ends = polyline_world_m[:-1], polyline_world_m[1:]
        return float((np.linalg.norm(ends - starts, axis=1) + self.of_lines_m(starts, ends)).sum())

    def paid(self, flown: Trajectory) -> "Paid":
        """What a trajectory pays."""
        path = flown.position(flown.sample(_STEP_S))
        return Paid(self.price, float(self.of_lines_m(path[:-1], path[1:]).sum()))


@dataclass(frozen=True, slots=True)
class Paid:
    """What a trajectory pays for space where an obstacle could hide."""

    price: float
    """As asked."""
    paid_m: float
    """By how many metres it counts longer than it is."""

    def as_dict(self) -> dict[str, float]:
        return {"hidden_price": self.price, "hidden_price_paid_m": self.paid_m}


def asked_of(item: TrajectoryFile) -> float | None:
    """The price that a file's trajectory was planned with; None if none was asked.

    Raises:
        FormatError: its record of that is damaged.
    """
    given = item.check.get("hidden_price")
    if given is None:
        return None
    try:
        return require_price(float(given))
    except (TypeError, ValueError, InputError) as error:
        raise FormatError(f"the price of hidden space in a trajectory file is damaged: {error}") from error


def require_price(price: float) -> float:
    """Check a price.

    Raises:
        InputError: it is out of range.
    """
    if not 0.0 < price <= MOST:
        raise InputError(f"the price of hidden space is {price:g}; it must be above 0 and at most {MOST:g}")
    return price
