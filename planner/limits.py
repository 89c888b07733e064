"""Whether the vehicle can fly a trajectory: speed and acceleration proved, attitude, rates and rotors sampled.

Speed and acceleration are polynomials: their bounds are certified over all time. Tilt, rates and rotor speeds come from
`vehicle.flatness` (drag included) at samples; an allowance for the values between two samples, from the curvature
there, is added to the value before it is compared.
"""

from dataclasses import asdict, dataclass

import numpy as np

import vehicle as vehicles
from flight import FlightError, FloatArray, Trajectory, polynomial
from planner import heading, penalty
from vehicle import Limits, Vehicle, flatness, invert

_PIECES = 16
"""Parts of a segment in which the hull bound is taken; its gap falls with the square of their number."""
_SIDE_S = 1e-9
"""Distance in seconds of the samples on both sides of a join: snap, and with it the torque, may jump there."""


NAMES = ("speed", "acceleration", "tilt", "roll and pitch rate", "yaw rate", "rotor speed", "slowest rotor")
"""The checks of this module, in order."""


@dataclass(frozen=True, slots=True)
class Check:
    """One check of the gate and its result."""

    name: str
    value: float
    bound: float
    unit: str
    passed: bool
    time_s: float | None = None
    """When on the trajectory the value occurs, if it belongs to an instant."""
    segment: int | None = None
    reason: str = ""
    """Method by which the value was found, or why there is none."""

    @property
    def ratio(self) -> float:
        """Value over bound, for checks whose value must stay below it."""
        return self.value / self.bound

    def as_dict(self) -> dict[str, object]:
        """JSON-able: what is not finite is None."""
        return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in asdict(self).items()}


def check(
    trajectory: Trajectory, vehicle: Vehicle, limits: Limits | None = None, *, step_s: float = 0.005
) -> list[Check]:
    """Every limit with the worst value over the whole trajectory; never raises for a trajectory that fails."""
    limits = vehicle.limits if limits is None else limits
    return [
        _polynomial_check("speed", trajectory, 1, limits.speed_m_s, "m/s"),
        _polynomial_check("acceleration", trajectory, 2, limits.acceleration_m_s2, "m/s2"),
        *_attitude_checks(trajectory, vehicle, limits, step_s),
    ]


def _polynomial_check(name: str, trajectory: Trajectory, derivative: int, bound: float, unit: str) -> Check:
    value, time_s, segment = certified_maximum(trajectory, derivative)
    return Check(name, value, bound, unit, bool(value <= bound), time_s, segment, "proved between samples")


def certified_maximum(trajectory: Trajectory, derivative: int) -> tuple[float, float, int]:
    """Upper bound of the norm of a derivative of position, near which time, and in which segment.

    The norm of a point of the hull is at most that of its farthest corner, the control points of a short piece.
    """
    T = trajectory.durations_s
    c = polynomial.differentiate(trajectory.coefficients[:, :3], derivative)
    starts = (np.arange(_PIECES) / _PIECES)[None, :, None] * T[:, None, None]
    pieces = polynomial.shift_argument(
        np.repeat(c[:, None], _PIECES, axis=1), np.broadcast_to(starts, (*c.shape[:1], _PIECES, 3))
    )
    lengths = np.broadcast_to((T / _PIECES)[:, None, None], pieces.shape[:3])
    norms = np.linalg.norm(polynomial.bernstein_from_seconds(pieces, lengths), axis=2).max(axis=2)
    segment, piece = np.unravel_index(int(np.argmax(norms)), norms.shape)
    time_s = float(trajectory.starts_s[segment] + T[segment] * (piece + 0.5) / _PIECES)
    return float(norms[segment, piece]), time_s, int(segment)


def _attitude_checks(trajectory: Trajectory, vehicle: Vehicle, limits: Limits, step_s: float) -> list[Check]:
    names = (
        ("tilt", limits.tilt_rad, "rad"),
        ("roll and pitch rate", limits.rate_rad_s, "rad/s"),
        ("yaw rate", limits.yaw_rate_rad_s, "rad/s"),
        ("rotor speed", limits.rotor_speed_max_rad_s, "rad/s"),
        ("slowest rotor", limits.rotor_speed_min_rad_s, "rad/s"),
    )
    times, segment = sample_times(trajectory, step_s)
    try:
        values = _attitude_values(trajectory, vehicle, times)
    except FlightError as error:
        return [Check(name, np.nan, bound, unit, False, reason=str(error)) for name, bound, unit in names]
    allowance = [_between_samples(v, segment) for v in values]
    checks = []
    for (name, bound, unit), value, more in zip(names, values, allowance, strict=True):
        lowest = name == "slowest rotor"
        careful = value - more if lowest else value + more
        worst = int(np.argmin(careful) if lowest else np.argmax(careful)) if np.isfinite(careful).all() else -1
        if worst < 0:
            worst = int(np.argmin(np.isfinite(careful)))
            reason = "no rotor speeds produce this motion"
        else:
            reason = f"sampled every {step_s:g} s; allowance between samples {more[worst]:.3g} {unit}"
        found = float(careful[worst])
        passed = bool(found >= bound if lowest else found <= bound)
        checks.append(Check(name, found, bound, unit, passed, float(times[worst]), int(segment[worst]), reason))
    return checks


