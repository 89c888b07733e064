"""Fill an empty project with an example: a room with two pillars, a vehicle, and a path between the pillars."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

import vehicle
from flight import InputError, Progress, Waypoints, project
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs import incoming
from gcs_web.jobs.jobs import Kind
from goshawk.commands.map import import_map

_ROOM_M = (6.0, 4.0, 2.5)
_PILLARS_M = ((2.0, 1.5, 0.25), (4.0, 2.6, 0.35))
"""x, y and radius."""
_PATH_M = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    pass


def _check(opened: Project, _: Arguments) -> None:
    there = {"map": opened.has_map, "vehicle": opened.has_vehicle, "path": opened.waypoints.exists()}
    if any(there.values()):
        kept = " and a ".join(part for part, has in there.items() if has)
        raise InputError(f"the project has a {kept}, which the example would replace; make a new project for it")


def _run(folder: Path, _: Arguments, progress: Progress) -> None:
    opened = Project(folder, "")
    mesh = incoming.place(opened, "example room.ply")
    mesh.parent.mkdir(parents=True, exist_ok=True)
    _room().export(mesh)
    asked = import_map.Asked(unit="m", up="z", voxel_m=0.05, observed=("0.8,0.8,1.0",))
    import_map.import_file(mesh, opened.map, asked, dry_run=False, overwrite=False, progress=progress)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    project.save_waypoints(opened.waypoints, Waypoints(_PATH_M, np.full(len(_PATH_M), np.nan)))


def _room() -> Any:
    import trimesh

    walls = trimesh.creation.box(bounds=np.array([np.zeros(3), _ROOM_M]))
    walls.invert()  # it is seen from inside
    height_m = _ROOM_M[2]
    pillars = [
        trimesh.creation.cylinder(
            radius_m, height_m, transform=trimesh.transformations.translation_matrix([x_m, y_m, height_m / 2])
        )
        for x_m, y_m, radius_m in _PILLARS_M
    ]
    return trimesh.util.concatenate([walls, *pillars])


def _done(_: Desk, __: None) -> str:
    return "a room with two pillars, a vehicle and a path are here: plan, then start the simulator"


KIND = Kind("example", "Example", Arguments, _run, _done, check=_check)
