"""The same estimation given to a general solver: CasADi's derivatives, IPOPT's Newton steps, none of our code.

Unknowns, residuals and noise levels are those of `sysid` (white noise); the attitude is a small turn from the
first guess. Only flights prepared by `sysid` (nodes, mean rotor speeds) and the first guess of the states go in.
"""

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle

GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class Answer:
    """What IPOPT found."""

    values: dict[str, float]
    cost: float
    """Half the sum of squares."""
    iterations: int
    cpu_s: float
    """CPU time of the solve alone, without building the graph."""
    success: bool


def solve(
    flights: list[Flight], states: tuple[States, ...], vehicle: Vehicle, names: tuple[str, ...], noise: Noise
) -> Answer:
    """Least squares over all states and the named parameters, from the given states and the vehicle's values."""
    size = np.array([max(abs(vehicle.value(n)), 1e-2 if "rotation" in n else 1e-3) for n in names])
    scaled = ca.MX.sym("parameters", len(names))
    interval, node = _interval(vehicle, names, size, noise), _node(vehicle, names, size, noise)
    unknowns, start, rows = [scaled], [np.array([vehicle.value(n) for n in names]) / size], []
    for flight, guess in zip(flights, states, strict=True):
        k = len(flight) - 1
        x = ca.MX.sym("x", 12, k + 1)
        unknowns.append(ca.vec(x))
        start.append(_stacked(guess).ravel())
        q = guess.q_world_body.T
        many = ca.repmat(scaled, 1, k)
        rows.append(
            interval.map(k)(
                x[:, :-1], x[:, 1:], q[:, :-1], q[:, 1:], flight.step_s[None], flight.rotor_speed_rad_s.T, many
            )
        )
        measured = np.concatenate([flight.position_world_m, flight.q_world_sensor], axis=1).T
        rows.append(node.map(k + 1)(x, q, measured, ca.repmat(scaled, 1, k + 1)))
    cost = 0.5 * sum(ca.sumsqr(r) for r in rows)
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 200}
    solver = ca.nlpsol("solver", "ipopt", {"x": ca.vertcat(*unknowns), "f": cost}, quiet)
    begun = time.process_time()
    found = solver(x0=np.concatenate(start))
    spent = time.process_time() - begun
    stats = solver.stats()
    values = np.array(found["x"]).ravel()[: len(names)] * size
    return Answer(
        dict(zip(names, values.tolist(), strict=True)),
        float(found["f"]),
        int(stats["iter_count"]),
        spent,
        bool(stats["success"]),
    )


def _stacked(guess: States) -> np.ndarray:
    turn = np.zeros_like(guess.position_world_m)
    return np.concatenate([guess.position_world_m, guess.velocity_world_m_s, turn, guess.rate_body_rad_s], axis=1)


def _interval(vehicle: Vehicle, names: tuple[str, ...], size: np.ndarray, noise: Noise) -> ca.Function:
    """Whitened defect (12) of one interval: midpoint rule, white acceleration."""
    x0, x1, q0, q1 = ca.SX.sym("x0", 12), ca.SX.sym("x1", 12), ca.SX.sym("q0", 4), ca.SX.sym("q1", 4)
    h, speed, scaled = ca.SX.sym("h"), ca.SX.sym("speed", 4), ca.SX.sym("p", len(names))
    value = _values(vehicle, names, size, scaled)
    q0_now, q1_now = _multiply(q0, _exp(x0[6:9])), _multiply(q1, _exp(x1[6:9]))
    turn = _log(_multiply(_conjugate(q0_now), q1_now))
    R = _matrix(_multiply(q0_now, _exp(0.5 * turn)))
    velocity, rate = 0.5 * (x0[3:6] + x1[3:6]), 0.5 * (x0[9:12] + x1[9:12])
    force, angular = _acceleration(vehicle, value, R.T @ velocity, rate, speed)
    moved = R.T @ (x1[0:3] - x0[0:3] - h * velocity)
    gained = R.T @ (x1[3:6] - x0[3:6] + h * ca.vertcat(0, 0, GRAVITY)) - h * force
    turned = turn - h * rate - h * h / 12.0 * ca.cross(x0[9:12], x1[9:12])
    spun = x1[9:12] - x0[9:12] - h * angular
    white = []
    for integral, change, std in ((moved, gained, noise.process[:3]), (turned, spun, noise.process[3:])):
        first = integral / (ca.sqrt(h**3 / 3.0) * std)
        white += [first, (change / std - 0.5 * ca.sqrt(3.0 * h) * first) / (0.5 * ca.sqrt(h))]
    return ca.Function("interval", [x0, x1, q0, q1, h, speed, scaled], [ca.vertcat(*white)])


