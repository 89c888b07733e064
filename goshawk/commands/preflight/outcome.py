"""What came out of a preflight: the result, what it asks of the next plan, and the worst flights."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import preflight
import vehicle
from flight import FloatArray
from goshawk.commands.plan.preflown import PLAN_AGAIN
from goshawk.commands.preflight import home
from goshawk.commands.preflight.inputs import Subject
from planner import LocalMargin
from planner.gate import gate
from planner.request import local_margins, space
from preflight import margins, slower

_SAMPLES, _POINTS = 49, 7
"""Of a segment: for the room that the plan has in it, and for where a margin is to be kept."""
_BY_THE_WAY_M, _LEAST_M = 0.006, 0.001
"""What a waypoint has beyond the margin that is asked for there, so that a path to it exists; and the least margin."""
RESERVE = 0.3
"""Share of the battery that a flight is to leave."""
_SAME_M = 0.01
"""Joins that come so near to a waypoint are as good as the nearest: a later lap passes it too."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """A result, beside what it is about."""

    subject: Subject
    result: preflight.Result
    replay: preflight.Replay | None = None
    """None: not flown again."""
    advice: preflight.Advice | None = None
    """None: not asked for, or not found before Ctrl-C."""
    ways_home: tuple[home.WayHome, ...] | None = None
    """Found with the advice, or before Ctrl-C; None: not looked for."""
    carried_j: float | None = None
    """Mechanical energy of the battery at the rotors; None: not given."""

    @property
    def assumed(self) -> tuple[str, ...]:
        """Sentences on what nobody told, and on what map and flights did."""
        return (*self.result.assumed, *self.subject.said)

    @property
    def shown(self) -> preflight.Replay:
        """The flights that were flown again, which are not for a page without them."""
        assert self.replay is not None
        return self.replay

    @cached_property
    def plan_again(self) -> dict[str, Any] | None:
        """The margins and speeds to plan with so that fewer flights are lost; None if neither would help.

        Where flights touch, a margin near that segment: the room that the plan has there, and what they are short of.
        Where they are given up, the plan's margin, which the controller allows them, and more. What was asked of the
        plan that was flown is kept. Where no room helps and they overturn, a speed for the leg between two waypoints.
        """
        of = self.subject
        near, segments = self._roomier
        slowed = () if segments else slower.needed(of.scenario, self.result, of.options)
        legs = _leg_speeds(of, slowed)
        if not segments and not any(leg["slowed"] for leg in legs):
            return None
        asked = gate.options_of(of.item)
        everywhere_m = max((of.margin_m + each.extra_m for each in segments if not each.touching), default=0.0)
        return {
            "margin_m": _millimetres(max(everywhere_m, asked.margin_m)),
            "near": [each.as_dict() for each in (*asked.local_margins, *near)],
            "legs": legs,
            "segments": [each.as_dict() for each in segments],
            "slower": [each.as_dict() for each in slowed],
        }

    @cached_property
    def _needed(self) -> tuple[tuple[margins.Needed, LocalMargin | int | None], ...]:
        """More room by segment, with the margin near it or the waypoint that is in its way; None: of all the plan."""
        of = self.subject
        found = margins.needed(of.scenario, self.result, of.options)
        return tuple((each, _margin_near(of, each) if each.touching else None) for each in found)

    @property
    def _roomier(self) -> tuple[list[LocalMargin], list[margins.Needed]]:
        """The margins near segments, and the segments that are to have more room at all."""
        near = [margin for _, margin in self._needed if isinstance(margin, LocalMargin)]
        return near, [each for each, margin in self._needed if not isinstance(margin, int)]

    @property
    def narrow_waypoints(self) -> list[int]:
        """Waypoints that leave a segment where flights touch no more room than it has."""
        return sorted({margin for _, margin in self._needed if isinstance(margin, int)})

    def as_dict(self) -> dict[str, Any]:
        """The whole outcome."""
        of, replay = self.subject, self.replay
        found = self.result.as_dict() | {
            "trajectory": of.item.name,
            "map_hash": of.area.hash,
            "vehicle": of.vehicle.name,
            "vehicle_hash": vehicle.vehicle_hash(of.vehicle),
            "seed": of.options.seed,
            "assumed": list(self.assumed),
            PLAN_AGAIN: self.plan_again,
            "narrow_waypoints": self.narrow_waypoints,
            "worst": [] if replay is None else [track.as_dict(of.item.trajectory) for track in replay.worst],
        }
        return found if self.advice is None and self.ways_home is None else found | {"advice": self._advised()}

    def _advised(self) -> dict[str, Any]:
        """What was found until Ctrl-C."""
        told = {} if self.advice is None else self.advice.as_dict()
        ways = self.ways_home
        return told | {
            "battery_j": self.battery_j,
            "ways_home": None if ways is None else [way.as_dict() for way in ways],
            "last_way_home_s": None if ways is None else home.last_s(ways),
            "carried_j": self.carried_j,
            "no_return_s": None if ways is None or not self.carried_j else home.no_return_s(ways, self._usable_j),
            "no_return": self._no_return().get("no return"),
        }

    @property
    def _usable_j(self) -> float:
        """Of the battery that is carried, but for the reserve."""
        return (1.0 - RESERVE) * (self.carried_j or 0.0)

    @property
    def battery_j(self) -> float | None:
        """Mechanical energy of a battery of which 99 % of the flights leave `RESERVE`, by the longest way home too.

        None where too few flights come to the end to tell.
        """
        flown_j = home.energy_j(self.result)
        if flown_j is None:
            return None
        return max([flown_j, *(way.energy_j or 0.0 for way in self.ways_home or ())]) / (1.0 - RESERVE)

    def advice_words(self) -> dict[str, str]:
        """What was found with the advice, by what it is about; empty where there is none."""
        if self.advice is None and self.ways_home is None:
            return {}
        battery_j, ways = self.battery_j, self.ways_home
        left = f"of which 99 % of flights leave {100.0 * RESERVE:.0f} %"
        few = f"not known: only {100.0 * self.result.finished:.0f} % of flights come to the end"
        return {
            **({} if self.advice is None else {"advice": self.advice.sentence()}),
            "battery": few if battery_j is None else f"{battery_j / 3600.0:.2f} Wh at the rotors, {left}",
            "way home": home.GROUNDED if ways is None else home.sentence(ways),
            **self._no_return(),
        }

    def _no_return(self) -> dict[str, str]:
        if self.carried_j is None or self.ways_home is None:
            return {}
        of = f"on {self.carried_j / 3600.0:.2f} Wh at the rotors, {100.0 * RESERVE:.0f} % of them kept"
        return {"no return": f"{home.no_return(self.ways_home, self._usable_j, home.energy_j(self.result))} ({of})"}


def _margin_near(of: Subject, needed: margins.Needed) -> LocalMargin | int:
    """The margin to keep near a segment, no more than the waypoints there have; the waypoint that has no more than the
    segment has now."""
    positions = of.item.trajectory.position(np.linspace(needed.from_s, needed.to_s, _SAMPLES))
    line = positions[:: (_SAMPLES - 1) // (_POINTS - 1)]
    now_m = float(np.min(_room_m(of, positions)))
    margin_m = now_m + needed.extra_m
    points = of.item.waypoints_world_m
    asked_m = gate.options_of(of.item).margin_m
    reach_m = local_margins.reach_m(max(margin_m - asked_m, 0.0), asked_m + of.radius_m)
    near = np.flatnonzero(space.far_from(line, points) < reach_m)
    rooms_m = _room_m(of, points[near]) - _BY_THE_WAY_M
    if near.size and rooms_m.min() < now_m + _LEAST_M:
        return int(near[rooms_m.argmin()])
    margin_m = max(min(margin_m, float(rooms_m.min(initial=np.inf))), _LEAST_M)
    polyline = tuple((float(x), float(y), float(z)) for x, y, z in line)
    return LocalMargin(_millimetres(margin_m), polyline, _millimetres(reach_m))


def _leg_speeds(of: Subject, slowed: tuple[slower.Slower, ...]) -> list[dict[str, Any]]:
    """Largest speeds of legs of the plan, by where they begin and end: of those to be slowed, and that were asked for.

    Not of the climb and the descent between waypoint and ground, of which none can be asked.
    """
    asked, path, points = gate.asked_of(of.item), of.item.trajectory, of.item.waypoints_world_m
    legs = len(points) - 1
    before = asked.leg_speed_m_s
    speeds = np.full(legs, np.inf) if before is None else np.where(np.isfinite(before), before, np.inf)
    passed_s, slow = _passed_s(of), np.zeros(legs, dtype=np.bool_)
    for each in slowed:
        leg = int(np.clip(np.searchsorted(passed_s, 0.5 * (each.from_s + each.to_s)) - 1, 0, legs - 1))
        times_s = np.linspace(each.from_s, each.to_s, _SAMPLES)
        top_m_s = float(np.linalg.norm(path.position(times_s, 1), axis=1).max())
        speeds[leg], slow[leg] = min(speeds[leg], top_m_s / each.factor), True
    grounds = () if asked.ground_world_m is None else asked.ground_world_m
    grounded = {end for end in (0, legs) for ground in grounds if np.allclose(points[end], ground, atol=1e-6)}
    return [
        {
            "from_world_m": points[leg].tolist(),
            "to_world_m": points[leg + 1].tolist(),
            "speed_m_s": round(float(speeds[leg]), 3),
            "slowed": bool(slow[leg]),
        }
        for leg in np.flatnonzero(np.isfinite(speeds)).tolist()
        if not grounded & {leg, leg + 1}
    ]


def _passed_s(of: Subject) -> FloatArray:
    """(n,) when each waypoint is passed: at a join of the trajectory, in their order."""
    joins_s, points = of.item.trajectory.starts_s, of.item.waypoints_world_m
    at, found = of.item.trajectory.position(joins_s), [0]
    for number, point in enumerate(points[1:], start=1):
        last = len(joins_s) - (len(points) - 1 - number)
        away_m = np.linalg.norm(at[found[-1] + 1 : last] - point, axis=1)
        found.append(found[-1] + 1 + int(np.argmax(away_m <= away_m.min() + _SAME_M)))
    return joins_s[found]


def _room_m(of: Subject, points_world_m: FloatArray) -> FloatArray:
    """(n,) beyond the vehicle's sphere."""
    return space.distance(of.area.field, points_world_m) - of.radius_m


def _millimetres(value_m: float) -> float:
    """Up to a whole millimetre."""
    return math.ceil(1e3 * value_m) / 1e3
