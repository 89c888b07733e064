"""Where the vehicle looks: a yaw spline on the same knots, along the path as far as the yaw rate allows.

A smoothing spline: least integral of w (yaw - heading)^2 + (s^2 times the body's yaw acceleration)^2 + a little of the
fourth derivative, with the headings that were asked for pinned; s is the time over which turns are smoothed out. The
weight w fades where the vehicle hardly moves, so a hover may face anywhere.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError, portable, rotations
from flight.frames import GRAVITY_M_S2
from planner.curve import minimum_snap
from planner.request.options import PlanOptions

_POINTS = (np.arange(12) + 0.5) / 12
"""Fractions of each segment at which it is sampled."""
_SLOW_M_S = 0.5
"""Horizontal speed at which looking along the path counts half."""
_SMOOTHING_S = (0.05, 10.0)
"""Range of the time over which turns of the heading are smoothed out."""
_SOFTEST_S = 0.2
"""Most that goes into the fourth derivative: yaw must be able to take back what tilting adds to the yaw rate."""
_FAINT = 1e-6
"""Weight of the heading where the vehicle stands still, so that the spline is always determined."""
_SAME_RAD = 1e-3
"""Headings that differ by less are the same."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """What the vehicle can do about its yaw."""

    rate_rad_s: float
    """Largest yaw rate of the body."""
    acceleration_rad_s2: float
    """Largest change of it: rotors have little torque about their own axes."""


def steady_enough(
    spline: minimum_snap.Spline,
    asked_rad: FloatArray,
    bounds: Bounds,
    *,
    along_path: bool,
    target_world_m: FloatArray | None = None,
) -> FloatArray:
    """As `solve`, with the least smoothing that stays within the bounds, or comes nearest to them."""
    spin, spin_up = tilt_spin(minimum_snap.derivatives(spline, _POINTS))
    T = spline.durations_s

    def excess(states: FloatArray) -> float:
        rate = np.abs(minimum_snap.sampled(states[..., None], T, _POINTS, 1)[..., 0] + spin).max() / bounds.rate_rad_s
        change = (
            np.abs(minimum_snap.sampled(states[..., None], T, _POINTS, 2)[..., 0] + spin_up).max()
            / bounds.acceleration_rad_s2
        )
        return float(max(rate, change))

    quick, slow = portable.logarithm(_SMOOTHING_S)
    how = {"along_path": along_path, "target_world_m": target_world_m}
    best = solve(spline, asked_rad, smoothing_s=_SMOOTHING_S[1], **how)
    least = excess(best)
    for _ in range(8):
        middle = 0.5 * (quick + slow)
        yaw = solve(spline, asked_rad, smoothing_s=float(portable.exponential(middle)), **how)
        found = excess(yaw)
        if found <= max(least, 1.0):
            best, least, slow = yaw, max(found, 1.0), middle
        else:
            quick = middle
    return best


def solve(
    spline: minimum_snap.Spline,
    asked_rad: FloatArray,
    *,
    smoothing_s: float,
    along_path: bool = True,
    target_world_m: FloatArray | None = None,
) -> FloatArray:
    """Knot states of yaw, (k + 1, 4), at rest at both ends.

    Args:
        spline: the path, axes x, y, z.
        asked_rad: (k + 1,) heading to be met at each knot, NaN where it is open.
        smoothing_s: the time over which turns are smoothed out.
        along_path: whether to look ahead at all; else as steadily as the asked headings allow.
        target_world_m: (3,) point to look at instead of along the path.
    """
    T, soft, square = spline.durations_s, np.square(min(smoothing_s, _SOFTEST_S)), np.square(smoothing_s)
    motion = minimum_snap.derivatives(spline, _POINTS)
    energy = minimum_snap.energy(T) * np.square(np.square(soft))
    heading, weight = path_heading(motion, target_world_m)
    pinned = _unwrapped(asked_rad, heading)
    if not along_path:
        heading, weight = np.zeros_like(heading), np.full_like(weight, _FAINT)
        if np.isfinite(pinned).any():
            heading += pinned[np.isfinite(pinned)][0]
    right = np.zeros(4 * (len(T) + 1))
    spin_up, step = tilt_spin(motion)[1], T / len(_POINTS)
    M, S = minimum_snap.monomials_from_states(), minimum_snap.time_powers(T)[:, None]
    value = portable.product(minimum_snap.basis(_POINTS, 0), M) * S
    bend = portable.product(minimum_snap.basis(_POINTS, 2), M) * S / T[:, None, None] ** 2
    look = (weight * step[:, None])[..., None] * value
    steady = (np.square(square) * step)[:, None, None] * bend
    blocks = energy + portable.product(look.swapaxes(1, 2), value) + portable.product(steady.swapaxes(1, 2), bend)
    wanted = np.einsum("kia,ki->ka", look, heading) - np.einsum("kia,ki->ka", steady, spin_up)
    for i in range(len(T)):
        right[4 * i : 4 * i + 8] += wanted[i]
    return _solve_pinned(blocks, right, pinned).reshape(-1, 4)


def constant(spline: minimum_snap.Spline, asked_rad: FloatArray, options: PlanOptions) -> float | None:
    """The one heading that is held all along; None if the options do not ask for one.

    Raises:
        InputError: a waypoint asks for another heading.
    """
    if options.yaw not in ("fixed", "steady"):
        return None
    given = np.flatnonzero(np.isfinite(asked_rad))
    if options.yaw == "fixed":
        held = options.heading_rad
    else:
        held = (
            float(asked_rad[given[0]])
            if given.size
            else float(path_heading(minimum_snap.derivatives(spline, _POINTS))[0][0, 0])
        )
    off = np.abs(rotations.wrapped(asked_rad[given] - held))
    if (off > _SAME_RAD).any():
        raise InputError(
            f"a waypoint asks for a heading of {np.degrees(asked_rad[given[int(off.argmax())]]):.0f} deg, but yaw "
            f"{options.yaw} holds {np.degrees(held):.0f} deg; leave its heading open or choose another yaw mode"
        )
    return held


def tilt_spin(motion: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What turning the thrust axis n adds to the body's yaw rate, and its time derivative: two arrays (k, samples).

    Yaw turns before it tilts here, and the shortest tilt spins about body z by -(n x dn/dt)_z / (1 + n_z).

    Args:
        motion: (k, samples, 5, axes) the path and four derivatives, axes x, y, z first.
    """
    thrust = motion[:, :, 2] + np.array([0.0, 0.0, GRAVITY_M_S2])
    size = np.maximum(np.linalg.norm(thrust, axis=-1, keepdims=True), 1.0)
    n, jerk, snap = thrust / size, motion[:, :, 3] / size, motion[:, :, 4] / size
    along = np.sum(n * jerk, axis=-1, keepdims=True)
    turn = jerk - n * along
    # d turn / dt, of which only the part across n matters below
    bend = snap - 2.0 * along * turn - n * np.sum(n * snap, axis=-1, keepdims=True)
    low = np.maximum(1.0 + n[..., 2], 0.1)
    spin = -(n[..., 0] * turn[..., 1] - n[..., 1] * turn[..., 0]) / low
    return spin, -(n[..., 0] * bend[..., 1] - n[..., 1] * bend[..., 0]) / low - spin * turn[..., 2] / low


