"""A plan in the page's terms: degrees, samples at equal steps, limits with their share."""

import math
from itertools import pairwise

import numpy as np

import planner
import planner.gate.limits
import planner.request.space
from firmware_bridge import wire
from flight import FloatArray, Trajectory, TrajectoryFile
from gcs_web.protocol.plan import Limit, Passing, Segment, Series
from gcs_web.protocol.vehicle import Held
from gcs_web.scene import drawing
from mapping.free_space import FreeSpace
from planner.request.space import DistanceField
from vehicle import Limits, Vehicle, flatness

SAMPLES, PER_SECOND, MOST_SAMPLES = 600, 40, 4000
"""Of a plan, for plots and for the 3D view: at least so many, so many a second, and no more than this."""
_NEAR_M = 0.01
"""A waypoint is passed at a join of segments that is so close to it, or to its ball."""

_UNITS = {"rad": ("°", 180.0 / math.pi), "m/s2": ("m/s²", 1.0), "m/s3": ("m/s³", 1.0)}
_RATE = ("°/s", 180.0 / math.pi)
"""Of the body's rates; a rotor's speed stays in rad/s."""


def series(trajectory: Trajectory, vehicle: Vehicle, field: DistanceField, bounds: Limits) -> Series:
    """What the plots show.

    Args:
        bounds: of the rotor speeds, for the margin that is left.
    """
    count = int(np.clip(PER_SECOND * trajectory.duration_s, SAMPLES, MOST_SAMPLES))
    times = np.linspace(0.0, trajectory.duration_s, count)
    flat = flatness.state(vehicle, trajectory, np.minimum(times, trajectory.duration_s * (1.0 - 1e-9)))
    x, y, z = flat.position_world_m.T
    slowest, fastest = flat.rotor_speed_rad_s.min(axis=1), flat.rotor_speed_rad_s.max(axis=1)
    return Series(
        time_s=_list(times),
        x_m=_list(x),
        y_m=_list(y),
        z_m=_list(z),
        speed_m_s=_list(np.linalg.norm(flat.velocity_world_m_s, axis=1)),
        acceleration_m_s2=_list(np.linalg.norm(flat.acceleration_world_m_s2, axis=1)),
        clearance_m=_list(field.distance(flat.position_world_m)),
        tilt_deg=_list(np.degrees(flat.tilt_rad)),
        rotor_slowest_rad_s=_list(slowest),
        rotor_fastest_rad_s=_list(fastest),
        yaw_rate_deg_s=_list(np.degrees(flat.rate_body_rad_s[:, 2])),
        thrust_n=_list(flat.thrust_n),
        rotor_margin_percent=_list(100.0 * bounds.rotor_margin(flat.rotor_speed_rad_s)),
        q_world_body=_list(flat.q_world_body.ravel()),
    )


def could_hide_mm(shown: Series, free: FreeSpace | None, reach_m: float) -> list[float]:
    """How thick an obstacle could hide at each sample of `series`; none where that is not known."""
    if free is None:
        return []
    positions = np.column_stack([shown.x_m, shown.y_m, shown.z_m])
    return _list(1e3 * np.minimum(free.profile(positions, reach_m), drawing.COULD_HIDE_SPAN_M))


def judged_clearance(
    trajectory: Trajectory, field: DistanceField, report: planner.GateReport, shown: Series
) -> FloatArray:
    """Clearance at the samples as the gate judges it: above the ground of a take-off or landing less is required."""
    ground = report.conditions.ground_world_m
    if ground is None:
        return np.array(shown.clearance_m)
    grounded = planner.request.space.Grounded(field, ground, report.required_clearance_m)
    times = np.minimum(shown.time_s, trajectory.duration_s)  # they are rounded
    return np.nan_to_num(grounded.distance(trajectory.position(times)), neginf=0.0)


def limits(report: planner.GateReport, shown: Series, judged_m: FloatArray) -> list[Limit]:
    """The gate's limits, the one of which most is used first; clearance among them.

    Args:
        judged_m: (n,) of `judged_clearance`.
    """
    closest = int(np.argmin(judged_m))
    found = [
        Limit(
            "clearance",
            report.clearance_m,
            report.required_clearance_m,
            ">=",
            "m",
            report.required_clearance_m / max(report.clearance_m, 1e-9),
            shown.time_s[closest],
        )
    ]
    for check in report.checks:
        if check.name in (*planner.gate.limits.NAMES, "speed of legs", "jerk of legs") and check.bound > 0.0:
            lowest = check.name == "slowest rotor"
            unit, scale = _RATE if check.name.endswith("rate") else _UNITS.get(check.unit, (check.unit, 1.0))
            share = check.bound / check.value if lowest else check.value / check.bound
            sense = ">=" if lowest else "<="
            at_s = check.time_s or 0.0
            found.append(Limit(check.name, scale * check.value, scale * check.bound, sense, unit, share, at_s))
    return sorted(found, key=lambda limit: -limit.share)


