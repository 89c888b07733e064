"""How thin an obstacle could hide near a trajectory, beside what the gate proves of the obstacles that the map shows.

A map tells this, and the planner does not know what a map is: it takes anything with `along(...)`.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from esdf.visibility import CouldHide
from flight import FloatArray, FormatError, InputError, Trajectory, TrajectoryFile
from planner.gate.gate import GateReport
from planner.gate.limits import Check
from planner.request.space import COLUMN_M, GROUND_TOLERANCE_M

CHECK = "thinnest obstacle"
"""Name of the check, where a thinnest obstacle to be ruled out was asked for."""
THINNEST_M = (0.001, 1.0)
"""Least and largest thickness that may be asked for; beyond is a wrong unit."""
LIKELY = 0.01
"""Probability of a missing obstacle, of the whole way, from which a plan warns."""
_STEP_M = 0.02
"""Between positions on the path: what lies between two balls of 0.3 m about them is thinner than 0.2 mm."""
_STEP_S = 0.005
_MOST_TIMES = 400_000


class FreeSpace(Protocol):
    """What knows how thin an obstacle the images of a map resolve."""

    def along(self, times_s: ArrayLike, positions_world_m: ArrayLike, reach_m: float) -> CouldHide: ...


def add(
    report: GateReport, trajectory: Trajectory, free: FreeSpace | None, thinnest_m: float | None = None
) -> GateReport:
    """The gate's report with how thin an obstacle could hide within the required clearance of the trajectory.

    Straight above a point on the ground, where the vehicle stands, lands or takes off, lower than the required
    clearance, it is not asked, as the gate asks for less clearance there.

    Args:
        free: None where nothing is known: the report then says so.
        thinnest_m: If given, a check fails where an obstacle this thick could hide, or where nothing is known.

    Raises:
        InputError: the thickness is not within `THINNEST_M`.
    """
    if thinnest_m is not None:
        require_thickness(thinnest_m)
    required_m = report.required_clearance_m
    found = None if free is None else near(trajectory, free, report.conditions.ground_world_m, required_m, required_m)
    report = replace(report, could_hide=found, thinnest_m=thinnest_m)
    if thinnest_m is None:
        return report
    return replace(report, checks=(*report.checks, _check(found, thinnest_m)))


def near(
    trajectory: Trajectory, free: FreeSpace, ground_world_m: FloatArray | None, required_m: float, reach_m: float
) -> CouldHide:
    """How thin an obstacle could hide within reach of the trajectory, but for where the gate asks for less clearance
    than `required_m` above the ground."""
    times = equally_spaced(trajectory)
    path = trajectory.position(times)
    off = ~_above_ground(path, ground_world_m, required_m)
    off = off if off.any() else ~off  # a hop that stays so low is asked all along
    return free.along(times[off], path[off], reach_m)


def asked_of(item: TrajectoryFile) -> float | None:
    """The thinnest obstacle, metres, that a file's trajectory was to rule out; None if that was not asked.

    Raises:
        FormatError: its record of that is damaged.
    """
    given = item.check.get("thinnest_m")
    if given is None:
        return None
    try:
        return require_thickness(float(given))
    except (TypeError, ValueError, InputError) as error:
        raise FormatError(f"the thinnest obstacle asked of a trajectory file is damaged: {error}") from error


def require_thickness(thinnest_m: float) -> float:
    """The thickness, if it may be asked for; else an `InputError`."""
    low, high = THINNEST_M
    if not low <= thinnest_m <= high:
        raise InputError(f"the thinnest obstacle is {thinnest_m:g} m; it must be from {low:g} to {high:g} m")
    return thinnest_m


def describe(report: GateReport) -> str:
    """How thin an obstacle could hide, in words; that it is not known where it is not."""
    found = report.could_hide
    if found is None:
        return "how thin an obstacle could hide is not known: the map has no images to tell it by"
    return found.describe()


def advice(report: GateReport) -> str:
    """What to do about it."""
    if report.could_hide is None:
        return "look for thin obstacles there yourself"
    bound_m = report.could_hide.threshold_m
    return f"`goshawk plan --thinnest {bound_m:g}` keeps out of space where {1e3 * bound_m:.0f} mm could hide"


def worth_a_warning(report: GateReport) -> bool:
    """Whether something thick enough to warn of could hide, or nothing is known of it, and nobody asked for less.

    Where the map states how likely that is, only if it is likely enough for a look, or no image looked somewhere.
    """
    found = report.could_hide
    if report.thinnest_m is not None:
        return False
    if found is None or found.probability is None:
        return found is None or found.thickness_m > found.threshold_m
    return found.unobserved or found.probability >= LIKELY


def equally_spaced(trajectory: Trajectory) -> FloatArray:
    """Times (n,) at which the trajectory has flown equal ways; the time 0 alone if it stays in its place."""
    times = trajectory.sample(max(_STEP_S, trajectory.duration_s / _MOST_TIMES))
    steps_m = np.linalg.norm(np.diff(trajectory.position(times), axis=0), axis=1)
    flown_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    count = 1 + int(np.ceil(flown_m[-1] / _STEP_M))
    return np.interp(np.linspace(0.0, flown_m[-1], count), flown_m, times)


def _above_ground(path_world_m: FloatArray, ground_world_m: FloatArray | None, required_m: float) -> np.ndarray:
    """(n,) which positions are straight above a ground point and so low that `Grounded` may ask for less there."""
    height_m = required_m + 2.0 * GROUND_TOLERANCE_M  # its ground may lie one tolerance deep, and it allows another
    above = np.zeros(len(path_world_m), bool)
    for ground in np.zeros((0, 3)) if ground_world_m is None else np.asarray(ground_world_m).reshape(-1, 3):
        offset = path_world_m - ground
        above |= (np.linalg.norm(offset[:, :2], axis=1) < COLUMN_M) & (offset[:, 2] < height_m)
    return above


def _check(found: CouldHide | None, thinnest_m: float) -> Check:
    if found is None:
        return Check(
            CHECK, float("inf"), thinnest_m, "m", False, reason="not known: the map has no images to tell it by"
        )
    passed = found.thickness_m <= thinnest_m
    return Check(CHECK, found.thickness_m, thinnest_m, "m", passed, found.time_s, reason=found.describe_thickness())
