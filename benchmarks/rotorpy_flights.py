"""Flights flown by RotorPy (its physics, its controller) for testing identification; and our vehicle for them."""

from dataclasses import replace

import numpy as np

import vehicle
from flight import FlightLog, rotations
from flight.flight_log import from_vectors
from flight.frames import GRAVITY_M_S2

SENSOR_BODY_M = np.array([0.0901, 0.0063, 0.0142])
RATE_HZ = 200.0
CENTRE_M = np.array([0.0014, -0.0008, 0.0])


def parameters() -> dict:
    """RotorPy's Hummingbird with a slower motor, all its aerodynamic terms, and an offset centre of mass."""
    from rotorpy.vehicles.hummingbird_params import quad_params

    rotors = {name: np.asarray(place) - CENTRE_M for name, place in quad_params["rotor_pos"].items()}
    return {**quad_params, "rotor_pos": rotors, "tau_m": 0.02, "k_flap": 0.0}


def truth() -> vehicle.Vehicle:
    """The same vehicle in our terms: the answers."""
    p = parameters()
    hubs = np.stack(list(p["rotor_pos"].values())) + CENTRE_M
    v = vehicle.example("hummingbird")
    v = replace(v, hub_body_m=hubs, spin=-np.asarray(p["rotor_directions"], dtype=float))
    v = v.with_effect("centre_of_mass", x_m=float(CENTRE_M[0]), y_m=float(CENTRE_M[1]))
    v = v.with_effect("inflow_linear", inflow_kg=p["k_z"]).with_effect("translational_lift", lift_kg_m=p["k_h"])
    drag = {f"drag_{axis}_kg_m": p[f"c_D{axis}"] for axis in "xyz"}
    v = v.with_effect("parasitic_drag_speed", **drag)
    for axis, value in zip("xyz", SENSOR_BODY_M, strict=True):
        v = v.with_value(f"pose_sensor_{axis}_m", float(value))
    return v


def fly(
    kind: str,
    duration_s: float,
    rng: np.random.Generator,
    *,
    rate_hz: float = RATE_HZ,
    flown: dict | None = None,
    share: float = 1.0,
) -> FlightLog:
    """`vertical`, `horizontal` (to 10.5 m/s) or `rotation`; pose noise 2 mm and 0.12 deg, rotors 4 rad/s.

    Args:
        flown: parameters of a vehicle of RotorPy, with gains of its attitude; else those of `parameters`.
        share: of the size of the paths, and of the pose sensor's distance from the centre.
    """
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.multirotor import Multirotor

    p = {**parameters(), "kp_att": 260.0, "kd_att": 26.0} if flown is None else flown
    body = Multirotor(p, control_abstraction="cmd_motor_speeds", integrator_kwargs={"rtol": 1e-7, "atol": 1e-9})
    body.g = GRAVITY_M_S2
    body.weight = np.array([0.0, 0.0, -p["mass"] * GRAVITY_M_S2])
    control = SE3Control(p)
    path = waves(kind, rng)
    path[:3, :, 0] *= share
    hover = np.sqrt(p["mass"] * GRAVITY_M_S2 / (4.0 * p["k_eta"]))
    state = {
        "x": flat(path, 0.0)["x"],
        "v": np.zeros(3),
        "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "w": np.zeros(3),
        "wind": np.zeros(3),
        "rotor_speeds": np.full(4, hover),
    }
    count = int(duration_s * rate_hz) + 1
    rows = np.empty((count, 11))
    for i in range(count):
        rows[i] = np.concatenate([state["x"], np.roll(state["q"], 1), state["rotor_speeds"]])
        command = control.update(i / rate_hz, state, flat(path, i / rate_hz))
        state = body.step(state, command, 1.0 / rate_hz)
    return noisy(kind, np.arange(count) / rate_hz, rows, share * SENSOR_BODY_M, rng)


def waves(kind: str, rng: np.random.Generator) -> np.ndarray:
    """(4, 2, 3): for x, y, z and yaw two sines of amplitude, angular frequency and phase."""
    sizes = {
        "vertical": [[0.4, 0.0], [0.3, 0.0], [1.2, 0.12], [0.6, 0.0]],
        "horizontal": [[7.0, 0.05], [4.5, 0.05], [0.5, 0.0], [0.9, 0.0]],
        "rotation": [[0.5, 0.06], [0.5, 0.06], [0.25, 0.0], [0.9, 0.25]],
    }[kind]
    speeds = {
        "vertical": [[1.1, 1.0], [1.3, 1.0], [1.9, 4.3], [1.7, 1.0]],
        "horizontal": [[1.15, 3.9], [1.47, 4.3], [1.9, 1.0], [1.1, 1.0]],
        "rotation": [[3.1, 7.3], [3.7, 6.7], [2.3, 1.0], [3.1, 5.3]],
    }[kind]
    phase = rng.uniform(0.0, 2.0 * np.pi, (4, 2))
    return np.stack([np.array(sizes), np.array(speeds), phase], axis=2)


def flat(path: np.ndarray, t: float) -> dict:
    """Position, yaw and their derivatives along `waves`."""
    amplitude, speed, phase = np.moveaxis(path, 2, 0)
    angle = speed * t + phase
    value = (amplitude * np.sin(angle)).sum(axis=1)
    slope = (amplitude * speed * np.cos(angle)).sum(axis=1)
    curve = -(amplitude * speed**2 * np.sin(angle)).sum(axis=1)
    third, fourth = (
        -(amplitude * speed**3 * np.cos(angle)).sum(axis=1),
        (amplitude * speed**4 * np.sin(angle)).sum(axis=1),
    )
    return {
        "x": value[:3],
        "x_dot": slope[:3],
        "x_ddot": curve[:3],
        "x_dddot": third[:3],
        "x_ddddot": fourth[:3],
        "yaw": value[3],
        "yaw_dot": slope[3],
        "yaw_ddot": curve[3],
    }


def noisy(
    kind: str,
    time_s: np.ndarray,
    rows: np.ndarray,
    sensor_body_m: np.ndarray,
    rng: np.random.Generator,
    *,
    source: str = "RotorPy",
) -> FlightLog:
    """A log of (n, 11) position, quaternion (w, x, y, z) and rotor speeds, as its sensors measure them."""
    n = len(time_s)
    q = rows[:, 3:7]
    position = rows[:, :3] + rotations.rotate(q, sensor_body_m) + 2e-3 * rng.standard_normal((n, 3))
    turned = rotations.multiply(q, rotations.exp(np.deg2rad(0.12) * rng.standard_normal((n, 3))))
    speed = rows[:, 7:] + 4.0 * rng.standard_normal((n, 4))
    vectors = {"position_world_m": position, "q_world_body": turned, "rotor_speed_rad_s": speed}
    return from_vectors(time_s, vectors, metadata={"name": kind, "source": source})
