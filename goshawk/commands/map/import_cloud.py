"""The points of `goshawk map import`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, Progress
from goshawk.terminal import console


@dataclass(frozen=True, slots=True)
class Rays:
    """From where the points were measured, as the options say; one of them at most."""

    sensor: str | None
    poses: Path | None
    viewpoints: bool


@dataclass(frozen=True, slots=True, eq=False)
class Options:
    """What becomes occupied and free."""

    voxel_m: float
    least_points: int
    observed_world_m: FloatArray
    """(n, 3)."""
    gap_m: float


def read(
    file: Path, unit: str | None, up: str | None, rays: Rays, options: Options, progress: Progress
) -> tuple[Any, Any, dict[str, Any]]:
    """The surface of the occupied voxels, all voxels, and facts about them."""
    from mapping import foreign_mesh
    from mapping.cloud import occupancy, point_cloud

    sensor = None if rays.sensor is None else np.array(console.numbers("--sensor", rays.sensor, 3))
    cloud = point_cloud.read(
        file, unit=unit, up=up, sensor_world_m=sensor, poses=rays.poses, viewpoints=rays.viewpoints
    )
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
    facts = {
        "points": len(cloud.points_world_m),
        "not_finite": cloud.not_finite,
        "least_points": options.least_points,
        "gap_m": options.gap_m if len(options.observed_world_m) else None,
        "sensor": cloud.sensor,
        "rays": carved.rays,
        "stopped_rays": carved.stopped,
        "surface_m": side_m,
    }
    return foreign_mesh.ForeignMesh(vertices, faces, cloud.unit, cloud.up, 0), carved.space, facts
