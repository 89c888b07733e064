"""The document as a mission (`flight.mission`), which counts waypoints by number, and back."""

import math
from dataclasses import fields, replace
from itertools import groupby

import msgspec
import numpy as np

from flight import FloatArray, Waypoints
from flight.mission import FlyBy, Gate, Laps, LegJerk, LegSpeed, Mission, Stay, Velocity, Yaw
from gcs_web.document.document import Content, LegLimit, Opening, Point


def mission_of(content: Content) -> Mission:
    """What the planner and `waypoints.json` take.

    Raises:
        InputError: two requests contradict each other.
    """
    points, chosen = content.points, content.settings
    ends, laps = lap_ends(content), None
    if ends is not None:
        laps = Laps(chosen.laps, ends[0], -1 if ends[1] == len(points) - 1 else ends[1])
    return Mission(
        content.waypoints(),
        laps=laps,
        stays=tuple(Stay(i, p.stay_s) for i, p in enumerate(points) if p.stay_s > 0.0),
        velocities=tuple(
            Velocity(i, p.velocity_world_m_s) for i, p in enumerate(points) if p.velocity_world_m_s is not None
        ),
        gates=tuple(Gate(i, **msgspec.structs.asdict(p.gate)) for i, p in enumerate(points) if p.gate is not None),
        fly_bys=tuple(FlyBy(i, p.fly_by_m) for i, p in enumerate(points) if p.fly_by_m > 0.0),
        leg_speeds=tuple(LegSpeed(*record) for record in _leg_records(points, laps, "leg_speed_m_s")),
        leg_jerks=tuple(LegJerk(*record) for record in _leg_records(points, laps, "leg_jerk_m_s3")),
        take_off=chosen.take_off,
        landing=chosen.landing,
        yaw=_yaw(content),
        keep_in=chosen.keep_in,
    )


def with_mission(content: Content, mission: Mission) -> Content:
    """The document with all waypoints new and the mission's requests; one that asks no yaw mode leaves it as it is."""
    after = content.with_waypoints(mission.waypoints)
    stays: dict[int, float] = {}
    for stay in mission.stays:
        stays[stay.waypoint] = max(stays.get(stay.waypoint, 0.0), stay.duration_s)
    radii = {fly_by.waypoint: fly_by.radius_m for fly_by in mission.fly_bys}
    velocities = {velocity.waypoint: velocity.velocity_world_m_s for velocity in mission.velocities}
    gates = {
        gate.waypoint: Opening(gate.width_m, gate.height_m, gate.heading_rad, gate.pitch_rad, gate.roll_rad)
        for gate in mission.gates
    }
    speeds = _by_leg([(record.first, record.last, record.speed_m_s) for record in mission.leg_speeds])
    jerks = _by_leg([(record.first, record.last, record.jerk_m_s3) for record in mission.leg_jerks])
    points = [
        msgspec.structs.replace(
            point,
            stay_s=stays.get(i, 0.0),
            fly_by_m=radii.get(i, 0.0),
            leg_speed_m_s=speeds.get(i),
            leg_jerk_m_s3=jerks.get(i),
            velocity_world_m_s=velocities.get(i),
            gate=gates.get(i),
        )
        for i, point in enumerate(after.points)
    ]
    laps, last = mission.laps, len(points) - 1
    settings = msgspec.structs.replace(
        content.settings,
        laps=0 if laps is None else laps.count,
        lap_first=None if laps is None or laps.first == 0 else points[laps.first].id,
        lap_last=None if laps is None or laps.last in (-1, last) else points[laps.last].id,
        take_off=mission.take_off,
        landing=mission.landing,
        keep_in=mission.keep_in,
    )
    if mission.yaw is not None:
        settings = msgspec.structs.replace(
            settings,
            yaw=mission.yaw.mode,
            heading_rad=mission.yaw.heading_rad,
            look_at_world_m=mission.yaw.look_at_world_m,
        )
    return msgspec.structs.replace(after.with_points(points), settings=settings)


