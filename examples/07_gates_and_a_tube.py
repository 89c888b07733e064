"""A race through gates, and a path that keeps near a recorded walk: both proved along the whole curve.

You will see: what openings save over their middles, what a tube costs, and `gates.png`. The idea: the planner uses
all the room that the pilot allows.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import vehicle
from esdf import solids
from flight import Waypoints, mission
from flight.mission import Gate, KeepIn, Mission
from planner import mission as missions
from planner.route import simplify

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)
kestrel = vehicle.example("rigter2019")

# Each gate has a frame of four bars round an opening of 1.6 m by 1.4 m. The vehicle's centre keeps 0.3 m from all of
# it, so what is left of the opening for it is 1 m by 0.8 m.
course = [((4.0, 0.0, 1.2), 0.3), ((8.0, 3.5, 1.8), 1.6), ((5.0, 7.0, 1.4), 2.9), ((1.0, 5.0, 1.9), -2.0)]


def frame(centre: tuple[float, float, float], heading_rad: float) -> list[solids.OrientedBox]:
    """Four bars, 10 cm thick."""
    q = np.array([np.cos(0.5 * heading_rad), 0.0, 0.0, np.sin(0.5 * heading_rad)])
    left = np.array([-np.sin(heading_rad), np.cos(heading_rad), 0.0])
    sides = [(sign * 0.85 * left, (0.05, 0.05, 0.8)) for sign in (-1.0, 1.0)]
    beams = [(np.array([0.0, 0.0, sign * 0.75]), (0.05, 0.9, 0.05)) for sign in (-1.0, 1.0)]
    return [solids.OrientedBox(tuple(centre + off), size, tuple(q)) for off, size in sides + beams]


arena = solids.Scene(
    [
        solids.Room((-3.0, -4.0, 0.0), (12.0, 10.0, 4.0)),
        *[bar for where, heading in course for bar in frame(where, heading)],
    ]
)
points = np.array([[-1.0, -1.0, 1.2], *[where for where, _ in course], [-1.0, 1.0, 1.2]])
middles = Mission(Waypoints(points, np.full(len(points), np.nan)))
race = replace(middles, gates=tuple(Gate(i + 1, 1.0, 0.8, heading) for i, (_, heading) in enumerate(course)))
mission.save(OUT / "race.json", race)
through_middles, raced = (missions.plan(each, arena, kestrel) for each in (middles, race))

walk = np.array(
    [[2 * t - 1, 2.5 + 2.0 * np.sin(0.9 * t), 1.3 + 0.2 * np.sin(2.0 * t)] for t in np.linspace(0.0, 6.0, 400)]
)
hall = solids.Scene([solids.Room((-3.0, -4.0, 0.0), (14.0, 10.0, 4.0))])
kept = walk[simplify.rdp(walk, 0.05)]
ends = Mission(Waypoints(kept[[0, -1]], np.full(2, np.nan)), keep_in=KeepIn(0.4, tuple(map(tuple, kept.tolist()))))
followed = missions.plan(ends, hall, kestrel)

for name, plan in (("race", raced), ("walk", followed)):
    for check in plan.gate.checks:
        if check.name in ("clearance", "gates", "keep-in", "speed"):
            print(f"  {name}  {check.name:10s} {check.value:8.3f} of {check.bound:.3f} {check.unit}  {check.reason}")
by_middles_s, race_s = through_middles.trajectory.duration_s, raced.trajectory.duration_s
print(f"{race_s:.2f} s through the gates; {by_middles_s:.2f} s by their middles")
walk_s = followed.trajectory.duration_s
print(f"{walk_s:.2f} s within 0.4 m of {len(walk)} recorded positions, {len(kept)} kept of them")

from matplotlib.figure import Figure  # noqa: E402  (heavy: after what needs no figure)
from matplotlib.patches import Circle  # noqa: E402

figure = Figure(figsize=(9.0, 4.4), layout="constrained")
left, right = figure.subplots(1, 2)
for plan, colour, where in ((through_middles, "0.6", "middles"), (raced, "tab:blue", "openings")):
    path = plan.trajectory
    left.plot(*path.position(path.sample(0.02))[:, :2].T, color=colour, label=f"{where}: {path.duration_s:.2f} s")
for gate in race.gates:
    edge, centre = gate.edges_m[0, :2], points[gate.waypoint, :2]
    left.plot(*np.stack([centre - edge, centre + edge]).T, color="tab:orange", linewidth=3)
left.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="a race through gates")
left.legend(loc="center")
path = followed.trajectory
for middle in walk[::4, :2]:
    right.add_patch(Circle(tuple(middle), 0.4, color="#ffe0c0"))
right.plot(*path.position(path.sample(0.02))[:, :2].T, color="tab:blue", label=f"plan: {path.duration_s:.2f} s")
right.set(xlabel="x (m)", aspect="equal", title="within 0.4 m of the walk")
right.legend()
figure.savefig(OUT / "gates.png", dpi=130)
print(f"wrote {OUT / 'race.json'} and {OUT / 'gates.png'}")
