"""From the pilot's waypoints to a polyline clear of obstacles: straight lines, and a search where one is not free."""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, Waypoints
from planner._planner import StopFlag
from planner.request import inputs, space
from planner.request.hidden import HiddenPrice
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
    lines = space.check_lines(field, points[:-1], points[1:], required)
    grids: dict[float, search.Lattice] = {}
    found, index = [points[0]], [0]
    for i, line in enumerate(lines):
        straight = points[i : i + 2]
        is_hidden = options.hidden is not None and options.hidden.of_lines_m(straight[:1], straight[1:])[0] > 0.0
        if not line.free or is_hidden:
            check_stop(stop)
            way = way_round(field, points, i, options, grids, stop)
            if line.free and options.hidden is not None:
                way = _cheaper(way, straight, options.hidden)
            if way is None:
                raise _no_way(points[i], points[i + 1], required, line.distance_m, i, grids)
            found += list(way[1:-1])
            index += [-1] * (len(way) - 2)
        found.append(points[i + 1])
        index.append(i + 1)
    return Route(np.array(found), np.array(index))


def _cheaper(way: FloatArray | None, straight: FloatArray, hidden: HiddenPrice) -> FloatArray:
    """A way (n, 3) that was searched, if there is one and it costs less than a straight line (2, 3) that is free."""
    return straight if way is None or hidden.cost_m(way) >= hidden.cost_m(straight) else way


def way_round(
    field: space.DistanceField,
    points: FloatArray,
    leg: int,
    options: PlanOptions,
    grids: dict[float, search.Lattice],
    stop: StopFlag | None = None,
) -> FloatArray | None:
    """Search near the waypoints first, then far round them; `grids` keeps what was sampled for the other legs."""
    if options.search != "grid":
        return _sampled_way(field, points[leg], points[leg + 1], options)
    for margin_m in (options.search_margin_m, 5.0 * options.search_margin_m):
        if margin_m not in grids:
            grids[margin_m] = search.lattice(field, points, margin_m, hidden=options.hidden, stop=stop)
        way = search.route(
            field, grids[margin_m], points[leg], points[leg + 1], options.planned_clearance_m, options.clearance_m + 0.5
        )
        if way is not None:
            return way
        low, high = search.region(field, points, margin_m)
        if (np.array(search.region(field, points, 5.0 * margin_m)) == np.array([low, high])).all():
            break
    return None


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


def _sampled_way(
    field: space.DistanceField, start: FloatArray, goal: FloatArray, options: PlanOptions
) -> FloatArray | None:
    """By the sampling planner that was asked for: near the two points first, then far round with more samples."""
    for more in (1, 4):
        way = sampling.route(
            field,
            start,
            goal,
            options.planned_clearance_m,
            sampler=sampling.SAMPLERS[options.search],
            margin_m=more * options.search_margin_m,
            checks=more * options.search_checks,
            seed=options.search_seed,
        )
        if way is not None:
            return way
    return None
