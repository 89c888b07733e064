"""What the vehicle uses of each limit at instants of a path, and how it can yaw: to plan by, not to judge."""

import numpy as np

import vehicle as vehicles
from flight import FloatArray, Trajectory, portable
from planner.curve import heading
from planner.gate import limits
from vehicle import Limits, Vehicle, flatness, invert

_SIDE_S = 1e-9
"""Distance in seconds of the samples on both sides of a join: snap, and with it the torque, may jump there."""


def _attitude_values(trajectory: Trajectory, vehicle: Vehicle, times: FloatArray) -> list[FloatArray]:
    state = flatness.state(vehicle, trajectory, times)
    _, x, y, _ = state.q_world_body.T
    tilt = 2.0 * portable.arcsine(np.clip(np.sqrt(x * x + y * y), 0.0, 1.0))
    rate = state.rate_body_rad_s
    rotor = state.rotor_speed_rad_s
    return [tilt, portable.length(rate[:, :2]), np.abs(rate[:, 2]), rotor.max(axis=1), rotor.min(axis=1)]


def time_shares(trajectory: Trajectory, vehicle: Vehicle, bounds: Limits, times: FloatArray) -> FloatArray:
    """Factor on the time at which each limit is just met, (limits, times); below 1 the limit is kept with margin.

    Where the motion is impossible the factor is 1.5. There is no row for a limit that there is not.
    """
    room = limits.time_factor(sampled_shares(trajectory, vehicle, bounds, times))
    return np.where(np.isfinite(room), room, 1.5)[np.isfinite(limits.bounds_of(bounds))]


def sampled_shares(trajectory: Trajectory, vehicle: Vehicle, bounds: Limits, times: FloatArray) -> FloatArray:
    """Share used of each limit at each of the times (n,), (limits, n); NaN where the motion is impossible."""
    norms = [np.linalg.norm(trajectory.position(times, r), axis=1) for r in range(1, limits.PROVED + 1)]
    value = np.stack(norms + _attitude_values(trajectory, vehicle, times))
    return limits.shares_used(value, bounds, limits.mean_hover_rad_s(vehicle))


def sample_times(trajectory: Trajectory, step_s: float) -> tuple[FloatArray, np.ndarray]:
    """Times at most `step_s` apart, both sides of every join among them, and the segment each belongs to."""
    times, segments = [], []
    for i, (start, duration) in enumerate(zip(trajectory.starts_s[:-1], trajectory.durations_s, strict=True)):
        side = min(_SIDE_S, 1e-3 * duration)
        count = max(int(np.ceil(duration / step_s)), 4) + 1
        times.append(start + np.linspace(0.0, duration - side, count))
        segments.append(np.full(count, i))
    return np.concatenate(times), np.concatenate(segments)


def yaw_bounds(vehicle: Vehicle, bounds: Limits) -> heading.Bounds:
    """Yaw rate, and the yaw acceleration from moving a quarter of hover's thrust between the two pairs of rotors."""
    still = np.zeros((1, 3))
    hover = invert.hover(vehicle)
    uneven = (hover * np.sqrt(1.0 + 0.25 * np.sign(vehicle.spin)))[None]
    torque = float(abs(vehicles.wrench(vehicle, still, still, uneven)[1][0, 2]))
    return heading.Bounds(0.9 * bounds.yaw_rate_rad_s, max(torque / vehicle.value("inertia_zz_kg_m2"), 0.1))
