"""Planning options, and the error for a plan that is infeasible."""

from dataclasses import dataclass, field, replace
from math import isfinite, sqrt
from typing import Any, Literal, get_args

import numpy as np

from flight import FlightError, FloatArray, FormatError, InfeasibleError, InputError
from planner._planner import StopFlag
from planner.request.hidden import HiddenPrice
from planner.request.local_margins import LocalMargin, Roomier
from planner.request.space import DistanceField
from vehicle import Limits, Vehicle

YawMode = Literal["along_path", "smooth", "steady", "fixed", "look_at", "free"]
Method = Literal["fastest", "corridor", "bry"]
Search = Literal["grid", "rrt_star", "informed_rrt_star", "bit_star", "aorrtc"]
YAW_MODES, METHODS, SEARCHES = get_args(YawMode), get_args(Method), get_args(Search)
MOST_STARTS = 8
_CHECKED = ("radius_m", "margin_m", "control_reserve", "waypoint_tolerance_m", "heading_rad", "sample_step_s")
"""Options that the gate asks as well, besides limits and where to look."""


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """How to plan; the defaults suit a small quadrotor in a mapped room."""

    radius_m: float | None = None
    """Radius of a ball round the vehicle's centre that holds all of it; None: to its farthest propeller tip."""
    margin_m: float = 0.15
    """Margin between that ball and every obstacle, for map and tracking errors."""
    local_margins: tuple[LocalMargin, ...] = field(default=(), repr=False)  # which journals of earlier versions lack
    """More margin in some places, as a preflight asks for it."""
    hidden: HiddenPrice | None = field(default=None, repr=False, compare=False)
    """Price on space where an obstacle could hide, for the grid search; None: of ways round obstacles the shortest."""
    waypoint_tolerance_m: float = 0.01
    """How close to a waypoint counts as reached."""
    yaw: YawMode = "along_path"
    """Heading where none is prescribed: along the path; turned as smoothly as possible from one asked heading to the
    next; steady at that of the start; fixed at `heading_rad`; towards `look_at_world_m`; or free, for least time."""
    heading_rad: float = 0.0
    """What yaw "fixed" holds."""
    look_at_world_m: tuple[float, float, float] | None = None
    """What yaw "look_at" looks at."""
    method: Method = "fastest"
    """Least time, least snap inside a corridor of proved boxes (slower; also the fallback when the former fails), or
    Bry's method as published (`planner.optimise.bry`)."""
    limits: Limits | None = None
    """Limits to use instead of the vehicle's own."""
    control_reserve: float = 0.08
    """Share of the range of rotor thrust that a plan leaves free at either end. A vehicle planned down to its slowest
    rotor speed, say in a dive, has no torque left to hold its attitude with, and tumbles."""
    pieces: int = 2
    """Polynomials per piece of route: more fly faster and take longer to plan."""
    starts: int = 1
    """Starts of the descent, of which the fastest path is kept, in parallel where processors are free. In the
    open the first ends within 0.1 % of the best of eight in half of all plans and 0.5 % in the worst; among obstacles
    0.2 and 0.8 %."""
    search: Search = "grid"
    """What finds a way round obstacles: the compiled grid search, or one of OMPL's sampling planners."""
    search_checks: int = 5000
    """Motions that a sampling planner may check (four times as many where it finds no way with these)."""
    search_seed: int = 1
    """Seed of a sampling planner; the same seed finds the same way."""
    search_margin_m: float = 6.0
    """Margin of the search region round the waypoints, for fields without bounds."""
    sample_step_s: float = 0.01
    """Time between the samples at which attitude, rates and rotor speeds are checked."""
    repairs: int = 4
    """How often a path that comes too close is bent away before the corridor method takes over."""

    def __post_init__(self) -> None:
        for name in ("radius_m", "margin_m"):
            if getattr(self, name) is not None and not 0.0 <= getattr(self, name) < 100.0:
                raise InputError(f"{name} is {getattr(self, name)}; it must be from 0 to 100 m")
        for name in ("waypoint_tolerance_m", "search_margin_m", "sample_step_s"):
            if not 0.0 < getattr(self, name) < 1000.0:
                raise InputError(f"{name} is {getattr(self, name)}; it must be positive")
        if not 0.0 <= self.control_reserve < 0.4:
            raise InputError(f"control_reserve is {self.control_reserve}; it must be from 0 to below 0.4")
        for name in ("pieces", "search_checks", "search_seed"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}; it must be at least 1")
        if not 1 <= self.starts <= MOST_STARTS:
            raise InputError(f"starts is {self.starts}; it must be from 1 to {MOST_STARTS}")
        if self.repairs < 0:
            raise InputError(f"repairs is {self.repairs}; it must be at least 0")
        if self.yaw == "look_at" and (self.look_at_world_m is None or not np.isfinite(self.look_at_world_m).all()):
            raise InputError(f"look_at_world_m is {self.look_at_world_m}; yaw look_at needs a point to look at")
        if not isfinite(self.heading_rad):
            raise InputError(f"heading_rad is {self.heading_rad}; it must be finite")
        if self.hidden is not None and (self.search != "grid" or self.method == "bry"):
            raise InputError("a price of hidden space goes with the grid search, not with a sampling planner")
        for name, known in (("yaw", YAW_MODES), ("method", METHODS), ("search", SEARCHES)):
            if getattr(self, name) not in known:
                raise InputError(f"{name} is {getattr(self, name)!r}; it must be {' or '.join(known)}")

    def as_dict(self) -> dict[str, Any]:
        """What a trajectory is checked for, JSON-able; `limits` is None for the vehicle's own."""
        look_at = self.look_at_world_m
        return {
            **{name: getattr(self, name) for name in _CHECKED},
            "yaw": self.yaw,
            "look_at_world_m": None if look_at is None else [float(x) for x in look_at],
            "limits": None if self.limits is None else self.limits.as_dict(),
            **({"local_margins": [each.as_dict() for each in self.local_margins]} if self.local_margins else {}),
        }

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> "PlanOptions":
        """The options to check with, from what `as_dict` made; the defaults for what older versions did not write.

        Raises:
            FormatError: it was not made by `as_dict`.
        """
        try:
            bounds, look_at = document["limits"], document.get("look_at_world_m")
            numbers: dict[str, Any] = {name: float(document[name]) for name in _CHECKED if name in document}
            return cls(
                **numbers,
                yaw=document.get("yaw", "along_path"),
                look_at_world_m=None if look_at is None else _point(look_at),
                limits=None if bounds is None else Limits(**bounds),
                local_margins=tuple(LocalMargin.from_dict(each) for each in document.get("local_margins", ())),
            )
        except (KeyError, TypeError, ValueError, AttributeError, InputError, FormatError) as error:
            raise FormatError(f"what a trajectory file asks of its check is damaged: {error}") from error

    def sized(self, vehicle: Vehicle) -> "PlanOptions":
        """These options; where they give no radius, with the vehicle's (`reach_m`, up to a whole millimetre)."""
        if self.radius_m is not None:
            return self
        return replace(self, radius_m=float(np.ceil(1e3 * vehicle.reach_m) / 1e3))

    def limits_for(self, vehicle: Vehicle) -> Limits:
        """Limits of a plan: the given ones (or the vehicle's own), less the control reserve."""
        own = vehicle.limits if self.limits is None else self.limits
        slowest, fastest = (speed * speed for speed in (own.rotor_speed_min_rad_s, own.rotor_speed_max_rad_s))
        spare = self.control_reserve * (fastest - slowest)  # thrust goes with the square of the speed
        return replace(own, rotor_speed_min_rad_s=sqrt(slowest + spare), rotor_speed_max_rad_s=sqrt(fastest - spare))

    @property
    def target_world_m(self) -> FloatArray | None:
        """(3,) the point to look at, if any."""
        return None if self.yaw != "look_at" else np.array(self.look_at_world_m, dtype=np.float64)

    def sampled(self) -> "PlanOptions":
        """These options with a sampling planner for the route: RRT*, unless another one was asked for."""
        return self if self.search != "grid" else replace(self, search="rrt_star")

    def roomier(self, field: DistanceField) -> DistanceField:
        """The field in which `clearance_m` asks for the local margins too.

        Raises:
            InputError: as `clearance_m`.
        """
        if not self.local_margins:
            return field
        return Roomier(field, self.local_margins, self.margin_m, self.clearance_m)

    @property
    def clearance_m(self) -> float:
        """Distance to keep between the vehicle's centre and every obstacle.

        Raises:
            InputError: the radius is left to the vehicle, which is not known here.
        """
        return self.body_radius_m + self.margin_m

    @property
    def body_radius_m(self) -> float:
        """The radius; raises as `clearance_m`."""
        if self.radius_m is None:
            raise InputError(
                "radius_m is left to the vehicle: ask `sized(vehicle)` for the clearance, or give a radius"
            )
        return self.radius_m

    @property
    def planned_clearance_m(self) -> float:
        """Clearance that the planner aims for, so that the gate, whose bound is good to 1 mm, proves `clearance_m`."""
        return self.clearance_m + 0.002

    @property
    def waypoint_clearance_m(self) -> float:
        """Clearance that waypoints must have: a little more than is planned, so that a path to them exists."""
        return self.planned_clearance_m + 0.002


