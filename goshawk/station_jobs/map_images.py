"""Make the project's map from images in its folder: what `goshawk map build` does."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec

import mapping
from esdf import load_edits
from esdf.edits import EDITS
from flight import InputError, Progress
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Choices, Kind
from goshawk.commands.map.build import CARRIER_M, THINNEST_M, VOXEL_M, length_from
from mapping.input import trajectory

_IMAGES = (".jpg", ".jpeg", ".png")
_RECORDED = (".csv", ".txt", ".tum")
_NO_FILE = ""


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    images: Annotated[str, msgspec.Meta(title="Images", description="Folder in the project")]
    camera: Annotated[str, msgspec.Meta(title="Camera file", description="Of the rig, in the project")]
    length: Annotated[str, msgspec.Meta(title="Measured length", description="[IMAGE_A,IMAGE_B,]METRES, or empty")] = ""
    poses: Annotated[
        str, msgspec.Meta(title="Recorded poses", description="Of a tracker, z up: TUM's or EuRoC's format, metres")
    ] = _NO_FILE
    odometry: Annotated[
        str, msgspec.Meta(title="Recorded odometry", description="In any frame: TUM's or EuRoC's format, metres")
    ] = _NO_FILE
    voxel_m: Annotated[
        float, msgspec.Meta(title="Voxel", ge=VOXEL_M[0], le=VOXEL_M[1], extra_json_schema={"unit": "m"})
    ] = 0.05
    carrier_radius_m: Annotated[
        float,
        msgspec.Meta(
            title="Radius of the carrier",
            description="What carried the cameras swept this much about each of them",
            ge=CARRIER_M[0],
            le=CARRIER_M[1],
            extra_json_schema={"unit": "m"},
        ),
    ] = 0.2
    thinnest_m: Annotated[
        float,
        msgspec.Meta(
            title="Thinnest obstacle (0: not asked)",
            description="Space is unknown where an obstacle this thick could be missing",
            ge=0.0,
            le=THINNEST_M[1],
            extra_json_schema={"unit": "m"},
        ),
    ] = 0.0
    overwrite: Annotated[bool, msgspec.Meta(title="Replace the present map (kept beside, its edits stay)")] = False


class Result(msgspec.Struct, frozen=True):
    verdict: str
    placed: int
    images: int
    reasons: list[str]


def image_folders(project: Project) -> list[str]:
    """Names of the project's folders that hold images, themselves or in a folder for each camera."""
    folders = [path for path in sorted(project.folder.iterdir()) if path.is_dir() and not path.name.startswith(".")]
    return [path.name for path in folders if path.name != "map" and _holds_images(path)]


def _holds_images(folder: Path) -> bool:
    """Not if it cannot be read: `lost+found`."""
    try:
        within = [*folder.iterdir()]
        return any(
            path.suffix.lower() in _IMAGES
            for place in (folder, *(path for path in within if path.is_dir()))
            for path in place.iterdir()
        )
    except OSError:
        return False


def _cameras(project: Project) -> list[str]:
    places = [project.folder, *(project.folder / name for name in image_folders(project))]
    found = [path for place in places for path in sorted(place.glob("*camera*.toml"))]
    return [path.relative_to(project.folder).as_posix() for path in found]


def _recorded(project: Project) -> list[str]:
    """Files that hold recorded motion, by their first line."""
    places = [project.folder, *(project.folder / name for name in image_folders(project))]
    found = [path for place in places for path in sorted(place.iterdir()) if path.suffix.lower() in _RECORDED]
    return [path.relative_to(project.folder).as_posix() for path in found if trajectory.looks_like_one(path)]


def _choices(project: Project) -> Choices:
    recorded = [_NO_FILE, *_recorded(project)]
    return {
        "images": image_folders(project),
        "camera": _cameras(project),
        "poses": recorded,
        "odometry": recorded,
    }


def _check(project: Project, asked: Arguments) -> None:
    if asked.images not in image_folders(project):
        raise InputError(f"{asked.images!r} is no folder of images in this project; copy one into it, then look again")
    if asked.camera not in _cameras(project):
        raise InputError(f"{asked.camera!r} is no camera file in this project (*camera*.toml)")
    if 0.0 < asked.thinnest_m < THINNEST_M[0]:
        raise InputError(
            f"the thinnest obstacle is {asked.thinnest_m:g} m; from {THINNEST_M[0]:g} m on, or 0: not asked"
        )
    for name in (asked.poses, asked.odometry):
        if name and name not in _recorded(project):
            raise InputError(f"{name!r} is no file of recorded motion in this project (TUM's or EuRoC's format)")
    if project.map.exists() and not asked.overwrite:
        raise InputError("the project has a map; choose to replace it, and the present one is kept beside")


def _foresee(project: Project, asked: Arguments) -> str:
    rig = mapping.rig.load(project.folder / asked.camera)
    counts = {camera.name: _count(project.folder / asked.images / camera.folder) for camera in rig.cameras}
    said = [f"{name}: {count} images" for name, count in counts.items()]
    missing = [name for name, count in counts.items() if not count]
    if missing:
        said.append(f"no image of {', '.join(missing)} is where the camera file says")
    for what, name in (("poses", asked.poses), ("odometry", asked.odometry)):
        if name:
            motion = trajectory.read(project.folder / name)
            said.append(f"recorded {what}: {len(motion.time_s)} over {motion.time_s[-1] - motion.time_s[0]:.0f} s")
    if asked.length:
        said.append(f"metres by the measured length {asked.length}")
    if project.map.exists():
        listed = project.map / "esdf" / EDITS
        edits = len(load_edits(listed)) if listed.exists() else 0
        said.append(f"the present map is kept beside, its {edits} edits are applied to the new one")
    return "; ".join(said)


def _count(folder: Path) -> int:
    try:
        return sum(path.suffix.lower() in _IMAGES for path in folder.iterdir())
    except OSError:
        return 0


def _run(folder: Path, asked: Arguments, progress: Progress) -> Result:
    base = mapping.MapOptions()
    options = replace(
        base,
        dense=replace(
            base.dense,
            voxel_m=asked.voxel_m,
            carrier_radius_m=asked.carrier_radius_m,
            thinnest_m=asked.thinnest_m,
        ),
        length=length_from(asked.length) if asked.length else None,
        poses=folder / asked.poses if asked.poses else None,
        odometry=folder / asked.odometry if asked.odometry else None,
    )
    rig = mapping.rig.load(folder / asked.camera)
    out = Project(folder, "").map
    report = mapping.build_map(folder / asked.images, rig, out, options, overwrite=asked.overwrite, progress=progress)
    return Result(str(report.verdict), report.images_placed, report.images, list(report.reasons))


def _done(_: Desk, result: Result) -> str:
    because = f": {'; '.join(result.reasons)}" if result.reasons else ""
    return f"the map is {result.verdict}{because}. {result.placed} of {result.images} images placed"


def _written(project: Project, _: Arguments) -> Path:
    return project.map


KIND = Kind("map", "Map from images", Arguments, _run, _done, _choices, _check, _foresee, _written)
