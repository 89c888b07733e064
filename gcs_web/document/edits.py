"""What each edit of the page does to the document; pure functions, one per message."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np

from esdf import Edit
from flight import InputError
from flight.mission import MOST_LAPS, Ground
from gcs_web.document import course_edits, map_edits, missions
from gcs_web.document.document import LEG_LIMITS, SETTING_BOUNDS, Content, Point
from gcs_web.document.map_edits import LARGEST_COORDINATE_M, MapEdit
from gcs_web.protocol import base as base_messages
from gcs_web.protocol import document as messages
from gcs_web.protocol.course import Place, RandomYaw
from gcs_web.protocol.map import AddMapEdit, ChangeMapEdit, DropMapEdits

Edited = tuple[Content, str]
"""The document after an edit, and what was done in words: "waypoint 8 moved 0.31 m up"."""


def apply(content: Content, edit: base_messages.Edit) -> Edited:
    """
    Raises:
        InputError: the edit cannot be done; the message says why.
    """
    after, label = _EDITS[type(edit)](content, edit)
    missions.mission_of(after)  # refuses requests that contradict each other
    return after, label


def _move(content: Content, edit: messages.Move) -> Edited:
    wanted = (edit.x_m, edit.y_m, edit.z_m)

    def moved(point: Point) -> Point:
        x, y, z = (old if new is None else new for old, new in zip(point.position_world_m, wanted, strict=True))
        return msgspec.structs.replace(point, position_world_m=(x, y, z))

    return _each(content, edit.waypoints, moved)


def _shift(content: Content, edit: messages.Shift) -> Edited:
    def moved(point: Point) -> Point:
        x, y, z = point.position_world_m
        return msgspec.structs.replace(point, position_world_m=(x + edit.x_m, y + edit.y_m, z + edit.z_m))

    return _each(content, edit.waypoints, moved)


def _place(content: Content, edit: Place) -> Edited:
    places = dict(zip(edit.waypoints, edit.positions_m, strict=True))
    after, _ = _each(
        content, edit.waypoints, lambda point: msgspec.structs.replace(point, position_world_m=places[point.id])
    )
    return after, f"{_named(content, edit.waypoints)} {edit.label}"


def _random_yaw(content: Content, edit: RandomYaw) -> Edited:
    """The same for the same revision; a plan that cannot turn as fast slows down, or is refused as any other."""
    yaw_rad = np.random.default_rng(edit.revision).uniform(-np.pi, np.pi, len(content.points)).tolist()
    of = {point.id: angle for point, angle in zip(content.points, yaw_rad, strict=True)}
    after, _ = _each(content, edit.waypoints, lambda point: msgspec.structs.replace(point, yaw_rad=of[point.id]))
    return after, f"random headings for {_named(content, edit.waypoints)}"


def _turn(content: Content, edit: messages.Turn) -> Edited:
    yaw_rad = None if edit.yaw_deg is None else math.remainder(math.radians(edit.yaw_deg), 2.0 * math.pi)
    after, _ = _each(content, edit.waypoints, lambda point: msgspec.structs.replace(point, yaw_rad=yaw_rad))
    heading = "free" if edit.yaw_deg is None else f"{edit.yaw_deg:.0f}°"
    return after, f"heading of {_named(content, edit.waypoints)} {heading}"


_ASKED = {"stay_s": (3600.0, "s", "stay at"), "fly_by_m": (100.0, "m", "radius of"),
          "leg_speed_m_s": (40.0, "m/s", "speed after"), "leg_jerk_m_s3": (1e5, "m/s3", "jerk after")}  # fmt: skip
"""Of each request at a waypoint: the largest value, its unit and its name."""


def _ask(content: Content, edit: messages.Ask) -> Edited:
    named, chosen = _named(content, edit.waypoints), set(edit.waypoints)
    asked = {name: value for name in _ASKED if (value := getattr(edit, name)) is not None}
    for name, value in asked.items():
        most, unit, words = _ASKED[name]
        if not 0.0 <= value <= most:
            raise InputError(f"the {words} {named} would be {value:g} {unit}; it must be from 0 to {most:g} {unit}")
    said = ", ".join(f"{_ASKED[n][2]} {named} {f'{v:g} {_ASKED[n][1]}' if v else 'dropped'}" for n, v in asked.items())
    last = content.points[-1].id
    on_leg = [name for name in LEG_LIMITS if name in asked]
    if chosen == {last} and any(asked[name] for name in on_leg):
        raise InputError(
            f"no leg follows {named}, the last one; the way back of laps has the largest limit of their legs, if all "
            "of them have one"
        )
    asked |= {name: asked[name] or None for name in on_leg}
    points = [msgspec.structs.replace(p, **asked) if p.id in chosen else p for p in content.points]
    if last in chosen:
        points[-1] = msgspec.structs.replace(points[-1], **dict.fromkeys(on_leg))
    return content.with_points(points), said


def _pass(content: Content, edit: messages.Pass) -> Edited:
    named, chosen, wanted = _named(content, edit.waypoints), set(edit.waypoints), edit.velocity_m_s
    most = SETTING_BOUNDS["speed_m_s"][1]
    if wanted is not None and not math.hypot(*wanted) <= most:
        raise InputError(f"the velocity at {named} would be {list(wanted)} m/s; {most:g} m/s is the most")
    points = [msgspec.structs.replace(p, velocity_world_m_s=wanted) if p.id in chosen else p for p in content.points]
    said = "open" if wanted is None else f"({', '.join(f'{v:g}' for v in wanted)}) m/s"
    return content.with_points(points), f"velocity at {named} {said}"


def _insert(content: Content, edit: messages.Insert) -> Edited:
    number = -1 if edit.after is None else content.number_of(edit.after)
    position = _inserted_position(content, number)
    for axis, value in enumerate((edit.x_m, edit.y_m, edit.z_m)):
        position[axis] = position[axis] if value is None else value
    point = Point(content.next_id, (float(position[0]), float(position[1]), float(position[2])))
    points = [*content.points[: number + 1], point, *content.points[number + 1 :]]
    return content.with_points(points), f"waypoint {number + 2} inserted"


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


def _delete(content: Content, edit: messages.Delete) -> Edited:
    label = f"{_named(content, edit.waypoints)} deleted"
    gone = set(edit.waypoints)
    points = [p for p in content.points if p.id not in gone]
    if len(points) < 2 <= len(content.points):
        raise InputError("two waypoints are the least a path can have; move them instead")
    chosen = content.settings
    ends = {
        "lap_first": _survivor(content.points, chosen.lap_first, gone),
        "lap_last": _survivor(content.points[::-1], chosen.lap_last, gone),
    }
    return _with_settings(content.with_points(points), **ends), label


def _survivor(points: Sequence[Point], waypoint: int | None, gone: set[int]) -> int | None:
    """A waypoint's id, or that of the next one which stays; None if there is none."""
    ids = [p.id for p in points]
    return None if waypoint is None else next((i for i in ids[ids.index(waypoint) :] if i not in gone), None)


