"""The fastest smooth way through a forest of pillars, proven clear over its whole length.

You will see: flight time, clearance, the share of each limit, and `plan.png`. The idea: the planner takes any
distance function, here a formula.
"""

import sys
from pathlib import Path

import numpy as np

import planner
import vehicle
from esdf import solids
from flight import Waypoints
from goshawk import plot

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")

rng = np.random.default_rng(4)
rows = [[x, y] for x in np.arange(2.0, 15.0, 2.2) for y in (0.7, 2.9, 5.1)]
centres = np.array(rows) + rng.uniform(-0.5, 0.5, (18, 2))
forest = solids.Scene(
    [
        solids.Room((0.0, -1.0, 0.0), (16.0, 7.0, 3.0)),
        *[solids.Cylinder((x, y, 1.5), 0.2, 3.0) for x, y in centres],
    ]
)
waypoints = Waypoints(np.array([[0.8, 3.0, 1.2], [8.0, 4.0, 1.5], [15.2, 1.5, 1.2]]), np.full(3, np.nan))
kestrel = vehicle.example("rigter2019")
plan = planner.plan(waypoints, forest, kestrel)

path = plan.trajectory
t = path.sample(0.01)
speed = np.linalg.norm(path.position(t, 1), axis=1)
print(f"{path.duration_s:.2f} s through {len(centres)} pillars, up to {speed.max():.1f} m/s")
gate = plan.gate
print(
    f"clearance is at least {gate.clearance_m:.3f} m along the whole curve; {gate.required_clearance_m:.2f} m required"
)
for check in plan.gate.checks:
    verdict = "passed" if check.passed else "FAILED"
    print(f"  {verdict}  {check.name:22s} {check.value:10.4g} of {check.bound:.4g} {check.unit}")

OUT.mkdir(parents=True, exist_ok=True)
plot.plan(plan, kestrel, forest).savefig(OUT / "plan.png", dpi=130)
print(f"wrote {OUT / 'plan.png'}")
