"""More margin near parts of a path than elsewhere: there obstacles count as so much nearer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flight import FloatArray, FormatError, InputError
from planner.request import space

MOST_M, MOST_POINTS = 100.0, 1000
"""Margins are below it; points of a polyline, at most."""
_BESIDE = 2.0
"""How much farther than the required clearance a margin reaches, over how much larger it is: a path that makes room
moves by that much."""


@dataclass(frozen=True, slots=True)
class LocalMargin:
    """A margin to keep near a polyline, in place of a smaller one."""

    margin_m: float
    """Beyond the vehicle's sphere."""
    polyline_world_m: tuple[tuple[float, float, float], ...]
    """One point or more."""
    reach_m: float | None = None
    """How far from it the margin is asked for; None: as `reach_m` tells from what is asked elsewhere."""

    def __post_init__(self) -> None:
        if not 0.0 < self.margin_m < MOST_M:
            raise InputError(f"a local margin of {self.margin_m:g} m; it must be above 0 and below {MOST_M:g} m")
        if not 1 <= len(self.polyline_world_m) <= MOST_POINTS or not np.isfinite(self.polyline_world_m).all():
            raise InputError(f"a local margin needs a polyline of 1 to {MOST_POINTS} finite points")
        if self.reach_m is not None and not 0.0 < self.reach_m < np.inf:
            raise InputError(f"a local margin reaches {self.reach_m:g} m; it must be positive")

    def as_dict(self) -> dict[str, Any]:
        reach = {} if self.reach_m is None else {"reach_m": self.reach_m}
        polyline = [list(point) for point in self.polyline_world_m]
        return {"margin_m": self.margin_m, "polyline_world_m": polyline, **reach}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> "LocalMargin":
        """What `as_dict` made.

        Raises:
            FormatError: it was not made by `as_dict`.
        """
        try:
            points = [tuple(float(x) for x in point) for point in document["polyline_world_m"]]
            polyline = tuple((x, y, z) for x, y, z in points)
            reach = document.get("reach_m")
            return cls(float(document["margin_m"]), polyline, None if reach is None else float(reach))
        except (KeyError, TypeError, ValueError, InputError) as error:
            raise FormatError(f"a local margin is damaged: {error}") from error


class Roomier:
    """A field in which obstacles near some polylines count as nearer, by as much as their margin is above the rest's.

    "At least `required_m`" then asks for the further margin within `reach_m` of a polyline, and for no more beyond. It
    changes no faster than the way flown. Distances of a sampled field are those that it proves (`space.distance`).
    """

    def __init__(
        self, field: space.DistanceField, margins: Sequence[LocalMargin], margin_m: float, required_m: float
    ) -> None:
        self.field, self.required_m = field, required_m
        self._further = [
            (
                each.margin_m - margin_m,
                np.array(each.polyline_world_m, dtype=np.float64),
                reach_m(each.margin_m - margin_m, required_m) if each.reach_m is None else each.reach_m,
            )
            for each in margins
            if each.margin_m > margin_m
        ]
        self.free_within_world_m = _bounds(field)

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray:
        """(n,) metres; minus infinity where the field does not know."""
        points = np.asarray(points_world_m, dtype=np.float64).reshape(-1, 3)
        free = space.distance(self.field, points)
        least = free
        for further_m, polyline, within_m in self._further:
            beyond_m = self.required_m + space.far_from(polyline, points) - within_m
            least = np.minimum(least, np.maximum(free - further_m, np.minimum(free, beyond_m)))
        return least


def reach_m(further_m: float, required_m: float) -> float:
    """How far from its polyline a margin is asked for that is larger by `further_m`."""
    return required_m + _BESIDE * further_m


def _bounds(field: space.DistanceField) -> tuple[FloatArray, FloatArray] | None:
    """Corners of a box outside of which nothing is free; None if there is none."""
    grid = getattr(field, "grid", None)
    if grid is None:
        return getattr(field, "free_within_world_m", None)
    origin = np.asarray(grid.origin_world_m, dtype=np.float64)
    return origin, origin + np.asarray(grid.voxel_m) * np.asarray(grid.shape)
