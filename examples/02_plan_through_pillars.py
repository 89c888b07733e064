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

from matplotlib.figure import Figure  # noqa: E402  (heavy: after what needs no figure)
from matplotlib.patches import Circle  # noqa: E402

figure = Figure(figsize=(9.5, 4.4), layout="constrained")
axes = figure.subplots()
for x, y in centres:
    axes.add_patch(Circle((x, y), 0.2, color="0.35"))
dots = axes.scatter(*path.position(t)[:, :2].T, c=speed, s=6, cmap="plasma")
axes.plot(*waypoints.positions_world_m[:, :2].T, "k+", markersize=10)
axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(0, 16), ylim=(-1, 7), title=f"{path.duration_s:.2f} s")
figure.colorbar(dots, label="speed (m/s)")
OUT.mkdir(parents=True, exist_ok=True)
figure.savefig(OUT / "plan.png", dpi=130)
print(f"wrote {OUT / 'plan.png'}")
