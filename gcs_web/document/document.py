"""What the pilots of one project edit together: waypoints, requests, settings, edits of the map; immutable values.

A change is a `Patch` from one `Content` to the next; `difference` finds it, `patched` applies it. So an undo is the
patch the other way round, and the journal (`gcs_web.document.journal`) stores what changed and no more.
"""

from collections.abc import Sequence
from typing import Any, Literal, Protocol, TypeVar, get_args

import msgspec
import numpy as np

from flight import InputError, Waypoints
from flight.mission import Ground, KeepIn
from gcs_web.document import map_edits
from gcs_web.document.map_edits import LARGEST_COORDINATE_M, MapEdit

MOST_WAYPOINTS = 10_000


class Opening(msgspec.Struct, frozen=True):
    """A gate: the rectangle round a waypoint that is passed forwards, as `flight.mission.Gate`."""

    width_m: float
    height_m: float
    heading_rad: float
    pitch_rad: float = 0.0
    roll_rad: float = 0.0


LegLimit = Literal["leg_speed_m_s", "leg_jerk_m_s3"]
"""What a point limits on the leg to the next one."""
LEG_LIMITS: tuple[LegLimit, ...] = get_args(LegLimit)


class Point(msgspec.Struct, frozen=True):
    """A waypoint that keeps its identity however its number changes."""

    id: int
    position_world_m: tuple[float, float, float]
    yaw_rad: float | None = None
    """None where the planner may choose the heading."""
    stay_s: float = 0.0
    """How long to hover here."""
    fly_by_m: float = 0.0
    """Radius within which it is enough to pass; 0: the waypoint itself."""
    leg_speed_m_s: float | None = None
    """Largest speed from here to the next waypoint, as listed; None: that of the settings."""
    leg_jerk_m_s3: float | None = None
    """The same of jerk."""
    velocity_world_m_s: tuple[float, float, float] | None = None
    """Velocity to have here; None where it is open."""
    gate: Opening | None = None

    @property
    def legs_plain(self) -> bool:
        """Whether nothing is asked of the leg from here to the next waypoint."""
        return all(getattr(self, name) is None for name in LEG_LIMITS)

    @property
    def plain(self) -> bool:
        """Whether nothing is asked here but position and heading."""
        return msgspec.structs.replace(self, **_NOTHING_ASKED) == self


_NOTHING_ASKED = {"stay_s": 0.0, "fly_by_m": 0.0, "leg_speed_m_s": None, "leg_jerk_m_s3": None,
                  "velocity_world_m_s": None, "gate": None}  # fmt: skip


class Settings(msgspec.Struct, frozen=True):
    """What is asked of the planner beside the waypoints."""

    speed_m_s: float = 5.0
    acceleration_m_s2: float = 8.0
    jerk_m_s3: float | None = None
    """None: no limit but the vehicle's own."""
    margin_m: float = 0.15
    yaw: Literal["along_path", "smooth", "steady", "fixed", "look_at", "free"] = "along_path"
    method: Literal["fastest", "corridor"] = "fastest"
    heading_rad: float = 0.0
    """Of yaw mode `fixed`."""
    look_at_world_m: tuple[float, float, float] | None = None
    """Of yaw mode `look_at`."""
    laps: int = 0
    """Times that the loop is flown; 0: the path is open."""
    lap_first: int | None = None
    """Id of the waypoint where the loop begins and closes; None: the first one."""
    lap_last: int | None = None
    """Id of the loop's last waypoint; None: the last one, so that nothing leads out."""
    take_off: Ground | None = None
    landing: Ground | None = None
    keep_in: KeepIn | None = None


SETTING_BOUNDS = {
    "speed_m_s": (0.1, 40.0),
    "acceleration_m_s2": (0.2, 100.0),
    "jerk_m_s3": (0.0, 100_000.0),
    "margin_m": (0.0, 10.0),
}
"""Smallest and largest value that is taken; the vehicle's own limits hold besides."""