def _node(vehicle: Vehicle, names: tuple[str, ...], size: np.ndarray, noise: Noise) -> ca.Function:
    """Whitened pose residual (6)."""
    x, q, measured, scaled = ca.SX.sym("x", 12), ca.SX.sym("q", 4), ca.SX.sym("m", 7), ca.SX.sym("p", len(names))
    value = _values(vehicle, names, size, scaled)
    now = _multiply(q, _exp(x[6:9]))
    offset = ca.vertcat(*(value[f"pose_sensor_{axis}_m"] for axis in "xyz"))
    rotation = ca.vertcat(*(value[f"pose_sensor_rotation_{axis}_rad"] for axis in "xyz"))
    position_m, attitude_rad = noise.levels["pose"].tolist()
    position = (measured[:3] - x[:3] - _matrix(now) @ offset) / position_m
    expected = _multiply(now, _exp(rotation))
    turned = _log(_multiply(_conjugate(expected), measured[3:])) / attitude_rad
    return ca.Function("node", [x, q, measured, scaled], [ca.vertcat(position, turned)])


def _values(vehicle: Vehicle, names: tuple[str, ...], size: np.ndarray, scaled: ca.SX) -> dict:
    known = {name: parameter.value for name, parameter in vehicle.parameters.items()}
    return known | {name: scaled[i] * size[i] for i, name in enumerate(names)}


def _acceleration(vehicle: Vehicle, value: dict, v: ca.SX, w: ca.SX, n: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Specific force and angular acceleration of RotorPy's forms, written down once more."""
    centre = ca.vertcat(value["centre_of_mass.x_m"], value["centre_of_mass.y_m"], 0.0)
    drag = ca.vertcat(*(value[f"parasitic_drag_speed.drag_{axis}_kg_m"] for axis in "xyz"))
    force, torque = -drag * ca.sqrt(ca.sumsqr(v) + 1e-12) * v, ca.SX.zeros(3)
    for i, spin in enumerate(vehicle.spin):
        arm = vehicle.hub_body_m[i] - centre
        air = v + ca.cross(w, arm)
        thrust = value["thrust_quadratic.k_n_s2"] * n[i] ** 2 - value["inflow_linear.inflow_kg"] * n[i] * air[2]
        thrust += value["translational_lift.lift_kg_m"] * (air[0] ** 2 + air[1] ** 2)
        side = -value["rotor_drag_speed.drag_kg"] * n[i]
        pull = ca.vertcat(side * air[0], side * air[1], thrust)
        force += pull
        torque += ca.cross(arm, pull)
        torque[2] -= value["rotor_yaw_torque.torque_n_m_s2"] * spin * n[i] ** 2
    inertia = ca.vertcat(*(value[f"inertia_{axis}_kg_m2"] for axis in ("xx", "yy", "zz")))
    return force / value["mass_kg"], (torque - ca.cross(w, inertia * w)) / inertia


def _exp(turn: ca.SX) -> ca.SX:
    """Quaternion of a rotation vector, by series: turns from the first guess, and between nodes, are small."""
    s = ca.sumsqr(turn) / 4.0
    return ca.vertcat(1 - s / 2 + s**2 / 24 - s**3 / 720, 0.5 * turn * (1 - s / 6 + s**2 / 120 - s**3 / 5040))


def _log(q: ca.SX) -> ca.SX:
    """Rotation vector of a quaternion near one: 2 asin |v| / |v| v, by series."""
    s = ca.sumsqr(q[1:])
    return 2.0 * q[1:] * (1 + s / 6 + 3 * s**2 / 40 + 5 * s**3 / 112) * ca.sign(q[0])


def _multiply(a: ca.SX, b: ca.SX) -> ca.SX:
    return ca.vertcat(a[0] * b[0] - ca.dot(a[1:], b[1:]), a[0] * b[1:] + b[0] * a[1:] + ca.cross(a[1:], b[1:]))


def _conjugate(q: ca.SX) -> ca.SX:
    return ca.vertcat(q[0], -q[1:])


def _matrix(q: ca.SX) -> ca.SX:
    """Rotation matrix of a unit quaternion."""
    hat = ca.skew(q[1:])
    return ca.SX.eye(3) + 2.0 * q[0] * hat + 2.0 * hat @ hat
