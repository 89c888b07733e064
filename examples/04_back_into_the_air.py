"""A vehicle with a shifted battery and unknown rotor drag flies, learns from its log, and flies again with less error.

You will see: the diagnosis beside the truth, the plan checked anew, new parameters over the link, and `again.png`.
Set OPENBLAS_NUM_THREADS=1: it takes half of the time.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import planner
import vehicle
from esdf import solids
from firmware_bridge import Sensors, SitlVehicle, connect, controller
from firmware_bridge.airborne import in_the_air, tracking
from flight import FlightLog, Waypoints
from goshawk import plot
from goshawk.demo.chain import vehicles
from planner.gate import gate
from sysid.diagnosis import diagnose

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
KEY = bytes(range(32))  # a key of your own comes from `goshawk sitl`; this one never leaves the process
HIDDEN = {"rotor_drag_thrust": {"drag_s_m": 0.0175}, "centre_of_mass": {"x_m": 0.008, "y_m": -0.006}}

hall = solids.Room((-7.0, -5.0, 0.0), (7.0, 5.0, 4.0))
turn = np.linspace(0.0, 2.0 * np.pi, 9)
eight = np.stack([5.0 * np.sin(turn), 2.8 * np.sin(2.0 * turn), 1.6 + 0.5 * np.cos(turn)], axis=1)
truth = vehicles()[0].with_limits(speed_m_s=6.0, acceleration_m_s2=8.0)
believed = truth
for effect, values in HIDDEN.items():
    believed = believed.without_effect(effect)
    truth = truth.with_effect(effect, **values)


def learn(logs: list[FlightLog], model: vehicle.Vehicle) -> vehicle.Vehicle:
    """Diagnose the missing effects and add them; ground truth is used for the printed comparison only."""
    found = diagnose([in_the_air(log, "eight") for log in logs], model, auto=True)
    print(f"diagnosis: {found.verdict} (confidence {found.confidence:.0%})")
    for candidate in found.candidates:
        if candidate.verdict == "present":
            for size in candidate.sizes:
                true = truth.parameter(size.parameter).value if size.parameter in truth.parameters else 0.0
                print(f"  {size.parameter:26s} {size.value:9.5f} ± {size.sigma:.1g} {size.unit}, the truth is {true:g}")
    return found.vehicle


def fly_learn_fly(teach: Callable[[list[FlightLog], vehicle.Vehicle], vehicle.Vehicle]) -> list[FlightLog]:
    """One session on the link: fly, learn, set the controller's parameters, fly again."""
    # More reserve than the gate requires: the learned model must find the same trajectory feasible.
    cautious = planner.PlanOptions(control_reserve=0.2)
    plan = planner.plan(Waypoints(eight, np.full(len(eight), np.nan)), hall, believed, cautious)
    item = planner.trajectory_file(plan, name="eight")
    start = item.trajectory.position([0.0])[0] * [1.0, 1.0, 0.0]
    plant = vehicle.simulate.Plant(truth, vehicle.simulate.State(position_world_m=start), ground_m=0.0)
    setup = controller.parameters_of(believed)
    with (
        SitlVehicle(plant, setup.parameters, key=KEY, speed=0.0, sensors=Sensors.typical()) as simulated,
        connect(simulated.url, key=KEY) as link,
    ):
        link.upload(item)
        before = link.fly(item)
        learned = teach([before], believed)
        report = gate.check(item.trajectory, hall, learned, waypoints_world_m=item.waypoints_world_m)
        for old, new in zip(plan.gate.checks, report.checks, strict=True):
            if new.name in ("tilt", "rotor speed"):
                print(f"{new.name}: {old.value:.4g} {new.unit} by the old model, {new.value:.4g} by the new one")
        item = planner.checked_file(item.trajectory, report, item.waypoints_world_m, name="eight")
        configuration = controller.parameters_of(learned)
        link.set_parameters(dict(configuration.parameters))
        print(f"not compensated by the controller: {', '.join(configuration.not_compensated) or 'nothing'}")
        link.upload(item, vehicle_hash=vehicle.vehicle_hash(learned))
        return [before, link.fly(item)]


flights = dict(zip(("first model", "after learning"), fly_learn_fly(learn), strict=True))
for label, log in flights.items():
    print(f"{label}: {100 * tracking(log)['tracking_mean_m']:.1f} cm mean tracking error")
OUT.mkdir(parents=True, exist_ok=True)
plot.tracking(flights).savefig(OUT / "again.png", dpi=130)
print(f"wrote {OUT / 'again.png'}")
