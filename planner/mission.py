"""A mission as one trajectory: take-off, paths, stays, turns on the spot, laps and landing, joined without a jump."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

import flight.trajectory
from flight import FloatArray, InputError, Progress, Trajectory, Waypoints, silent
from flight.mission import Ground, Mission
from flight.trajectory import LONGEST_S
from planner import planning, turn
from planner._planner import StopFlag
from planner.curve import minimum_snap
from planner.gate import gate
from planner.planning import Plan
from planner.request import inputs, space
from planner.request.conditions import OF_LEGS, Conditions
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError, PlanOptions
from vehicle import Vehicle

_OF_WAYPOINTS = ("velocity_world_m_s", "fly_by_m", "gate_edges_m")
"""Conditions with a row for each waypoint."""
_HEIGHTS_M = np.arange(0.2, 5.0, 0.05)
"""Heights above the ground at which a take-off may join the path: the first with clearance."""


def plan(
    mission: Mission,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None = None,
    *,
    progress: Progress = silent,
    stop: StopFlag | None = None,
) -> Plan:
    """Plan a whole mission; the trajectory as a whole has passed the gate.

    Its yaw record, where it has one, comes before the options' own. Raises as `planner.plan`; the waypoints in messages
    are numbered as flown, laps unrolled.
    """
    options = with_yaw(inputs.options_for(vehicle, options), mission)
    # numbered as the pilot listed them, before anything is taken apart
    inputs.check(Request(mission.waypoints, field, vehicle, options, Conditions()), may_turn=True)
    flown = mission.unrolled()
    _check_stays(flown)
    _check_turns(flown)
    whole = conditions(flown)
    if flown.keep_in is not None:
        whole = replace(whole, **_tube(mission, field, options))
    if not of_parts(flown):
        return planning.plan(flown.waypoints, field, vehicle, options, conditions=whole, progress=progress, stop=stop)
    parts = _parts(flown, whole, field, options)
    plans: list[Plan] = []
    for number, part in enumerate(parts):
        ahead = _turned_on(part.waypoints, plans[-1].trajectory if plans else None)
        share = _share(progress, number, len(parts))
        try:
            if part.turns:
                plans.append(turn.plan(Request(ahead, field, vehicle, options, part.conditions, stop)))
                share("gate", 1.0)
                continue
            plans.append(
                planning.plan(ahead, field, vehicle, options, conditions=part.conditions, progress=share, stop=stop)
            )
        except PlanInfeasibleError as error:
            leg = None if error.segment is None else part.first + max(error.segment - part.lead_in, 0)
            raise PlanInfeasibleError(error.reason, error.remedy, leg) from error
    trajectory = join(_pieces(flown, plans, parts))
    if trajectory.duration_s > LONGEST_S:
        raise PlanInfeasibleError(
            f"stays and paths last {trajectory.duration_s:.5g} s together, and a trajectory at most {LONGEST_S:g} s",
            "shorten the stays, or plan the flight in parts",
        )
    points = _asked(flown)
    report = gate.judge(Request(points, field, vehicle, options, whole, stop), trajectory, None)
    if not report.passed:
        first = report.failures[0]
        raise PlanInfeasibleError(
            f"the whole mission fails: {first.name} ({first.reason})", "relax what is asked there"
        )
    methods = "+".join(sorted({p.method for p in plans}))
    route = np.concatenate([p.route_world_m for p in plans])
    return Plan(trajectory, report, points, route, methods, tuple(o for p in plans for o in p.optima))


def _check_stays(flown: Mission) -> None:
    total_s = sum(stay.duration_s for stay in flown.stays)
    if total_s > LONGEST_S:
        raise InputError(
            f"the stays last {total_s:.4g} s in all, laps counted, and a trajectory at most {LONGEST_S:g} s; "
            "shorten them, or plan the flight in parts"
        )


def of_parts(mission: Mission) -> bool:
    """Whether a mission without laps is flown as several paths, with rest or the ground between or beside them."""
    grounds = mission.take_off is not None or mission.landing is not None
    return bool(mission.stays) or grounds or bool(inputs.turns(mission.waypoints).size)


def _check_turns(flown: Mission) -> None:
    """Refuse what cannot be asked where the vehicle turns on the spot.

    Raises:
        InputError: a velocity, a radius or a gate is, or a take-off or landing.
    """
    turns = inputs.turns(flown.waypoints)
    resting = {*turns.tolist(), *(turns + 1).tolist()}
    of_waypoints = {"velocity": flown.velocities, "radius to pass it by": flown.fly_bys, "gate": flown.gates}
    for kind, records in of_waypoints.items():
        both = sorted(resting & {record.waypoint for record in records})
        if both:
            raise InputError(f"waypoint {both[0] + 1} is turned at on the spot and has a {kind}; remove one of them")
    last = len(flown.waypoints.positions_world_m) - 1
    for name, ground, end in (("take-off", flown.take_off, 0), ("landing", flown.landing, last)):
        if ground is not None and end in resting:
            raise InputError(
                f"waypoint {end + 1} is turned at on the spot and has a {name}; add a waypoint for one of them"
            )


def with_yaw(options: PlanOptions, mission: Mission) -> PlanOptions:
    """The options, with the mission's own yaw mode."""
    yaw = mission.yaw
    if yaw is None:
        return options
    return replace(options, yaw=yaw.mode, heading_rad=yaw.heading_rad, look_at_world_m=yaw.look_at_world_m)


