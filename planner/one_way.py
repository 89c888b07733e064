"""Gates are passed one way: a way round the edge of those that a first path passes backwards too.

A path that comes to a gate from its far side, or goes on to its near side, crosses the gate's plane against it. It does
so beside the opening if it is led through another opening there, turned round, which the optimiser treats like a gate.
Such an opening is no waypoint: the path that is returned, its report and its file know nothing of it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from flight import FloatArray, Waypoints, portable
from planner.gate import instants, visits
from planner.optimise.fastest import Path
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError
from planner.route import routes

_GAP = 0.05
"""Metres between a gate and the opening beside it, or this share of the gate's half size if that is more."""
_HALVES_M = (0.6, 0.3, 0.15, 0.05)
"""Half widths of the opening beside a gate, tried until its middle is free; with 1.2 m a gate of 78 was not passed."""
_HIGHER = 2.0
"""How much longer that opening is along the edge that it shares: saves 4 % of the flight time in the open."""
_ATTEMPTS = 8
"""How often a path is planned again: once for 95 of 109 that needed it, at most four times."""
_STEP_S = 1e-3
"""Crossings of openings are looked for between samples so far apart."""

PlanAgain = Callable[[routes.Route, Request], Path]
"""The fastest path for another route, through other waypoints, under other conditions."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Which way must go round the edge of a gate at which a path is wrong; none where it just misses the opening."""

    before: bool
    """The way to the gate: it crosses the opening backwards, or begins in front of the gate."""
    behind: bool
    """The way from it: it crosses the opening backwards, or ends behind the gate."""


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """Openings (3, 3) beside a gate, middle and half edges, to come through before it and behind it; None: straight."""

    before: FloatArray | None
    behind: FloatArray | None


@dataclass(slots=True, eq=False)
class _Tried:
    """What was found wrong at a gate in any attempt, the ways round it, and which of them is tried."""

    fault: Fault
    ways: list[Around] = field(default_factory=list)
    number: int = 0


def planned(path: Path, route: routes.Route, request: Request, plan_again: PlanAgain) -> tuple[Path, routes.Route]:
    """A path that the gate refused, and its route, or others round the edges of gates that it passes backwards.

    Raises:
        PlanInfeasibleError: there is no way round an edge, or none of those that were tried passes the gate.
    """
    points, asked, tried = request.waypoints.positions_world_m, request.conditions, dict[int, _Tried]()
    wrong = faults(path, points, asked)
    for _ in range(_ATTEMPTS):
        if not wrong:
            break
        for i, fault in wrong.items():
            _next_way(i, fault, tried, request)
        try:
            chosen = {i: gate.ways[gate.number] for i, gate in tried.items()}
            around, through, number = led_through(chosen, request)
            found = plan_again(around, through)
        except PlanInfeasibleError:  # no way to such an opening; `wrong` stays what it was
            continue
        found = replace(found, waypoint=np.append(number, -1)[found.waypoint])
        if found.report.passed:
            return found, around
        wrong = faults(found, points, asked) or wrong
    if wrong:
        i = min(wrong)
        raise _refused(i, tried[i], request)
    return path, route


def faults(path: Path, points_world_m: FloatArray, asked: Conditions) -> dict[int, Fault]:
    """The gates that a path passes backwards too, or not forwards, between the waypoints on either side of them."""
    edges, trajectory, found = asked.gate_edges_m, path.trajectory, dict[int, Fault]()
    if edges is None:
        return found
    times = np.append(instants.sample_times(trajectory, _STEP_S)[0], trajectory.duration_s)
    points = trajectory.position(times)

    def crossed(first: int, last: int, way: FloatArray) -> bool:
        return visits.first_pass(trajectory, times[:last], points[:last], first, points_world_m[i], way) is not None

    for i in np.flatnonzero(edges.any(axis=(1, 2))).tolist():
        knots = [int(np.flatnonzero(path.waypoint == j)[0]) for j in (i - 1, i, i + 1)]
        first, at, last = np.searchsorted(times, trajectory.starts_s[knots]).tolist()
        before, behind = crossed(first, at, edges[i, ::-1]), crossed(at, last, edges[i, ::-1])
        if before or behind or not crossed(first, last, edges[i]):
            ahead = ((points_world_m[[i - 1, i + 1]] - points_world_m[i]) * np.cross(*edges[i])).sum(axis=1)
            found[i] = Fault(before or bool(ahead[0] > 0.0), behind or bool(ahead[1] < 0.0))
    return found


