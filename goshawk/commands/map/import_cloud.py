"""The points of `goshawk map import`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, InputError, Progress
from goshawk.terminal import console


@dataclass(frozen=True, slots=True)
class Rays:
    """From where the points were measured, as the options say; one of them at most."""

    sensors: tuple[str, ...]
    """One for all files, or one for each."""
    poses: Path | None
    viewpoints: bool


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """How coordinates of the files are taken; None: as these say, or as is guessed."""

    unit: str | None
    up: str | None
    origin: FloatArray | None
    """(3,) in the files' numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Options:
    """What becomes occupied and free."""

    voxel_m: float
    least_points: int
    observed_world_m: FloatArray
    """(n, 3)."""
    gap_m: float


def read(
    files: Sequence[Path], taken: Taken, rays: Rays, options: Options, progress: Progress
) -> tuple[Any, Any, dict[str, Any]]:
    """The surface of the occupied voxels, all voxels, and facts about them."""
    from mapping import foreign_mesh
    from mapping.cloud import occupancy, point_cloud

    places = [np.array(console.numbers("--sensor", text, 3)) for text in rays.sensors]
    if len(places) not in (0, 1, len(files)):
        raise InputError(
            f"--sensor is given {len(places)} times for {len(files)} files; give it once, or once for each"
        )
    stations = places if len(places) == len(files) else [places[0] if places else None] * len(files)
    clouds = [
        point_cloud.read(
            file,
            unit=taken.unit,
            up=taken.up,
            sensor_world_m=station,
            poses=rays.poses,
            viewpoints=rays.viewpoints,
            origin=taken.origin,
            progress=progress,
        )
        for file, station in zip(files, stations, strict=True)
    ]
    cloud = clouds[0] if len(clouds) == 1 else point_cloud.joined(clouds)
    progress("voxels", 0.3)
    carved = occupancy.carve(
        cloud,
        options.voxel_m,
        least_points=options.least_points,
        observed_world_m=options.observed_world_m,
        gap_m=options.gap_m,
        progress=progress,
    )
    vertices, faces, side_m = occupancy.surface(carved.space)
    mesh = foreign_mesh.ForeignMesh(vertices, faces, cloud.unit, cloud.up, 0)
    facts = {
        "points": len(cloud.points_world_m),
        "not_finite": cloud.not_finite,
        "least_points": options.least_points,
        "gap_m": options.gap_m if len(options.observed_world_m) else None,
        "sensor": cloud.sensor,
        "rays": carved.rays,
        "stopped_rays": carved.stopped,
        "surface_m": side_m,
        "parts": foreign_mesh.parts(mesh),
    }
    return mesh, carved.space, facts