def _attitude_values(trajectory: Trajectory, vehicle: Vehicle, times: FloatArray) -> list[FloatArray]:
    state = flatness.state(vehicle, trajectory, times)
    _, x, y, _ = state.q_world_body.T
    tilt = 2.0 * np.arcsin(np.clip(np.hypot(x, y), 0.0, 1.0))
    rate = state.rate_body_rad_s
    rotor = state.rotor_speed_rad_s
    return [tilt, np.hypot(rate[:, 0], rate[:, 1]), np.abs(rate[:, 2]), rotor.max(axis=1), rotor.min(axis=1)]


def time_shares(trajectory: Trajectory, vehicle: Vehicle, limits: Limits, times: FloatArray) -> FloatArray:
    """Factor on the time at which each limit is just met, (limits, times); below 1 the limit is kept with margin.

    A prediction: speed and yaw rate fall with the time, acceleration and what follows from it with its square, rates
    of the thrust's direction with its cube. Where the motion is impossible the factor is 1.5.
    """
    hover = float(flatness.state(vehicle, trajectory, times[:1]).rotor_speed_rad_s.mean())
    tilt, rate, yaw_rate, fastest, slowest = _attitude_values(trajectory, vehicle, times)
    speed, push = (np.linalg.norm(trajectory.position(times, r), axis=1) for r in (1, 2))
    room = np.stack(
        [
            speed / limits.speed_m_s,
            np.sqrt(push / limits.acceleration_m_s2),
            np.sqrt(tilt / limits.tilt_rad),
            np.cbrt(rate / limits.rate_rad_s),
            yaw_rate / limits.yaw_rate_rad_s,
            np.sqrt(np.maximum(fastest - hover, 0.0) / max(limits.rotor_speed_max_rad_s - hover, 1e-9)),
            np.sqrt(np.maximum(hover - slowest, 0.0) / max(hover - limits.rotor_speed_min_rad_s, 1e-9)),
        ]
    )
    return np.where(np.isfinite(room), room, 1.5)


def sample_times(trajectory: Trajectory, step_s: float) -> tuple[FloatArray, np.ndarray]:
    """Times at most `step_s` apart, both sides of every join among them, and the segment each belongs to."""
    times, segments = [], []
    for i, (start, duration) in enumerate(zip(trajectory.starts_s[:-1], trajectory.durations_s, strict=True)):
        side = min(_SIDE_S, 1e-3 * duration)
        count = max(int(np.ceil(duration / step_s)), 4) + 1
        times.append(start + np.linspace(0.0, duration - side, count))
        segments.append(np.full(count, i))
    return np.concatenate(times), np.concatenate(segments)


def _between_samples(value: FloatArray, segment: np.ndarray) -> FloatArray:
    """How far a value may rise beside a sample: an eighth of the second difference for a parabola; twice that here."""
    allowance = np.zeros_like(value)
    inner = (segment[2:] == segment[:-2]).nonzero()[0] + 1
    allowance[inner] = 0.25 * np.abs(value[inner + 1] - 2.0 * value[inner] + value[inner - 1])
    first = np.flatnonzero(np.diff(segment, prepend=-1))
    last = np.append(first[1:], len(segment)) - 1
    allowance[first], allowance[last] = allowance[first + 1], allowance[last - 1]
    return allowance


def point_mass_bounds(vehicle: Vehicle, limits: Limits) -> penalty.Bounds:
    """The limits for an optimiser without a rotor model."""
    still = np.zeros((1, 3))
    mass = vehicle.mass_kg
    speeds = (limits.rotor_speed_min_rad_s, limits.rotor_speed_max_rad_s)
    least, most = (float(vehicles.wrench(vehicle, still, still, np.full((1, 4), n))[0][0, 2]) / mass for n in speeds)
    arm = float(np.abs(vehicle.hub_body_m[:, :2]).mean())
    inertia = max(vehicle.value("inertia_xx_kg_m2"), vehicle.value("inertia_yy_kg_m2"))
    return penalty.Bounds(
        speed_m_s=limits.speed_m_s,
        acceleration_m_s2=limits.acceleration_m_s2,
        tilt_rad=limits.tilt_rad,
        rate_rad_s=limits.rate_rad_s,
        thrust_min_m_s2=least,
        thrust_max_m_s2=most,
        # A turn about the diagonal is the dearest, two rotors do all of it; a fifth of their room is left for yaw.
        turn_rad_s2_per_m_s2=0.8 * mass * arm / inertia / np.sqrt(2.0),
    )


def yaw_bounds(vehicle: Vehicle, limits: Limits) -> heading.Bounds:
    """Yaw rate, and the yaw acceleration from moving a quarter of hover's thrust between the two pairs of rotors."""
    still = np.zeros((1, 3))
    hover = invert.hover(vehicle)
    uneven = (hover * np.sqrt(1.0 + 0.25 * np.sign(vehicle.spin)))[None]
    torque = float(abs(vehicles.wrench(vehicle, still, still, uneven)[1][0, 2]))
    return heading.Bounds(0.9 * limits.yaw_rate_rad_s, max(torque / vehicle.value("inertia_zz_kg_m2"), 0.1))
