"""What may be asked of a path besides its waypoints: motion at both ends, velocities at waypoints, speeds of legs."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flight import FloatArray, FormatError, InputError, Trajectory
from planner.limits import Check, certified_maxima
from vehicle import Limits

_SAME = 1e-6
"""Largest difference (SI) from a motion that was asked for, relative to the largest number in it above one."""
_VISIT_S = 0.1
"""A visit is timed by where the path comes nearest within the tolerance, shortly before or after a hover."""
_INSIDE = 0.97
"""Share of a fly-by's radius that the optimiser uses: it charges what is outside, and so stays a little outside."""
_PROVABLE = 0.985
"""Share of a leg's speed that the optimiser uses: the gate's bound is at most 1 % above the truth."""


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
    fly_by_m: FloatArray | None = None
    """(n,) radius of the ball round an inner waypoint that is enough to pass; 0: the waypoint itself."""
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

    def checked(self, count: int, limits: Limits) -> "Conditions":
        """These conditions for `count` waypoints, as float arrays.

        Raises:
            InputError: a shape does not fit, a number makes no sense, or a velocity is beyond a limit; it is named.
        """
        if self.stay_s is not None or self.ground_world_m is not None:
            raise InputError("a single path does not stay, take off or land; plan it as a mission")
        given = self.shaped(count)
        for name in ("start", "end"):
            _check_end(name, getattr(given, name), limits)
        _check_velocities(given.velocity_world_m_s, given.leg_speed_m_s, limits)
        _check_fly_by(given.fly_by_m, given.velocity_world_m_s)
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
            "fly_by_m": (count,),
            "stay_s": (count,),
        }
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {name: None if v is None else np.asarray(v, dtype=np.float64) for name, v in given.items()}
        for name, shape in shapes.items():
            found = arrays[name]
            if found is not None and found.shape != shape:
                raise InputError(f"{name}: expected shape {shape} for {count} waypoints, got {found.shape}")
        ground = arrays["ground_world_m"]
        if ground is not None and (ground.ndim != 2 or ground.shape[1] != 3 or not np.isfinite(ground).all()):
            raise InputError(f"ground_world_m: expected finite points (m, 3), got shape {ground.shape}")
        return Conditions(**arrays)

    def at_knots(self, waypoint: np.ndarray) -> FloatArray | None:
        """(k + 1, 4) velocity and yaw rate at knots, NaN where open; `waypoint` (k + 1,) is -1 between waypoints."""
        if self.velocity_world_m_s is None:
            return None
        found = np.full((len(waypoint), 4), np.nan)
        at = waypoint >= 0
        found[at, :3] = self.velocity_world_m_s[waypoint[at]]
        found[np.isfinite(found[:, 0]), 3] = 0.0
        return found

    def balls(self, points_world_m: FloatArray, waypoint: np.ndarray) -> FloatArray | None:
        """(k + 1, 4) centre and radius of the ball that each knot may move in, 0 for none.

        Args:
            points_world_m: (k + 1, 3) where the knots are that are waypoints.
        """
        if self.fly_by_m is None:
            return None
        radius = np.where(waypoint >= 0, _INSIDE * self.fly_by_m[waypoint], 0.0)
        return np.column_stack([points_world_m, radius])

    def most_speed_m_s(self, waypoint: np.ndarray) -> FloatArray:
        """(k,) the speed asked for between knots, infinite where none is; `waypoint` as in `at_knots`."""
        leg = np.maximum.accumulate(waypoint)[:-1]
        if self.leg_speed_m_s is None:
            return np.full(len(leg), np.inf)
        return np.where(np.isfinite(self.leg_speed_m_s), self.leg_speed_m_s, np.inf)[leg]

    def planned_speed_m_s(self, waypoint: np.ndarray, limits: Limits) -> FloatArray | None:
        """(k,) speed limits for the optimiser, so that the gate proves those asked for; None if none is."""
        if self.leg_speed_m_s is None:
            return None
        return np.minimum(_PROVABLE * self.most_speed_m_s(waypoint), limits.speed_m_s)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; what is not asked for is left out, open numbers are None."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: np.where(np.isfinite(value), value.astype(object), np.array(None)).tolist()  # JSON has no NaN
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


def _check_end(name: str, motion: FloatArray | None, limits: Limits) -> None:
    if motion is None:
        return
    if not np.isfinite(motion).all():
        raise InputError(f"the {name}'s motion is not finite: {motion.tolist()}")
    for row, unit, most in ((0, "m/s", limits.speed_m_s), (1, "m/s2", limits.acceleration_m_s2)):
        size = float(np.linalg.norm(motion[row, :3]))
        if size > most:
            raise InputError(f"the {name} moves at {size:.3g} {unit}, limit {most:g}; lower it or raise the limit")


def _check_velocities(velocity: FloatArray | None, leg_speed: FloatArray | None, limits: Limits) -> None:
    if leg_speed is not None:
        wrong = np.flatnonzero(leg_speed <= 0.0)
        if wrong.size:
            i = int(wrong[0])
            raise InputError(f"the leg from waypoint {i} to {i + 1} has a speed of {leg_speed[i]:g} m/s; give it some")
    if velocity is None:
        return
    if np.isfinite(velocity[[0, -1]]).any():
        raise InputError("a velocity at the first or last waypoint is given as `start` or `end`")
    broken = np.isfinite(velocity).any(axis=1) & ~np.isfinite(velocity).all(axis=1)
    if broken.any():
        raise InputError(f"the velocity at waypoint {int(np.argmax(broken))} is not finite in every axis")
    for i in np.flatnonzero(np.isfinite(velocity[:, 0])):
        size = float(np.linalg.norm(velocity[i]))
        if size > limits.speed_m_s:
            raise InputError(
                f"waypoint {i} is to be passed at {size:.3g} m/s, limit {limits.speed_m_s:g}; "
                "lower it or raise the limit"
            )
        legs = [] if leg_speed is None else [j for j in (i - 1, i) if leg_speed[j] < size]
        if legs:
            raise InputError(
                f"waypoint {i} is to be passed at {size:.3g} m/s, but the leg from waypoint {legs[0]} is flown at "
                f"{leg_speed[legs[0]] if leg_speed is not None else 0.0:.3g} m/s at most; change one of the two"
            )