def path_heading(motion: FloatArray, target_world_m: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Direction of flight, or to a target, at samples of each segment, unwrapped, with its weight: two (k, samples).

    Args:
        motion: as of `tilt_spin`.
    """
    velocity = motion[:, :, 1, :2]
    if target_world_m is not None:
        velocity = target_world_m[:2] - motion[:, :, 0, :2]
    speed = portable.length(velocity).ravel()
    moving = np.flatnonzero(speed > 0.3 * _SLOW_M_S)
    if not moving.size:
        return np.zeros(velocity.shape[:2]), np.full(velocity.shape[:2], _FAINT)
    direction = portable.arctangent2(velocity[..., 1], velocity[..., 0]).ravel()
    unwrapped = np.unwrap(direction[moving])
    heading = np.interp(np.arange(speed.size), moving, unwrapped)
    weight = np.where(speed > 0.3 * _SLOW_M_S, speed**2 / (speed**2 + _SLOW_M_S**2), 0.0) + _FAINT
    return heading.reshape(velocity.shape[:2]), weight.reshape(velocity.shape[:2])


def _unwrapped(asked_rad: FloatArray, heading: FloatArray) -> FloatArray:
    """The asked headings, each turned by whole turns to lie nearest to the last one, or to the path's direction."""
    near = np.append(heading[:, 0], heading[-1, -1])
    pinned = np.array(asked_rad, dtype=np.float64)
    lead = 0.0  # how far the last pinned heading was ahead of the path's direction
    for i in np.flatnonzero(np.isfinite(pinned)):
        pinned[i] += 2.0 * np.pi * np.round((near[i] + lead - pinned[i]) / (2.0 * np.pi))
        lead = pinned[i] - near[i]
    return pinned


def _solve_pinned(blocks: FloatArray, right: FloatArray, pinned: FloatArray) -> FloatArray:
    """Minimise with the pinned values and both ends' derivatives held; one block (8, 8) for each segment."""
    fixed = np.full((len(pinned), 4), np.nan)
    fixed[:, 0] = pinned
    fixed[[0, -1], 1:] = 0.0
    held = np.isfinite(fixed.ravel())
    solution = np.where(held, fixed.ravel(), 0.0)
    band = np.zeros((8, len(right)))  # lower storage: band[i - j, j]
    rest = right.copy()
    for i, block in enumerate(blocks):
        part = slice(4 * i, 4 * i + 8)
        rest[part] -= np.einsum("ab,b->a", block, np.where(held[part], solution[part], 0.0))
        open_ = ~held[part]
        kept = block * open_[:, None] * open_
        for below in range(8):
            band[below, 4 * i : 4 * i + 8 - below] += np.diagonal(kept, -below)
    band[0, held], rest[held] = 1.0, 0.0
    scale = 1.0 / np.sqrt(band[0])
    for below in range(8):
        band[below, : len(right) - below] *= scale[: len(right) - below] * scale[below:]
    found = portable.solve_banded(band, scale * rest)
    if found is None:
        raise InputError("two waypoints are too close together to turn between them; leave one of them out")
    return solution + scale * found
