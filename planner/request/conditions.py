"""What may be asked of a path besides its waypoints: motion at ends and waypoints, gates, speeds and jerks of legs, a
tube."""

from dataclasses import dataclass, fields, replace
from typing import Any, TypedDict

import numpy as np

from flight import FloatArray, FormatError, InputError, portable
from flight.mission import SLIMMEST_M
from planner.request import space
from planner.request.options import PlanOptions
from vehicle import Limits

OF_LEGS = ("leg_speed_m_s", "leg_jerk_m_s3")
"""Conditions with a number for each leg."""
_INSIDE = 0.97
"""Share of a radius or opening that the optimiser uses: it charges what is outside, and so stays a little outside."""
_TOUCHING_M = 0.03
"""How far inside a tube waypoints must lie: a little more than the planner keeps from its surface."""
_MOST_RADII = 25_000.0
"""Length of the longest tube, in radii: the space round it is sampled."""
_PROVABLE = 0.985
"""Share of a leg's speed or jerk that the optimiser uses: the gate's bound is at most 1 % above the truth."""


class AtKnots(TypedDict):
    """What the optimiser keeps at k + 1 knots and on the k segments between them; None where nothing is asked for."""

    velocity: FloatArray | None
    """(k + 1, 4) velocity and yaw rate, NaN where open."""
    balls: FloatArray | None
    """(k + 1, 4) centre and radius of the ball that each knot may move in, 0 for none."""
    gates: FloatArray | None
    """(k + 1, 3, 3) centre and half edges of the opening in whose plane each knot may move, zero edges for none."""
    speed_m_s: FloatArray | None
    """(k,) largest speed, such that the gate proves the one asked for."""
    jerk_m_s3: FloatArray | None
    """(k,) the same of jerk."""


