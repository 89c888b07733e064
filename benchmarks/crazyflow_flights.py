"""Flights of crazyflow's Crazyflie, by its physics and its controller; run by an interpreter that has crazyflow:

    python benchmarks/crazyflow_flights.py PATHS.npz FLIGHTS.npz

crazyflow is no dependency of ours: JAX and MuJoCo come with it. So this file imports nothing of Goshawk.

PATHS holds `path` (flights, n, 13): position, velocity, acceleration and the quaternion (x, y, z, w) asked for, every
`step_ms` of whole milliseconds; and `shares` (flights, 4): of the usual inertias about x, y, z and of the usual thrust.
FLIGHTS gets, where the vehicle is at the times of `path`, `state` (flights, n, 11): position in m, quaternion
(w, x, y, z), rotor speeds in rad/s; `motion` (flights, n, 10): velocity in m/s in the world, rate in rad/s in the body,
rotor speeds commanded until the next row in rad/s; and as `parameters` the vehicle's, as JSON in SI.
"""

import json
import sys
import tomllib
from importlib import import_module, resources

import numpy as np

DRONE = "cf21B_500"
RATE_HZ = 1000
"""Of its semi-implicit integrator."""
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


def fly(path: np.ndarray, step_ms: int, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(flights, n, 11) states and (flights, n, 10) motions, as flown along (flights, n, 13)."""
    count = len(path)
    sim = import_module("crazyflow.sim").Sim(
        n_worlds=count, drone=DRONE, dynamics="first_principles", control="state", freq=RATE_HZ
    )
    sim.reset()
    states, usual = sim.data.states, sim.data.params
    inertia = np.asarray(usual.J) * np.eye(3) * shares[:, None, :3, None]
    thrust = np.asarray(usual.rpm2thrust) * shares[:, 3, None, None, None]
    hover = np.sqrt(parameters()["mass_kg"] * 9.81 / 4.0 / parameters()["thrust_n"][2]) / RAD_S
    sim.data = sim.data.replace(
        states=states.replace(
            pos=states.pos.at[:, 0].set(path[:, 0, :3]),
            vel=states.vel.at[:, 0].set(path[:, 0, 3:6]),
            rotor_vel=states.rotor_vel.at[:].set(hover),
        ),
        params=usual.replace(J=inertia, J_inv=np.linalg.inv(inertia), rpm2thrust=thrust),
    )
    state, motion = np.empty((count, path.shape[1], 11)), np.empty((count, path.shape[1], 10))
    for i in range(path.shape[1]):
        s = sim.data.states
        turned = np.roll(np.asarray(s.quat)[:, 0], 1, axis=1)
        state[:, i] = np.concatenate([s.pos[:, 0], turned, np.asarray(s.rotor_vel)[:, 0] * RAD_S], axis=1)
        motion[:, i, :6] = np.concatenate([s.vel[:, 0], s.ang_vel[:, 0]], axis=1)
        sim.state_control(np.concatenate([path[:, i], np.zeros((count, 3))], axis=1)[:, None])
        sim.step(step_ms)
        motion[:, i, 6:] = np.asarray(sim.data.controls.rotor_vel)[:, 0] * RAD_S
    return state, motion


if __name__ == "__main__":
    given, found = sys.argv[1:]
    with np.load(given) as asked:
        state, motion = fly(asked["path"], int(asked["step_ms"]), asked["shares"])
    np.savez(found, state=state, motion=motion, parameters=json.dumps(parameters()))
