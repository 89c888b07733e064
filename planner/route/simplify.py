"""A dense recorded path as a few waypoints: Ramer-Douglas-Peucker, and a variant that also keeps the clearance."""

import numpy as np

from flight import FloatArray, InputError, Waypoints, rotations
from planner.request import space
from planner.request.options import PlanOptions


def rdp(
    points_world_m: FloatArray,
    tolerance_m: float,
    *,
    field: space.DistanceField | None = None,
    clearance_m: float = 0.3,
    yaw_rad: FloatArray | None = None,
    yaw_tolerance_rad: float = 0.2,
) -> np.ndarray:
    """Indices of the points to keep, so that every other point is within `tolerance_m` of the line kept.

    Args:
        points_world_m: (n, 3) in order; repeated points are fine.
        field: if given, a chord is also split where it does not keep `clearance_m` (as far as the points allow: a
            chord between neighbouring points stays, whatever its clearance).
        yaw_rad: (n,) headings; if given, so many points are kept that turning evenly along each line stays within
            `yaw_tolerance_rad` of them. NaN: any heading.

    Returns:
        (m,) increasing indices; the first and the last point are always kept (one of them if they are all equal).

    Raises:
        InputError: a point is not finite, there is none, or the tolerance is negative.
    """
    points = np.asarray(points_world_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"the path: expected shape (n, 3) with n >= 1, got {points.shape}")
    broken = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if broken.size:
        raise InputError(f"point {int(broken[0]) + 1} of the path is not finite: {points[broken[0]].tolist()}")
    if not tolerance_m >= 0.0:
        raise InputError(f"tolerance_m is {tolerance_m:g}; it must be zero or more")
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    stack = [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        gaps = distance_to_chord(points[first + 1 : last], points[first], points[last])
        worst = first + 1 + int(np.argmax(gaps))
        turned = np.zeros(1) if yaw_rad is None else heading_gaps(points, yaw_rad, first, last)
        if gaps.max() <= tolerance_m and turned.max() > yaw_tolerance_rad:
            worst = first + 1 + int(np.argmax(turned))
            keep[worst] = True
            stack += [(first, worst), (worst, last)]
        elif gaps.max() > tolerance_m or _blocked(field, points[first], points[last], clearance_m):
            if gaps.max() <= 0.0:  # a blocked straight line: all points have zero distance, so halve it
                worst = (first + last) // 2
            keep[worst] = True
            stack += [(first, worst), (worst, last)]
    kept = np.flatnonzero(keep)
    distinct = np.linalg.norm(np.diff(points[kept], axis=0), axis=1) > 0.0
    return kept[np.concatenate([[True], distinct])]


def waypoints_along(
    walked_world_m: FloatArray,
    tolerance_m: float,
    field: space.DistanceField,
    how: PlanOptions,
    yaw_rad: FloatArray | None = None,
) -> tuple[Waypoints, int]:
    """Waypoints along recorded positions (n, 3), with the headings of `yaw_rad` (n,), and how many were left out.

    Whoever walked may have started with a wall, or with space that no camera saw, closer than the vehicle may come.
    Such positions are left out; between the others the planner finds its own way.

    Raises:
        InputError: fewer than two positions have room.
    """
    near_m = np.nan_to_num(space.distance(field, walked_world_m), nan=-np.inf)
    room = near_m >= how.waypoint_clearance_m
    roomy, yaw = walked_world_m[room], None if yaw_rad is None else yaw_rad[room]
    if len(roomy) < 2:
        raise InputError(
            f"{len(roomy)} of {len(walked_world_m)} recorded positions keep {how.waypoint_clearance_m:.3f} m from "
            "obstacles and unknown space. Lower --margin, map again with images of the space beside them, or state how "
            "much the carrier swept: `goshawk map build --carrier-radius`"
        )
    kept = rdp(roomy, tolerance_m, field=field, clearance_m=how.clearance_m, yaw_rad=yaw)
    headings = np.full(len(kept), np.nan) if yaw is None else yaw[kept]
    return Waypoints(roomy[kept], headings), len(walked_world_m) - len(roomy)


def distance_to_chord(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of points (n, 3) from the line segment between `start` and `end`."""
    along = end - start
    square = float((along * along).sum())
    fraction = (
        np.clip(((points - start) * along).sum(axis=1) / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    )
    return np.linalg.norm(points - (start + fraction[:, None] * along), axis=1)


def heading_gaps(points: FloatArray, yaw_rad: FloatArray, first: int, last: int) -> FloatArray:
    """How far the headings of the points between two (last - first - 1,) are from turning evenly between theirs.

    A heading is only compared where both ends have one; then it turns the short way, evenly with the way flown.
    """
    inner = yaw_rad[first + 1 : last]
    steps = np.linalg.norm(np.diff(points[first : last + 1], axis=0), axis=1)
    share = np.cumsum(steps)[:-1] / max(float(steps.sum()), 1e-12)
    turn = rotations.wrapped(yaw_rad[last] - yaw_rad[first])
    off = np.abs(rotations.wrapped(inner - yaw_rad[first] - share * turn))
    return np.where(np.isfinite(off), off, 0.0)


def _blocked(field: space.DistanceField | None, start: FloatArray, end: FloatArray, clearance_m: float) -> bool:
    return field is not None and not space.check_lines(field, start, end, clearance_m)[0].free
