"""Recorded motion beside the poses of images: does it show the same flight, at the same time, in the same shape?

Distances and turn angles between two instants do not depend on the frames in which they were recorded, nor on the axes
of the thing that was tracked. They give the scale of the map, and a clock that is off.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, rotations
from mapping.input.trajectory import Motion

STRETCHES = 8
"""The path is compared in this many pieces: odometry drifts over longer ones."""
_SYSTEMATIC_STD = 0.01
"""Relative standard deviation that the scale of recorded motion keeps, however long the path."""
_LEAST_SHARE = 0.3
"""Pieces shorter than this share of the longest one say nothing of the scale."""
_LATEST_S, _STEP_S = 1.0, 0.02
"""Clocks that are off by at most this are found, on a grid of this."""
TURN_NOISE_RAD, SHIFT_NOISE_M = 0.01, 0.02
"""What a recorded turn and shift between two instants is off by: weights of the two in a rotation."""
_LARGEST_TILT_STD_RAD = 0.05


@dataclass(frozen=True, slots=True)
class MotionCheck:
    """How a recorded motion fits the poses of the images."""

    source: str
    """What it is, with its file."""
    instants: int
    """Placed images that it covers."""
    scale: float
    """Recorded metres per unit of the map."""
    scale_std: float
    """Relative standard deviation of `scale`."""
    shape: float
    """Largest relative difference of the scale along the path from `scale`: 0 for the same shape."""
    turn_error_rad: float
    """Median difference of the turns over a piece of the path."""
    direction_error_rad: float | None
    """Mean angle between its turns and shifts and the map's, in the frame that fits best; None if they are too small to
    determine a frame."""
    late_s: float | None
    """By which the file's times are too large; None if the vehicle hardly turns, or recorded poses are too far apart in
    time."""
    late_std_s: float | None
    """Standard deviation of `late_s`."""


def check(motion: Motion, time_s: FloatArray, T_old_body: FloatArray) -> MotionCheck | None:
    """Lay a recorded motion beside the poses (instants, 4, 4) of images taken at `time_s`, NaN where not placed.

    Returns:
        None if it covers fewer than three placed images, or the vehicle did not move.
    """
    recorded = motion.trajectory.at(time_s)
    both = np.flatnonzero(np.isfinite(recorded[:, 0, 0]) & np.isfinite(T_old_body[:, 0, 0]))
    if len(both) < 3:
        return None
    ends = np.unique(np.linspace(0, len(both) - 1, STRETCHES + 1).astype(int))
    ours, theirs = T_old_body[both[ends]], recorded[both[ends]]
    moved, moved_m = _shifts(ours), _shifts(theirs)
    if not (moved.any() and moved_m.any()):
        return None
    scale = float(moved @ moved_m / (moved @ moved))
    long = moved > _LEAST_SHARE * moved.max()
    shape = float(np.abs(moved_m[long] / (scale * moved[long]) - 1.0).max())
    off_m = moved_m - scale * moved
    noise = np.sqrt(((moved * off_m) ** 2).sum()) / (moved @ moved) / scale  # heteroscedastic (White, 1980)
    shifting = both[motion.trajectory.interpolates(time_s[both])]  # a pose known at its own time alone fits no other
    late_s, late_std_s = _late(motion, time_s[shifting], T_old_body[shifting])
    _, is_determined, direction_error_rad = _rotation(recorded[both], T_old_body[both], scale)
    return MotionCheck(
        motion.name,
        len(both),
        scale,
        float(np.hypot(noise * np.sqrt(len(moved) / max(len(moved) - 1, 1)), _SYSTEMATIC_STD)),
        shape,
        float(np.median(np.abs(_turns(ours) - _turns(theirs)))),
        direction_error_rad if is_determined else None,
        late_s,
        late_std_s,
    )


def _shifts(T: FloatArray) -> FloatArray:
    """(n - 1,) distances between neighbouring poses (n, 4, 4)."""
    return np.asarray(np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))


def _turns(T: FloatArray) -> FloatArray:
    """(n - 1,) angles of the turns between neighbouring poses (n, 4, 4); NaN where one is not known."""
    q = rotations.from_matrix(T[:, :3, :3])
    return np.asarray(rotations.angle_between(q[:-1], q[1:]))


def _late(motion: Motion, time_s: FloatArray, T_old_body: FloatArray) -> tuple[float, float] | tuple[None, None]:
    """How late the file's clock is, and the standard deviation, from how far the vehicle turns between images."""
    ours = _turns(T_old_body)

    def off_rad(late_s: float) -> FloatArray:
        T = motion.trajectory.at(time_s + late_s)
        known = np.isfinite(T[:, 0, 0])
        turns = np.full(len(ours), np.nan)
        pairs = np.flatnonzero(known[:-1] & known[1:])
        q = rotations.from_matrix(T[:, :3, :3][known])
        order = np.cumsum(known) - 1
        turns[pairs] = rotations.angle_between(q[order[pairs]], q[order[pairs + 1]])
        return turns - ours

    def cost(late_s: float) -> float:
        off = off_rad(late_s)
        return float(np.nanmean(np.abs(off))) if np.isfinite(off).sum() > 0.5 * len(off) else np.inf

    tried_s = np.arange(-_LATEST_S, _LATEST_S + 0.5 * _STEP_S, _STEP_S)
    best_s = float(min(tried_s, key=cost))
    off = off_rad(best_s)
    slope = (off_rad(best_s + _STEP_S) - off_rad(best_s - _STEP_S)) / (2.0 * _STEP_S)
    used = np.isfinite(off) & np.isfinite(slope)
    curvature = float((slope[used] ** 2).sum())
    if not curvature > 0.0:
        return None, None
    step_s = float(np.clip(-(slope[used] @ off[used]) / curvature, -_STEP_S, _STEP_S))
    noise_rad = 1.4826 * float(np.median(np.abs(off[used])))
    return best_s + step_s, float(noise_rad / np.sqrt(curvature))