class Content(msgspec.Struct, frozen=True):
    """The document at one revision."""

    points: tuple[Point, ...] = ()
    settings: Settings = Settings()
    next_id: int = 0
    """Id of the next new waypoint or edit of the map; ids are never used again."""
    map_edits: tuple[MapEdit, ...] = ()
    """In the order in which they were made."""

    def waypoints(self) -> Waypoints:
        """As the planner and `waypoints.json` take them."""
        positions = np.array([p.position_world_m for p in self.points], dtype=np.float64).reshape(-1, 3)
        yaw = [np.nan if p.yaw_rad is None else p.yaw_rad for p in self.points]
        return Waypoints(positions, np.array(yaw, dtype=np.float64))

    def with_waypoints(self, waypoints: Waypoints) -> "Content":
        """With other waypoints, all of them new and nothing asked there; the settings stay."""
        return self.with_points(
            [
                Point(self.next_id + i, (float(p[0]), float(p[1]), float(p[2])), None if np.isnan(yaw) else float(yaw))
                for i, (p, yaw) in enumerate(zip(waypoints.positions_world_m, waypoints.yaw_rad, strict=True))
            ]
        )

    def with_points(self, points: Sequence[Point]) -> "Content":
        """With other points, checked.

        Raises:
            InputError: a coordinate is not finite or too large, or there are too many points.
        """
        if len(points) > MOST_WAYPOINTS:
            raise InputError(f"{len(points)} waypoints; {MOST_WAYPOINTS} are the most the page takes")
        for number, point in enumerate(points):
            values = (*point.position_world_m, 0.0 if point.yaw_rad is None else point.yaw_rad)
            if not all(np.isfinite(values)) or max(map(abs, values)) > LARGEST_COORDINATE_M:
                raise InputError(
                    f"waypoint {number + 1} would be at {list(point.position_world_m)} m, heading {point.yaw_rad}; "
                    f"coordinates must be finite and within {LARGEST_COORDINATE_M:g} m"
                )
        next_id = max((p.id + 1 for p in points), default=0)
        return msgspec.structs.replace(self, points=tuple(points), next_id=max(self.next_id, next_id))

    def with_map_edits(self, edits: Sequence[MapEdit]) -> "Content":
        """With another list of edits of the map, checked.

        Raises:
            InputError: as `map_edits.require_consistent`.
        """
        map_edits.require_consistent(tuple(edits))
        next_id = max((each.id + 1 for each in edits), default=0)
        return msgspec.structs.replace(self, map_edits=tuple(edits), next_id=max(self.next_id, next_id))

    def number_of(self, waypoint: int) -> int:
        """Where a waypoint stands in the order.

        Raises:
            InputError: it is not there (any more).
        """
        for number, point in enumerate(self.points):
            if point.id == waypoint:
                return number
        raise InputError("that waypoint was deleted meanwhile; nothing was changed")


class Splice(msgspec.Struct, frozen=True):
    """At `start`, these ids go and those come."""

    start: int
    removed: tuple[int, ...]
    added: tuple[int, ...]


class Patch(msgspec.Struct, frozen=True, omit_defaults=True):
    """What turns one content into the next."""

    points: tuple[Point, ...] = ()
    """New ones, and those that have other values."""
    order: Splice | None = None
    settings: dict[str, Any] = {}
    """As JSON has them."""
    next_id: int | None = None
    map_edits: tuple[MapEdit, ...] = ()
    """New ones, and those that have other values."""
    map_order: Splice | None = None

    @property
    def touched(self) -> frozenset[int | str]:
        """Ids and names of settings that it changes: what another person's edit may conflict with."""
        gone = [i for splice in (self.order, self.map_order) if splice is not None for i in splice.removed]
        return frozenset((*(p.id for p in self.points), *(e.id for e in self.map_edits), *gone, *self.settings))


def difference(before: Content, after: Content) -> Patch:
    points, order = _changes(before.points, after.points)
    map_edits, map_order = _changes(before.map_edits, after.map_edits)
    settings = {
        name: msgspec.to_builtins(getattr(after.settings, name))
        for name in Settings.__struct_fields__
        if getattr(after.settings, name) != getattr(before.settings, name)
    }
    return Patch(
        points=points,
        order=order,
        settings=settings,
        next_id=None if after.next_id == before.next_id else after.next_id,
        map_edits=map_edits,
        map_order=map_order,
    )


def patched(content: Content, patch: Patch) -> Content:
    map_edits = _changed(content.map_edits, patch.map_edits, patch.map_order)
    free_id = max((each.id + 1 for each in map_edits), default=0)  # a patch of an older program knows of no map edits
    return Content(
        _changed(content.points, patch.points, patch.order),
        msgspec.convert(msgspec.to_builtins(content.settings) | patch.settings, Settings),
        max(content.next_id if patch.next_id is None else patch.next_id, free_id),
        map_edits,
    )


class _Identified(Protocol):
    """A waypoint or an edit of the map."""

    @property
    def id(self) -> int: ...


Item = TypeVar("Item", bound=_Identified)


def _changes(before: Sequence[Item], after: Sequence[Item]) -> tuple[tuple[Item, ...], Splice | None]:
    """Items that are new or have other values, and where the order changed."""
    known = {item.id: item for item in before}
    old, new = [item.id for item in before], [item.id for item in after]
    start = _shared(old, new)
    end = min(_shared(old[::-1], new[::-1]), len(old) - start, len(new) - start)
    splice = Splice(start, tuple(old[start : len(old) - end]), tuple(new[start : len(new) - end]))
    changed = tuple(item for item in after if known.get(item.id) != item)
    return changed, splice if splice.removed or splice.added else None


def _changed(before: Sequence[Item], items: Sequence[Item], splice: Splice | None) -> tuple[Item, ...]:
    """The way on by `_changes`."""
    known = {item.id: item for item in before} | {item.id: item for item in items}
    order = [item.id for item in before]
    if splice is not None:
        order[splice.start : splice.start + len(splice.removed)] = splice.added
    return tuple(known[i] for i in order)


def _shared(a: list[int], b: list[int]) -> int:
    """Length of the common beginning."""
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
