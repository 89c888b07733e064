"""The document as a mission (`flight.mission`), which counts waypoints by number, and back."""

import math
from dataclasses import fields
from itertools import groupby
from pathlib import Path

import msgspec
import numpy as np

from flight import InputError, Waypoints, mission
from flight.mission import FlyBy, Laps, LegSpeed, Mission, Stay, Velocity, Yaw
from gcs_web.document import Content, Point


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
        fly_bys=tuple(FlyBy(i, p.fly_by_m) for i, p in enumerate(points) if p.fly_by_m > 0.0),
        leg_speeds=(*_leg_speeds(points), *_way_back(points, laps)),
        take_off=chosen.take_off,
        landing=chosen.landing,
        yaw=_yaw(content),
    )


def load(path: Path) -> Mission:
    """What `waypoints.json` asks for.

    Raises:
        FlightError: as `flight.mission.load`, or the page cannot keep a request.
    """
    found = mission.load(path)
    try:
        _require_editable(found)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return found


def _require_editable(asked: Mission) -> None:
    """Refuse requests that the document has no place for: dropped, they would be missed in the air."""
    lost = [name for name, given in (("gates", asked.gates), ("keep_in", asked.keep_in)) if given]
    if lost:
        raise InputError(
            f"the page cannot keep {' and '.join(lost)}; plan this mission with `goshawk plan`, "
            "or move the file away to start without"
        )


def with_mission(content: Content, mission: Mission) -> Content:
    """The document with all waypoints new and the mission's requests; one that asks no yaw mode leaves it as it is.

    Raises:
        InputError: the document has no place for a request.
    """
    _require_editable(mission)
    after = content.with_waypoints(mission.waypoints)
    stays: dict[int, float] = {}
    for stay in mission.stays:
        stays[stay.waypoint] = max(stays.get(stay.waypoint, 0.0), stay.duration_s)
    radii = {fly_by.waypoint: fly_by.radius_m for fly_by in mission.fly_bys}
    velocities = {velocity.waypoint: velocity.velocity_world_m_s for velocity in mission.velocities}
    speeds: dict[int, float] = {}
    for record in mission.leg_speeds:
        for leg in range(record.first, record.last):
            speeds[leg] = min(speeds.get(leg, math.inf), record.speed_m_s)
    points = [
        msgspec.structs.replace(
            point,
            stay_s=stays.get(i, 0.0),
            fly_by_m=radii.get(i, 0.0),
            leg_speed_m_s=speeds.get(i),
            velocity_world_m_s=velocities.get(i),
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


def _leg_speeds(points: tuple[Point, ...]) -> tuple[LegSpeed, ...]:
    """Legs one after another that have the same largest speed are one record."""
    found = []
    for speed, legs in groupby(range(len(points) - 1), lambda leg: points[leg].leg_speed_m_s):
        numbers = list(legs)
        if speed is not None:
            found.append(LegSpeed(numbers[0], numbers[-1] + 1, speed))
    return tuple(found)


def lap_ends(content: Content) -> tuple[int, int] | None:
    """Numbers of the first and the last waypoint of the loop; None for an open path."""
    chosen = content.settings
    if not chosen.laps:
        return None
    first = 0 if chosen.lap_first is None else content.number_of(chosen.lap_first)
    return first, len(content.points) - 1 if chosen.lap_last is None else content.number_of(chosen.lap_last)


def way_back_speed(points: tuple[Point, ...], loop: tuple[int, int]) -> float | None:
    """The largest speed on the way back of laps: that of their legs, if every one has some; None for no such limit."""
    asked = [point.leg_speed_m_s for point in points[slice(*loop)]]
    speeds = [speed for speed in asked if speed is not None]
    return max(speeds) if speeds and len(speeds) == len(asked) else None


def _way_back(points: tuple[Point, ...], laps: Laps | None) -> tuple[LegSpeed, ...]:
    """The record of the limit on the way back, where it needs one of its own."""
    if laps is None:
        return ()
    first, last = laps.ends(len(points))
    speed = way_back_speed(points, (first, last))
    if speed is None or all(point.leg_speed_m_s == speed for point in points[first:last]):
        return ()  # one speed throughout: its record spans the laps
    return (LegSpeed(first, last, speed),)


def _yaw(content: Content) -> Yaw | None:
    """None for along the path, which is what everybody does who is not told otherwise."""
    chosen = content.settings
    if chosen.yaw == "along_path":
        return None
    heading_rad = chosen.heading_rad if chosen.yaw == "fixed" else 0.0
    return Yaw(chosen.yaw, heading_rad, chosen.look_at_world_m if chosen.yaw == "look_at" else None)
