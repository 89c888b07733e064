"""Where the vehicle looks: a yaw spline on the same knots, along the path as far as the yaw rate allows.

A smoothing spline: least integral of w (yaw - heading)^2 + smoothing^8 (fourth derivative)^2, with the headings that
were asked for pinned. The weight w fades where the vehicle hardly moves, so a hover may face anywhere.
"""

import numpy as np

from flight import FloatArray
from planner import hermite, minimum_snap
from planner.penalty import GRAVITY_M_S2

_SAMPLES = 12
_SLOW_M_S = 0.5
"""Horizontal speed at which looking along the path counts half."""
_SMOOTHING_S = (0.05, 10.0)
"""Range of the time over which turns of the heading are smoothed out."""
_FAINT = 1e-6
"""Weight of the heading where the vehicle stands still, so that the spline is always determined."""


def solve(
    spline: minimum_snap.Spline, asked_rad: FloatArray, *, smoothing_s: float, along_path: bool = True
) -> FloatArray:
    """Knot states of yaw, (k + 1, 4), at rest at both ends.

    Args:
        spline: the path, axes x, y, z.
        asked_rad: (k + 1,) heading to be met at each knot, NaN where it is open.
        smoothing_s: the time over which turns are smoothed out.
    """
    T = spline.durations_s
    heading, weight = path_heading(spline)
    if not along_path or not (weight > _FAINT).any():
        heading, weight = np.zeros_like(heading), np.full_like(weight, _FAINT)
    pinned = _unwrapped(asked_rad, heading)
    if not along_path and np.isfinite(pinned).any():
        known = np.flatnonzero(np.isfinite(pinned))
        starts = np.concatenate([[0.0], np.cumsum(T)])
        times = starts[:-1, None] + _points() * T[:, None]
        heading = np.interp(times, starts[known], pinned[known])
    size = 4 * (len(T) + 1)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    B = hermite.basis(_points(), 0) @ hermite.monomials_from_states()
    energy = minimum_snap.energy(T) * smoothing_s**8
    for i, duration in enumerate(T):
        rows = B * hermite.time_powers(duration[None])[0]
        block = slice(4 * i, 4 * i + 8)
        w = weight[i] * duration / _SAMPLES
        matrix[block, block] += energy[i] + (rows.T * w) @ rows
        right[block] += rows.T @ (w * heading[i])
    return _solve_pinned(matrix, right, pinned).reshape(-1, 4)


def steady_enough(
    spline: minimum_snap.Spline, asked_rad: FloatArray, yaw_rate_rad_s: float, *, along_path: bool
) -> FloatArray:
    """As `solve`, with the least smoothing that keeps the body's yaw rate within the bound (or the most there is)."""
    quick, slow = np.log(_SMOOTHING_S)
    yaw = solve(spline, asked_rad, smoothing_s=_SMOOTHING_S[1], along_path=along_path)
    if not along_path:
        return yaw
    spin = _tilt_spin(spline)
    for _ in range(8):
        middle = 0.5 * (quick + slow)
        candidate = solve(spline, asked_rad, smoothing_s=float(np.exp(middle)))
        if np.abs(_sampled(candidate[..., None], spline.durations_s, 1)[..., 0] + spin).max() <= yaw_rate_rad_s:
            slow, yaw = middle, candidate
        else:
            quick = middle
    return yaw


def _tilt_spin(spline: minimum_snap.Spline) -> FloatArray:
    """What turning the thrust axis n adds to the body's yaw rate, (k, samples): yaw here turns before it tilts."""
    T = spline.durations_s
    thrust = _sampled(spline.states, T, 2) + np.array([0.0, 0.0, GRAVITY_M_S2])
    size = np.maximum(np.linalg.norm(thrust, axis=-1, keepdims=True), 1.0)
    n = thrust / size
    jerk = _sampled(spline.states, T, 3) / size
    turn = jerk - n * np.sum(n * jerk, axis=-1, keepdims=True)
    return -(n[..., 0] * turn[..., 1] - n[..., 1] * turn[..., 0]) / np.maximum(1.0 + n[..., 2], 0.1)


def _sampled(states: FloatArray, durations_s: FloatArray, derivative: int) -> FloatArray:
    """A derivative at the sample points of each segment, (k, samples, axes)."""
    scaled = hermite.segment_states(states) * hermite.time_powers(durations_s)[..., None]
    rows = hermite.basis(_points(), derivative) @ hermite.monomials_from_states()
    return rows @ scaled / durations_s[:, None, None] ** derivative


def path_heading(spline: minimum_snap.Spline) -> tuple[FloatArray, FloatArray]:
    """Direction of flight at samples of each segment, unwrapped, with its weight: two arrays (k, samples)."""
    T = spline.durations_s
    velocity = _sampled(spline.states[..., :2], T, 1)
    speed = np.hypot(velocity[..., 0], velocity[..., 1]).ravel()
    moving = np.flatnonzero(speed > 0.3 * _SLOW_M_S)
    if not moving.size:
        return np.zeros(velocity.shape[:2]), np.full(velocity.shape[:2], _FAINT)
    direction = np.arctan2(velocity[..., 1], velocity[..., 0]).ravel()
    unwrapped = np.unwrap(direction[moving])
    heading = np.interp(np.arange(speed.size), moving, unwrapped)
    weight = np.where(speed > 0.3 * _SLOW_M_S, speed**2 / (speed**2 + _SLOW_M_S**2), 0.0) + _FAINT
    return heading.reshape(velocity.shape[:2]), weight.reshape(velocity.shape[:2])


def _points() -> FloatArray:
    return (np.arange(_SAMPLES) + 0.5) / _SAMPLES


def _unwrapped(asked_rad: FloatArray, heading: FloatArray) -> FloatArray:
    """The asked headings, each turned by whole turns to lie nearest to the last one, or to the path's direction."""
    near = np.append(heading[:, 0], heading[-1, -1])
    pinned = np.array(asked_rad, dtype=np.float64)
    lead = 0.0  # how far the last pinned heading was ahead of the path's direction
    for i in np.flatnonzero(np.isfinite(pinned)):
        pinned[i] += 2.0 * np.pi * np.round((near[i] + lead - pinned[i]) / (2.0 * np.pi))
        lead = pinned[i] - near[i]
    return pinned


def _solve_pinned(matrix: FloatArray, right: FloatArray, pinned: FloatArray) -> FloatArray:
    """Minimise with the pinned values and both ends' derivatives held."""
    fixed = np.full((len(pinned), 4), np.nan)
    fixed[:, 0] = pinned
    fixed[[0, -1], 1:] = 0.0
    held = np.isfinite(fixed.ravel())
    solution = np.where(held, fixed.ravel(), 0.0)
    open_ = ~held
    rest = right[open_] - matrix[np.ix_(open_, held)] @ solution[held]
    scale = 1.0 / np.sqrt(np.diag(matrix)[open_])
    inner = matrix[np.ix_(open_, open_)] * scale[:, None] * scale
    solution[open_] = scale * np.linalg.solve(inner, scale * rest)
    return solution
