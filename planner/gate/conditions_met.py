"""Whether a trajectory does what is asked besides its waypoints: motion, speeds and jerks of legs, stays, a tube,
headings."""

import numpy as np

import esdf
from flight import FloatArray, Trajectory, polynomial, portable, rotations
from planner.gate.limits import Check, certified_maxima
from planner.gate.visits import SAME_RAD, Visits
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.options import PlanOptions

_SAME = 1e-6
"""Largest difference (SI) from a motion that was asked for, relative to the largest number in it above one."""
_VISIT_S = 0.1
"""A visit is timed by where the path comes nearest within the tolerance, shortly before or after a hover."""
_LOOK_RAD = 0.6
"""Largest angle between the heading and the direction of a point that is looked at."""
_NEAR_M = 1.0
"""Horizontal distance of that point below which any heading will do."""


def checks(trajectory: Trajectory, visits: Visits | None, asked: Conditions) -> list[Check]:
    """Every condition with the worst deviation from it.

    Args:
        visits: None if the waypoints are not all passed.
    """
    found = [
        _end_check("start", trajectory, 0.0, asked.start),
        _end_check("end", trajectory, trajectory.duration_s, asked.end),
    ]
    if asked.tube is not None:
        found.append(_tube_check(trajectory, asked.tube))
    if visits is None:
        return found
    if asked.velocity_world_m_s is not None:
        found += _velocity_checks(trajectory, visits.joins_s(trajectory), asked.velocity_world_m_s)
    for name, unit, derivative, most in (
        ("speed of legs", "m/s", 1, asked.leg_speed_m_s),
        ("jerk of legs", "m/s3", 3, asked.leg_jerk_m_s3),
    ):
        if most is not None:
            found += _leg_checks(name, unit, derivative, trajectory, visits, most)
    if asked.stay_s is not None:
        found.append(_stay_check(trajectory, visits.time_s, asked.stay_s))
    return found


def _tube_check(trajectory: Trajectory, tube: space.KeepIn) -> Check:
    """How far the path strays from the middle of the tube, proved along the whole curve."""
    inside = esdf.certify(tube, trajectory, 0.0)
    farthest = tube.radius_m - inside.proven_m
    place = np.round(inside.point_world_m, 2).tolist()
    reason = f"proved along the whole curve; farthest from the line at {place}"
    return Check("keep-in", farthest, tube.radius_m, "m", inside.passed, inside.time_s, inside.segment, reason)


def _end_check(name: str, trajectory: Trajectory, time_s: float, asked: FloatArray | None) -> Check:
    motion = np.concatenate([trajectory.evaluate(np.array([time_s]), r) for r in (1, 2, 3)])
    wanted = np.zeros((3, 4)) if asked is None else asked
    segment = 0 if time_s == 0.0 else -1
    T = trajectory.durations_s[segment]
    scale = np.abs(trajectory.coefficients[segment] * polynomial.powers(T, trajectory.coefficients.shape[-1])).max()
    tolerance = _SAME * max(1.0, float(scale))
    worst = float(np.abs(motion - wanted).max())
    what = "rest" if asked is None else "motion"
    return Check(f"{what} at the {name}", worst, tolerance, "SI", worst <= tolerance)


def _velocity_checks(trajectory: Trajectory, visits_s: FloatArray, asked: FloatArray) -> list[Check]:
    at = np.flatnonzero(np.isfinite(asked[:, 0]))
    if not at.size:
        return []
    times = visits_s[at]
    off = np.linalg.norm(trajectory.position(times, 1) - asked[at], axis=1)
    worst = int(off.argmax())
    tolerance = _SAME * max(1.0, float(np.abs(asked[at]).max())) * 100.0
    reason = f"largest difference at waypoint {int(at[worst]) + 1}"
    return [Check("velocity at waypoints", float(off[worst]), tolerance, "m/s", bool(off[worst] <= tolerance),
                  float(times[worst]), reason=reason)]  # fmt: skip