@dataclass(frozen=True, slots=True, eq=False)
class Conditions:
    """Conditions at the ends, the waypoints and on the legs; at rest at both ends and else nothing by default."""

    start: FloatArray | None = None
    """(3, 4) velocity, acceleration and jerk of x, y, z and yaw at the first waypoint; None: at rest."""
    end: FloatArray | None = None
    """The same at the last waypoint."""
    velocity_world_m_s: FloatArray | None = None
    """(n, 3) velocity at each inner waypoint, where the heading then is steady; rows of NaN are open."""
    leg_speed_m_s: FloatArray | None = None
    """(n - 1,) largest speed on the leg after each waypoint; NaN: the vehicle's own limit."""
    leg_jerk_m_s3: FloatArray | None = None
    """(n - 1,) the same of jerk."""
    fly_by_m: FloatArray | None = None
    """(n,) radius of the ball round an inner waypoint that is enough to pass; 0: the waypoint itself."""
    gate_edges_m: FloatArray | None = None
    """(n, 2, 3) from an inner waypoint to the middle of the left and of the upper edge of the opening round it that is
    passed along their cross product; zero: no gate (`flight.mission.Gate`)."""
    keep_in_world_m: FloatArray | None = None
    """(m, 3) polyline in the middle of a tube that the path stays in, and"""
    keep_in_radius_m: FloatArray | float | None = None
    """its radius."""
    stay_s: FloatArray | None = None
    """(n,) least time to hover at each waypoint; a single path has none, a mission may (`planner.mission`)."""
    ground_world_m: FloatArray | None = None
    """(m, 3) where the vehicle's centre is while it stands on the ground. Vertically above, the required clearance
    grows with height from what there is at the ground; a single path has none."""

    @property
    def given_motion(self) -> bool:
        """Whether any velocity is prescribed, so that the path cannot be flown at another pace."""
        inner = self.velocity_world_m_s
        return self.start is not None or self.end is not None or (inner is not None and bool(np.isfinite(inner).any()))

    @property
    def leg_limits(self) -> bool:
        """Whether a leg has limits of its own."""
        return any(getattr(self, name) is not None for name in OF_LEGS)

    def checked(self, count: int, limits: Limits) -> "Conditions":
        """These conditions for `count` waypoints, as float arrays.

        Raises:
            InputError: a shape does not fit, a number makes no sense, or a velocity is beyond a limit; it is named.
        """
        if self.stay_s is not None or self.ground_world_m is not None:
            raise InputError("a single path does not stay, take off or land; plan it as a mission")
        given = self.shaped(count)
        for name in ("start", "end"):
            _check_end(name, getattr(given, name), limits, given.leg_jerk_m_s3)
        _check_legs(given)
        _check_velocities(given.velocity_world_m_s, given.leg_speed_m_s, limits)
        _check_fly_by(given.fly_by_m, given.velocity_world_m_s)
        _check_gates(given)
        return given

    def shaped(self, count: int) -> "Conditions":
        """These conditions as float arrays.

        Raises:
            InputError: a shape does not fit that many waypoints.
        """
        shapes = {
            "start": (3, 4),
            "end": (3, 4),
            "velocity_world_m_s": (count, 3),
            "leg_speed_m_s": (count - 1,),
            "leg_jerk_m_s3": (count - 1,),
            "fly_by_m": (count,),
            "gate_edges_m": (count, 2, 3),
            "keep_in_radius_m": (),
            "stay_s": (count,),
        }
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {name: None if v is None else np.asarray(v, dtype=np.float64) for name, v in given.items()}
        for name, shape in shapes.items():
            found = arrays[name]
            if found is not None and found.shape != shape:
                raise InputError(f"{name}: expected shape {shape} for {count} waypoints, got {found.shape}")
        for name in ("ground_world_m", "keep_in_world_m"):
            points = arrays[name]
            if points is not None and (points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all()):
                raise InputError(f"{name}: expected finite points (m, 3), got shape {points.shape}")
        _check_keep_in(arrays["keep_in_world_m"], arrays["keep_in_radius_m"])
        return Conditions(**arrays)

    def inserted(self, index: int) -> "Conditions":
        """For one more inner or outer waypoint, which gets this index and of which nothing is asked.

        The two legs that it makes of one have that one's limits; a leg before the first or behind the last has none.
        """
        legs: dict[str, FloatArray] = {}
        for name, most in self._of_legs():
            here = most[index - 1] if 0 < index <= len(most) else np.nan
            legs[name] = np.insert(most, min(index, len(most)), here)
        rows = {name: np.insert(rows, index, nothing, axis=0) for name, nothing, rows in self._of_waypoints()}
        return replace(self, **legs, **rows)

    def deleted(self, index: int) -> "Conditions":
        """For one waypoint less; the leg that two become has the lower ones of their limits."""
        legs: dict[str, FloatArray] = {}
        for name, most in self._of_legs():
            legs[name] = np.delete(most, min(index, len(most) - 1))
            if 0 < index < len(most):
                legs[name][index - 1] = np.fmin(most[index - 1], most[index])
        rows = {name: np.delete(rows, index, axis=0) for name, _, rows in self._of_waypoints()}
        return replace(self, **legs, **rows)

    def _of_legs(self) -> list[tuple[str, FloatArray]]:
        """What is given with a number for each leg, NaN where it asks for nothing."""
        given = [(name, getattr(self, name)) for name in OF_LEGS]
        return [item for item in given if item[1] is not None]

    def _of_waypoints(self) -> list[tuple[str, float, FloatArray]]:
        """What is given with a row for each waypoint: its name, the number that asks for nothing, and the rows."""
        nothing = {"velocity_world_m_s": np.nan, "fly_by_m": 0.0, "gate_edges_m": 0.0, "stay_s": 0.0}
        given = [(name, asks, getattr(self, name)) for name, asks in nothing.items()]
        return [item for item in given if item[2] is not None]

    def at_knots(self, positions_world_m: FloatArray, waypoint: np.ndarray, limits: Limits) -> AtKnots:
        """What is asked for at knots, of which `waypoint` (k + 1,) says which waypoint each is, -1 for none.

        Args:
            positions_world_m: (n, 3) of the waypoints.
        """
        most, at = self.most_on_legs(waypoint), waypoint >= 0
        velocity, balls, gates, centres = None, None, None, positions_world_m[np.maximum(waypoint, 0)]
        if self.velocity_world_m_s is not None:
            velocity = np.full((len(waypoint), 4), np.nan)
            velocity[at, :3] = self.velocity_world_m_s[waypoint[at]]
            velocity[np.isfinite(velocity[:, 0]), 3] = 0.0
        if self.fly_by_m is not None:
            balls = np.column_stack([centres, np.where(at, _INSIDE * self.fly_by_m[waypoint], 0.0)])
        if self.gate_edges_m is not None:
            edges = np.where(at[:, None, None], _INSIDE * self.gate_edges_m[waypoint], 0.0)
            gates = np.concatenate([centres[:, None], edges], axis=1)
        speed, jerk = (_PROVABLE * most[name] for name in ("speed", "jerk"))
        return {
            "velocity": velocity,
            "balls": balls,
            "gates": gates,
            "speed_m_s": None if self.leg_speed_m_s is None else np.minimum(speed, limits.speed_m_s),
            "jerk_m_s3": None if self.leg_jerk_m_s3 is None else np.minimum(jerk, limits.largest_jerk_m_s3),
        }

    @property
    def tube(self) -> space.KeepIn | None:
        """The tube that the path stays in, if any."""
        if self.keep_in_world_m is None or self.keep_in_radius_m is None:
            return None
        return space.KeepIn(self.keep_in_world_m, float(self.keep_in_radius_m))

    def room(self, field: space.DistanceField, options: PlanOptions) -> space.DistanceField:
        """The field to plan in: inside the tube, if there is one."""
        return field if self.tube is None else space.Within(field, self.tube, options.clearance_m)

    def check_inside(self, points_world_m: FloatArray) -> None:
        """Refuse waypoints (n, 3) outside of the tube.

        Raises:
            InputError: one is, or touches its surface.
        """
        if self.tube is None:
            return
        inside = self.tube.distance(points_world_m)
        i = int(inside.argmin())
        if inside[i] < _TOUCHING_M:
            raise InputError(
                f"waypoint {i + 1} is {self.tube.radius_m - inside[i]:.2f} m from the line to keep in, whose tube has "
                f"a radius of {self.tube.radius_m:g} m; move the waypoint or widen the tube"
            )

    def most_on_legs(self, waypoint: np.ndarray) -> dict[str, FloatArray]:
        """(k,) by name of the limit what is asked for between knots (`at_knots`), infinite where nothing is."""
        return {"speed": _between(self.leg_speed_m_s, waypoint), "jerk": _between(self.leg_jerk_m_s3, waypoint)}

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; what is not asked for is left out, open numbers are None."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: np.where(
                np.isfinite(value), np.asarray(value).astype(object), np.array(None)
            ).tolist()  # JSON: no NaN
            for name, value in given.items()
            if value is not None
        }

    @classmethod
    def from_dict(cls, document: dict[str, Any], count: int) -> "Conditions":
        """What `as_dict` made, for `count` waypoints.

        Raises:
            FormatError: it was not made by `as_dict`, or not for so many waypoints.
        """
        try:
            found = cls(**{name: np.array(value, dtype=np.float64) for name, value in document.items()})
            return found.shaped(count)
        except (TypeError, ValueError, AttributeError, InputError) as error:
            raise FormatError(f"the conditions in a trajectory file are damaged: {error}") from error


