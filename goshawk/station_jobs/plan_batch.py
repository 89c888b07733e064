"""Plan every mission of a folder in the project: what `goshawk plan batch` does."""

from pathlib import Path
from typing import Annotated, Any

import msgspec

import vehicle
from flight import InputError, Progress
from flight.project import Project, part_name
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Choices, Kind
from goshawk.commands.plan import batch, batch_mission, batch_work
from goshawk.commands.plan.plan_options import options_from


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    missions: Annotated[str, msgspec.Meta(title="Missions", description="Folder of waypoint files in the project")]
    out: Annotated[str, msgspec.Meta(title="Results", description="Folder to write, in the project")] = "plans"
    margin_m: Annotated[float, msgspec.Meta(title="Margin", ge=0.0, le=10.0, extra_json_schema={"unit": "m"})] = 0.15
    radius_m: Annotated[
        float,
        msgspec.Meta(
            title="Radius (0: its propellers')",
            description="Of a ball that holds the vehicle",
            ge=0.0,
            le=10.0,
            extra_json_schema={"unit": "m"},
        ),
    ] = 0.0
    processes: Annotated[int, msgspec.Meta(title="Processes", ge=1, le=32)] = 1
    overwrite: Annotated[bool, msgspec.Meta(title="Plan again what was planned with other inputs")] = False


def folders(project: Project) -> list[str]:
    """Names of the project's folders that hold waypoint files."""
    names = [path.name for path in sorted(project.folder.iterdir()) if path.is_dir() and not path.name.startswith(".")]
    own = {"map", "trajectories", "flights", "learned"}
    return [name for name in names if name not in own and _holds_missions(project.folder / name)]


def _holds_missions(folder: Path) -> bool:
    """Not if it cannot be read: `lost+found`."""
    try:
        return not (folder / batch.JOURNAL).exists() and any(path.suffix in batch.SUFFIXES for path in folder.iterdir())
    except OSError:
        return False


def _choices(project: Project) -> Choices:
    return {"missions": folders(project)}


def _check(project: Project, asked: Arguments) -> None:
    if asked.missions not in folders(project):
        raise InputError(f"{asked.missions!r} is no folder of waypoint files in this project; add one, then look again")
    part_name(asked.out)
    if asked.out == asked.missions or asked.out in ("map", "trajectories", "flights"):
        raise InputError(f"results cannot be written to {asked.out}; choose another folder")


def _run(folder: Path, asked: Arguments, progress: Progress) -> list[batch_work.Row]:
    project = Project(folder, "")
    drone = vehicle.load(project.vehicle)
    how = options_from(drone, asked.margin_m, radius_m=asked.radius_m or None).sized(drone)
    job = batch_mission.Job(project.map, project.vehicle, how, folder / asked.out, overwrite=asked.overwrite)
    files = batch.mission_files(folder / asked.missions)
    return batch.run(files, job, jobs=asked.processes, progress=progress)


def _done(_: Desk, rows: list[dict[str, Any]]) -> str:
    planned = sum(row["status"] == "planned" for row in rows)
    refused = "; ".join(f"{row['name']}: {row['reason']}" for row in rows if row["status"] != "planned")
    return f"{planned} of {len(rows)} missions planned" + (f". {refused}" if refused else "")


def _written(project: Project, asked: Arguments) -> Path:
    return project.folder / asked.out


KIND = Kind("plan_batch", "Plan a folder of missions", Arguments, _run, _done, _choices, _check, writes=_written)
