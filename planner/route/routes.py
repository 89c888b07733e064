"""From the pilot's waypoints to a polyline clear of obstacles: checks the waypoints and searches between them."""

from dataclasses import dataclass

import numpy as np

from flight import FlightError, FloatArray, InputError, Waypoints, portable, rotations
from planner._planner import StopFlag
from planner.request import space
from planner.request.options import PlanInfeasibleError, PlanOptions, check_stop
from planner.route import sampling, search

_CLOSE_M = 0.5
"""Spacing of the points of a way that touches obstacles; it grows with twice the room there is."""
SAME_M = 1e-3
"""Waypoints nearer than this are one point."""
_SAME_RAD = 1e-3
"""Headings that differ by less are the same, as in `heading`."""


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


def turns(waypoints: Waypoints) -> np.ndarray:
    """Indices of the waypoints behind which the next one is in the same place and asks for another heading."""
    gaps = np.linalg.norm(np.diff(waypoints.positions_world_m, axis=0), axis=1)
    turned = np.abs(rotations.wrapped(np.diff(waypoints.yaw_rad))) >= _SAME_RAD  # not so where one is open
    return np.flatnonzero((gaps < SAME_M) & turned)


def check_waypoints(
    waypoints: Waypoints, field: space.DistanceField, clearance_m: float, *, may_turn: bool = False
) -> None:
    """Refuse waypoints that no path can reach.

    Args:
        may_turn: two may be in the same place if they ask for two headings.

    Raises:
        InputError: too few, two in the same place, or one too close to an obstacle or in unknown space.
    """
    points = waypoints.positions_world_m
    if len(points) < 2:
        raise InputError(f"{len(points)} waypoints are given; at least two are needed, a start and an end")
    same = np.linalg.norm(np.diff(points, axis=0), axis=1) < SAME_M
    on_the_spot = turns(waypoints)
    if may_turn:
        same[on_the_spot] = False
    if same.any():
        i = int(np.argmax(same))
        where = f"waypoints {i + 1} and {i + 2} are in the same place {_text(points[i])}"
        if i in on_the_spot:
            raise InputError(f"{where} with two headings; plan this turn as a mission (`planner.mission.plan`)")
        raise InputError(f"{where}; remove one of them, or give both a heading to turn on the spot")
    distances = space.distance(field, points)
    short = np.flatnonzero(distances < clearance_m)
    if short.size:
        i = int(short[0])
        raise InputError(_trouble(field, i, points[i], float(distances[i]), clearance_m))


def not_free(distance_m: float) -> str:
    """Where a point is whose distance is negative, or minus infinity, as `space.distance` gives it."""
    if np.isneginf(distance_m):
        return "in unknown space or outside of the map"
    return f"{-distance_m:.2f} m inside an obstacle or beyond a wall"


def _trouble(field: space.DistanceField, i: int, point: FloatArray, distance_m: float, clearance_m: float) -> str:
    if distance_m < 0.0:
        place = not_free(distance_m)
    else:
        place = f"{distance_m:.3f} m from an obstacle or unknown space, {clearance_m:.3f} m are required"
    where = f"waypoint {i + 1} at {_text(point)} is {place}"
    try:
        free = space.nearest_free(field, point, clearance_m + 0.01)
        return f"{where}; the nearest free point is near {_text(free)}"
    except FlightError as error:
        return f"{where}; {error}"


def _text(point: FloatArray) -> str:
    return "(" + ", ".join(f"{x:.2f}" if abs(x) < 1e6 else f"{x:.3g}" for x in point) + ")"


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
        if not line.free:
            check_stop(stop)
            way = way_round(field, points, i, options, grids, stop)
            if way is None:
                raise _no_way(points[i], points[i + 1], required, line.distance_m, i, grids)
            found += list(way[1:-1])
            index += [-1] * (len(way) - 2)
        found.append(points[i + 1])
        index.append(i + 1)
    return Route(np.array(found), np.array(index))


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
            grids[margin_m] = search.lattice(field, points, margin_m, stop=stop)
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
    place = _text(np.array(gap.point_world_m))
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


def subdivided(route: Route, field: space.DistanceField) -> Route:
    """The same polyline with more points in narrow places, so that a spline through them stays close to it."""
    points, index = [route.points[:1]], [route.waypoint[:1]]
    for i in range(len(route.points) - 1):
        a, b = route.points[i], route.points[i + 1]
        near = space.distance(field, a + np.linspace(0.0, 1.0, 9)[:, None] * (b - a)).min()
        pieces = max(int(np.ceil(portable.length(b - a) / (_CLOSE_M + 2.0 * max(near, 0.0)))), 1)
        points.append(a + np.linspace(0.0, 1.0, pieces + 1)[1:, None] * (b - a))
        index.append(np.append(np.full(pieces - 1, -1), route.waypoint[i + 1]))
    return Route(np.concatenate(points), np.concatenate(index))