def may_move(at: AtKnots, knots: int) -> np.ndarray:
    """(k + 1,) bool: whether a knot has a ball, or the opening of a gate, to move in."""
    free, balls, gates = np.zeros(knots, dtype=bool), at["balls"], at["gates"]
    if balls is not None:
        free |= balls[:, 3] > 0.0
    if gates is not None:
        free |= np.linalg.norm(gates[:, 1:], axis=(1, 2)) > 0.0
    return free


def _between(most: FloatArray | None, waypoint: np.ndarray) -> FloatArray:
    """(k,) limits of legs (n - 1,) between knots, infinite where there is none."""
    leg = np.maximum.accumulate(waypoint)[:-1]
    if most is None:
        return np.full(len(leg), np.inf)
    return np.where(np.isfinite(most), most, np.inf)[leg]


def _check_end(name: str, motion: FloatArray | None, limits: Limits, leg_jerk: FloatArray | None) -> None:
    if motion is None:
        return
    if not np.isfinite(motion).all():
        raise InputError(f"the {name}'s motion is not finite: {motion.tolist()}")
    leg = np.inf if leg_jerk is None else np.fmin(leg_jerk[0 if name == "start" else -1], np.inf)
    bounds = (limits.speed_m_s, "m/s"), (limits.acceleration_m_s2, "m/s2"), (min(limits.largest_jerk_m_s3, leg), "m/s3")
    for derivative, (most, unit) in zip(motion, bounds, strict=True):
        size = float(portable.length(derivative[:3]))
        if size > most:
            raise InputError(f"the {name} moves at {size:.3g} {unit}, limit {most:g}; lower it or raise the limit")


def _check_legs(asked: Conditions) -> None:
    for most, kind, unit in ((asked.leg_speed_m_s, "speed", "m/s"), (asked.leg_jerk_m_s3, "jerk", "m/s3")):
        wrong = [] if most is None else np.flatnonzero(most <= 0.0)
        if most is not None and len(wrong):
            i = int(wrong[0])
            raise InputError(
                f"the leg from waypoint {i + 1} to {i + 2} has a {kind} of {most[i]:g} {unit}; give it some"
            )