def _reverse(content: Content, edit: messages.Reverse) -> Edited:
    """The same flight backwards: legs keep their speeds, velocities and gates turn round, take-off and landing swap.

    A loop begins and closes at its first waypoint whichever way it is flown.
    """
    chosen, points = content.settings, content.points
    loop = missions.lap_ends(content)
    if loop is None:
        order = points[::-1]
        ends = {"lap_first": chosen.lap_last, "lap_last": chosen.lap_first}
    else:
        first, last = loop
        order = (*points[:last:-1], points[first], *points[last:first:-1], *points[:first][::-1])
        ends = {
            "lap_first": points[first].id if last < len(points) - 1 else None,
            "lap_last": points[first + 1].id if first > 0 else None,
        }
    turned = [
        msgspec.structs.replace(
            point,
            **asked,
            velocity_world_m_s=None if (v := point.velocity_world_m_s) is None else (-v[0], -v[1], -v[2]),
            gate=None if point.gate is None else course_edits.turned_round(point.gate),
        )
        for point, asked in zip(order, _legs_backwards(points, loop), strict=True)
    ]
    after = _with_settings(content.with_points(turned), **ends, take_off=chosen.landing, landing=chosen.take_off)
    back = missions.lap_ends(after)
    if loop is not None and back is not None:
        for name, words in zip(LEG_LIMITS, ("speed", "jerk"), strict=True):
            asked = getattr(points[loop[0]], name)  # of the leg that is the way back now
            if missions.way_back(after.points, back, name) != asked:
                raise InputError(
                    f"the leg after waypoint {loop[0] + 1} would be the way back of the laps, which takes the largest "
                    f"{words} of their legs. Give all of them the same {words}, or none, then reverse"
                )
    return after, "order of the waypoints reversed"


