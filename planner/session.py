"""A plan that changes step by step: what an edit does not touch is kept, and what the gate found of it.

An edit replaces the knots of the legs it touches, optimises them with a few neighbours while all else keeps its state,
and asks the gate, which looks again only at segments that changed. What cannot be done in this way is planned from
scratch, so the answer is always a plan that has passed the gate.
"""

import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flight import FloatArray, InputError, Waypoints, portable
from planner import drafting, planning
from planner._planner import StopFlag
from planner.curve import minimum_snap
from planner.drafting import Draft
from planner.gate import gate
from planner.optimise import fastest
from planner.planning import Plan
from planner.request import inputs, space
from planner.request.conditions import Conditions, may_move
from planner.request.inputs import Request
from planner.request.options import PlanOptions, check_stop
from vehicle import Limits, Vehicle


@dataclass(frozen=True, slots=True, eq=False)
class _Leg:
    """Knot states of a leg (n, 4, 4), the waypoints at its ends among them, and the durations between them (n - 1,)."""

    states: FloatArray
    durations_s: FloatArray
    drawn: bool
    """Whether it is the leg before the edit, drawn along; else only the places of its knots are known."""


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """A finished plan, and how it came about."""

    path: fastest.Path
    plan: Plan


class Planner:
    """Waypoints that are moved, inserted and deleted, always with a checked plan.

    One edit works at a time. An edit from another thread ends the one that works (`PlanCancelledError` there), as do
    `cancel` and the flag that an edit was given to `stop` it; the plan then is the last one that was finished.
    """

    def __init__(
        self,
        waypoints: Waypoints,
        field: space.DistanceField,
        vehicle: Vehicle,
        options: PlanOptions | None = None,
        *,
        conditions: Conditions | None = None,
        stop: StopFlag | None = None,
    ) -> None:
        """Plans from scratch, until it is told to `stop` from another thread. Raises as `planner.plan`."""
        asked = Conditions() if conditions is None else conditions
        self._field, self._vehicle = field, vehicle
        self._options = inputs.options_for(vehicle, options)
        self._stop = StopFlag() if stop is None else stop
        self._flags, self._working, self._swap = threading.Lock(), threading.Lock(), threading.Lock()
        self._foreseen: _Answer | None = None
        """Of a move from the plan as it is."""
        self._accept(self._scratch(waypoints, asked, self._options, self._stop))
        self._stop = StopFlag()
        self._room = self._conditions.room(self._options.roomier(field), self._options)

    @property
    def plan(self) -> Plan:
        """The last finished plan."""
        return self._plan

    def move(self, index: int, position_world_m: ArrayLike, *, stop: StopFlag | None = None) -> Plan:
        """Move one waypoint. Raises as `planner.plan`; the plan then stays what it was."""
        with self._edit(stop) as stop:
            return self._accept(self._moved(index, position_world_m, stop))

    def foresee(self, index: int, position_world_m: ArrayLike, *, stop: StopFlag | None = None) -> Plan:
        """The plan that `move` would give, which then is at hand at once. Raises as `move`; the plan stays."""
        with self._edit(stop) as stop:
            self._foreseen = self._moved(index, position_world_m, stop)
            return self._foreseen.plan

    def insert(
        self, index: int, position_world_m: ArrayLike, yaw_rad: float = np.nan, *, stop: StopFlag | None = None
    ) -> Plan:
        """Insert a waypoint, of which nothing is asked but a heading, so that it gets this index.

        Both legs beside it keep the speed asked for on the leg that it parts. Raises as `planner.plan`.
        """
        with self._edit(stop) as stop:
            old = self._plan.waypoints
            if not 0 <= index <= len(old.yaw_rad):
                raise InputError(f"a waypoint cannot get number {index}; there are {len(old.yaw_rad)}")
            points = np.insert(old.positions_world_m, index, _point(position_world_m), axis=0)
            new = Waypoints(points, np.insert(old.yaw_rad, index, yaw_rad))
            inside = 0 < index < len(old.yaw_rad)
            asked = self._conditions.inserted(index)
            old_legs = (index - 1, index) if inside else None
            return self._accept(self._changed(new, asked, old_legs, (index - 1, index + 1), stop))

    def delete(self, index: int, *, stop: StopFlag | None = None) -> Plan:
        """Delete a waypoint and what is asked there; the leg that two become has the lower one of their speeds.

        Raises as `planner.plan`.
        """
        with self._edit(stop) as stop:
            old = self._waypoint(index)
            new = Waypoints(np.delete(old.positions_world_m, index, axis=0), np.delete(old.yaw_rad, index))
            inside = 0 < index < len(new.yaw_rad)
            asked = self._conditions.deleted(index)
            old_legs = (index - 1, index + 1) if inside else None
            return self._accept(self._changed(new, asked, old_legs, (index - 1, index), stop))

    def limit(self, bounds: Limits) -> Plan:
        """Plan within other limits. Raises as `planner.plan`."""
        with self._edit() as stop:
            options, waypoints = replace(self._options, limits=bounds), self._plan.waypoints
            plan = self._accept(self._scratch(waypoints, self._conditions, options, stop))
            self._options = options
            return plan

    def settle(self) -> Plan:
        """Plan the waypoints as they are from scratch: after many edits, a little faster. Raises as `planner.plan`."""
        with self._edit() as stop:
            return self._accept(self._scratch(self._plan.waypoints, self._conditions, self._options, stop))

    def draft(self, index: int, position_world_m: ArrayLike) -> Draft:
        """What the path would look like with one waypoint moved: quick, and checked by nothing. The plan stays.

        Raises:
            InputError: no path can reach the waypoint there.
        """
        with self._swap:
            path, conditions, before = self._path, self._conditions, self._waypoint(index)
        points = before.positions_world_m.copy()
        points[index] = _point(position_world_m)
        after = Waypoints(points, before.yaw_rad)
        inputs.check_waypoints(after, self._field, self._options.waypoint_clearance_m)
        conditions.check_inside(points)
        return drafting.draft(path, index, before, after, self._room, self._vehicle, self._options, conditions)

    def cancel(self) -> None:
        """End the edit that works, if there is one."""
        with self._flags:
            self._stop.set()

    @contextmanager
    def _edit(self, stop: StopFlag | None = None) -> Generator[StopFlag]:
        """One edit at a time: tells the one before to stop, and waits for it."""
        stop = StopFlag() if stop is None else stop
        with self._flags:
            self._stop.set()
            self._stop = stop
        with self._working:
            check_stop(stop)
            try:
                yield stop
            finally:
                with self._flags:
                    if self._stop is stop:  # it may be the caller's, for whom it is not ours to set any more
                        self._stop = StopFlag()

    def _waypoint(self, index: int) -> Waypoints:
        waypoints = self._plan.waypoints
        if not 0 <= index < len(waypoints.yaw_rad):
            raise InputError(f"there is no waypoint {index + 1}; there are {len(waypoints.yaw_rad)}")
        return waypoints

    def _scratch(self, waypoints: Waypoints, asked: Conditions, options: PlanOptions, stop: StopFlag) -> _Answer:
        path, route = planning.from_scratch(waypoints, self._field, self._vehicle, options, asked, stop)
        return self._answer(path, route.points, waypoints)

    @staticmethod
    def _answer(path: fastest.Path, route_world_m: FloatArray, waypoints: Waypoints) -> _Answer:
        return _Answer(path, planning.of_path(path, waypoints, route_world_m))

    def _accept(self, answer: _Answer) -> Plan:
        path, self._foreseen = answer.path, None
        with self._swap:
            self._path, self._conditions, self._plan = path, path.report.conditions, answer.plan
        return answer.plan

    def _moved(self, index: int, position_world_m: ArrayLike, stop: StopFlag) -> _Answer:
        old, foreseen = self._waypoint(index), self._foreseen
        points = old.positions_world_m.copy()
        points[index] = _point(position_world_m)
        if foreseen is not None and np.array_equal(foreseen.plan.waypoints.positions_world_m, points):
            return foreseen
        first, last = max(index - 1, 0), min(index + 1, len(points) - 1)
        new = Waypoints(points, old.yaw_rad)
        return self._changed(new, self._conditions, (first, last), (first, last), stop)

    def _changed(
        self, waypoints: Waypoints, asked: Conditions, old: tuple[int, int] | None, new: tuple[int, int], stop: StopFlag
    ) -> _Answer:
        """Plan for waypoints of which those from `new[0]` to `new[1]` take the place of `old[0]` to `old[1]`.

        `old` is None where the path begins or ends elsewhere: then it is planned from scratch.
        """
        path = None
        if old is not None and self._path.kept is not None:
            request = inputs.admitted(waypoints, self._field, self._vehicle, self._options, asked, stop)
            path = self._mended(request, old, new)
        if path is None or not path.report.passed or path.kept is None:
            return self._scratch(waypoints, asked, self._options, stop)
        return self._answer(path, path.kept.spline.states[:, 0, :3], waypoints)

    def _mended(self, request: Request, old: tuple[int, int], new: tuple[int, int]) -> fastest.Path | None:
        """The last path with new legs, optimised again near them; None if that does not keep clear of obstacles."""
        kept, number, waypoints = self._path.kept, self._path.waypoint, request.waypoints
        assert kept is not None
        first, last = (int(np.flatnonzero(number == i)[0]) for i in old)
        points = self._points(waypoints, old, new)
        legs = [self._leg(waypoints, points, leg, old, new) for leg in range(*new)]
        if any(leg is None for leg in legs):
            return None
        legs = [leg for leg in legs if leg is not None]
        states = np.concatenate([legs[0].states[:1], *(leg.states[1:] for leg in legs)])
        index = np.full(len(states), -1)
        index[np.cumsum([0, *(len(leg.durations_s) for leg in legs)])] = np.arange(new[0], new[1] + 1)
        durations = np.concatenate([leg.durations_s for leg in legs])
        after = np.where(number[last + 1 :] < 0, -1, number[last + 1 :] + new[1] - old[1])
        for place, there in ((0, first), (-1, last)):
            states[place, 1:] = kept.spline.states[there, 1:]
        spline = minimum_snap.Spline(
            np.concatenate([kept.spline.durations_s[:first], durations, kept.spline.durations_s[last:]]),
            np.concatenate([kept.spline.states[:first], states, kept.spline.states[last + 1 :]]),
        )
        waypoint = np.concatenate([number[:first], index, after])
        at_knots = request.conditions.at_knots(waypoints.positions_world_m, waypoint, request.limits)
        gates = at_knots["gates"]
        if gates is not None and kept.problem.gates is not None:  # openings beside gates (`one_way`) are no waypoints
            here, before = np.arange(len(waypoint)), np.arange(len(number))
            for there, was in ((here < first, before < first), (here >= first + len(index), before > last)):
                gates[there & (waypoint < 0)] = kept.problem.gates[was & (number < 0)]
        moves = (index < 0) | may_move(at_knots, len(waypoint))[first : first + len(index)]
        free = np.repeat(moves[:, None], 4, axis=1)
        free[:, 3] = (index < 0) | np.isnan(waypoints.yaw_rad[index])
        problem = replace(
            kept.problem,
            knots=spline.states[:, 0],
            free=np.concatenate([kept.problem.free[:first], free, kept.problem.free[last + 1 :]]),
            **at_knots,
        )
        wrong = np.zeros(len(spline.durations_s), dtype=bool)
        wrong[first : first + len(durations)] = True
        used = self._path.report.usage
        return fastest.until_flyable(
            problem,
            spline,
            waypoint,
            replace(request, field=self._room),
            partial(gate.judge, request),
            wrong=wrong,
            drawn=all(leg.drawn for leg in legs),
            corrections=kept.corrections.spliced(first, last, len(durations)),
            used=None if used is None else (self._path.trajectory, used),
        )

    def _points(self, waypoints: Waypoints, old: tuple[int, int], new: tuple[int, int]) -> FloatArray:
        """(n, 3) where the path passes waypoints `new[0]` to `new[1]` to begin with.

        As far beside one as it did before the edit, within its radius or in the plane of its gate.
        """
        kept, number, before = self._path.kept, self._path.waypoint, self._plan.waypoints.positions_world_m
        assert kept is not None
        points = waypoints.positions_world_m.copy()
        same = zip(range(*new), range(*old), strict=True) if old == new else [(new[0], old[0])]
        for here, there in [*same, (new[1], old[1])]:
            knot = int(np.flatnonzero(number == there)[0])
            points[here] += kept.spline.states[knot, 0, :3] - before[there]
        return points

    def _leg(
        self, waypoints: Waypoints, points: FloatArray, leg: int, old: tuple[int, int], new: tuple[int, int]
    ) -> _Leg | None:
        """Knots and durations to start from between waypoints `leg` and `leg + 1`, passed at `points` (n, 3).

        Those of the leg before the edit, drawn along with its ends, if they still go round what they went round; else a
        straight line; None if something is in its way.
        """
        kept = self._path.kept
        assert kept is not None
        a, b = points[[leg, leg + 1]]
        straight, pieces = self._free(np.stack([a, b])), self._options.pieces
        if old == new:
            first, last = _leg_knots(self._path.waypoint, leg) or (0, 0)
            states, T = kept.spline.states[first : last + 1].copy(), kept.spline.durations_s[first:last]
            knots, share = states[:, 0], np.linspace(0.0, 1.0, len(states))[:, None]
            before_m = portable.length(knots[-1, :3] - knots[0, :3])
            knots[:, :3] += (1.0 - share) * (a - knots[0, :3]) + share * (b - knots[-1, :3])
            if straight == (len(T) <= pieces) and (straight or self._free(knots[:, :3])):
                longer = np.clip(portable.length(b - a) / max(before_m, 1e-9), 0.5, 3.0)
                return _Leg(states, T * longer, drawn=True)
        if not straight:
            return None
        start, end = (np.append(p, self._yaw_at(leg + n, waypoints, old, new)) for n, p in enumerate((a, b)))
        frame = kept.problem.airframe
        pace = 0.5 * min(frame.speed_m_s, frame.acceleration_m_s2)
        duration = max(float(portable.length(b - a)) / pace, 0.1)
        states = np.zeros((pieces + 1, 4, 4))
        states[:, 0] = np.linspace(start, end, pieces + 1)
        return _Leg(states, np.full(pieces, duration / pieces), drawn=False)

    def _yaw_at(self, waypoint: int, waypoints: Waypoints, old: tuple[int, int], new: tuple[int, int]) -> float:
        """The heading to start from at a waypoint: as it was, or halfway; the one asked for, up to whole turns."""
        kept, number = self._path.kept, self._path.waypoint
        assert kept is not None
        around = [float(kept.spline.states[np.flatnonzero(number == i)[0], 0, 3]) for i in old]
        near = around[0] if waypoint == new[0] else around[1] if waypoint == new[1] else 0.5 * sum(around)
        asked = waypoints.yaw_rad[waypoint]
        if np.isnan(asked) or waypoint in new:
            return near
        return float(asked + 2.0 * np.pi * np.round((near - asked) / (2.0 * np.pi)))

    def _free(self, points: FloatArray) -> bool:
        required = self._options.planned_clearance_m
        return all(line.free for line in space.check_lines(self._room, points[:-1], points[1:], required))


def _point(position_world_m: ArrayLike) -> FloatArray:
    try:
        point = np.asarray(position_world_m, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"a position is three numbers x, y, z in metres, not {position_world_m!r}") from None
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(f"a position is three finite numbers x, y, z in metres, not {point.tolist()}")
    return point


def _leg_knots(waypoint: np.ndarray, leg: int) -> tuple[int, int] | None:
    """Knots at the ends of a leg; None if there is no such leg."""
    ends = [np.flatnonzero(waypoint == i) for i in (leg, leg + 1)]
    return (int(ends[0][0]), int(ends[1][0])) if leg >= 0 and all(len(end) for end in ends) else None