def conditions(mission: Mission) -> Conditions:
    """What a mission without laps asks of the whole trajectory, take-off and landing points counted as waypoints."""
    count = len(mission.waypoints.positions_world_m)
    velocity, (speed, jerk) = np.full((count, 3), np.nan), np.full((2, count - 1), np.nan)
    stay, radius, edges = np.zeros(count), np.zeros(count), np.zeros((count, 2, 3))
    for record in mission.gates:
        edges[record.waypoint] = record.edges_m
    for record in mission.fly_bys:
        radius[record.waypoint] = record.radius_m
    for record in mission.velocities:
        velocity[record.waypoint] = record.velocity_world_m_s
    for record in mission.leg_speeds:
        speed[record.first : record.last] = np.fmin(speed[record.first : record.last], record.speed_m_s)
    for record in mission.leg_jerks:
        jerk[record.first : record.last] = np.fmin(jerk[record.first : record.last], record.jerk_m_s3)
    for record in mission.stays:
        stay[record.waypoint] = max(stay[record.waypoint], record.duration_s)
    grounds = [ground.position_world_m for ground in (mission.take_off, mission.landing) if ground is not None]
    before, after = int(mission.take_off is not None), int(mission.landing is not None)
    inner = velocity.copy()
    inner[[0, -1]] = np.nan
    return Conditions(
        start=_motion(velocity[0]),
        end=_motion(velocity[-1]),
        velocity_world_m_s=None if np.isnan(inner).all() else np.pad(inner, ((before, after), (0, 0)), "edge"),
        leg_speed_m_s=None if np.isnan(speed).all() else np.pad(speed, (before, after), constant_values=np.nan),
        leg_jerk_m_s3=None if np.isnan(jerk).all() else np.pad(jerk, (before, after), constant_values=np.nan),
        fly_by_m=None if not radius.any() else np.pad(radius, (before, after)),
        gate_edges_m=None if not edges.any() else np.pad(edges, ((before, after), (0, 0), (0, 0))),
        stay_s=None if not stay.any() else np.pad(stay, (before, after)),
        ground_world_m=np.array(grounds) if grounds else None,
    )


def _tube(mission: Mission, field: space.DistanceField, options: PlanOptions) -> dict[str, FloatArray | float]:
    """The tube to keep in, as conditions: on to where the vehicle climbs from, and lands, straight and then down."""
    assert mission.keep_in is not None
    points = mission.waypoints.positions_world_m
    given = mission.keep_in.polyline_world_m
    line = points if given is None else np.array(given)
    if given is None and mission.laps is not None:
        first, last = mission.laps.ends(len(points))
        line = np.concatenate([points[: last + 1], points[first : first + 1], points[last + 1 :]])
    if mission.take_off is not None:
        foot = np.array(mission.take_off.position_world_m)
        line = np.concatenate([[foot, _above(mission.take_off, field, options), points[0]], line])
    if mission.landing is not None:
        foot = np.array(mission.landing.position_world_m)
        line = np.concatenate([line, [points[-1], _above(mission.landing, field, options), foot]])
    return {"keep_in_world_m": line, "keep_in_radius_m": mission.keep_in.radius_m}


