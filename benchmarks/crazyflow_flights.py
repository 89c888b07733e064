"""Flights of crazyflow's Crazyflie, by its physics and its controller; run by an interpreter that has crazyflow:

    python benchmarks/crazyflow_flights.py PATHS.npz FLIGHTS.npz

crazyflow is no dependency of ours: JAX and MuJoCo come with it. So this file imports nothing of Goshawk.

PATHS holds `path` (flights, n, 13): position, velocity, acceleration and the quaternion (x, y, z, w) asked for, every
.005 s. FLIGHTS gets `state` (flights, n, 11): position in m, quaternion (w, x, y, z), rotor speeds in rad/s; and as
`parameters` the vehicle's, as JSON in SI.
"""

import json
import sys
import tomllib
from importlib import import_module, resources

import numpy as np

DRONE = "cf21B_500"
STEPS_PER_ROW = 5
"""Of 1 ms: its integrator is semi-implicit."""
RAD_S = 2.0 * np.pi / 60.0
"""Of one revolution per minute."""


def parameters() -> dict:
    """Of the vehicle in SI; crazyflow's curves are in revolutions per minute."""
    room = resources.files("crazyflow.dynamics.first_principles")
    own = tomllib.loads((room / "params.toml").read_text())[DRONE]
    per_power = RAD_S ** -np.arange(3.0)
    return {
        "mass_kg": own["mass"],
        "inertia_kg_m2": np.diag(own["J"]).tolist(),
        "arm_m": own["L"],
        "mixing": own["mixing_matrix"],
        "rotor_inertia_kg_m2": own["prop_inertia"],
        "thrust_n": (np.array(own["rpm2thrust"]) * per_power).tolist(),
        "torque_n_m": (np.array(own["rpm2torque"]) * per_power).tolist(),
        "drag_n_s_m": (-np.diag(own["drag_matrix"])).tolist(),
        "thrust_max_n": own["thrust_max"],
    }


def fly(path: np.ndarray) -> np.ndarray:
    """(flights, n, 11) as flown along (flights, n, 13)."""
    count = len(path)
    sim = import_module("crazyflow.sim").Sim(
        n_worlds=count, drone=DRONE, dynamics="first_principles", control="state", freq=1000
    )
    sim.reset()
    states = sim.data.states
    hover = np.sqrt(parameters()["mass_kg"] * 9.81 / 4.0 / parameters()["thrust_n"][2]) / RAD_S
    sim.data = sim.data.replace(
        states=states.replace(
            pos=states.pos.at[:, 0].set(path[:, 0, :3]),
            vel=states.vel.at[:, 0].set(path[:, 0, 3:6]),
            rotor_vel=states.rotor_vel.at[:].set(hover),
        )
    )
    rows = np.empty((count, path.shape[1], 11))
    for i in range(path.shape[1]):
        s = sim.data.states
        turned = np.roll(np.asarray(s.quat)[:, 0], 1, axis=1)
        rows[:, i] = np.concatenate([s.pos[:, 0], turned, np.asarray(s.rotor_vel)[:, 0] * RAD_S], axis=1)
        sim.state_control(np.concatenate([path[:, i], np.zeros((count, 3))], axis=1)[:, None])
        sim.step(STEPS_PER_ROW)
    return rows


if __name__ == "__main__":
    asked, given = sys.argv[1:]
    np.savez(given, state=fly(np.load(asked)["path"]), parameters=json.dumps(parameters()))