def same(content: Content, mission: Mission) -> bool:
    """Whether the document asks for what a mission asks for."""
    ours, theirs = mission_of(content), mission_of(with_mission(content, mission))
    return same_waypoints(ours.waypoints, theirs.waypoints) and all(
        getattr(ours, field.name) == getattr(theirs, field.name)
        for field in fields(Mission)
        if field.name != "waypoints"
    )


def same_waypoints(a: Waypoints, b: Waypoints) -> bool:
    return np.array_equal(a.positions_world_m, b.positions_world_m) and np.array_equal(
        a.yaw_rad, b.yaw_rad, equal_nan=True
    )


def flown(content: Content) -> list[int | None]:
    """Ids of the waypoints in the order they are flown, laps unrolled; None for the ground of take-off and landing."""
    ids: list[int | None] = [p.id for p in content.points]
    laps = mission_of(content).laps
    if laps is not None:
        last = laps.last if laps.last >= 0 else len(ids) + laps.last
        ids = [*ids[: laps.first], *ids[laps.first : last + 1] * laps.count, ids[laps.first], *ids[last + 1 :]]
    before, after = content.settings.take_off is not None, content.settings.landing is not None
    return [*[None] * before, *ids, *[None] * after]


def tube_line(content: Content) -> FloatArray:
    """(m, 3) the middle of the tube to keep in: what is given, or straight lines through one lap of the waypoints."""
    asked = mission_of(content)
    if asked.keep_in is not None and asked.keep_in.polyline_world_m is not None:
        return np.array(asked.keep_in.polyline_world_m)
    once = replace(asked, laps=None if asked.laps is None else replace(asked.laps, count=1))
    return once.unrolled().waypoints.positions_world_m


def _by_leg(records: list[tuple[int, int, float]]) -> dict[int, float]:
    """The lowest limit of each leg that has one, from records of the first and last waypoint and the limit."""
    found: dict[int, float] = {}
    for first, last, most in records:
        for leg in range(first, last):
            found[leg] = min(found.get(leg, math.inf), most)
    return found


def _leg_records(points: tuple[Point, ...], laps: Laps | None, name: LegLimit) -> list[tuple[int, int, float]]:
    """First and last waypoint and limit; legs one after another with the same limit are one record."""
    found: list[tuple[int, int, float]] = []
    for most, legs in groupby(range(len(points) - 1), lambda leg: getattr(points[leg], name)):
        numbers = list(legs)
        if most is not None:
            found.append((numbers[0], numbers[-1] + 1, most))
    return found + _way_back(points, laps, name)


def lap_ends(content: Content) -> tuple[int, int] | None:
    """Numbers of the first and the last waypoint of the loop; None for an open path."""
    chosen = content.settings
    if not chosen.laps:
        return None
    first = 0 if chosen.lap_first is None else content.number_of(chosen.lap_first)
    return first, len(content.points) - 1 if chosen.lap_last is None else content.number_of(chosen.lap_last)


def way_back(points: tuple[Point, ...], loop: tuple[int, int], name: LegLimit) -> float | None:
    """The limit on the way back of laps: the largest of their legs, if every one has some; None for no such limit."""
    asked = [getattr(point, name) for point in points[slice(*loop)]]
    given = [most for most in asked if most is not None]
    return max(given) if given and len(given) == len(asked) else None


def _way_back(points: tuple[Point, ...], laps: Laps | None, name: LegLimit) -> list[tuple[int, int, float]]:
    """The record of the limit on the way back, where it needs one of its own."""
    if laps is None:
        return []
    first, last = laps.ends(len(points))
    most = way_back(points, (first, last), name)
    if most is None or all(getattr(point, name) == most for point in points[first:last]):
        return []  # one limit throughout: its record spans the laps
    return [(first, last, most)]


def _yaw(content: Content) -> Yaw | None:
    """None for along the path, which is what everybody does who is not told otherwise."""
    chosen = content.settings
    if chosen.yaw == "along_path":
        return None
    heading_rad = chosen.heading_rad if chosen.yaw == "fixed" else 0.0
    return Yaw(chosen.yaw, heading_rad, chosen.look_at_world_m if chosen.yaw == "look_at" else None)