def _legs_backwards(points: Sequence[Point], loop: tuple[int, int] | None) -> list[dict[str, float | None]]:
    """What is asked of the leg after each waypoint, when the waypoints are flown in the other order."""
    found: list[dict[str, float | None]] = [{} for _ in points]
    for name in LEG_LIMITS:
        legs = [getattr(point, name) for point in points[:-1]]
        if loop is None:
            legs = legs[::-1]
        else:
            first, last = loop
            back = missions.way_back(tuple(points), loop, name)
            legs = [*legs[last:][::-1], back, *legs[first + 1 : last][::-1], *legs[:first][::-1]]
        for asked, most in zip(found, [*legs, None], strict=True):
            asked[name] = most
    return found


def _choose(content: Content, edit: messages.Choose) -> Edited:
    given = {n: v for n in edit.__struct_fields__ if (v := getattr(edit, n)) is not None and n not in _NOT_SETTINGS}
    for name, value in given.items():
        if name in SETTING_BOUNDS and not SETTING_BOUNDS[name][0] <= value <= SETTING_BOUNDS[name][1]:
            low, high = SETTING_BOUNDS[name]
            raise InputError(f"{_words(name)} {value:g} is refused; it must be from {low:g} to {high:g}")
    said = ", ".join(f"{_words(n)} {_value(v)}" for n, v in given.items())
    if "heading_deg" in given:
        given["heading_rad"] = math.remainder(math.radians(_finite(given.pop("heading_deg"))), 2.0 * math.pi)
    if "jerk_m_s3" in given:
        given["jerk_m_s3"] = given["jerk_m_s3"] or None
    if "look_at_m" in given:
        given["look_at_world_m"] = _checked_place(given.pop("look_at_m"))
    if given.get("yaw") == "look_at" and (given.get("look_at_world_m") or content.settings.look_at_world_m) is None:
        given["look_at_world_m"] = _middle(content)
    return _with_settings(content, **given), said


_NOT_SETTINGS = ("serial", "revision")


def _value(value: object) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(f'{v:g}' for v in value)})"
    return str(value).replace("_", " ") if isinstance(value, str) else f"{value:g}"


def _words(name: str) -> str:
    """As people read it: without its unit."""
    for unit in ("_m_s3", "_m_s2", "_m_s", "_m", "_deg"):
        name = name.removesuffix(unit)
    return name.replace("_", " ")


def _middle(content: Content) -> tuple[float, float, float]:
    """Of all waypoints: what one looks at who flies round something."""
    if not content.points:
        return (0.0, 0.0, 0.0)
    x, y, z = np.round(np.mean([p.position_world_m for p in content.points], axis=0), 2).tolist()
    return (x, y, z)


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise InputError(f"{value} is no heading; give degrees from x towards y")
    return value


def _checked_place(position_m: tuple[float, float, float]) -> tuple[float, float, float]:
    if not all(abs(value) <= LARGEST_COORDINATE_M for value in position_m):  # NaN is not
        raise InputError(f"{list(position_m)} m is refused; coordinates must be within {LARGEST_COORDINATE_M:g} m")
    return position_m


def _loop(content: Content, edit: messages.Loop) -> Edited:
    if not 0 <= edit.laps <= MOST_LAPS:
        raise InputError(f"{edit.laps} laps are refused; it must be from 0 (an open path) to {MOST_LAPS}")
    first = None if edit.lap_first is None or content.number_of(edit.lap_first) == 0 else edit.lap_first
    last = edit.lap_last
    if last is not None and content.number_of(last) == len(content.points) - 1:
        last = None
    label = "path open" if edit.laps == 0 else f"closed loop, {edit.laps} lap{'s' if edit.laps > 1 else ''}"
    return _with_settings(content, laps=edit.laps, lap_first=first, lap_last=last), label


_FASTEST_CLIMB_M_S = 20.0


