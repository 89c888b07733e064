"""What each edit of the page does to the document; pure functions, one per message."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np

from flight import InputError
from gcs_web import protocol
from gcs_web.document import SETTING_BOUNDS, Content, Point

Edited = tuple[Content, str]
"""The document after an edit, and what was done in words: "waypoint 8 moved 0.31 m up"."""


def apply(content: Content, edit: protocol.Edit) -> Edited:
    """
    Raises:
        InputError: the edit cannot be done; the message says why.
    """
    return _EDITS[type(edit)](content, edit)


def _move(content: Content, edit: protocol.Move) -> Edited:
    wanted = (edit.x_m, edit.y_m, edit.z_m)

    def moved(point: Point) -> Point:
        x, y, z = (old if new is None else new for old, new in zip(point.position_world_m, wanted, strict=True))
        return msgspec.structs.replace(point, position_world_m=(x, y, z))

    return _each(content, edit.waypoints, moved)


def _shift(content: Content, edit: protocol.Shift) -> Edited:
    def moved(point: Point) -> Point:
        x, y, z = point.position_world_m
        return msgspec.structs.replace(point, position_world_m=(x + edit.x_m, y + edit.y_m, z + edit.z_m))

    return _each(content, edit.waypoints, moved)


def _turn(content: Content, edit: protocol.Turn) -> Edited:
    yaw_rad = None if edit.yaw_deg is None else math.remainder(math.radians(edit.yaw_deg), 2.0 * math.pi)
    after, _ = _each(content, edit.waypoints, lambda point: msgspec.structs.replace(point, yaw_rad=yaw_rad))
    heading = "free" if edit.yaw_deg is None else f"{edit.yaw_deg:.0f}°"
    return after, f"heading of {_named(content, edit.waypoints)} {heading}"


def _insert(content: Content, edit: protocol.Insert) -> Edited:
    number = -1 if edit.after is None else content.number_of(edit.after)
    position = _inserted_position(content, number)
    for axis, value in enumerate((edit.x_m, edit.y_m, edit.z_m)):
        position[axis] = position[axis] if value is None else value
    point = Point(content.next_id, (float(position[0]), float(position[1]), float(position[2])))
    points = [*content.points[: number + 1], point, *content.points[number + 1 :]]
    return content.with_points(points), f"waypoint {number + 1} inserted"


def _inserted_position(content: Content, number: int) -> Any:
    """Half-way to the next waypoint; beyond the last one, a metre on."""
    here, after = (content.points[k : k + 1] for k in (max(number, 0), number + 1))
    if not content.points:
        return np.array([0.0, 0.0, 1.0])
    if number < 0:
        return np.subtract(after[0].position_world_m, (1.0, 0.0, 0.0))
    if not after:
        return np.add(here[0].position_world_m, (1.0, 0.0, 0.0))
    return 0.5 * np.add(here[0].position_world_m, after[0].position_world_m)


def _delete(content: Content, edit: protocol.Delete) -> Edited:
    label = f"{_named(content, edit.waypoints)} deleted"
    gone = set(edit.waypoints)
    points = [p for p in content.points if p.id not in gone]
    if len(points) < 2 <= len(content.points):
        raise InputError("two waypoints are the least a path can have; move them instead")
    return content.with_points(points), label


def _reverse(content: Content, edit: protocol.Reverse) -> Edited:
    return content.with_points(content.points[::-1]), "order of the waypoints reversed"


def _choose(content: Content, edit: protocol.Choose) -> Edited:
    chosen = {n: v for n in content.settings.__struct_fields__ if (v := getattr(edit, n)) is not None}
    for name, value in chosen.items():
        low, high = SETTING_BOUNDS.get(name, (0.0, 0.0))
        if not isinstance(value, str) and not low <= value <= high:
            raise InputError(f"{_words(name)} {value:g} is refused; it must be from {low:g} to {high:g}")
    said = ", ".join(f"{_words(n)} {v if isinstance(v, str) else f'{v:g}'}" for n, v in chosen.items())
    settings = msgspec.structs.replace(content.settings, **chosen)
    return msgspec.structs.replace(content, settings=settings), said.replace("_", " ")


def _words(name: str) -> str:
    return {"speed_m_s": "speed", "acceleration_m_s2": "acceleration", "margin_m": "margin"}.get(name, name)


def _each(content: Content, waypoints: Sequence[int], change: Callable[[Point], Point]) -> Edited:
    """Change the waypoints of these ids."""
    named = _named(content, waypoints)
    chosen = set(waypoints)
    after = content.with_points([change(p) if p.id in chosen else p for p in content.points])
    steps = [
        np.subtract(b.position_world_m, a.position_world_m)
        for a, b in zip(content.points, after.points, strict=True)
        if a.id in chosen
    ]
    return after, f"{named} moved {float(max(np.linalg.norm(s) for s in steps)):.2f} m"


def _named(content: Content, waypoints: Sequence[int]) -> str:
    """
    Raises:
        InputError: no waypoint is named, or one is not there.
    """
    if not waypoints:
        raise InputError("no waypoint is selected")
    numbers = sorted(content.number_of(w) for w in set(waypoints))
    return f"waypoint {numbers[0]}" if len(numbers) == 1 else f"{len(numbers)} waypoints"


_EDITS: dict[type, Callable[[Content, Any], Edited]] = {
    protocol.Move: _move,
    protocol.Shift: _shift,
    protocol.Turn: _turn,
    protocol.Insert: _insert,
    protocol.Delete: _delete,
    protocol.Reverse: _reverse,
    protocol.Choose: _choose,
}
