"""The flights that are worth looking at, flown once more: the worst of all, and a bundle of the first ones."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, Trajectory
from preflight import clearance, core
from preflight.clearance import DistanceField
from preflight.core import SAMPLE_S
from preflight.record import Record
from preflight.result import Result
from preflight.scenario import Scenario
from preflight.study import Options, fly_again

WORST = 3
BUNDLE = 60
_WORST_SAMPLES, _BUNDLE_SAMPLES = 480, 160
"""Of a path at most; what lies between is left out, but never the moment that matters."""
_AFTER_TOUCH_S = 0.2
"""Contact is not simulated: what follows a touch is no flight."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One flight: k samples of it, from the start of the trajectory or where it came closest before."""

    number: int
    """Of the flight: the same seed and number fly it again."""
    time_s: FloatArray
    """(k,) from the start; negative in the hover before."""
    path_s: FloatArray
    """(k,) time on the trajectory; off it, where it left it."""
    on_path: NDArray[np.bool_]
    """(k,) whether it follows the trajectory."""
    position_world_m: FloatArray
    """(k, 3)."""
    clearance_m: FloatArray
    """(k,) as `clearance.Along`."""
    error_m: FloatArray
    """(k,) distance from the set-point; NaN without one."""
    lost: bool
    moment: int
    """Index of the sample where it first touches; else where it came closest, or was farthest off without a map."""
    surface_world_m: tuple[float, float, float] | None
    """The place of the obstacle there; None without one."""

    @property
    def touches(self) -> bool:
        return bool(self.clearance_m[self.moment] < 0.0)

    def as_dict(self, trajectory: Trajectory) -> dict[str, Any]:
        """Where it touches or came closest, as plain JSON values."""
        i = self.moment
        return {
            "number": self.number,
            "lost": self.lost,
            "touches": self.touches,
            "clearance_m": float(self.clearance_m[i]) if np.isfinite(self.clearance_m[i]) else None,
            "segment": int(trajectory.segment_at([self.path_s[i]])[0][0]),
            "time_s": float(self.path_s[i]),
            "point_world_m": [float(x) for x in self.position_world_m[i]],
            "obstacle_world_m": None if self.surface_world_m is None else list(self.surface_world_m),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """What a preflight looked like."""

    worst: tuple[Track, ...]
    """The worst first."""
    bundle: tuple[Track, ...]
    """The first flights, which are any: a fair picture of all."""


def replay(scenario: Scenario, result: Result, options: Options, *, bundle: int = BUNDLE) -> Replay:
    """Fly the worst flights and the first `bundle` of a result once more; arguments as it was flown with."""
    worst = worst_numbers(result.record)
    numbers = np.concatenate([worst, np.arange(min(bundle, result.flights))])
    flown, near = fly_again(scenario, numbers, options)
    found = [
        _track(int(n), flown, near, row, bool(result.record.lost[n]), scenario.field,
               _WORST_SAMPLES if row < len(worst) else _BUNDLE_SAMPLES)
        for row, n in enumerate(numbers)
    ]  # fmt: skip
    return Replay(tuple(found[: len(worst)]), tuple(found[len(worst) :]))


def worst_numbers(record: Record, count: int = WORST) -> NDArray[np.int64]:
    """Numbers of the worst flights, the worst first: lost ones, then by clearance, without a map by error."""
    error = np.nan_to_num(record.error_m, nan=-np.inf).max(axis=1)
    return np.lexsort((-error, record.clearance_m, ~record.lost))[:count].astype(np.int64)


def _track(
    number: int,
    flown: core.Flown,
    near: clearance.Along,
    row: int,
    lost: bool,
    field: DistanceField | None,
    most: int,
) -> Track:
    """A row of a batch, thinned to `most` samples and the one that matters."""
    clearance_m, error_m = near.clearance_m[row], flown.error_m[row]
    on_path = np.isfinite(flown.path_s[row])
    start = int(on_path.argmax())
    end = max(int((flown.state[row] != core.NONE).sum()), start + 1)
    moment = _moment(clearance_m[:end], error_m[:end])
    if clearance_m[moment] < 0.0:
        end = min(end, moment + round(_AFTER_TOUCH_S / SAMPLE_S) + 1)
    samples = np.arange(min(start, moment), end)
    thinned = np.linspace(samples[0], samples[-1], min(most, len(samples))).astype(int)
    at = np.unique(np.append(thinned, moment))
    return Track(
        number,
        SAMPLE_S * (at - start),
        np.nan_to_num(clearance.held(flown.path_s[row : row + 1])[0, at]),
        on_path[at],
        flown.position_world_m[row, at].astype(np.float64),
        clearance_m[at],
        error_m[at].astype(np.float64),
        lost,
        int(np.searchsorted(at, moment)),
        _surface(field, flown.position_world_m[row, moment].astype(np.float64), clearance_m[moment]),
    )


def _moment(clearance_m: FloatArray, error_m: NDArray[np.float32]) -> int:
    """Index of the first touch, else of the least clearance; of the largest error where no distance is known."""
    if (touches := clearance_m < 0.0).any():
        return int(touches.argmax())
    if np.isfinite(clearance_m).any():
        return int(clearance_m.argmin())
    return int(np.nan_to_num(error_m, nan=-1.0).argmax())


def _surface(
    field: DistanceField | None, point_world_m: FloatArray, clearance_m: float
) -> tuple[float, float, float] | None:
    """The obstacle that a point has this clearance to; None where no distance is known."""
    if field is None or not np.isfinite(clearance_m):
        return None
    x, y, z = (float(c) for c in clearance.surface(field, point_world_m[None])[0])
    return (x, y, z) if np.isfinite((x, y, z)).all() else None
