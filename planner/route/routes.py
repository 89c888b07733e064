"""From the pilot's waypoints to a polyline clear of obstacles: straight lines, and a search where one is not free."""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, Waypoints
from planner._planner import StopFlag
from planner.request import inputs, space
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError, PlanOptions, check_stop
from planner.route import sampling, search


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """A polyline through the waypoints whose lines all keep the required clearance."""

    points: FloatArray
    """(n, 3) in order."""
    waypoint: np.ndarray
    """(n,) index of the waypoint a point is, -1 for a point that the search put in."""

    def leg(self, segment: int) -> int:
        """Index of the waypoint before the given line of the route."""
        return int(self.waypoint[: segment + 1].max())


def of(request: Request) -> Route:
    """As `find`, by a sampling planner for Bry's method, and with a reason that names the tube if there is one."""
    options = request.options.sampled() if request.options.method == "bry" else request.options
    try:
        return find(request.waypoints, request.field, options, request.stop)
    except PlanInfeasibleError as error:
        if request.conditions.tube is None:
            raise
        raise PlanInfeasibleError(
            f"within the tube, {error.reason}", f"{error.remedy}, or widen the tube", error.segment, gap=error.gap
        ) from error


def find(waypoints: Waypoints, field: space.DistanceField, options: PlanOptions, stop: StopFlag | None = None) -> Route:
    """Straight lines where they are free, and a searched path elsewhere.

    Raises:
        PlanCancelledError: `stop` was set.
        PlanInfeasibleError: there is no path between two waypoints.
    """
    points, required = waypoints.positions_world_m, options.planned_clearance_m
    lines = search.check_lines(field, points[:-1], points[1:], required)
    grids: dict[float, search.Lattice] = {}
    found, index = [points[0]], [0]
    for i, line in enumerate(lines):
        if not line.free:
            check_stop(stop)
            if options.search == "grid":
                way = search.way_round(field, points, i, options, grids, stop)
            else:
                way = sampling.way_round(field, points[i], points[i + 1], options)
            if way is None:
                raise _no_way(points[i], points[i + 1], required, line.distance_m, i, grids)
            found += list(way[1:-1])
            index += [-1] * (len(way) - 2)
        found.append(points[i + 1])
        index.append(i + 1)
    return Route(np.array(found), np.array(index))


def _no_way(
    start: FloatArray,
    goal: FloatArray,
    required_m: float,
    straight_m: float,
    leg: int,
    grids: dict[float, search.Lattice],
) -> PlanInfeasibleError:
    gaps = [gap for gap in (search.narrowest(grid, start, goal) for grid in grids.values()) if gap is not None]
    gap = max(gaps, key=lambda gap: gap.width_m, default=None)
    if gap is None or gap.width_m >= 2.0 * required_m:
        reason = f"no path keeps {required_m:.2f} m of clearance (the straight line keeps {straight_m:.2f} m)"
        return PlanInfeasibleError(reason, "move a waypoint, or lower margin_m", leg)
    place = inputs.shown(np.array(gap.point_world_m))
    reason = f"the widest way narrows to {max(gap.width_m, 0.0):.2f} m at {place}; {2.0 * required_m:.2f} m are needed"
    return PlanInfeasibleError(reason, "move a waypoint, or lower margin_m", leg, gap=gap)