def _point(numbers: list[Any]) -> tuple[float, float, float]:
    x, y, z = (float(number) for number in numbers)
    return x, y, z


@dataclass(frozen=True, slots=True)
class Gap:
    """The narrowest place of the way that has most room."""

    point_world_m: tuple[float, float, float]
    width_m: float
    """Diameter of the largest ball that passes it, to the spacing of the search grid."""


class PlanInfeasibleError(InfeasibleError):
    """No trajectory was found that passes the gate."""

    def __init__(self, reason: str, remedy: str, segment: int | None = None, *, gap: Gap | None = None) -> None:
        where = "" if segment is None else f"between waypoints {segment + 1} and {segment + 2}: "
        super().__init__(f"{where}{reason}; {remedy}")
        self.segment = segment
        """Index of the waypoint where the leg in question starts; None if the failure belongs to no single leg."""
        self.reason = reason
        self.remedy = remedy
        self.gap = gap
        """Where the way that has most room is narrowest, if room is what is missing."""


class PlanCancelledError(FlightError):
    """The plan was given up because its stop flag was set."""


def check_stop(stop: StopFlag | None) -> None:
    """Raises `PlanCancelledError` if the flag is set. Long work asks at least every 50 ms of processor time."""
    if stop is not None and stop.is_set():
        raise PlanCancelledError("the plan was cancelled")