def _ground(content: Content, edit: messages.SetGround) -> Edited:
    old: Ground | None = getattr(content.settings, edit.end)
    if not content.points:
        raise InputError("there is no path to take off for or to land from; add waypoints first")
    below = content.points[0 if edit.end == "take_off" else -1].position_world_m
    before = old.position_world_m if old is not None else below
    x, y, z = (b if new is None else new for b, new in zip(before, (edit.x_m, edit.y_m, edit.z_m), strict=True))
    climb_m_s = edit.climb_m_s if edit.climb_m_s is not None else 1.0 if old is None else old.climb_m_s
    if not 0.0 < climb_m_s <= _FASTEST_CLIMB_M_S:
        raise InputError(f"{climb_m_s:g} m/s is refused; give more than 0 and at most {_FASTEST_CLIMB_M_S:g} m/s")
    ground = Ground(_checked_place((x, y, z)), climb_m_s)
    where = f"({x:.2f}, {y:.2f}, {z:.2f}) m"
    return _with_settings(content, **{edit.end: ground}), f"{_END_WORDS[edit.end]} at {where}, {climb_m_s:g} m/s"


def _clear_ground(content: Content, edit: messages.ClearGround) -> Edited:
    return _with_settings(content, **{edit.end: None}), f"no {_END_WORDS[edit.end]}"


_END_WORDS = {"take_off": "take-off", "landing": "landing"}


_ACTIONS = {"add": "obstacle", "no-fly": "no-fly zone", "clear": "cleared", "remove": "declared free"}


def _add_map_edit(content: Content, edit: AddMapEdit) -> Edited:
    new = map_edits.of(content.next_id, Edit(edit.action, map_edits.solid(edit.shape), _edit_name(edit.name)))
    return content.with_map_edits([*content.map_edits, new]), f"{_map_words(new)} added to the map"


def _change_map_edit(content: Content, edit: ChangeMapEdit) -> Edited:
    old = _map_edit(content, edit.edit)
    before = old.edit()
    body = before.solid if edit.shape is None else map_edits.solid(edit.shape)
    name = before.name if edit.name is None else _edit_name(edit.name)
    new = map_edits.of(old.id, Edit(edit.action or before.action, body, name))
    after = [new if each.id == old.id else each for each in content.map_edits]
    return content.with_map_edits(after), f"{_map_words(new)} changed"


def _drop_map_edits(content: Content, edit: DropMapEdits) -> Edited:
    gone = [_map_edit(content, number) for number in edit.edits]
    if not gone:
        raise InputError("no edit of the map is selected")
    after = [each for each in content.map_edits if each not in gone]
    said = _map_words(gone[0]) if len(gone) == 1 else f"{len(gone)} edits of the map"
    return content.with_map_edits(after), f"{said} dropped"


_LONGEST_NAME = 60


def _edit_name(name: str) -> str:
    if len(name) > _LONGEST_NAME or not name.isprintable():
        raise InputError(f"a name here has at most {_LONGEST_NAME} characters, all of them printable")
    return name.strip()


def _map_edit(content: Content, number: int) -> MapEdit:
    for each in content.map_edits:
        if each.id == number:
            return each
    raise InputError("that edit of the map was dropped meanwhile; nothing was changed")


def _map_words(edit: MapEdit) -> str:
    return f"{_ACTIONS[edit.action]} {edit.name}".strip()


def _with_settings(content: Content, **changed: Any) -> Content:
    return msgspec.structs.replace(content, settings=msgspec.structs.replace(content.settings, **changed))


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
    return f"waypoint {numbers[0] + 1}" if len(numbers) == 1 else f"{len(numbers)} waypoints"


_EDITS: dict[type, Callable[[Content, Any], Edited]] = {
    messages.Move: _move,
    messages.Shift: _shift,
    messages.Turn: _turn,
    Place: _place,
    RandomYaw: _random_yaw,
    messages.Insert: _insert,
    messages.Delete: _delete,
    messages.Reverse: _reverse,
    messages.Choose: _choose,
    messages.Ask: _ask,
    messages.Pass: _pass,
    messages.Loop: _loop,
    messages.SetGround: _ground,
    messages.ClearGround: _clear_ground,
    messages.SetGate: course_edits.set_gate,
    messages.ClearGate: course_edits.clear_gate,
    messages.SetTube: course_edits.set_tube,
    AddMapEdit: _add_map_edit,
    ChangeMapEdit: _change_map_edit,
    DropMapEdits: _drop_map_edits,
}
