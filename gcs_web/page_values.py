"""The document and a plan in the page's terms: degrees, samples at equal steps, limits with their share."""

import math
from itertools import pairwise

import numpy as np

import planner
import planner.limits
from firmware_bridge import wire
from flight import FloatArray, Trajectory, TrajectoryFile
from gcs_web import document, protocol
from planner.space import DistanceField
from vehicle import Vehicle, flatness

SAMPLES = 600
"""Of a plan, for plots and for the 3D view."""

_UNITS = {"rad": ("°", 180.0 / math.pi), "m/s2": ("m/s²", 1.0)}
_RATE = ("°/s", 180.0 / math.pi)
"""Of the body's rates; a rotor's speed stays in rad/s."""


def waypoint(point: document.Point) -> protocol.Waypoint:
    x, y, z = point.position_world_m
    return protocol.Waypoint(point.id, x, y, z, None if point.yaw_rad is None else math.degrees(point.yaw_rad))


def settings(chosen: document.Settings) -> protocol.Settings:
    return protocol.Settings(**{name: getattr(chosen, name) for name in chosen.__struct_fields__})


def series(trajectory: Trajectory, vehicle: Vehicle, field: DistanceField) -> protocol.Series:
    """What the plots show."""
    times = np.linspace(0.0, trajectory.duration_s, SAMPLES)
    flat = flatness.state(vehicle, trajectory, np.minimum(times, trajectory.duration_s * (1.0 - 1e-9)))
    x, y, z = flat.position_world_m.T
    return protocol.Series(
        time_s=_list(times),
        x_m=_list(x),
        y_m=_list(y),
        z_m=_list(z),
        speed_m_s=_list(np.linalg.norm(flat.velocity_world_m_s, axis=1)),
        acceleration_m_s2=_list(np.linalg.norm(flat.acceleration_world_m_s2, axis=1)),
        clearance_m=_list(field.distance(flat.position_world_m)),
        tilt_deg=_list(np.degrees(flat.tilt_rad)),
        rotor_slowest_rad_s=_list(flat.rotor_speed_rad_s.min(axis=1)),
        rotor_fastest_rad_s=_list(flat.rotor_speed_rad_s.max(axis=1)),
        yaw_rate_deg_s=_list(np.degrees(flat.rate_body_rad_s[:, 2])),
        q_world_body=_list(flat.q_world_body.ravel()),
    )


def limits(report: planner.GateReport, shown: protocol.Series) -> list[protocol.Limit]:
    """The gate's limits, the one of which most is used first; clearance among them."""
    closest = int(np.argmin(shown.clearance_m))
    found = [
        protocol.Limit(
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
        if check.name in planner.limits.NAMES and check.bound > 0.0:
            lowest = check.name == "slowest rotor"
            unit, scale = _RATE if check.name.endswith("rate") else _UNITS.get(check.unit, (check.unit, 1.0))
            share = check.bound / check.value if lowest else check.value / check.bound
            sense = ">=" if lowest else "<="
            at_s = check.time_s or 0.0
            found.append(protocol.Limit(check.name, scale * check.value, scale * check.bound, sense, unit, share, at_s))
    return sorted(found, key=lambda limit: -limit.share)


def passings(
    points: tuple[document.Point, ...], trajectory: Trajectory, shown: protocol.Series
) -> list[protocol.Passing]:
    """When, how fast and how far from obstacles each waypoint is passed: the first time after the one before."""
    path = np.stack([shown.x_m, shown.y_m, shown.z_m], axis=1)
    step_m = float(np.linalg.norm(np.diff(path, axis=0), axis=1).max())
    found, first = [], 0
    for number, point in enumerate(points):
        last = len(path) - (len(points) - 1 - number)  # every later waypoint still needs a sample of its own
        away_m = np.linalg.norm(path[first:last] - np.array(point.position_world_m), axis=1)
        k = first + _first_pass(away_m, step_m)
        found.append(protocol.Passing(point.id, shown.time_s[k], shown.speed_m_s[k], shown.clearance_m[k]))
        first = k + 1
    return found


def _first_pass(away_m: FloatArray, step_m: float) -> int:
    """The nearest sample of the first stretch of path that comes to within a step of the waypoint."""
    near = away_m <= max(float(away_m.min()), step_m)
    start = int(np.argmax(near))
    stop = start + int(np.argmin(np.append(near[start:], False)))
    return start + int(np.argmin(away_m[start:stop]))


def segments(
    passed: list[protocol.Passing], bounds: list[protocol.Limit], shown: protocol.Series
) -> list[protocol.Segment]:
    """Between each two waypoints: the limit of which most is used."""
    by_name = {limit.name: limit for limit in bounds}
    values = {
        "speed": shown.speed_m_s,
        "acceleration": shown.acceleration_m_s2,
        "tilt": shown.tilt_deg,
        "rotor speed": shown.rotor_fastest_rad_s,
        "clearance": shown.clearance_m,
        "slowest rotor": shown.rotor_slowest_rad_s,
    }
    shares = {
        name: np.array(value) / by_name[name].bound
        if by_name[name].sense == "<="
        else by_name[name].bound / np.maximum(np.array(value), 1e-9)
        for name, value in values.items()
        if name in by_name
    }
    times = np.array(shown.time_s)
    found = []
    for a, b in pairwise(passed):
        inside = (times >= a.time_s) & (times <= b.time_s)
        name, share = max(((n, float(s[inside].max())) for n, s in shares.items()), key=lambda item: item[1])
        found.append(protocol.Segment(a.time_s, b.time_s, name, share))
    return found


def held(name: str, plan: wire.WirePlan) -> protocol.Held:
    """A trajectory as the vehicle holds it."""
    duration_s = float(plan.durations_us.sum()) * 1e-6
    return protocol.Held(name, duration_s, len(plan.durations_us), plan.clearance_m, f"{plan.crc32:08x}")


def crc32(file: TrajectoryFile) -> str:
    """What the vehicle would give as the trajectory's CRC."""
    return f"{wire.plan_from_file(file).crc32:08x}"


def _list(values: FloatArray) -> list[float]:
    """JSON has no NaN; what is not known is drawn as zero margin."""
    return np.round(np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0), 5).tolist()
