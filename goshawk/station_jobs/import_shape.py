"""Make the project's map of a mesh, a point cloud or a ROS map that was sent: what `goshawk map import` does."""

from pathlib import Path
from typing import Annotated, Any

import msgspec

from flight import FlightError, InputError, Progress
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs import incoming
from gcs_web.jobs.jobs import Choices, Kind
from goshawk.commands.learn import fit_options
from goshawk.commands.map import import_map
from goshawk.station_jobs.flights import in_words_of

_GUESSED = "as in the file"
_UNITS, _AXES = (_GUESSED, "m", "mm", "cm", "ft"), (_GUESSED, "z", "y", "x", "-z", "-y", "-x")
_VOXEL_M = (0.01, 1.0)
LARGEST_LOOK_BYTES = 20_000_000
"""Of a file that is read while the form is filled in."""
BOXES = {
    "--observed X,Y,Z": 'the box "A place that is free"',
    "--observed": 'the box "A place that is free"',
    "--sensor-poses": "the command line (poses)",
    "--viewpoints": "the command line (viewpoints)",
    "--sensor": 'the box "Measured from"',
    "--heights LOW,HIGH": 'the box "Between heights"',
    "--heights": 'the box "Between heights"',
    "--origin": 'the box "Origin"',
    "--voxel": 'the box "Voxel"',
    "--gap": "the command line (gap)",
    "--least-points": "the command line (least points)",
    "--dry-run": "the command line (dry run)",
    "--out": "the command line (out)",
    "--unit": 'the box "Unit"',
    "--up": 'the box "Up"',
}
"""Options that the verb's messages name, and what the form has in their place."""


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    file: Annotated[str, msgspec.Meta(title="File", description="PLY, OBJ, STL, GLB, PCD, or a ROS map's YAML.")]
    unit: Annotated[str, msgspec.Meta(title="Unit")] = _GUESSED
    up: Annotated[str, msgspec.Meta(title="Up", description="Direction in the file that points up")] = _GUESSED
    origin: Annotated[
        str, msgspec.Meta(title="Origin", description="X, Y, Z in the file that become the map's origin; or empty")
    ] = ""
    observed: Annotated[
        str,
        msgspec.Meta(title="A place that is free", description="X, Y, Z in the map: free, with all about it to a wall"),
    ] = ""
    sensor: Annotated[
        str, msgspec.Meta(title="Measured from", description="X, Y, Z in the map, for points of one place; or empty")
    ] = ""
    heights: Annotated[
        str, msgspec.Meta(title="Between heights", description="LOW, HIGH in metres, of a ROS map; or empty")
    ] = ""
    voxel_m: Annotated[
        float, msgspec.Meta(title="Voxel", ge=_VOXEL_M[0], le=_VOXEL_M[1], extra_json_schema={"unit": "m"})
    ] = 0.05
    overwrite: Annotated[bool, msgspec.Meta(title="Replace the present map (kept beside, its edits stay)")] = False


class Result(msgspec.Struct, frozen=True):
    free_m3: float
    occupied_m3: float


def _choices(project: Project) -> Choices:
    return {"file": incoming.listed(project, (*incoming.SHAPES, *incoming.FLOORS)), "unit": _UNITS, "up": _AXES}


def _is_floor(file: Path) -> bool:
    return file.suffix.lower() in incoming.FLOORS


def _stated(value: str) -> str | None:
    return None if value == _GUESSED else value


def _typed(text: str) -> str | None:
    return text if text.strip() else None


def _check(project: Project, asked: Arguments) -> None:
    incoming.found(project, asked.file)
    for value, allowed in ((asked.unit, _UNITS), (asked.up, _AXES)):
        if value not in allowed:
            raise InputError(f"{value!r} is none of {', '.join(allowed)}")
    if project.has_map and not asked.overwrite:
        raise InputError("the project has a map; choose to replace it, and the present one is kept beside")


def _foresee(project: Project, asked: Arguments) -> str:
    file = incoming.found(project, asked.file)
    if _is_floor(file):
        return "it is a map of one height: say between which heights its walls stand"
    if file.stat().st_size > LARGEST_LOOK_BYTES:
        return f"{file.name} is large; its unit and axes are said when it is read"
    try:
        found = import_map.look(file, _stated(asked.unit), _stated(asked.up), _typed(asked.origin))
    except FlightError as error:
        raise type(error)(fit_options.worded(str(error), BOXES)) from error
    if asked.observed or asked.sensor or not import_map.takes(file, "--observed"):
        return found
    return f"nothing is free until you name a place that is; {found}"


@in_words_of(BOXES)
def _run(folder: Path, asked: Arguments, progress: Progress) -> Result:
    project = Project(folder, "")
    file = incoming.found(project, asked.file)
    wanted = import_map.Asked(
        unit=_stated(asked.unit),
        up=_stated(asked.up),
        voxel_m=asked.voxel_m if import_map.takes(file, "--voxel") else None,
        observed=(asked.observed,) if asked.observed.strip() else (),
        sensors=(asked.sensor,) if asked.sensor.strip() else (),
        origin=_typed(asked.origin),
        heights=_typed(asked.heights),
        beside=True,
    )
    _, found = import_map.import_file(
        file, project.map, wanted, dry_run=False, overwrite=asked.overwrite, progress=progress
    )
    return Result(found["free_m3"], found["occupied_m3"])


def _done(_: Desk, result: Result) -> str:
    if not result.free_m3:
        return "the map has no free space yet: name a place that is free, and import again"
    return f"the map has {result.free_m3:.1f} m³ of free space"


def _written(project: Project, _: Any) -> Path:
    return project.map


KIND = Kind("import_map", "Map from a file", Arguments, _run, _done, _choices, _check, _foresee, _written)
