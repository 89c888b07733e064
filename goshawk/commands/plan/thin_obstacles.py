"""Plans that say how thin an obstacle could hide near them, and plans that keep out of space where one could."""

from dataclasses import replace

import esdf
import planner
from flight import InfeasibleError, InputError, Progress, TrajectoryFile, silent
from flight.mission import Mission
from mapping import Map
from mapping.free_space import FreeSpace
from planner import mission
from planner.gate import could_hide, gate
from planner.request import hidden
from planner.request.hidden import HiddenPrice, Paid
from vehicle import Vehicle


def field_to_plan_in(area: Map, free: FreeSpace | None, thinnest_m: float | None) -> esdf.Field:
    """The map's field; if a thickness is given, with space not free where an obstacle so thick could hide.

    Raises:
        InputError: the thickness is out of its range, or what the map's images resolve is not known.
    """
    if thinnest_m is None:
        return area.field
    could_hide.require_thickness(thinnest_m)
    if free is None:
        raise InputError(
            f"{area.folder} has no images: how thin an obstacle could hide in it is not known; leave out --thinnest"
        )
    return free.resolving(thinnest_m)


def priced(
    options: planner.PlanOptions, area: Map, free: FreeSpace | None, hidden_price: float | None
) -> planner.PlanOptions:
    """The options with a price on space where an obstacle could hide, if one is given.

    Raises:
        InputError: the price is out of its range, or what the map's images resolve is not known.
    """
    if hidden_price is None:
        return options
    if free is None:
        raise InputError(f"{area.folder} has no images: what could hide in it is not known; leave out --hidden-price")
    return replace(options, hidden=HiddenPrice(hidden_price, free))


def paid(item: TrajectoryFile, free: FreeSpace | None) -> Paid | None:
    """What a file's trajectory pays in a map's free space, at the price that it was planned with.

    Returns:
        None where no price was asked, or where what the map's images resolve is not known.

    Raises:
        FormatError: the file's record of the price is damaged.
    """
    price = hidden.asked_of(item)
    return None if price is None or free is None else HiddenPrice(price, free).paid(item.trajectory)


def free_share(field: esdf.Field, area: Map) -> float:
    """Share of the map's free space that is free in that field, too."""
    return float((field.state == esdf.FREE).sum()) / max(1.0, float((area.field.state == esdf.FREE).sum()))


def plan(
    asked: Mission,
    area: Map,
    field: esdf.Field,
    drone: Vehicle,
    options: planner.PlanOptions,
    free: FreeSpace | None,
    thinnest_m: float | None,
    *,
    progress: Progress = silent,
) -> planner.Plan:
    """Plan in a field of `field_to_plan_in`; the gate's report is about the map itself, and says what could hide
    and what was paid for it.

    Raises:
        InfeasibleError, InputError: as `planner.mission.plan`.
    """
    found = mission.plan(asked, field, drone, options, progress=progress)
    report = found.gate
    if field is not area.field:
        report = gate.check(
            found.trajectory,
            area.field,
            drone,
            report.options,
            waypoints_world_m=found.waypoints.positions_world_m,
            yaw_rad=report.yaw_rad,
            conditions=report.conditions,
        )
    report = could_hide.add(report, found.trajectory, free, thinnest_m)
    report = report if options.hidden is None else replace(report, hidden=options.hidden.paid(found.trajectory))
    if not report.passed:
        first = report.failures[0]
        raise InfeasibleError(f"the plan fails in the map: {first.name} ({first.reason}); keep more margin")
    return replace(found, gate=report)