def passings(
    file: TrajectoryFile,
    join_s: FloatArray,
    flown: list[int | None],
    radii_m: dict[int, float],
    field: DistanceField,
) -> list[Passing]:
    """When, how fast and how far from obstacles each waypoint is passed, in the order of time.

    Args:
        join_s: increasing instants of which each waypoint is passed at one: where segments join.
        flown: ids of the file's waypoints, one each, None for ground.
        radii_m: by id, of those that need only be passed within a radius.
    """
    joins = np.minimum(join_s, file.trajectory.duration_s)
    path = file.trajectory.position(joins)
    at, first = [], 0
    for number, (name, point) in enumerate(zip(flown, file.waypoints_world_m, strict=True)):
        last = len(joins) - (len(flown) - 1 - number)  # every later waypoint still needs a join of its own
        away_m = np.linalg.norm(path[first:last] - point, axis=1)
        at.append(first + _first_pass(away_m, radii_m.get(name, 0.0) if name is not None else 0.0))
        first = at[-1] + 1
    speeds = np.linalg.norm(file.trajectory.position(joins[at], 1), axis=1)
    clearances = field.distance(path[at])
    rows = zip(flown, _list(joins[at]), _list(speeds), _list(clearances), strict=True)
    return [Passing(*row) for row in rows]


def _first_pass(away_m: FloatArray, radius_m: float) -> int:
    """The nearest join of the first stretch of path that comes to the waypoint, or into its ball."""
    near = away_m <= max(float(away_m.min()), radius_m + _NEAR_M)
    start = int(np.argmax(near))
    stop = start + int(np.argmin(np.append(near[start:], False)))
    return start + int(np.argmin(away_m[start:stop]))


def segments(
    passed: list[Passing],
    bounds: list[Limit],
    shown: Series,
    judged_m: FloatArray,
    trajectory: Trajectory,
) -> list[Segment]:
    """Between each two waypoints: the limit of which most is used, and when.

    Args:
        judged_m: (n,) of `judged_clearance`.
    """
    by_name, times = {limit.name: limit for limit in bounds}, np.array(shown.time_s)
    jerk = trajectory.position(np.minimum(times, trajectory.duration_s), 3)
    values = {
        "speed": shown.speed_m_s,
        "acceleration": shown.acceleration_m_s2,
        "jerk": np.linalg.norm(jerk, axis=1),
        "tilt": shown.tilt_deg,
        "rotor speed": shown.rotor_fastest_rad_s,
        "clearance": judged_m,
        "slowest rotor": shown.rotor_slowest_rad_s,
    }
    names = [name for name in values if name in by_name]
    shares = np.stack(
        [
            np.array(values[name]) / by_name[name].bound
            if by_name[name].sense == "<="
            else by_name[name].bound / np.maximum(np.array(values[name]), 1e-9)
            for name in names
        ]
    )
    found = []
    for a, b in pairwise(passed):
        first = int(np.searchsorted(times, a.time_s))
        last = max(int(np.searchsorted(times, b.time_s, side="right")), first + 1)
        first = min(first, len(times) - 1)
        most, k = np.unravel_index(int(np.argmax(shares[:, first:last])), shares[:, first:last].shape)
        worst_s = min(max(shown.time_s[first + int(k)], a.time_s), b.time_s)
        share = float(shares[most, first + k])
        found.append(Segment(a.time_s, b.time_s, a.waypoint, b.waypoint, names[int(most)], share, worst_s))
    return found


def held(name: str, plan: wire.WirePlan) -> Held:
    """A trajectory as the vehicle holds it."""
    duration_s = float(plan.durations_us.sum()) * 1e-6
    return Held(name, duration_s, len(plan.durations_us), plan.clearance_m, f"{plan.crc32:08x}")


def crc32(file: TrajectoryFile) -> str:
    """What the vehicle would give as the trajectory's CRC."""
    return f"{wire.plan_from_file(file).crc32:08x}"


def _list(values: FloatArray) -> list[float]:
    """JSON has no NaN; what is not known is drawn as zero margin."""
    return np.round(np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0), 5).tolist()