def _check_fly_by(radius: FloatArray | None, velocity: FloatArray | None) -> None:
    if radius is None:
        return
    wrong = np.flatnonzero(~((radius >= 0.0) & (radius < 100.0)))
    if wrong.size:
        i = int(wrong[0])
        raise InputError(f"waypoint {i} is to be passed within {radius[i]:g} m; that must be from 0 to 100 m")
    if (radius[[0, -1]] > 0.0).any():
        raise InputError("the first and last waypoint are met exactly; give the radius to inner waypoints")
    both = np.flatnonzero((radius > 0.0) & np.isfinite(velocity[:, 0])) if velocity is not None else np.zeros(0)
    if both.size:
        raise InputError(f"waypoint {int(both[0])} has a velocity and a radius to pass it by; remove one of them")


def checks(trajectory: Trajectory, visits_s: FloatArray | None, asked: Conditions) -> list[Check]:
    """Every condition with the worst deviation from it.

    Args:
        visits_s: (n,) when each waypoint is passed; None if they are not all passed.
    """
    found = [
        _end_check("start", trajectory, 0.0, asked.start),
        _end_check("end", trajectory, trajectory.duration_s, asked.end),
    ]
    if visits_s is None:
        return found
    if asked.velocity_world_m_s is not None:
        found += _velocity_checks(trajectory, visits_s, asked.velocity_world_m_s)
    if asked.leg_speed_m_s is not None:
        found += _speed_checks(trajectory, visits_s, asked.leg_speed_m_s)
    if asked.stay_s is not None:
        found.append(_stay_check(trajectory, visits_s, asked.stay_s))
    return found


def _end_check(name: str, trajectory: Trajectory, time_s: float, asked: FloatArray | None) -> Check:
    motion = np.concatenate([trajectory.evaluate(np.array([time_s]), r) for r in (1, 2, 3)])
    wanted = np.zeros((3, 4)) if asked is None else asked
    segment = 0 if time_s == 0.0 else -1
    T = trajectory.durations_s[segment]
    scale = np.abs(trajectory.coefficients[segment] * T ** np.arange(trajectory.coefficients.shape[-1])).max()
    tolerance = _SAME * max(1.0, float(scale))
    worst = float(np.abs(motion - wanted).max())
    what = "rest" if asked is None else "motion"
    return Check(f"{what} at the {name}", worst, tolerance, "SI", worst <= tolerance)


def _velocity_checks(trajectory: Trajectory, visits_s: FloatArray, asked: FloatArray) -> list[Check]:
    at = np.flatnonzero(np.isfinite(asked[:, 0]))
    if not at.size:
        return []
    # A visit is the nearest sample; the join that was planned for it is at most a sample away.
    joins = trajectory.starts_s
    times = joins[np.abs(joins[None] - visits_s[at][:, None]).argmin(axis=1)]
    off = np.linalg.norm(trajectory.position(times, 1) - asked[at], axis=1)
    worst = int(off.argmax())
    tolerance = _SAME * max(1.0, float(np.abs(asked[at]).max())) * 100.0
    reason = f"largest difference at waypoint {int(at[worst])}"
    return [Check("velocity at waypoints", float(off[worst]), tolerance, "m/s", bool(off[worst] <= tolerance),
                  float(times[worst]), reason=reason)]  # fmt: skip


def _speed_checks(trajectory: Trajectory, visits_s: FloatArray, asked: FloatArray) -> list[Check]:
    """A proved bound on each segment, against the lowest speed of the legs that it has a part in."""
    bound, time_s = certified_maxima(trajectory, 1)
    middle = trajectory.starts_s[:-1] + 0.5 * trajectory.durations_s
    leg = np.clip(np.searchsorted(visits_s, middle, side="right") - 1, 0, len(asked) - 1)
    most = np.where(np.isfinite(asked[leg]), asked[leg], np.inf)
    worst = int(np.argmax(bound / most))
    if not np.isfinite(most[worst]):
        return []
    value, limit = float(bound[worst]), float(most[worst])
    reason = (
        f"leg from waypoint {int(leg[worst])} at {time_s[worst]:.1f} s: {value:.3g} m/s, asked for at most {limit:.3g}"
    )
    return [Check("speed of legs", value, limit, "m/s", value <= limit, float(time_s[worst]), worst, reason)]


def _stay_check(trajectory: Trajectory, visits_s: FloatArray, asked_s: FloatArray) -> Check:
    """How long the vehicle hovers where it is at each visit, against what is asked there."""
    still = np.all(np.abs(trajectory.coefficients[:, :3, 1:]) <= 0.0, axis=(1, 2))
    starts, ends = trajectory.starts_s[:-1][still], trajectory.starts_s[1:][still]
    hover_s = [float((ends - starts)[(starts <= t + _VISIT_S) & (ends >= t - _VISIT_S)].sum()) for t in visits_s]
    lack = asked_s - np.array(hover_s)
    worst = int(lack.argmax())
    reason = f"waypoint {worst}: {hover_s[worst]:.2f} s of {asked_s[worst]:.2f} s"
    return Check(
        "stays", float(lack[worst]), 1e-6, "s", bool(lack[worst] <= 1e-6), float(visits_s[worst]), None, reason
    )
