"""Laps round a statue that the vehicle keeps looking at, with a take-off and a stay, as one checked flight.

You will see: the mission's file, what the gate checked, and `mission.png`. The idea: requests are plain records.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import vehicle
from esdf import solids
from flight import Waypoints, mission
from flight.mission import FlyBy, Ground, Laps, Mission, Stay, Yaw
from planner import mission as missions

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")

statue = (0.0, 0.0, 1.2)
hall = solids.Scene([solids.Room((-8.0, -8.0, 0.0), (8.0, 8.0, 4.0)), solids.Cylinder((0.0, 0.0, 1.0), 0.8, 2.0)])
points = np.array(
    [[-5.0, -5.0, 1.2], [3.5, 0.0, 1.2], [0.0, 3.5, 2.2], [-3.5, 0.0, 1.2], [0.0, -3.5, 2.2], [5, -5, 1.2]]
)
asked = Mission(
    Waypoints(points, np.full(len(points), np.nan)),
    laps=Laps(2, first=1, last=4),
    stays=(Stay(5, 1.0),),
    take_off=Ground((-6.0, -6.0, 0.1)),
    yaw=Yaw("look_at", look_at_world_m=statue),
)
loose = replace(asked, fly_bys=tuple(FlyBy(i, 0.5) for i in (1, 2, 3, 4)))
OUT.mkdir(parents=True, exist_ok=True)
mission.save(OUT / "mission.json", asked)
print((OUT / "mission.json").read_text()[:60].replace("\n", " "), "...")

kestrel = vehicle.example("rigter2019")
plan, faster = (missions.plan(each, hall, kestrel) for each in (asked, loose))
for check in plan.gate.checks:
    verdict = "passed" if check.passed else "FAILED"
    print(f"  {verdict}  {check.name:22s} {check.value:10.4g} of {check.bound:.4g} {check.unit}")
print(f"{plan.trajectory.duration_s:.2f} s; {faster.trajectory.duration_s:.2f} s where 0.5 m beside a waypoint will do")

from matplotlib.figure import Figure  # noqa: E402  (heavy: after what needs no figure)
from matplotlib.patches import Circle  # noqa: E402

figure = Figure(figsize=(5.4, 5.4), layout="constrained")
axes = figure.subplots()
axes.add_patch(Circle((0.0, 0.0), 0.8, color="0.35"))
for flown, colour, how in ((plan, "tab:blue", "through the waypoints"), (faster, "tab:orange", "within 0.5 m of them")):
    path = flown.trajectory
    axes.plot(*path.position(path.sample(0.02))[:, :2].T, color=colour, label=f"{how}: {path.duration_s:.2f} s")
values = plan.trajectory.evaluate(plan.trajectory.sample(0.3))
axes.quiver(values[:, 0], values[:, 1], np.cos(values[:, 3]), np.sin(values[:, 3]), color="tab:blue", width=0.003)
axes.plot(*points[:, :2].T, "k+", markersize=10)
axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="two laps, looking at the statue (arrows)")
axes.set_ylim(top=5.4)  # room for the legend
axes.legend(loc="upper left")
figure.savefig(OUT / "mission.png", dpi=130)
print(f"wrote {OUT / 'mission.png'}")