def _motion(velocity_world_m_s: FloatArray) -> FloatArray | None:
    """(3, 4) that velocity and no acceleration or jerk; None where it is open."""
    if np.isnan(velocity_world_m_s).any():
        return None
    motion = np.zeros((3, 4))
    motion[0, :3] = velocity_world_m_s
    return motion


def _asked(mission: Mission) -> Waypoints:
    """The waypoints with the points of take-off and landing at either end."""
    points, yaw = mission.waypoints.positions_world_m, mission.waypoints.yaw_rad
    for ground, at in ((mission.take_off, 0), (mission.landing, None)):
        if ground is not None:
            where = len(points) if at is None else at
            points, yaw = np.insert(points, where, ground.position_world_m, axis=0), np.insert(yaw, where, np.nan)
    return Waypoints(points, yaw)


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A path from one stay, turn or end to the next, or a turn."""

    waypoints: Waypoints
    conditions: Conditions
    first: int
    """Index of its first waypoint among those flown."""
    lead_in: int
    """How many points, above the ground, come before that one."""
    turns: bool
    """Whether it only turns on the spot."""


def _parts(mission: Mission, whole: Conditions, field: space.DistanceField, options: PlanOptions) -> list[_Part]:
    """The paths between stays and turns on the spot, and those turns.

    The first starts and the last ends above the ground where that is asked for.
    """
    points, yaw = mission.waypoints.positions_world_m, mission.waypoints.yaw_rad
    before = int(mission.take_off is not None)
    turns = inputs.turns(mission.waypoints)
    cuts = sorted({0, len(points) - 1, *turns, *(turns + 1)} | {stay.waypoint for stay in mission.stays})
    parts: list[_Part] = []
    for a, b in pairwise(cuts):
        way, turned = points[a : b + 1], yaw[a : b + 1]
        arrays = {
            name: None if getattr(whole, name) is None else getattr(whole, name)[before:][a : b + (name not in OF_LEGS)]
            for name in (*_OF_WAYPOINTS, *OF_LEGS)
        }
        start, end = (whole.start if a == 0 else None), (whole.end if b == len(points) - 1 else None)
        if mission.take_off is not None and a == 0:
            above = _above(mission.take_off, field, options)
            way, turned, start = (
                np.concatenate([[above], way]),
                np.append(np.nan, turned),
                _climb(mission.take_off, 1.0),
            )
            arrays = {name: _longer(name, values, 0) for name, values in arrays.items()}
        if mission.landing is not None and b == len(points) - 1:
            above = _above(mission.landing, field, options)
            way, turned, end = np.concatenate([way, [above]]), np.append(turned, np.nan), _climb(mission.landing, -1.0)
            arrays = {name: _longer(name, values, -1) for name, values in arrays.items()}
        tube = {"keep_in_world_m": whole.keep_in_world_m, "keep_in_radius_m": whole.keep_in_radius_m}
        asked = Conditions(start=start, end=end, **arrays, **tube)
        parts.append(_Part(Waypoints(way, turned), asked, a, before if a == 0 else 0, a in turns))
    return parts


def _longer(name: str, values: FloatArray | None, at: int) -> FloatArray | None:
    """With one more row that asks for nothing, at the start (0) or the end (-1)."""
    if values is None:
        return None
    nothing = 0.0 if name in ("fly_by_m", "gate_edges_m") else np.nan
    return np.insert(values, 0 if at == 0 else len(values), nothing, axis=0)


def _above(ground: Ground, field: space.DistanceField, options: PlanOptions) -> FloatArray:
    """The lowest point vertically above the ground point that keeps the clearance of a waypoint."""
    foot = np.array(ground.position_world_m)
    below_m = float(space.distance(field, foot[None])[0])
    if below_m < -space.GROUND_TOLERANCE_M:
        raise InputError(
            f"the ground point {np.round(foot, 2).tolist()} is {inputs.not_free(below_m)}; "
            "move it to where the vehicle can stand"
        )
    points = foot + _HEIGHTS_M[:, None] * np.array([0.0, 0.0, 1.0])
    clear = space.distance(field, points) >= options.waypoint_clearance_m
    if not clear.any():
        raise InputError(
            f"nowhere within {_HEIGHTS_M[-1]:.1f} m above the ground point {np.round(foot, 2).tolist()} is "
            f"{options.waypoint_clearance_m:.2f} m of clearance; move it"
        )
    return points[int(np.argmax(clear))]


def _climb(ground: Ground, sign: float) -> FloatArray:
    motion = np.zeros((3, 4))
    motion[0, 2] = sign * ground.climb_m_s
    return motion


def _turned_on(ahead: Waypoints, before: Trajectory | None) -> Waypoints:
    """The waypoints of the next path, which begins with the heading that the one before ended with."""
    if before is None:
        return ahead
    yaw = ahead.yaw_rad.copy()
    yaw[0] = before.evaluate(np.array([before.duration_s]))[0, 3]
    return Waypoints(ahead.positions_world_m, yaw)


def _pieces(mission: Mission, plans: list[Plan], parts: list[_Part]) -> list[Trajectory]:
    """Everything that is flown, in order."""
    pieces: list[Trajectory] = []
    if mission.take_off is not None:
        pieces.append(_vertical(mission.take_off, plans[0].trajectory, start=True))
    stays = {stay.waypoint: stay.duration_s for stay in mission.stays}
    for plan_, part in zip(plans, parts, strict=True):
        if part.first in stays:
            pieces.append(_hover(plan_.trajectory, stays[part.first], start=True))
        pieces.append(plan_.trajectory)
    last = len(mission.waypoints.positions_world_m) - 1
    if last in stays:
        pieces.append(_hover(plans[-1].trajectory, stays[last], start=False))
    if mission.landing is not None:
        pieces.append(_vertical(mission.landing, plans[-1].trajectory, start=False))
    return pieces


def _hover(beside: Trajectory, duration_s: float, *, start: bool) -> Trajectory:
    """Rest where a trajectory starts or ends."""
    at = beside.evaluate(np.array([0.0 if start else beside.duration_s]))[0]
    coefficients = np.zeros((1, 4, beside.coefficients.shape[2]))
    coefficients[0, :, 0] = at
    return Trajectory(np.array([duration_s]), coefficients)


def _vertical(ground: Ground, beside: Trajectory, *, start: bool) -> Trajectory:
    """Straight up from the ground into the path, or down out of it, with the path's heading and climb speed."""
    foot = np.array(ground.position_world_m)
    joint = beside.evaluate(np.array([0.0 if start else beside.duration_s]))[0]
    # from rest to the climb speed with smooth acceleration: half of that speed on average
    T = np.array([2.0 * (joint[2] - foot[2]) / ground.climb_m_s])
    low = np.append(foot, joint[3])
    climb = _climb(ground, 1.0 if start else -1.0)
    if start:
        spline = minimum_snap.solve(np.stack([low, joint]), T, end=climb)
    else:
        spline = minimum_snap.solve(np.stack([joint, low]), T, start=climb)
    return minimum_snap.trajectory(spline)


def join(parts: list[Trajectory]) -> Trajectory:
    """One after the other; each turns on from the heading of the one before by whole turns, never back."""
    turned = [parts[0]]
    for part in parts[1:]:
        last = turned[-1]
        gap = last.evaluate(np.array([last.duration_s]))[0, 3] - part.evaluate(np.array([0.0]))[0, 3]
        coefficients = part.coefficients.copy()
        coefficients[:, 3, 0] += 2.0 * np.pi * np.round(gap / (2.0 * np.pi))
        turned.append(Trajectory(part.durations_s, coefficients))
    return flight.trajectory.join(turned)


def _share(progress: Progress, number: int, count: int) -> Progress:
    """Progress of one part of several as progress of the whole."""
    return lambda stage, fraction: progress(stage, (number + fraction) / count)
