"""A vehicle with Betaflight learnt in two flights: settings, plan, flight, blackbox, diagnosis, and a better flight.

You will see: Betaflight 4.6's real firmware fly plans round a column, in a simulated body with drag that its file
lacks; the diagnosis name it; and the same laps flown closer. The idea: every step is a verb, as on the bench.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import vehicle
from esdf import solids
from firmware_bridge.betaflight_sitl import process
from firmware_bridge.betaflight_sitl.body import SETTINGS
from flight import Waypoints
from flight.mission import Laps, Mission
from planner import PlanOptions, save_plan
from planner import mission as missions

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out").resolve()
OUT.mkdir(parents=True, exist_ok=True)
HIDDEN, DRAG_S_M, THRUST = "rotor_drag_thrust", 0.06, 0.95
"""What the body has and its file has not: drag of the rotors, and 5 % less thrust."""


def goshawk(*words: object) -> dict:
    """What a verb says, as JSON; printed as it would be typed."""
    print("$ goshawk", *words, flush=True)
    command = [sys.executable, "-m", "goshawk", *map(str, words), "--overwrite", "--quiet", "--json"]
    done = subprocess.run(command, cwd=OUT, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


# What the firmware says of itself, and scale, ruler and data sheet: the vehicle file.
with process.alone(), tempfile.TemporaryDirectory() as folder:
    (OUT / "diff_all.txt").write_text(process.configure(Path(folder), SETTINGS))
sheet = ("--mass", 0.65, "--arm", 0.125, "--prop-diameter", 0.127, "--hover-rpm", 9600, "--max-rpm", 20000)
goshawk("vehicle", "new", "quad.toml", "--import", "diff_all.txt", *sheet)
believed = vehicle.load(OUT / "quad.toml").with_effect("rotor_acceleration_torque", rotor_inertia_kg_m2=1e-5)
vehicle.save(OUT / "quad.toml", believed)  # spun up, a propeller of 5 inches turns the body against itself

# The body, which nobody on the ground knows.
k = believed.value("thrust_quadratic.k_n_s2")
vehicle.save(OUT / "body.toml", believed.with_value("thrust_quadratic.k_n_s2", THRUST * k).with_effect(
    HIDDEN, drag_s_m=DRAG_S_M))  # fmt: skip

# Two plans in a map: laps round a column, and a figure of eight that rises and falls.
room = solids.Scene([solids.Room((-6.0, -5.0, 0.0), (6.0, 5.0, 4.0)), solids.Cylinder((0.0, 0.0, 2.0), 0.5, 4.0)])
turn = np.linspace(0.0, 2.0 * np.pi, 4, endpoint=False)
rings = {
    "laps": np.column_stack([1.5 * np.cos(turn), 1.5 * np.sin(turn), np.full(4, 1.5)]),
    "eight": np.array([[3.5, 0, 1.2], [1.5, 2, 1.6], [-1.5, -2, 1.2], [-3.5, 0, 1.8], [-1.5, 2, 1.4], [1.5, -2, 1.6]]),
}
limits = believed.with_limits(speed_m_s=3.5, acceleration_m_s2=6.0).limits
asked = {name: Mission(Waypoints(ring, np.full(len(ring), np.nan)), laps=Laps(2)) for name, ring in rings.items()}
options = PlanOptions(limits=limits)
plans = {name: missions.plan(mission, room, believed, options) for name, mission in asked.items()}
for name, plan in plans.items():
    save_plan(OUT / f"{name}.json", plan, name=name)


def flown(plan: str, file: str, flight: str) -> float:
    """By the real firmware in the body; mean distance from the plan, metres."""
    facts = goshawk("fly", f"{plan}.json", "--rehearse", "--vehicle", file, "--body", "body.toml",
                    "--record", f"recorded_{flight}", "--out", f"{flight}.parquet")  # fmt: skip
    print(f"  {1e3 * facts['tracking_mean_m']:.0f} mm from the plan on average", flush=True)
    return facts["tracking_mean_m"]


before = {plan: flown(plan, "quad.toml", plan) for plan in rings}

# Blackbox and poses, by two clocks, into one log; the doctor; the fit; the diagnosis.
for plan in rings:
    recorded = f"recorded_{plan}"
    goshawk("log", "import", "--pose", f"{recorded}/poses.tum", "--imu", f"{recorded}/blackbox.bfl", "--align",
            "--full-throttle", 20000, "--out", f"joined_{plan}.parquet")  # fmt: skip
    goshawk("log", "check", f"joined_{plan}.parquet", "--vehicle", "quad.toml")
logs = [f"joined_{plan}.parquet" for plan in rings]
goshawk("diagnose", *logs, "--vehicle", "quad.toml", "--out", "learnt.toml")
learnt = vehicle.load(OUT / "learnt.toml")
assert HIDDEN in learnt.effects, f"the diagnosis added {set(learnt.effects) - set(believed.effects) or 'nothing'}"
for name, value in ((f"{HIDDEN}.drag_s_m", DRAG_S_M), ("thrust_quadratic.k_n_s2", THRUST * k)):
    print(f"  {name}: {learnt.value(name):.4g} learnt, {value:.4g} in the body")

# The same laps, planned for the vehicle as learnt; the controller now compensates the drag.
save_plan(OUT / "laps.json", missions.plan(asked["laps"], room, learnt, options), name="laps")
after_m = flown("laps", "learnt.toml", "laps_again")
print(f"laps: {1e3 * before['laps']:.0f} mm before, {1e3 * after_m:.0f} mm after")

from matplotlib.figure import Figure  # noqa: E402  (heavy: after what needs no figure)

from firmware_bridge.controller import State  # noqa: E402
from flight import flight_log  # noqa: E402

figure = Figure(figsize=(9.0, 4.2), layout="constrained")
above, beside = figure.subplots(1, 2)
for flight, colour, label in (("laps", "tab:orange", "as the file said"), ("laps_again", "tab:blue", "drag learnt")):
    log = flight_log.load(OUT / f"{flight}.parquet")
    rows = log.columns["mission_state"] == State.TRAJECTORY
    place, wanted = (log.vector(name)[rows] for name in ("position_world_m", "setpoint_position_world_m"))
    if flight == "laps":
        above.plot(*wanted[:, :2].T, color="0.6", linewidth=4.0, label="plan")
    above.plot(*place[:, :2].T, color=colour, label=label)
    off_mm = 1e3 * np.linalg.norm(place - wanted, axis=1)
    beside.plot(log.time_s[rows] - log.time_s[rows][0], off_mm, color=colour, label=f"{label}: {off_mm.mean():.0f} mm")
above.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="laps on Betaflight, simulated body")
beside.set(xlabel="time (s)", ylabel="distance from the plan (mm)", ylim=(0.0, None))
beside.legend()
above.legend()
figure.savefig(OUT / "learnt.png", dpi=130)
print(f"wrote {OUT / 'learnt.png'}")
