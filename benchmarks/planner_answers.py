"""Hashes of plans, by name, as JSON: what `planner_one_answer.py` and the tests compare between processor features.

python benchmarks/planner_answers.py few          # or: clutter FIRST END, walks FIRST END
"""

import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import planner_scenes

import planner
from esdf import solids
from flight import FlightError, Waypoints
from flight.mission import Gate, Mission
from planner import mission as missions

SKY = solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])
CLUTTER = planner.PlanOptions(radius_m=0.1, margin_m=0.1, control_reserve=0.0)
Case = tuple[str, Callable[[], planner.Plan]]


def hashed(work: Callable[[], planner.Plan]) -> str:
    """Of the trajectory's bytes and the gate's report, or of the message of the error raised."""
    try:
        plan = work()
    except FlightError as error:
        return "refused " + hashlib.sha256(str(error).encode()).hexdigest()[:16]
    digest = hashlib.sha256(plan.trajectory.durations_s.tobytes() + plan.trajectory.coefficients.tobytes())
    digest.update(json.dumps(plan.gate.as_dict()).encode())
    return digest.hexdigest()[:16]


def clutter(first: int, end: int) -> Iterator[Case]:
    """Ten scenes of each of the five kinds, the kinds in turn."""
    own = planner_scenes.clutter_vehicle(planner_scenes.vehicles()["rigter2019"])
    for i in range(first, end):
        kind, seed = planner_scenes.CLUTTER[i % 5], i // 5
        place = planner_scenes.clutter(kind, seed)
        yield f"{kind} {seed}", lambda place=place: planner.plan(place.waypoints, place.field, own, CLUTTER)


def walks(first: int, end: int) -> Iterator[Case]:
    """Ten waypoints in the open, with each of the three vehicles."""
    for name, drone in planner_scenes.vehicles().items():
        for seed in range(first, end):
            points = _walk(10, seed)
            yield f"walk {seed}, {name}", lambda points=points, drone=drone: planner.plan(points, SKY, drone)


def few() -> Iterator[Case]:
    """A small set that takes every way through the planner: methods, yaw modes, vehicles, gates, obstacles."""
    drones = planner_scenes.vehicles()
    drone, points = drones["rigter2019"], _walk(5, 1)
    for name, other in drones.items():
        yield f"walk, {name}", lambda other=other: planner.plan(points, SKY, other)
    for yaw, more in (("free", {}), ("steady", {}), ("fixed", {"heading_rad": 0.4}), ("look_at", _LOOK_AT)):
        options = replace(planner.PlanOptions(), yaw=yaw, **more)
        yield f"yaw {yaw}", lambda options=options: planner.plan(points, SKY, drone, options)
    own = planner_scenes.clutter_vehicle(drone)
    for kind, method in (("office", "fastest"), ("office", "corridor"), ("forest .05", "bry")):
        place, options = planner_scenes.clutter(kind, 1), replace(CLUTTER, method=method)
        yield (
            f"{kind}, {method}",
            lambda place=place, options=options: planner.plan(place.waypoints, place.field, own, options),
        )
    yield "gates", lambda: missions.plan(_gates(), SKY, drone)
    yield "gates, one gone round", lambda: missions.plan(_gates(turned_rad=3.0), SKY, drone)


_LOOK_AT = {"look_at_world_m": (2.0, 7.0, 1.0)}


def _walk(count: int, seed: int) -> Waypoints:
    points = np.round(planner_scenes.walk(count, seed), 6)  # the tails of a normal draw come from the C library
    return Waypoints(points, np.full(count, np.nan))


def _gates(turned_rad: float = 0.0) -> Mission:
    points = np.array([[0.0, 0.0, 2.0], [4.0, 1.0, 2.0], [8.0, -1.0, 2.5], [12.0, 2.0, 2.0]])
    gates = (Gate(1, 1.2, 1.0, 0.3, 0.1, 0.0), Gate(2, 1.0, 1.4, turned_rad, 0.0, 0.5))
    return Mission(Waypoints(points, np.array([np.nan, 0.3, np.nan, np.nan])), gates=gates)


if __name__ == "__main__":
    which, *span = sys.argv[1:]
    cases = {"clutter": clutter, "walks": walks, "few": few}[which](*(int(n) for n in span))
    print(json.dumps({name: hashed(work) for name, work in cases}))