def _leg_checks(
    name: str, unit: str, derivative: int, trajectory: Trajectory, visits: Visits, asked: FloatArray
) -> list[Check]:
    """A proved bound on each leg, from where its first waypoint is left to where its last one is reached.

    Where a waypoint counts as passed, the larger one of the limits on either side will do.
    """
    most = np.where(np.isfinite(asked), asked, np.inf)
    if not np.isfinite(most).any():
        return []
    path = trajectory.cut(np.concatenate([visits.enter_s, visits.leave_s]))
    bound, time_s = certified_maxima(path, derivative)
    middle = path.starts_s[:-1] + 0.5 * path.durations_s
    leg = np.clip(np.searchsorted(visits.enter_s, middle, side="right") - 1, 0, len(asked) - 1)  # begun, or passing
    passing = middle < visits.leave_s[leg]
    allowed = np.where(passing, np.maximum(most[np.maximum(leg - 1, 0)], most[leg]), most[leg])
    worst = int(np.argmax(bound / allowed))
    value, limit = float(bound[worst]), float(allowed[worst])
    segment = int(trajectory.segment_at(middle[worst : worst + 1])[0][0])
    where = f"leg from waypoint {int(leg[worst]) + 1} at {time_s[worst]:.1f} s"
    reason = f"{where}: {value:.3g} {unit}, asked for at most {limit:.3g}"
    return [Check(name, value, limit, unit, value <= limit, float(time_s[worst]), segment, reason)]


def _stay_check(trajectory: Trajectory, visits_s: FloatArray, asked_s: FloatArray) -> Check:
    """How long the vehicle hovers where it is, turning nowhere, at each visit, against what is asked there."""
    still = ~trajectory.coefficients[:, :, 1:].any(axis=(1, 2))
    starts, ends = trajectory.starts_s[:-1][still], trajectory.starts_s[1:][still]
    hover_s = [float((ends - starts)[(starts <= t + _VISIT_S) & (ends >= t - _VISIT_S)].sum()) for t in visits_s]
    lack = asked_s - np.array(hover_s)
    worst = int(lack.argmax())
    reason = f"waypoint {worst + 1}: {hover_s[worst]:.2f} s of {asked_s[worst]:.2f} s"
    return Check(
        "stays", float(lack[worst]), 1e-6, "s", bool(lack[worst] <= 1e-6), float(visits_s[worst]), None, reason
    )


def headings(
    trajectory: Trajectory, joins_s: FloatArray | None, yaw_rad: FloatArray | None, options: PlanOptions
) -> list[Check]:
    """Headings asked for at waypoints (n,), held all along, or towards a point.

    Args:
        joins_s: (n,) when they are to be had (`Visits.joins_s`); None if the waypoints are not all passed.
    """
    checks = []
    times = trajectory.sample(options.sample_step_s)
    motion = trajectory.evaluate(times)
    if joins_s is not None and yaw_rad is not None and np.isfinite(yaw_rad).any():
        off = np.abs(rotations.wrapped(trajectory.evaluate(joins_s)[:, 3] - yaw_rad))
        off = np.where(np.isfinite(off), off, 0.0)
        checks.append(_heading_check("heading at waypoints", off, joins_s, SAME_RAD))
    if options.yaw in ("fixed", "steady"):
        held = options.heading_rad if options.yaw == "fixed" else motion[0, 3]
        off = np.abs(rotations.wrapped(motion[:, 3] - held))
        checks.append(_heading_check("heading held", off, times, SAME_RAD))
    if options.target_world_m is not None:
        aim = options.target_world_m[:2] - motion[:, :2]
        off = np.abs(rotations.wrapped(motion[:, 3] - portable.arctangent2(aim[:, 1], aim[:, 0])))
        off = np.where(portable.length(aim) > _NEAR_M, off, 0.0)
        checks.append(_heading_check("look at the point", off, times, _LOOK_RAD))
    return checks


def _heading_check(name: str, off_rad: FloatArray, times_s: FloatArray, bound_rad: float) -> Check:
    worst = int(off_rad.argmax())
    value, time_s = float(off_rad[worst]), float(times_s[worst])
    reason = f"{np.degrees(value):.1f} deg off at {time_s:.1f} s, at most {np.degrees(bound_rad):.1f} are allowed"
    return Check(name, value, bound_rad, "rad", value <= bound_rad, time_s, reason=reason)
