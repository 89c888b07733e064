"""Path search round obstacles: A* on a grid of the field (`planner/src/search.cpp`), then free straight lines."""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, portable
from planner._planner import StopFlag, bottleneck
from planner._planner import search as grid_search
from planner.request import space
from planner.request.hidden import HiddenPrice
from planner.request.options import Gap, check_stop

_CELLS = 800_000
"""Most cells of a search grid; larger regions get larger cells."""
_CELLS_FINE = 4_000_000
"""The same for the second search, at finer resolution, where the first found no path."""
_FINEST_M = 0.15
_PRICE = 3.0
"""Added cost per metre of a path at the required clearance rather than at a comfortable one."""

_HALF_DIAGONAL = 0.87
"""Of a cell, in steps: how far a point can be from the nearest cell."""
_GREED = 1.5
"""How much dearer than the cheapest a way may be: far fewer cells are looked at; the optimiser moves it anyway."""

_BLIND = 16
"""Points of a path that a shortcut is looked for in together."""


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Distances on a regular grid of points over the region to search."""

    origin_world_m: FloatArray
    step_m: float
    distance_m: np.ndarray
    """(nx, ny, nz) float32; minus infinity where unknown."""
    hidden: HiddenPrice | None = None
    """Price of a way through space where an obstacle could hide."""
    dearer: np.ndarray | None = None
    """(nx, ny, nz) float32, that price at each point."""

    def point(self, cells: np.ndarray) -> FloatArray:
        return self.origin_world_m + self.step_m * np.stack(np.unravel_index(cells, self.distance_m.shape), axis=-1)

    def nearest_allowed(self, point: FloatArray, required_m: float) -> int:
        """The closest cell within two steps whose distance suffices; -1 if there is none."""
        centre = np.round((point - self.origin_world_m) / self.step_m).astype(int)
        around = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + centre
        around = around[((around >= 0) & (around < self.distance_m.shape)).all(axis=1)]
        if not len(around):
            return -1
        free = self.distance_m[tuple(around.T)] >= required_m
        gap = np.linalg.norm(self.origin_world_m + self.step_m * around - point, axis=1)
        gap[~free] = np.inf
        best = int(np.argmin(gap))
        return int(np.ravel_multi_index(tuple(around[best]), self.distance_m.shape)) if free[best] else -1


def region(field: space.DistanceField, points: FloatArray, margin_m: float) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corner of the box to search: round the points, inside the field's grid or tube if it has one."""
    low, high = points.min(axis=0) - margin_m, points.max(axis=0) + margin_m
    grid = getattr(field, "grid", None)
    if grid is not None:
        origin = np.asarray(grid.origin_world_m, dtype=np.float64)
        low = np.maximum(low, origin)
        high = np.minimum(high, origin + np.asarray(grid.voxel_m) * np.asarray(grid.shape))
    bounds = getattr(field, "free_within_world_m", None)
    if bounds is not None:
        low, high = np.maximum(low, bounds[0]), np.minimum(high, bounds[1])
    return low, np.maximum(high, low)


def lattice(
    field: space.DistanceField,
    points: FloatArray,
    margin_m: float,
    *,
    finest_m: float = _FINEST_M,
    cells: int = _CELLS,
    hidden: HiddenPrice | None = None,
    stop: StopFlag | None = None,
) -> Lattice:
    """Sample the field round `points` (n, 3), one of them exactly on the grid.

    Raises:
        PlanCancelledError: `stop` was set.
    """
    low, high = region(field, points, margin_m)
    step = max(finest_m, float(portable.exponential(portable.logarithm(np.prod(high - low) / cells) / 3.0)))
    low = points[0] - np.floor((points[0] - low) / step) * step
    shape = np.floor((high - low) / step).astype(int) + 1
    axes = [low[i] + step * np.arange(shape[i]) for i in range(3)]
    distances = np.empty(tuple(shape), dtype=np.float32)
    dearer = None if hidden is None else np.empty_like(distances)
    layer = np.empty((shape[1], shape[2], 3))
    layer[..., 1], layer[..., 2] = axes[1][:, None], axes[2]
    for i, x in enumerate(axes[0]):
        check_stop(stop)
        layer[..., 0] = x
        value = np.asarray(field.distance(layer.reshape(-1, 3)), dtype=np.float64)
        distances[i] = space.certain(field, value).reshape(shape[1], shape[2])
        if hidden is not None and dearer is not None:
            dearer[i] = hidden.per_metre(layer.reshape(-1, 3)).reshape(shape[1], shape[2])
    is_hidden = dearer is not None and bool(dearer.any())  # where all is well seen the way is that without a price
    return Lattice(low, step, distances, hidden if is_hidden else None, dearer if is_hidden else None)


def narrowest(grid: Lattice, start: FloatArray, goal: FloatArray) -> Gap | None:
    """Where the way between two points that keeps farthest from obstacles comes nearest to them.

    None if every way leads through unknown space, or out of the grid.
    """
    first, last = grid.nearest_allowed(start, 0.0), grid.nearest_allowed(goal, 0.0)
    cell = bottleneck(grid.distance_m, first, last) if first >= 0 and last >= 0 else -1
    if cell < 0:
        return None
    x, y, z = grid.point(np.array([cell]))[0].tolist()
    return Gap((x, y, z), 2.0 * float(grid.distance_m.ravel()[cell]))


