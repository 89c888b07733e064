"""Plans on from the last answer where one waypoint changed, else from scratch; drafts while one is dragged."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np

import planner
from flight import FloatArray
from gcs_web.document import missions
from gcs_web.document.document import Content, Point
from planner.request.space import DistanceField
from vehicle import Vehicle


class Known(NamedTuple):
    """What a plan depends on beside the document."""

    field: DistanceField
    vehicle: Vehicle
    options: planner.PlanOptions


@dataclass(frozen=True, slots=True, eq=False)
class _Kept:
    """A session of the planner, and the document that its plan answers."""

    content: Content
    known: Known
    session: planner.Planner


class Replanner:
    """One plan at a time; `draft` and `cancel` may be called from another thread meanwhile."""

    def __init__(self) -> None:
        self._kept: _Kept | None = None
        self._flag = planner.StopFlag()

    def begin(self) -> None:
        """Before each `plan`: a `cancel` from now on is meant for it."""
        self._flag = planner.StopFlag()

    def plan(self, content: Content, known: Known, *, afresh: bool = False) -> planner.Plan:
        """
        Args:
            afresh: from scratch in any case.

        Raises:
            PlanCancelledError: `cancel` was called.
            FlightError: as `planner.mission.plan`.
        """
        flag = self._flag
        mission = missions.mission_of(content)
        asked = planner.mission.conditions(mission)
        of_parts = mission.laps is not None or planner.mission.of_parts(mission)
        if of_parts or mission.keep_in is not None:
            self._kept = None
            return planner.mission.plan(mission, known.field, known.vehicle, known.options, stop=flag)
        kept = self._kept
        step = None if afresh or kept is None else _step(kept, content, known)
        if kept is None or step is None:
            options = planner.mission.with_yaw(known.options, mission)
            session = planner.Planner(
                mission.waypoints, known.field, known.vehicle, options, conditions=asked, stop=flag
            )
            self._kept = _Kept(content, known, session)
            return session.plan
        plan = step(kept.session, flag)
        self._kept = _Kept(content, known, kept.session)
        return plan

    def draft(self, waypoint: int, position_world_m: FloatArray) -> planner.Draft | None:
        """The last plan with one waypoint (id) moved, not checked.

        Returns None where the last plan has no such waypoint, or is a mission's of several paths.

        Raises:
            InputError: no path can reach the waypoint there.
        """
        kept = self._kept
        if kept is None or all(point.id != waypoint for point in kept.content.points):
            return None
        return kept.session.draft(kept.content.number_of(waypoint), position_world_m)

    def foresee(self, waypoint: int, position_world_m: FloatArray) -> planner.Plan | None:
        """The checked plan that moving this waypoint would give; the last plan stays. None as from `draft`.

        Raises as `plan`.
        """
        kept, flag = self._kept, self._flag
        if kept is None or all(point.id != waypoint for point in kept.content.points):
            return None
        return kept.session.foresee(kept.content.number_of(waypoint), position_world_m, stop=flag)

    def cancel(self) -> None:
        """End the plan that is worked on, if there is one."""
        self._flag.set()


_Step = Callable[[planner.Planner, planner.StopFlag], planner.Plan]


def _step(kept: _Kept, after: Content, known: Known) -> _Step | None:
    """The one edit of the planner's session that leads to the document; None if there is none."""
    before = kept.content
    same = known.field is kept.known.field and known.vehicle is kept.known.vehicle
    if not same or known.options != kept.known.options or before.settings != after.settings:
        return None
    old, new = before.points, after.points
    if len(old) == len(new):
        changed = [i for i, (a, b) in enumerate(zip(old, new, strict=True)) if a != b]
        if not changed:
            return lambda session, _: session.plan
        i = changed[0]
        moved = msgspec.structs.replace(old[i], position_world_m=new[i].position_world_m) == new[i]
        if len(changed) > 1 or not moved:
            return None
        return lambda session, stop: session.move(i, np.array(new[i].position_world_m), stop=stop)
    i = _first_difference(old, new)
    inner = 0 < i < max(len(old), len(new)) - 1
    plain = all(point.plain for point in (*old, *new))
    if _without(new, i) == old:
        if not (plain or (inner and new[i].plain and old[i - 1].legs_plain)):
            return None  # the session would give the limits of the leg that it parts to both parts
        asked = new[i].yaw_rad
        yaw_rad = math.nan if asked is None else asked
        return lambda session, stop: session.insert(i, np.array(new[i].position_world_m), yaw_rad, stop=stop)
    if _without(old, i) == new and (plain or (inner and old[i].legs_plain)):
        return lambda session, stop: session.delete(i, stop=stop)
    return None


def _first_difference(a: tuple[Point, ...], b: tuple[Point, ...]) -> int:
    return next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))


def _without(points: tuple[Point, ...], index: int) -> tuple[Point, ...]:
    return points[:index] + points[index + 1 :]
