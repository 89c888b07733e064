"""A vehicle with Betaflight learnt in two flights: settings, plan, flight, blackbox, diagnosis, and a better flight.

You will see: Betaflight 4.6's real firmware fly plans round a column, in a simulated body with drag that its file
lacks; the diagnosis name it; and the same plan flown closer. The idea: every step is a verb, as on the bench.
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
believed = vehicle.load(OUT / "quad.toml")

# The body, which nobody on the ground knows.
k = believed.value("thrust_quadratic.k_n_s2")
vehicle.save(OUT / "body.toml", believed.with_value("thrust_quadratic.k_n_s2", THRUST * k).with_effect(
    HIDDEN, drag_s_m=DRAG_S_M))  # fmt: skip

# Two plans in a map: laps round a column, and a figure of eight that rises and falls.
room = solids.Scene([solids.Room((-6.0, -5.0, 0.0), (6.0, 5.0, 4.0)), solids.Cylinder((0.0, 0.0, 2.0), 0.5, 4.0)])
turn = np.linspace(0.0, 2.0 * np.pi, 4, endpoint=False)
rings = {
    "laps": np.column_stack([1.5 * np.cos(turn), 1.5 * np.sin(turn), np.full(4, 1.5)]),
    "eight": np.array([[3.5, 0.0, 1.2], [1.5, 2.0, 1.6], [-1.5, -2.0, 1.2], [-3.5, 0.0, 1.8], [-1.5, 2.0, 1.4], [1.5, -2.0, 1.6]]),
}  # fmt: skip
limits = believed.with_limits(speed_m_s=3.5, acceleration_m_s2=6.0).limits
for name, points in rings.items():
    asked = Mission(Waypoints(points, np.full(len(points), np.nan)), laps=Laps(2))
    save_plan(OUT / f"{name}.json", missions.plan(asked, room, believed, PlanOptions(limits=limits)), name=name)


def flown(plan: str, file: str) -> dict:
    """By the real firmware in the body."""
    return goshawk("fly", f"{plan}.json", "--rehearse", "--vehicle", file, "--body", "body.toml",
                   "--record", f"recorded_{plan}", "--out", f"{plan}.parquet")  # fmt: skip


before = {plan: flown(plan, "quad.toml") for plan in rings}

# Blackbox and poses, by two clocks, into one log; the doctor; the fit; the diagnosis.
for plan in rings:
    recorded = f"recorded_{plan}"
    goshawk("log", "import", "--pose", f"{recorded}/poses.tum", "--imu", f"{recorded}/blackbox.bfl", "--align",
            "--out", f"joined_{plan}.parquet")  # fmt: skip
logs = [f"joined_{plan}.parquet" for plan in rings]
