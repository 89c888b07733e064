"""Forests and rooms with drawn requests: limits, gates, a tube, speeds of legs, radii to pass waypoints by.

Each plan is checked by brute force: no bound, hull or bisection of the gate's own.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import planner_scenes
import report

import planner
import vehicle
from flight import FlightError, FloatArray, Waypoints
from flight.mission import FlyBy, Gate, KeepIn, LegSpeed, Mission
from planner import mission as missions
from planner.route import routes

_MISS_M = 0.02
"""How far beside a waypoint's ball a path may pass."""
_BESIDE_M = 0.005
"""The same beside an opening or tube: what 20,000 samples leave open."""


@dataclass(frozen=True)
class Request:
    """A mission, the place and the vehicle with its limits."""

    mission: Mission
    place: planner_scenes.Place
    drone: vehicle.Vehicle


def rows(scenes: int = 400) -> list[report.Row]:
    """Nothing unsafe, nothing refused but for want of room, at seeds that no other benchmark has."""
    faulty: list[str] = []
    refused: list[str] = []
    crashed: list[str] = []
    narrow, asked = 0, {"gate": 0.0, "tube": 0.0, "speed": 0.0, "radius": 0.0}
    for seed in range(2000, 2000 + scenes):
        try:
            request = draw(seed)
            for name, there in _asked(request.mission).items():
                asked[name] += there
            plan = missions.plan(request.mission, request.place.field, request.drone, planner_scenes.OPTIONS)
        except planner.PlanInfeasibleError as error:
            narrow += error.gap is not None
            refused += [] if error.gap is not None else [f"{seed}: {error}"]
        except FlightError as error:
            refused.append(f"{seed}: {error}")
        except Exception as error:  # any other is a crash, which is counted
            crashed.append(f"{seed}: {error!r}")
        else:
            faulty += [f"{seed}: {fault}" for fault in faults(plan, request)]
    print(*faulty, *refused, *crashed, sep="\n")
    return [
        report.row(f"{scenes} mixed missions: faults by brute force", len(faulty), "faults", "0", not faulty, asked),
        report.row("  refused, though there is room", len(refused), "missions", "0", not refused),
        report.row("  crashes", len(crashed), "missions", "0", not crashed),
        report.row("  refused: the widest way in the map is too narrow", narrow, "missions"),
    ]


def _asked(mission: Mission) -> dict[str, bool]:
    given = {"gate": mission.gates, "tube": mission.keep_in, "speed": mission.leg_speeds, "radius": mission.fly_bys}
    return {name: bool(there) for name, there in given.items()}


def draw(seed: int) -> Request:
    """A place of `planner_scenes.place`; each kind of request is asked for in about every second mission.

    Raises:
        PlanInfeasibleError: there is no way between the waypoints that is wide enough.
    """
    where, rng = planner_scenes.place(seed), np.random.default_rng(seed + 20_000)
    drone = vehicle.example("rigter2019")
    if rng.uniform() < 0.5:
        slower = rng.uniform(0.4, 1.0, 3)
        own = drone.limits
        drone = drone.with_limits(
            speed_m_s=own.speed_m_s * slower[0],
            acceleration_m_s2=own.acceleration_m_s2 * slower[1],
            yaw_rate_rad_s=own.yaw_rate_rad_s * slower[2],
        )
    count = len(where.waypoints.positions_world_m)
    asked = Mission(where.waypoints)
    route = routes.find(where.waypoints, where.field, planner_scenes.OPTIONS)
    if rng.uniform() < 0.5:
        middle = tuple((float(x), float(y), float(z)) for x, y, z in route.points)
        asked = replace(asked, keep_in=KeepIn(float(rng.uniform(0.4, 1.2)), middle))
    if rng.uniform() < 0.5:
        first = int(rng.integers(count - 1))
        last = int(rng.integers(first + 1, count))
        asked = replace(asked, leg_speeds=(LegSpeed(first, last, float(rng.uniform(0.5, 3.0))),))
    inner = rng.permutation(np.arange(1, count - 1))
    if len(inner) and rng.uniform() < 0.7:
        asked = replace(asked, gates=(_gate(int(inner[0]), route, rng),))
    if len(inner) > 1 and rng.uniform() < 0.7:
        asked = replace(asked, fly_bys=(FlyBy(int(inner[1]), float(rng.uniform(0.1, 0.6))),))
    return Request(asked, where, drone)


