"""What cannot be planned is refused before any work, with the waypoint or the limit, the bound and the way out."""

import numpy as np

from flight import InfeasibleError, InputError, Waypoints
from flight.trajectory import LONGEST_S
from planner.options import PlanInfeasibleError, PlanOptions
from vehicle import Limits, Vehicle, invert

MOST_WAYPOINTS = 2000
"""More would take minutes; a recorded path is thinned first."""
_LONGEST_TURN_S = 60.0
"""A turn between two headings that takes longer than this is taken for a mistake in the headings or the limit."""


def check(waypoints: Waypoints, field: object, vehicle: object, options: PlanOptions) -> None:
    """Refuse what no plan can come of.

    Raises:
        InputError: no map or vehicle, a vehicle larger than the clearance, too many waypoints, two too far apart, or
            headings that take too long to turn.
        PlanInfeasibleError: the limits do not let the vehicle hover.
    """
    if not hasattr(field, "distance"):
        raise InputError(f"no map is given but {field!r}; give a field with `distance(points)`, say of `esdf.load`")
    if not isinstance(vehicle, Vehicle):
        raise InputError(f"no vehicle is given but {vehicle!r}; read one with `vehicle.load`, or use `vehicle.example`")
    count = len(waypoints.positions_world_m)
    if count > MOST_WAYPOINTS:
        raise InputError(
            f"{count} waypoints are given; at most {MOST_WAYPOINTS} are planned at once: "
            "thin them (`goshawk plan --path`, or `planner.simplify.rdp`), or plan in parts"
        )
    if vehicle.reach_m > options.clearance_m:
        raise InputError(beyond_clearance(vehicle, options.clearance_m))
    bounds = options.limits_for(vehicle)
    _check_hover(vehicle, bounds, options)
    _check_distances(waypoints, bounds)
    _check_headings(waypoints, bounds)


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
        raise PlanInfeasibleError(str(error), "correct the vehicle's mass, thrust or limits") from error
    low, high = bounds.rotor_speed_min_rad_s, bounds.rotor_speed_max_rad_s
    if hover.min() >= low and hover.max() <= high:
        return
    name = "rotor_speed_min_rad_s" if hover.min() < low else "rotor_speed_max_rad_s"
    raise PlanInfeasibleError(
        f"the vehicle cannot hover: its rotors need {hover.min():.0f} to {hover.max():.0f} rad/s, and the limits with "
        f"a control_reserve of {options.control_reserve:g} leave {low:.0f} to {high:.0f}",
        f"change {name}, or lower control_reserve",
    )


def _check_distances(waypoints: Waypoints, bounds: Limits) -> None:
    gaps = np.linalg.norm(np.diff(waypoints.positions_world_m, axis=0), axis=1)
    if gaps.sum() <= bounds.speed_m_s * LONGEST_S:
        return
    i = int(gaps.argmax())
    raise InputError(
        f"the way of {gaps.sum():.3g} m takes more than {LONGEST_S:g} s at speed_m_s {bounds.speed_m_s:g}; the longest "
        f"leg, {gaps[i]:.3g} m, is between waypoints {i} and {i + 1}: move them, or raise the limit"
    )


def _check_headings(waypoints: Waypoints, bounds: Limits) -> None:
    given = np.flatnonzero(np.isfinite(waypoints.yaw_rad))
    turns = np.abs(np.angle(np.exp(1j * np.diff(waypoints.yaw_rad[given]))))
    slow = np.flatnonzero(turns > _LONGEST_TURN_S * bounds.yaw_rate_rad_s)
    if slow.size:
        first, then = given[slow[0]], given[slow[0] + 1]
        turn = float(turns[slow[0]])
        raise InputError(
            f"waypoints {first} and {then} ask for headings {np.degrees(turn):.0f} deg apart, a turn of "
            f"{turn / bounds.yaw_rate_rad_s:.0f} s at yaw_rate_rad_s {bounds.yaw_rate_rad_s:g}; bring the headings "
            "closer, or raise the limit"
        )