def _check_velocities(velocity: FloatArray | None, leg_speed: FloatArray | None, limits: Limits) -> None:
    if velocity is None:
        return
    if np.isfinite(velocity[[0, -1]]).any():
        raise InputError("a velocity at the first or last waypoint is given as `start` or `end`")
    broken = np.isfinite(velocity).any(axis=1) & ~np.isfinite(velocity).all(axis=1)
    if broken.any():
        raise InputError(f"the velocity at waypoint {int(np.argmax(broken)) + 1} is not finite in every axis")
    for i in np.flatnonzero(np.isfinite(velocity[:, 0])):
        size = float(portable.length(velocity[i]))
        if size > limits.speed_m_s:
            raise InputError(
                f"waypoint {i + 1} is to be passed at {size:.3g} m/s, limit {limits.speed_m_s:g}; "
                "lower it or raise the limit"
            )
        legs = [] if leg_speed is None else [j for j in (i - 1, i) if leg_speed[j] < size]
        if legs:
            raise InputError(
                f"waypoint {i + 1} is to be passed at {size:.3g} m/s, but the leg from waypoint {legs[0] + 1} is flown "
                f"at {leg_speed[legs[0]] if leg_speed is not None else 0.0:.3g} m/s at most; change one of the two"
            )


def _check_fly_by(radius: FloatArray | None, velocity: FloatArray | None) -> None:
    if radius is None:
        return
    wrong = np.flatnonzero(~((radius >= 0.0) & (radius < 100.0)))
    if wrong.size:
        i = int(wrong[0])
        raise InputError(f"waypoint {i + 1} is to be passed within {radius[i]:g} m; that must be from 0 to 100 m")
    if (radius[[0, -1]] > 0.0).any():
        raise InputError("the first and last waypoint are met exactly; give the radius to inner waypoints")
    both = np.flatnonzero((radius > 0.0) & np.isfinite(velocity[:, 0])) if velocity is not None else np.zeros(0)
    if both.size:
        raise InputError(f"waypoint {int(both[0]) + 1} has a velocity and a radius to pass it by; remove one of them")


def _check_gates(asked: Conditions) -> None:
    edges = asked.gate_edges_m
    if edges is None:
        return
    sizes = np.linalg.norm(edges, axis=2)
    there = np.nan_to_num(sizes, nan=1.0).sum(axis=1) > 0.0
    with np.errstate(invalid="ignore"):  # edges without end are refused below
        square = np.abs((edges[:, 0] * edges[:, 1]).sum(axis=1)) <= 1e-6 * np.prod(sizes, axis=1)
    wrong = np.flatnonzero(there & ~(np.isfinite(sizes).all(axis=1) & (sizes > 0.0).all(axis=1) & square))
    if wrong.size:
        raise InputError(f"the gate at waypoint {int(wrong[0]) + 1} needs two edges at right angles: {edges[wrong[0]]}")
    if there[[0, -1]].any():
        raise InputError("the first and last waypoint are met exactly; give gates to inner waypoints")
    for name, others in (("radius", asked.fly_by_m), ("velocity", asked.velocity_world_m_s)):
        if others is None:
            continue
        given = others > 0.0 if others.ndim == 1 else np.isfinite(others[:, 0])
        both = np.flatnonzero(there & given)
        if both.size:
            raise InputError(f"waypoint {int(both[0]) + 1} has a gate and a {name}; remove one of them")


def _check_keep_in(line: FloatArray | None, radius: FloatArray | None) -> None:
    if (line is None) != (radius is None):
        raise InputError("a tube to keep in has both a polyline and a radius")
    if line is not None and len(line) < 2:
        raise InputError("the polyline of a tube to keep in has at least two points")
    if radius is not None and not SLIMMEST_M <= float(radius) < 1000.0:
        raise InputError(f"the tube to keep in has a radius of {radius:g} m; it must be {SLIMMEST_M:g} to 1000 m")
    if line is not None and radius is not None:
        length_m, most_m = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()), _MOST_RADII * float(radius)
        if not length_m <= most_m:
            raise InputError(
                f"the tube to keep in is {length_m:.3g} m long; with a radius of {radius:g} m at most {most_m:g} m are "
                "allowed: shorten its polyline, widen it, or plan in parts"
            )
