"""Where to look again in a map, for the command line, its report and the page: places, and waypoints through them."""

from pathlib import Path

import numpy as np

from flight import FloatArray, Progress, Waypoints, silent
from goshawk.terminal import console
from mapping import Map
from mapping.dense.surface import DenseOptions
from mapping.exploration import view_planning
from mapping.exploration.view_planning import Again, ViewOptions

_HANDS_M = 0.15
"""How much higher or lower than before somebody on foot can hold the cameras."""


def clearance_m(area: Map, vehicle_file: Path | None, radius_m: float | None, margin_m: float | None) -> float:
    """What `goshawk plan` asks of a waypoint for this vehicle; without one, for what carried the map's cameras.

    Raises:
        FlightError: the vehicle cannot be read.
        InputError: the radius or the margin is out of its range.
    """
    import vehicle

    if vehicle_file is None and radius_m is None:
        radius_m = float(area.facts.get("carrier_radius_m", DenseOptions().carrier_radius_m))
    asked = console.body_options(radius_m, margin_m)
    return (asked if vehicle_file is None else asked.sized(vehicle.load(vehicle_file))).waypoint_clearance_m


def on_foot(area: Map) -> tuple[float, float]:
    """Lowest and highest place (world z) at which the cameras can be held as they were."""
    height_m = area.T_world_body[:, 2, 3]
    return float(height_m.min(initial=np.inf)) - _HANDS_M, float(height_m.max(initial=-np.inf)) + _HANDS_M


def find(
    area: Map, options: ViewOptions, *, near_world_m: FloatArray | None = None, progress: Progress = silent
) -> Again:
    """
    Raises:
        InputError: the map is refused, has no images, or no space with the clearance.
    """
    area.require_not_refused()
    return view_planning.look_again(
        area.field, area.rig, area.T_world_body, options, near_world_m=near_world_m, progress=progress
    )


def waypoints(found: Again) -> Waypoints:
    """The views as waypoints with headings, in the order of the tour."""
    return Waypoints(
        np.array([view.position_world_m for view in found.views]),
        np.array([view.heading_rad for view in found.views]),
    )


def sentence(found: Again) -> str:
    """What the views would show."""
    if not found.views:
        left = (
            f"; {found.unknown_m3:.2f} m3 of unknown space are seen from no such place"
            if found.unknown_m3 > 0.0
            else ""
        )
        return f"nothing beside the free space is worth another look{left}"
    return (
        f"{len(found.views)} views would show about {found.shown_m3:.2f} m3 of the {found.unknown_m3:.2f} m3 of "
        "unknown space beside the free space"
    )