def route(
    field: space.DistanceField,
    grid: Lattice,
    start: FloatArray,
    goal: FloatArray,
    required_m: float,
    comfort_m: float,
) -> FloatArray | None:
    """Points (m, 3) from start to goal whose straight lines all keep `required_m`; None if the grid has no such path.

    Cells just at the required distance can be joined by lines that dip below it; then cells must keep a little more,
    up to half the diagonal of a cell, where every line is certain to be free.
    """
    for extra in (0.0, 0.3, 0.6, _HALF_DIAGONAL):
        level = required_m + extra * grid.step_m
        first, last = grid.nearest_allowed(start, level), grid.nearest_allowed(goal, level)
        if first < 0 or last < 0:
            continue
        greed = _GREED if grid.hidden is None else 1.0  # a way that much dearer may lead through all the hidden space
        cells = grid_search(
            grid.distance_m, first, last, level, max(comfort_m, level), _PRICE, greed, dearer=grid.dearer
        )
        if not len(cells):
            break
        points = np.concatenate([[start], grid.point(cells), [goal]])
        points = shortcut(points, field, required_m, required_m + 0.05, grid.hidden)
        if all(check.free for check in space.check_lines(field, points[:-1], points[1:], required_m)):
            return points
    gap = narrowest(grid, start, goal)
    slack_m = _HALF_DIAGONAL * grid.step_m + getattr(getattr(field, "grid", None), "half_diagonal_m", 0.0)
    if gap is not None and 0.5 * gap.width_m + slack_m < required_m:
        return None  # the distance changes by no more than the way to the nearest cell: finer cells are no help
    return _finer(field, grid, start, goal, required_m, comfort_m)


def _finer(
    field: space.DistanceField,
    grid: Lattice,
    start: FloatArray,
    goal: FloatArray,
    required_m: float,
    comfort_m: float,
) -> FloatArray | None:
    """Once more with half the cells' size, near the two points only; None if that is too fine to be worth it."""
    if grid.step_m < 0.03:
        return None
    cells = _CELLS_FINE if hasattr(field, "grid") else _CELLS  # a formula is slow to sample
    closer = lattice(field, np.stack([start, goal]), 3.0, finest_m=0.5 * grid.step_m, cells=cells, hidden=grid.hidden)
    if closer.step_m > 0.75 * grid.step_m:
        return None
    return route(field, closer, start, goal, required_m, comfort_m)


def shortcut(
    points: FloatArray,
    field: space.DistanceField,
    clearance_m: float,
    comfort_m: float,
    hidden: HiddenPrice | None = None,
) -> FloatArray:
    """Fewer points (m, 3) along a free path: each point is joined to the farthest one in a free straight line.

    A shortcut may come no closer to obstacles than the part it replaces does, or than `comfort_m`, whichever is
    smaller, and never closer than `clearance_m`. Neighbours are joined in any case. Nor may it cost more, where hidden
    space has a price.
    """
    near = space.distance(field, points)
    costs_m = None if hidden is None else _costs_m(points, hidden)
    kept, at = [0], 0
    while at < len(points) - 1:
        ahead = np.arange(at + 1, len(points))
        allowed = np.clip(np.minimum.accumulate(near[at:])[1:] - 1e-3, clearance_m, comfort_m)
        if hidden is not None and costs_m is not None:
            starts = np.broadcast_to(points[at], (len(ahead), 3))
            straight_m = np.linalg.norm(points[ahead] - starts, axis=1) + hidden.of_lines_m(starts, points[ahead])
            allowed = np.where(straight_m > costs_m[ahead] - costs_m[at] + 1e-3, np.inf, allowed)
        at = int(ahead[_farthest_free(points, at, ahead, field, allowed)])
        kept.append(at)
    return points[kept]


def _costs_m(points: FloatArray, hidden: HiddenPrice) -> FloatArray:
    """(n,) cost of a path up to each of its points (n, 3)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) + hidden.of_lines_m(points[:-1], points[1:])
    return np.concatenate([[0.0], np.cumsum(steps)])


def _farthest_free(
    points: FloatArray, at: int, ahead: np.ndarray, field: space.DistanceField, allowed: FloatArray
) -> int:
    """Position in `ahead` of the farthest point seen from `at`; 0 (the neighbour) if none is.

    They are looked at in blocks of `_BLIND`, up to the first of which none is seen.
    """
    best, asked = 0, 3 * _BLIND  # at once: most are decided by then
    for first in range(0, len(ahead), asked):
        ends = points[ahead[first : first + asked]]
        starts = np.broadcast_to(points[at], ends.shape)
        lines = space.check_lines(field, starts, ends, allowed[first : first + asked])
        for block in range(0, len(lines), _BLIND):
            seen = [first + block + i for i, line in enumerate(lines[block : block + _BLIND]) if line.free]
            if not seen:
                return best
            best = seen[-1]
    return best