def _gate(waypoint: int, route: routes.Route, rng: np.random.Generator) -> Gate:
    """An opening turned by at most 30 degrees from the route's way through it."""
    at = int(np.flatnonzero(route.waypoint == waypoint)[0])
    ahead = _unit(route.points[at + 1] - route.points[at]) + _unit(route.points[at] - route.points[at - 1])
    off, roll = rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5)
    width_m, height_m = rng.uniform(0.3, 1.0, 2)
    heading_rad = np.arctan2(ahead[1], ahead[0]) + off
    return Gate(waypoint, float(width_m), float(height_m), float(heading_rad), 0.0, float(roll))


def _unit(vector: FloatArray) -> FloatArray:
    return vector / np.linalg.norm(vector)


def faults(plan: planner.Plan, request: Request) -> list[str]:
    """What is wrong with a plan, by 20,000 samples: `planner_scenes.faults`, and what else was asked for."""
    mission, where = request.mission, request.place
    points = where.waypoints.positions_world_m
    # Waypoints are looked at below, each with its radius or opening.
    ends = replace(where, waypoints=Waypoints(points[[0, -1]], np.full(2, np.nan)))
    found = planner_scenes.faults(plan, ends, request.drone)
    p = plan.trajectory.position(np.linspace(0.0, plan.trajectory.duration_s, 20_001))
    at, spans = 0, []
    for i, point in enumerate(points):
        gate = next((g for g in mission.gates if g.waypoint == i), None)
        radius_m = sum(f.radius_m for f in mission.fly_bys if f.waypoint == i)
        span = _crossed(p, at, point, gate) if gate else _near(p, at, point, radius_m + _MISS_M)
        if span is None:
            return [*found, f"waypoint {i + 1} is missed"]
        spans.append(span)
        at = span[0]
    step_m = np.linalg.norm(np.diff(p, axis=0), axis=1)
    most_m = plan.trajectory.duration_s / 20_000 * 1.001
    for leg in mission.leg_speeds:
        there = step_m[spans[leg.first][1] : spans[leg.last][0]]
        if there.size and there.max() > leg.speed_m_s * most_m:
            found.append("too fast on a leg")
    if mission.keep_in is not None and _off_line(p, mission.keep_in) > mission.keep_in.radius_m + _BESIDE_M:
        found.append("outside of the tube")
    return found


def _near(p: FloatArray, start: int, point: FloatArray, within_m: float) -> tuple[int, int] | None:
    """First and last sample of the first run within a ball, from a sample on."""
    near = np.linalg.norm(p[start:] - point, axis=1) <= within_m
    if not near.any():
        return None
    first = int(np.argmax(near))
    return start + first, start + first + int(np.argmin(np.append(near[first:], False))) - 1


def _crossed(p: FloatArray, start: int, point: FloatArray, gate: Gate) -> tuple[int, int] | None:
    """The sample behind the first forward passage of an opening, twice."""
    left, up = gate.edges_m
    forward = np.cross(left, up)
    ahead = (p[start:] - point) @ forward >= 0.0
    for k in np.flatnonzero(~ahead[:-1] & ahead[1:]) + start + 1:
        off_m = [abs((p[k] - point) @ edge) / np.linalg.norm(edge) - np.linalg.norm(edge) for edge in (left, up)]
        if max(off_m) <= _BESIDE_M:
            return int(k), int(k)
    return None


def _off_line(p: FloatArray, tube: KeepIn) -> float:
    """The largest distance of samples from the middle of a tube."""
    line = np.array(tube.polyline_world_m)
    nearest = np.full(len(p), np.inf)
    for a, b in pairwise(line):
        along = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(p - a - along[:, None] * (b - a), axis=1))
    return float(nearest.max())


if __name__ == "__main__":
    report.main(rows, scenes=400)
