"""Where to look again in the project's map, as waypoints of the plan: what `goshawk map again` does."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

import mapping
from flight import InputError, Progress, Waypoints, mission
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Kind
from goshawk.commands.map import look_again
from mapping.exploration.view_planning import ViewOptions

_DEFAULT = ViewOptions()


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    margin_m: Annotated[float, msgspec.Meta(title="Margin", ge=0.0, le=10.0, extra_json_schema={"unit": "m"})] = 0.15
    near_plan: Annotated[bool, msgspec.Meta(title="Only near the present waypoints")] = False
    within_m: Annotated[float, msgspec.Meta(title="How near", ge=0.1, le=100.0, extra_json_schema={"unit": "m"})] = (
        ViewOptions().within_m
    )
    on_foot: Annotated[bool, msgspec.Meta(title="Only at the heights at which the images were taken")] = False


class Result(msgspec.Struct, frozen=True):
    sentence: str
    positions_world_m: list[tuple[float, float, float]]
    heading_rad: list[float]


def _check(opened: Project, asked: Arguments) -> None:
    if not opened.map.is_dir():
        raise InputError("this project has no map; make one of images first")
    if asked.near_plan:
        _present_waypoints(opened)


def _present_waypoints(opened: Project) -> Waypoints:
    points = mission.load(opened.waypoints).waypoints if opened.waypoints.is_file() else None
    if points is None or not len(points.positions_world_m):
        raise InputError("there are no waypoints yet to look near to")
    return points


def _run(folder: Path, asked: Arguments, progress: Progress) -> Result:
    opened = Project(folder, "")
    area = mapping.open_map(opened.map)
    options = ViewOptions(
        clearance_m=look_again.clearance_m(
            area, opened.vehicle if opened.vehicle.is_file() else None, None, asked.margin_m
        ),
        within_m=asked.within_m,
        heights_world_m=look_again.on_foot(area) if asked.on_foot else _DEFAULT.heights_world_m,
    )
    near = _present_waypoints(opened).positions_world_m if asked.near_plan else None
    found = look_again.find(area, options, near_world_m=near, progress=progress)
    return Result(
        look_again.sentence(found),
        [view.position_world_m for view in found.views],
        [view.heading_rad for view in found.views],
    )


def _done(desk: Desk, result: Result) -> str:
    if not result.positions_world_m:
        return result.sentence
    points = Waypoints(np.array(result.positions_world_m), np.array(result.heading_rad))
    desk.session.take(points, "waypoints to look again", "the station")
    return f"{result.sentence}. They are the plan's waypoints now; undo brings back those of before"


KIND = Kind("look_again", "Where to look again", Arguments, _run, _done, check=_check)
