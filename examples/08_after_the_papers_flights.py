"""Two flights after those of Rigter et al. (2019): through a cluttered hall as walked, and a fast figure of eight.

You will see: a walk flown within half a metre, and a figure of eight at the paper's 8.5 m/s and 10.8 m/s2. Halls,
trees and paths are ours. The idea: the same call plans both.
"""

import itertools
import sys
from pathlib import Path

import numpy as np

import planner
import vehicle
from esdf import solids
from flight import Waypoints
from flight.mission import KeepIn, Laps, Mission
from goshawk import plot
from planner import PlanOptions
from planner import mission as missions
from planner.route import simplify

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)
kestrel = vehicle.example("rigter2019")

# Indoors: two rooms, a doorway of 1 m, shelves, a table and a column; somebody walked through with the map's camera.
hall = solids.Scene(
    [
        solids.Room((0.0, 0.0, 0.0), (14.0, 8.0, 3.0)),
        solids.Box((6.9, 0.0, 0.0), (7.1, 4.6, 3.0)),
        solids.Box((6.9, 5.6, 0.0), (7.1, 8.0, 3.0)),
        solids.Box((2.5, 0.0, 0.0), (3.0, 4.2, 2.0)),
        solids.Box((9.0, 3.6, 0.0), (9.5, 8.0, 2.0)),
        solids.Box((4.2, 6.4, 0.0), (5.8, 8.0, 0.8)),
        solids.Cylinder((11.6, 2.4, 1.5), 0.3, 3.0),
    ]
)
corners = np.array(
    [[1.2, 1.0], [1.4, 4.6], [2.8, 5.4], [6.0, 5.1], [7.9, 5.0], [8.2, 2.8], [10.4, 2.3], [12.6, 4.4], [12.6, 6.8]]
)
steps = np.linspace(0.0, 1.0, 40, endpoint=False)[:, None]
walk = np.concatenate([a + steps * (b - a) for a, b in itertools.pairwise(corners)] + [corners[-1:]])
walk = np.column_stack([walk, 1.4 + 0.15 * np.sin(0.05 * np.arange(len(walk)))])
kept = walk[simplify.rdp(walk, 0.1, field=hall, clearance_m=0.32)]
line = walk[simplify.rdp(walk, 0.05)]
walked = Mission(Waypoints(kept, np.full(len(kept), np.nan)), keep_in=KeepIn(0.45, tuple(map(tuple, line.tolist()))))
indoors = missions.plan(walked, hall, kestrel)

# Outdoors: a figure of eight, level, flown twice.
turn = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
eight = np.column_stack([9.0 * np.sin(turn), 4.5 * np.sin(2.0 * turn), np.full(8, 2.0)])
half = [(0.0, 1.5), (6.4, 5.6), (6.2, 3.2), (10.2, 0.4), (7.7, -0.2), (6.0, -5.7), (3.2, 0.4)]
trees = half + [(-x, -y) for x, y in half]
wood = solids.Scene(
    [solids.Room((-15.0, -12.0, 0.0), (15.0, 12.0, 12.0)), *[solids.Cylinder((x, y, 4.0), 0.25, 8.0) for x, y in trees]]
)
bounds = kestrel.with_limits(speed_m_s=8.5, acceleration_m_s2=10.8).limits
lap = Mission(Waypoints(eight, np.full(len(eight), np.nan)), laps=Laps(2))
outdoors = missions.plan(lap, wood, kestrel, PlanOptions(limits=bounds))


def facts(name: str, plan: planner.Plan) -> str:
    """Waypoints, time and the extremes of a plan."""
    worst = {check.name: check.value for check in plan.gate.checks}
    length_m = np.linalg.norm(np.diff(plan.trajectory.position(plan.trajectory.sample(0.01)), axis=0), axis=1).sum()
    return (
        f"{name}: {length_m:.0f} m in {plan.trajectory.duration_s:.2f} s, up to {worst['speed']:.1f} m/s and "
        f"{worst['acceleration']:.1f} m/s2, tilted up to {np.degrees(worst['tilt']):.0f} deg, clear by "
        f"{plan.gate.clearance_m:.2f} m"
    )


print(f"{len(walk)} recorded positions, {len(kept)} waypoints")
print(facts("indoors", indoors))
print(facts("outdoors", outdoors))
OUT.mkdir(parents=True, exist_ok=True)
for name, plan, scene in (("walk", indoors, hall), ("eight", outdoors, wood)):
    plot.plan(plan, kestrel, scene).savefig(OUT / f"{name}.png", dpi=130)
    print(f"wrote {OUT / f'{name}.png'}")
