"""A small flight simulator of the tests' own: rigid body, induced-velocity thrust, drag, motor lag, PD control.

It shares no physics code with `vehicle`, so that identification is judged by an independent truth. Many flights are
flown at once, arrays (flights, ...).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flight import FlightLog, rotations
from flight.flight_log import from_vectors
from flight.frames import GRAVITY_M_S2

GRAVITY = np.array([0.0, 0.0, -GRAVITY_M_S2])
HUBS = 0.0885 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
SPIN = np.array([-1.0, 1.0, -1.0, 1.0])
GUSTS_PER_SAMPLE = 3
RHO_AREA = 1.2 * np.pi * 0.0635**2


@dataclass(frozen=True)
class Truth:
    """Constants of the simulated vehicle, in SI."""

    mass: float = 0.70
    inertia: tuple[float, float, float] = (0.00306, 0.00442, 0.00441)
    k1: float = 3.119e-6
    k2: float = -1.547e-4
    c_q: float = 3.100e-8
    rotor_drag: float = 0.0175
    drag_xy: float = 0.0055
    drag_z: float = 0.0185
    centre: tuple[float, float] = (0.0014, 0.00018)
    sensor: tuple[float, float, float] = (0.0901, 0.0063, 0.0142)
    sensor_turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lag: float = 0.03
    gust: float = 0.0
    """Standard deviation of a random acceleration that lasts about `gust_time`, m/s2."""
    gust_torque: float = 0.0
    """The same of a random angular acceleration, rad/s2."""
    gust_time: float = 0.5
    tether: float = 0.0
    """Stiffness of a spring towards the world's origin, in the level plane, N/m."""
    extra: Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    """Hidden effect: velocity in body axes, rate, rotor speed to force and torque."""


def thrust(truth: Truth, speed: np.ndarray, axial: np.ndarray, lateral: np.ndarray) -> np.ndarray:
    """Blade element thrust k1 n^2 + k2 n (v_z + v_i), balanced with momentum theory by Newton's method on v_i.

    From above: there the balance falls ever faster with v_i, so that no step goes past the root.
    """
    static, slope = truth.k1 * speed**2 + truth.k2 * speed * axial, truth.k2 * speed
    induced = np.full_like(speed, 8.0)
    for _ in range(6):
        through = axial + induced
        along = np.hypot(through, lateral)
        surplus_slope = slope - 2.0 * RHO_AREA * along
        surplus = static + induced * surplus_slope
        induced = induced - surplus / (surplus_slope - 2.0 * RHO_AREA * induced * through / along)
    return static + slope * induced


