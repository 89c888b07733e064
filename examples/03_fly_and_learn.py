"""Fly a figure of eight in the SITL vehicle, learn its rotor drag from the log, fly again with less error.

You will see: the drag coefficient beside the true one, and both flights in `learn.png`. The idea: the controller uses
the learned model at once.
"""

import sys
from pathlib import Path

import numpy as np

import planner
import sysid
import vehicle
from esdf import solids
from firmware_bridge import Sensors, SitlVehicle, connect, controller
from firmware_bridge.airborne import in_the_air, tracking
from flight import FlightLog, TrajectoryFile, Waypoints
from goshawk import plot
from goshawk.demo.chain import vehicles

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
KEY = bytes(range(32))  # a key of your own comes from `goshawk sitl`; this one never leaves the process

hall = solids.Room((-6.0, -4.0, 0.0), (6.0, 4.0, 4.0))
turn = np.linspace(0.0, 2.0 * np.pi, 9)
eight = np.stack([4.0 * np.sin(turn), 2.2 * np.sin(2.0 * turn), 1.6 + 0.5 * np.cos(turn)], axis=1)
truth, believed = vehicles()
plan = planner.plan(Waypoints(eight, np.full(len(eight), np.nan)), hall, believed)
figure_of_eight = planner.trajectory_file(plan, name="eight")


def fly(item: TrajectoryFile, believed_now: vehicle.Vehicle) -> FlightLog:
    """One flight of the true vehicle under a controller with the model `believed_now`."""
    start = item.trajectory.position([0.0])[0] * [1.0, 1.0, 0.0]
    plant = vehicle.simulate.Plant(truth, vehicle.simulate.State(position_world_m=start), ground_m=0.0)
    setup = controller.parameters_of(believed_now)
    with (
        SitlVehicle(plant, setup.parameters, key=KEY, speed=0.0, sensors=Sensors.typical()) as simulated,
        connect(simulated.url, key=KEY) as link,
    ):
        report = link.upload(item)
        print(f"uploaded {report.segments} segments in {1000 * report.duration_s:.0f} ms, read back and equal")
        return link.fly(item)


before = fly(figure_of_eight, believed)
fit = sysid.identify(
    [in_the_air(before, "eight")], believed.with_effect("rotor_drag_thrust"), sysid.Options(unseen="hold")
)
for name in ("rotor_drag_thrust.drag_s_m", "thrust_bem.k1_n_s2", "inertia_xx_kg_m2"):
    found = fit.estimate(name)
    print(f"{name:28s} {found.value:.4g} +- {found.std_robust:.1g} {found.unit} (truth {truth.value(name):.4g})")
after = fly(figure_of_eight, fit.vehicle)

flights = {"first model": before, "learned model": after}
for label, log in flights.items():
    print(f"{label}: {1000 * tracking(log)['tracking_mean_m']:.0f} mm mean tracking error")
OUT.mkdir(parents=True, exist_ok=True)
plot.tracking(flights).savefig(OUT / "learn.png", dpi=130)
print(f"wrote {OUT / 'learn.png'}")
