"""A request to the planner: what cannot be planned is refused before any work, with the waypoint or the limit, the
bound and the way out."""

from dataclasses import dataclass, replace

import numpy as np

from flight import FlightError, FloatArray, InfeasibleError, InputError, Waypoints, rotations
from flight.trajectory import LONGEST_S
from planner._planner import StopFlag
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.options import PlanInfeasibleError, PlanOptions, check_stop
from vehicle import Limits, Vehicle, allocation, invert

MOST_WAYPOINTS = 2000
"""More would take minutes; a recorded path is thinned first."""
_LONGEST_TURN_S = 60.0
"""A turn between two headings that takes longer than this is taken for a mistake in the headings or the limit."""
SAME_M = 1e-3
"""Waypoints nearer than this are one point."""
_SAME_RAD = 1e-3
"""Headings that differ by less are the same, as in `heading`."""
_MOST_SIDEWAYS = 0.02
"""Of `allocation.sideways`. On a .28 m hexarotor at its race limits .02 (rotors that lean 1.1 degrees inwards) is an
error of .1 degrees of tilt that no check sees; .36 one of 2 degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """What a trajectory is planned for, of which vehicle, in which space."""

    waypoints: Waypoints
    field: space.DistanceField
    vehicle: Vehicle
    options: PlanOptions
    conditions: Conditions
    stop: StopFlag | None = None
    """Set from another thread, ends the work."""

    @property
    def limits(self) -> Limits:
        """Limits to plan within."""
        return self.options.limits_for(self.vehicle)


def options_for(vehicle: object, options: PlanOptions | None) -> PlanOptions:
    """The options, the defaults if None, with the vehicle's own radius where they leave it open.

    Raises:
        InputError: there is no vehicle.
    """
    if not isinstance(vehicle, Vehicle):
        raise InputError(f"expected a vehicle, got {vehicle!r}; read one with `vehicle.load`, or use `vehicle.example`")
    return (PlanOptions() if options is None else options).sized(vehicle)


def admitted(
    waypoints: Waypoints,
    field: space.DistanceField,
    vehicle: Vehicle,
    options: PlanOptions | None,
    conditions: Conditions | None,
    stop: StopFlag | None,
) -> Request:
    """The request, with its options sized and its conditions as arrays, if a plan can come of it.

    Raises:
        InputError: as `options_for` and `check`, or what is asked besides the waypoints makes no sense or lasts too
            long.
        PlanInfeasibleError: the limits do not let the vehicle hover.
        PlanCancelledError: `stop` was set.
    """
    options = options_for(vehicle, options)
    check_stop(stop)
    request = Request(waypoints, field, vehicle, options, Conditions() if conditions is None else conditions, stop)
    check(request)
    bounds = request.limits
    asked = request.conditions.checked(len(waypoints.positions_world_m), bounds)
    check_durations(waypoints, bounds, asked.leg_speed_m_s)
    if options.method == "bry" and (asked.given_motion or asked.leg_limits):
        raise InputError(
            "Bry's method starts and ends at rest and knows no velocities and no speeds or jerks of legs; use fastest"
        )
    asked.check_inside(waypoints.positions_world_m)
    return replace(request, conditions=asked)


def require_thrust_apart(vehicle: Vehicle) -> None:
    """Refuse rotors whose torque comes with a force sideways, which neither optimiser nor gate allows for.

    Raises:
        InputError: such rotors; the share and its bound.
    """
    if (share := allocation.sideways(vehicle)) > _MOST_SIDEWAYS:
        raise InputError(
            f"{vehicle.name}: turning pushes its tilted rotors sideways ({share:.2f} of torque over arm, at most "
            f"{_MOST_SIDEWAYS:g} is planned); straighten `thrust_axis_body`, or lean all the same way"
        )


def check(request: Request, *, may_turn: bool = False) -> None:
    """Refuse waypoints that no plan can come of, whatever else is asked.

    Args:
        may_turn: as in `check_waypoints`.

    Raises:
        InputError: no map, a vehicle larger than the clearance, too many waypoints, two too far apart, headings that
            take too long to turn, or as `require_thrust_apart` and `check_waypoints`.
        PlanInfeasibleError: the limits do not let the vehicle hover.
    """
    waypoints, field, vehicle, options = request.waypoints, request.field, request.vehicle, request.options
    if not hasattr(field, "distance"):
        raise InputError(f"expected a map, got {field!r}; give a field with `distance(points)`, say of `esdf.load`")
    count = len(waypoints.positions_world_m)
    if count > MOST_WAYPOINTS:
        raise InputError(
            f"{count} waypoints are given; at most {MOST_WAYPOINTS} are planned at once: "
            "thin them (`goshawk plan --path`, or `planner.route.simplify.rdp`), or plan in parts"
        )
    bounds, required_m, free_m = request.limits, options.clearance_m, options.waypoint_clearance_m
    if vehicle.reach_m > required_m:
        raise InputError(beyond_clearance(vehicle, required_m))
    require_thrust_apart(vehicle)
    _check_hover(vehicle, bounds, options)
    check_durations(waypoints, bounds)
    _check_headings(waypoints, bounds)
    check_waypoints(waypoints, field, free_m, may_turn=may_turn)
    _check_local_margins(waypoints.positions_world_m, field, options)


def _check_local_margins(points: FloatArray, field: space.DistanceField, options: PlanOptions) -> None:
    short_m = options.waypoint_clearance_m - space.distance(options.roomier(field), points)
    i = int(short_m.argmax())
    if short_m[i] > 0.0:
        raise InputError(
            f"waypoint {i + 1} at {shown(points[i])} has {short_m[i]:.3f} m less room than the local margin there asks "
            "for; move it, or lower that margin and fly slower there"
        )


def beyond_clearance(vehicle: Vehicle, clearance_m: float) -> str:
    """Why a clearance is too small for a vehicle, and the way out."""
    least_m = np.ceil(1e3 * vehicle.reach_m) / 1e3
    return (
        f"the propellers of {vehicle.name} reach {vehicle.reach_m:.3f} m from its centre, beyond the clearance of "
        f"{clearance_m:.3f} m that is asked for; raise radius_m (--radius) to {least_m:g} or more"
    )


def _check_hover(vehicle: Vehicle, bounds: Limits, options: PlanOptions) -> None:
    try:
        hover = invert.hover(vehicle)
    except InfeasibleError as error:
        raise PlanInfeasibleError(
            str(error), "change rotor_speed_max_rad_s, or correct the vehicle's mass or thrust coefficients"
        ) from error
    low, high = bounds.rotor_speed_min_rad_s, bounds.rotor_speed_max_rad_s
    if hover.min() >= low and hover.max() <= high:
        return
    name = "rotor_speed_min_rad_s" if hover.min() < low else "rotor_speed_max_rad_s"
    raise PlanInfeasibleError(
        f"the vehicle cannot hover: its rotors need {hover.min():.0f} to {hover.max():.0f} rad/s, and the limits with "
        f"a control_reserve of {options.control_reserve:g} leave {low:.0f} to {high:.0f}",
        f"change {name}, or lower control_reserve",
    )


def check_durations(waypoints: Waypoints, bounds: Limits, leg_speed_m_s: FloatArray | None = None) -> None:
    """Refuse what takes longer than a trajectory may last.

    Args:
        leg_speed_m_s: (n - 1,) the largest speed asked for on each leg, NaN for none.

    Raises:
        InputError: it does, even at the largest speeds or the largest acceleration.
    """
    gaps = np.linalg.norm(np.diff(waypoints.positions_world_m, axis=0), axis=1)
    speed = np.full(len(gaps), bounds.speed_m_s)
    if leg_speed_m_s is not None:
        speed = np.fmin(speed, leg_speed_m_s)
    times_s = gaps / speed
    i = int(times_s.argmax()) if len(gaps) else 0
    if times_s.sum() > LONGEST_S:
        name = "speed_m_s" if speed[i] >= bounds.speed_m_s else "the speed asked for there"
        raise InputError(
            f"the way of {gaps.sum():.3g} m takes more than {LONGEST_S:g} s; most of it is between waypoints {i + 1} "
            f"and {i + 2}, {gaps[i]:.3g} m at {speed[i]:.3g} m/s: move them, or raise {name}"
        )
    if 2.0 * np.sqrt(gaps.sum() / bounds.acceleration_m_s2) > LONGEST_S:
        raise InputError(
            f"the way of {gaps.sum():.3g} m takes more than {LONGEST_S:g} s at acceleration_m_s2 "
            f"{bounds.acceleration_m_s2:.3g}: raise the limit"
        )
    if gaps.sum() > bounds.largest_jerk_m_s3 * (LONGEST_S**3 / 32.0):  # from rest to rest, jerk at its limit all along
        raise InputError(
            f"the way of {gaps.sum():.3g} m takes more than {LONGEST_S:g} s at jerk_m_s3 {bounds.jerk_m_s3:.3g}: raise "
            "the limit"
        )


def _check_headings(waypoints: Waypoints, bounds: Limits) -> None:
    given = np.flatnonzero(np.isfinite(waypoints.yaw_rad))
    turns = np.abs(rotations.wrapped(np.diff(waypoints.yaw_rad[given])))
    slow = np.flatnonzero(turns > _LONGEST_TURN_S * bounds.yaw_rate_rad_s)
    if slow.size:
        first, then = given[slow[0]], given[slow[0] + 1]
        turn = float(turns[slow[0]])
        raise InputError(
            f"waypoints {first + 1} and {then + 1} ask for headings {np.degrees(turn):.0f} deg apart, a turn of "
            f"{turn / bounds.yaw_rate_rad_s:.0f} s at yaw_rate_rad_s {bounds.yaw_rate_rad_s:g}; bring the headings "
            "closer, or raise the limit"
        )


def turns(waypoints: Waypoints) -> np.ndarray:
    """Indices of the waypoints behind which the next one is in the same place and asks for another heading."""
    gaps = np.linalg.norm(np.diff(waypoints.positions_world_m, axis=0), axis=1)
    turned = np.abs(rotations.wrapped(np.diff(waypoints.yaw_rad))) >= _SAME_RAD  # not so where one is open
    return np.flatnonzero((gaps < SAME_M) & turned)


def check_waypoints(
    waypoints: Waypoints, field: space.DistanceField, clearance_m: float, *, may_turn: bool = False
) -> None:
    """Refuse waypoints that no path can reach.

    Args:
        may_turn: two may be in the same place if they ask for two headings.

    Raises:
        InputError: too few, two in the same place, or one too close to an obstacle or in unknown space.
    """
    points = waypoints.positions_world_m
    if len(points) < 2:
        raise InputError(f"{len(points)} waypoints are given; at least two are needed, a start and an end")
    same = np.linalg.norm(np.diff(points, axis=0), axis=1) < SAME_M
    on_the_spot = turns(waypoints)
    if may_turn:
        same[on_the_spot] = False
    if same.any():
        i = int(np.argmax(same))
        where = f"waypoints {i + 1} and {i + 2} are in the same place {shown(points[i])}"
        if i in on_the_spot:
            raise InputError(f"{where} with two headings; plan this turn as a mission (`planner.mission.plan`)")
        raise InputError(f"{where}; remove one of them, or give both a heading to turn on the spot")
    distances = space.distance(field, points)
    short = np.flatnonzero(distances < clearance_m)
    if short.size:
        i = int(short[0])
        raise InputError(_trouble(field, i, points[i], float(distances[i]), clearance_m))


def not_free(distance_m: float) -> str:
    """Where a point is whose distance is negative, or minus infinity, as `space.distance` gives it."""
    if np.isneginf(distance_m):
        return "in unknown space or outside of the map"
    return f"{-distance_m:.2f} m inside an obstacle or beyond a wall"


def _trouble(field: space.DistanceField, i: int, point: FloatArray, distance_m: float, clearance_m: float) -> str:
    if distance_m < 0.0:
        place = not_free(distance_m)
    else:
        place = f"{distance_m:.3f} m from an obstacle or unknown space, {clearance_m:.3f} m are required"
    where = f"waypoint {i + 1} at {shown(point)} is {place}"
    try:
        free = space.nearest_free(field, point, clearance_m + 0.01)
        return f"{where}; the nearest free point is near {shown(free)}"
    except FlightError as error:
        return f"{where}; {error}"


def shown(point: FloatArray) -> str:
    """A place in metres, for a message."""
    return "(" + ", ".join(f"{x:.2f}" if abs(x) < 1e6 else f"{x:.3g}" for x in point) + ")"