def wrench(truth: Truth, velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque in body axes, (flights, 3) each."""
    arm = HUBS - np.array(truth.centre)
    axial = velocity[:, 2:] + rate[:, :1] * arm[:, 1] - rate[:, 1:2] * arm[:, 0]
    lateral = np.hypot(velocity[:, :1] - rate[:, 2:] * arm[:, 1], velocity[:, 1:2] + rate[:, 2:] * arm[:, 0])
    lift = thrust(truth, speed, axial, lateral)
    collective = lift @ np.ones(4)
    force = -np.array([truth.drag_xy, truth.drag_xy, truth.drag_z]) * np.abs(velocity) * velocity
    force[:, :2] -= truth.rotor_drag * collective[:, None] * velocity[:, :2]
    force[:, 2] += collective
    torque = np.empty_like(force)
    torque[:, 0], torque[:, 1], torque[:, 2] = lift @ arm[:, 1], -lift @ arm[:, 0], -truth.c_q * (speed**2 @ SPIN)
    if truth.extra is not None:
        more_force, more_torque = truth.extra(velocity, rate, speed)
        force, torque = force + more_force, torque + more_torque
    return force, torque


Reference = Callable[[float], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
"""Time to position, velocity, acceleration (flights, 3) and yaw (flights,)."""


def weave(amplitude: np.ndarray, frequency: np.ndarray, phase: np.ndarray, yaw: np.ndarray) -> Reference:
    """Sums of sines per axis: amplitude, frequency (rad/s) and phase are (flights, 3, terms); yaw (flights, 2)."""

    def at(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        angle = frequency * t + phase
        start = np.minimum(1.0, t / 2.0)
        return (
            start * (amplitude * np.sin(angle)).sum(axis=2),
            (amplitude * frequency * np.cos(angle)).sum(axis=2),
            (-amplitude * frequency**2 * np.sin(angle)).sum(axis=2),
            yaw[:, 0] * np.sin(yaw[:, 1] * t),
        )

    return at


def paper_flights(rng: np.random.Generator, campaigns: int = 1, spread: float = 0.0) -> Reference:
    """Per campaign three flights as in the paper: vertical, horizontal (fast) and rotation; sizes vary by `spread`."""
    amplitude = np.zeros((3, 3, 2))
    frequency = np.ones((3, 3, 2))
    amplitude[0, 2], frequency[0, 2] = (1.2, 0.25), (1.7, 4.1)
    amplitude[0, 0, 0], frequency[0, 0, 0] = 0.5, 1.1
    amplitude[1, 0], frequency[1, 0] = (7.5, 0.1), (1.15, 3.9)
    amplitude[1, 1], frequency[1, 1] = (5.0, 0.1), (1.47, 4.3)
    amplitude[1, 2, 0], frequency[1, 2, 0] = 0.6, 1.9
    amplitude[2, 0], frequency[2, 0] = (0.5, 0.08), (3.1, 7.3)
    amplitude[2, 1], frequency[2, 1] = (0.5, 0.08), (3.7, 6.7)
    amplitude[2, 2, 0], frequency[2, 2, 0] = 0.3, 2.3
    shape = (3 * campaigns, 3, 2)
    vary = 1.0 + spread * rng.uniform(-1.0, 1.0, shape)
    phase = rng.uniform(0.0, 2.0 * np.pi, shape)
    yaw = np.tile([[0.8, 1.7], [1.0, 1.1], [0.9, 4.1]], (campaigns, 1))
    return weave(np.tile(amplitude, (campaigns, 1, 1)) * vary, np.tile(frequency, (campaigns, 1, 1)), phase, yaw)


def fly(
    truth: Truth,
    reference: Reference,
    flights: int,
    *,
    duration_s: float,
    rng: np.random.Generator,
    rate_hz: float = 200.0,
    position_noise_m: float = 2e-3,
    attitude_noise_rad: float = 2e-3,
    rotor_noise_rad_s: float = 4.0,
    gyro_noise_rad_s: float | None = None,
) -> list[FlightLog]:
    """Fly all references at once with the fourth-order Runge-Kutta rule, and record noisy logs.

    One step per sample moves what three steps log by 0.01 mm, 0.001 deg and 0.1 rad/s, a fortieth of its noise at most.
    Gusts are drawn anew several times in each.
    """
    step_s, gust_s = 1.0 / rate_hz, 1.0 / (rate_hz * GUSTS_PER_SAMPLE)
    samples, gusty = int(duration_s * rate_hz) + 1, bool(truth.gust or truth.gust_torque)
    position, velocity, _, yaw = reference(0.0)
    velocity = 0.0 * velocity
    state = np.concatenate(
        [position, velocity, rotations.from_yaw(yaw), np.zeros((flights, 3)), np.full((flights, 4), 950.0)], axis=1
    )
    kept = np.empty((samples, flights, 21))
    gust = np.zeros((flights, 6))
    lasts = np.exp(-gust_s / truth.gust_time)
    fresh = np.sqrt(1.0 - lasts * lasts) * np.repeat([truth.gust, truth.gust_torque], 3)
    for sample in range(samples):
        command = _control(truth, state, reference(sample / rate_hz))
        kept[sample] = np.concatenate([state, command], axis=1)
        state = _step(truth, state, command, step_s)
        for _ in range(GUSTS_PER_SAMPLE if gusty else 0):
            gust = lasts * gust + fresh * rng.standard_normal((flights, 6))
            state[:, 3:6] += gust_s * gust[:, :3]
            state[:, 10:13] += gust_s * gust[:, 3:]
    time_s = np.arange(samples) / rate_hz
    return [
        _log(truth, time_s, kept[:, i], rng, position_noise_m, attitude_noise_rad, rotor_noise_rad_s, gyro_noise_rad_s)
        for i in range(flights)
    ]


def _control(truth: Truth, state: np.ndarray, setpoint: tuple[np.ndarray, ...]) -> np.ndarray:
    """Rotor speeds of a PD position and attitude controller that knows the vehicle only roughly."""
    position, velocity, q, rate = state[:, :3], state[:, 3:6], state[:, 6:10], state[:, 10:13]
    wanted, wanted_velocity, wanted_acceleration, yaw = setpoint
    pull = 4.0 * (wanted - position) + 3.0 * (wanted_velocity - velocity) + wanted_acceleration - GRAVITY
    pull[:, 2] = np.maximum(pull[:, 2], 3.0)
    z = pull / np.linalg.norm(pull, axis=1, keepdims=True)
    y = rotations.cross(z, np.stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw], axis=1))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    R = np.stack([rotations.cross(y, z), y, z], axis=2)
    error = rotations.log(rotations.multiply(rotations.conjugate(q), rotations.from_matrix(R)))
    turn = 0.004 * np.array([220.0, 220.0, 40.0]) * error - 0.004 * np.array([22.0, 22.0, 12.0]) * rate
    collective = truth.mass * (pull * rotations.rotate(q, np.array([0.0, 0.0, 1.0]))).sum(axis=1)
    k = 2.08e-6
    # Inverse of the X mixer: rotors front left, rear left, rear right, front right.
    mix = np.column_stack([np.full(4, 0.25), np.sign(HUBS[:, 1]) / 0.354, -np.sign(HUBS[:, 0]) / 0.354])
    squared = np.column_stack([collective, turn[:, 0], turn[:, 1]]) @ mix.T / k
    squared -= SPIN * np.clip(turn[:, 2:] / (4.0 * truth.c_q), -2.5e5, 2.5e5)
    return np.sqrt(np.clip(squared, 250.0**2, 1800.0**2))


def _derivative(truth: Truth, state: np.ndarray, command: np.ndarray) -> np.ndarray:
    q, rate, speed = state[:, 6:10], state[:, 10:13], state[:, 13:]
    inertia = np.array(truth.inertia)
    R = rotations.matrix(q)
    force, torque = wrench(truth, (state[:, None, 3:6] @ R)[:, 0], rate, speed)
    turning = 0.5 * rotations.multiply(q, np.concatenate([np.zeros((len(q), 1)), rate], axis=1))
    angular = (torque - rotations.cross(rate, inertia * rate)) / inertia
    pulled = (R @ force[..., None])[..., 0] - truth.tether * np.array([1.0, 1.0, 0.0]) * state[:, :3]
    linear = pulled / truth.mass + GRAVITY
    return np.concatenate([state[:, 3:6], linear, turning, angular, (command - speed) / truth.lag], axis=1)


def _step(truth: Truth, state: np.ndarray, command: np.ndarray, h: float) -> np.ndarray:
    a = _derivative(truth, state, command)
    b = _derivative(truth, state + 0.5 * h * a, command)
    c = _derivative(truth, state + 0.5 * h * b, command)
    d = _derivative(truth, state + h * c, command)
    after = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    after[:, 6:10] = rotations.normalise(after[:, 6:10])
    return after


def _log(
    truth: Truth,
    time_s: np.ndarray,
    states: np.ndarray,
    rng: np.random.Generator,
    position_noise_m: float,
    attitude_noise_rad: float,
    rotor_noise_rad_s: float,
    gyro_noise_rad_s: float | None,
) -> FlightLog:
    n = len(time_s)
    q = states[:, 6:10]
    position = states[:, :3] + rotations.rotate(q, np.array(truth.sensor))
    sensed = rotations.multiply(q, rotations.exp(truth.sensor_turn))
    vectors = {
        "position_world_m": position + position_noise_m * rng.standard_normal((n, 3)),
        "q_world_body": rotations.multiply(sensed, rotations.exp(attitude_noise_rad * rng.standard_normal((n, 3)))),
        "rotor_speed_rad_s": states[:, 13:17] + rotor_noise_rad_s * rng.standard_normal((n, 4)),
        "rotor_speed_command_rad_s": states[:, 17:],
    }
    if gyro_noise_rad_s is not None:
        bias = 0.01 * rng.standard_normal(3)
        vectors["rate_body_rad_s"] = states[:, 10:13] + bias + gyro_noise_rad_s * rng.standard_normal((n, 3))
    return from_vectors(time_s, vectors)