def up_old(T_start_body: FloatArray, T_old_body: FloatArray, scale: float) -> FloatArray | None:
    """The z axis of recorded poses in COLMAP's world, (3,); None if the motion does not determine it.

    Args:
        T_start_body, T_old_body: (n, 4, 4) both known. The tracked thing may have other axes than the body.
    """
    R_old_start, is_determined, _ = _rotation(T_start_body, T_old_body, scale)
    return np.asarray(R_old_start[:, 2]) if is_determined else None


def _rotation(T_start_body: FloatArray, T_old_body: FloatArray, scale: float) -> tuple[FloatArray, bool, float]:
    """R_old_start (3, 3), whether the motion determines it, and the mean angle (rad) that is left.

    Turns and shifts between instants, each in its own world, are the same vectors up to one rotation (Wahba, 1965). No
    rotation fits where the quaternions are in another order, or are those of the inverse rotations, though the angles
    of the turns are then the same.
    """
    ends = np.unique(np.linspace(0, len(T_old_body) - 1, 4 * STRETCHES + 1).astype(int))
    ours, theirs = T_old_body[ends].copy(), T_start_body[ends]
    ours[:, :3, 3] *= scale
    pairs = [
        (a / noise, b / noise)
        for vectors, noise in ((_turn_vectors, TURN_NOISE_RAD), (_shift_vectors, SHIFT_NOISE_M))
        for a, b in zip(vectors(ours), vectors(theirs), strict=True)
    ]
    product = np.sum([np.outer(a, b) for a, b in pairs], axis=0)
    R_old_start, strength = nearest_rotation(product), np.linalg.svd(product, compute_uv=False)
    longest = sum(float(np.linalg.norm(a) * np.linalg.norm(b)) for a, b in pairs)
    cosine = float((R_old_start * product).sum()) / max(longest, 1e-30)
    is_determined = bool(strength[1] - len(pairs) >= _LARGEST_TILT_STD_RAD**-2)
    return R_old_start, is_determined, float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def nearest_rotation(product: FloatArray) -> FloatArray:
    """R (3, 3) that maximises the sum of a . R b, from the sum (3, 3) of the products a b^T (Wahba, 1965)."""
    u, _, vt = np.linalg.svd(product)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def _turn_vectors(T: FloatArray) -> FloatArray:
    """(n - 1, 3) rotation vectors from each pose to the next, in the world."""
    R = T[:, :3, :3]
    return np.asarray(rotations.log(rotations.from_matrix(R[1:] @ R[:-1].transpose(0, 2, 1))))


def _shift_vectors(T: FloatArray) -> FloatArray:
    return np.asarray(np.diff(T[:, :3, 3], axis=0))