def _next_way(i: int, fault: Fault, tried: dict[int, _Tried], request: Request) -> None:
    """Choose the next way round the edges of gate `i`: the first one if its fault is another than before."""
    old = tried.get(i)
    both = fault if old is None else Fault(old.fault.before or fault.before, old.fault.behind or fault.behind)
    if old is None or both != old.fault:
        points, free_m = request.waypoints.positions_world_m, request.options.waypoint_clearance_m
        tried[i] = _Tried(both, ways(i, both, points, request.conditions, request.field, free_m))
    else:
        old.number += 1
    if tried[i].number >= len(tried[i].ways):
        raise _refused(i, tried[i], request)


def ways(
    i: int,
    fault: Fault,
    points_world_m: FloatArray,
    asked: Conditions,
    room: space.DistanceField,
    free_m: float,
) -> list[Around]:
    """The ways to come to the gate at waypoint `i` and to go on from it, the shortest first; none where there is no
    room, or no need."""
    assert asked.gate_edges_m is not None
    centre = points_world_m[i]
    beside = openings_beside(centre, asked.gate_edges_m[i], room, free_m)
    choices = []
    for other, needed in ((points_world_m[i - 1], fault.before), (points_world_m[i + 1], fault.behind)):
        lengths = [float(portable.length(other - o[0]) + portable.length(o[0] - centre)) for o in beside]
        choices.append(list(zip(lengths, beside, strict=True)) if needed else [(0.0, None)])
    pairs = sorted(product(*choices), key=lambda pair: pair[0][0] + pair[1][0])
    return [Around(before, behind) for (_, before), (_, behind) in pairs if fault.before or fault.behind]


def openings_beside(
    centre: FloatArray, edges_m: FloatArray, room: space.DistanceField, free_m: float
) -> list[FloatArray]:
    """Openings (3, 3) on the sides of a gate where there is room, in its plane and passed against it."""
    found = []
    for e, sign in product((0, 1), (1.0, -1.0)):
        size = float(portable.length(edges_m[e]))
        outwards, start_m = sign * edges_m[e] / size, size + max(_GAP, _GAP * size)
        for half_m in _HALVES_M:
            middle = centre + (start_m + half_m) * outwards
            if space.distance(room, middle[None])[0] >= free_m:
                opening = np.stack([middle, _HIGHER * edges_m[1], _HIGHER * edges_m[0]])  # exchanged: turned round
                opening[2 - e] = half_m * edges_m[e] / size
                found.append(opening)
                break
    return found


def led_through(chosen: dict[int, Around], request: Request) -> tuple[routes.Route, Request, np.ndarray]:
    """A route through openings chosen beside gates, as if they were waypoints, and what is asked along it.

    Returns:
        The route, the request with its (n,) waypoints, and the index that each has among those given (-1: an opening).

    Raises:
        PlanInfeasibleError: there is no path to an opening.
    """
    waypoints, there = request.waypoints, request.conditions
    points, number = list(waypoints.positions_world_m), list(range(len(waypoints.yaw_rad)))
    for i in sorted(chosen, reverse=True):
        way = chosen[i]
        for at, opening in ((i + 1, way.behind), (i, way.before)):
            if opening is None:
                continue
            points.insert(at, opening[0])
            number.insert(at, -1)
            there = there.inserted(at)
            assert there.gate_edges_m is not None
            there.gate_edges_m[at] = opening[1:]
    own = np.array(number)
    through = Waypoints(np.array(points), np.where(own < 0, np.nan, waypoints.yaw_rad[own]))
    route = routes.find(through, request.field, request.options, request.stop)
    return route, replace(request, waypoints=through, conditions=there), own


def _refused(i: int, tried: _Tried, request: Request) -> PlanInfeasibleError:
    asked = request.conditions
    assert asked.gate_edges_m is not None
    gate = "the gate at the latter, {:.2f} m x {:.2f} m, is".format(*(2.0 * portable.length(asked.gate_edges_m[i])))
    if tried.ways:
        count = min(tried.number + 1, len(tried.ways))
        reason = f"{gate} passed backwards too, and none of {count} ways round its edges can be flown"
        return PlanInfeasibleError(reason, "turn the gate, make it smaller, or move a waypoint beside it", i - 1)
    if tried.fault.before or tried.fault.behind:
        reason = (
            f"{gate} passed backwards too, and on no side of it is {request.options.waypoint_clearance_m:.3f} m of "
            "clearance to come round its edge"
        )
        return PlanInfeasibleError(reason, "turn the gate, make it smaller, or move the waypoints beside it", i - 1)
    return PlanInfeasibleError(f"{gate} not passed forwards within its opening", "turn the gate or enlarge it", i - 1)
