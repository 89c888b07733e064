"""Points in metres with z up, and from where each was measured, if somebody says so."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError, Progress, silent
from mapping import foreign_mesh, reach
from mapping.cloud import columns as files
from mapping.cloud import point_file
from mapping.input import trajectory

VIEWPOINT = ("vp_x", "vp_y", "vp_z")
"""PCL's names of the place from which a point was measured."""
_OF_POSES = (".e57",)
"""Kinds of file that state the pose of each scan, so that a scanner may stand at 0, 0, 0."""
TIMES = ("time", "timestamp", "t", "gps_time", "GpsTime")
_TIME_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_LARGEST_TIME_STEP_S = 1e-3
"""Of the numbers that hold times: at the speed of a car 3 cm."""


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points of another program."""

    points_world_m: FloatArray
    """(n, 3) finite, z up."""
    origins_world_m: FloatArray | None
    """(n, 3) from where each was measured, NaN where that is unknown; None: of none."""
    not_finite: int
    """Points of the file that were left out."""
    unit: str
    """And why."""
    up: str
    """The direction in the file, and why."""
    sensor: str | None
    """What says from where they were measured."""


def read(
    path: Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    sensor_world_m: FloatArray | None = None,
    poses: Path | None = None,
    viewpoints: bool = False,
    origin: FloatArray | None = None,
    progress: Progress = silent,
) -> PointCloud:
    """Read a file of points: PLY, PCD, LAS, LAZ, E57.

    Args:
        unit: of `foreign_mesh.UNITS_M`; None: as the file states, or guessed from the extent.
        up: an axis like `y` or `-z`, or `X,Y,Z`; None: z.
        sensor_world_m: (3,) from where all points were measured.
        poses: file of the sensor's poses, in metres in the axes of the cloud, in TUM's or EuRoC's format; each point's
            own time says from which it was measured.
        viewpoints: whether the points' own columns `VIEWPOINT` say so, an E57 file's scans, or a PCD file's header.
        origin: (3,) in the file's numbers, what becomes the origin of the map's frame; None: the file's own.

    Raises:
        InputError: the file is missing, of another type or too large, the unit cannot be right, times are of another
            clock, or more than one thing says from where the points were measured.
        FormatError: it is damaged, or holds no finite point, or lacks columns that are asked for.
    """
    if sum((sensor_world_m is not None, poses is not None, viewpoints)) > 1:
        raise InputError("give one of --sensor, --sensor-poses and --viewpoints: each says from where was measured")
    columns = files.read(path, progress=progress)
    points = _stacked(columns, ("x", "y", "z"))
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise FormatError(f"{path} holds {len(points)} points, none of which is finite; export it again")
    dropped = int((~finite).sum())
    points = points[finite] if dropped else points
    R_world_file, up_because = foreign_mesh.rotation(path, up)
    given = "as the file states" if unit is None else "as given"
    unit = files.stated_unit(path, unit)
    unit_m, unit_because = foreign_mesh.scale(path, float(np.ptp(points, axis=0).max()), unit, given=given)
    foreign_mesh.require_fine(path, unit_m * max(reach.single_step(points[:, k]) for k in range(3)))
    start = np.zeros(3) if origin is None else origin
    points = (points - start) @ (unit_m * R_world_file.T)
    reach.require_near_origin(points, str(path), foreign_mesh.origin_remedy(start + points[0] @ R_world_file / unit_m))
    origins, sensor = None, None
    if sensor_world_m is not None:
        origins, sensor = np.broadcast_to(sensor_world_m, points.shape), "one place, as given"
    elif viewpoints:
        places = _viewpoints(path, columns)[finite] - start
        origins, sensor = places @ (unit_m * R_world_file.T), "the points' viewpoints"
    elif poses is not None:
        positions, time_unit = _sensor_at(poses, _times(path, columns)[finite])
        positions -= unit_m * start
        origins, sensor = positions @ R_world_file.T, f"poses of {poses.name}, times of points in {time_unit}"
    if origins is not None:
        _require_near(path, points, origins)
    return PointCloud(points, origins, dropped, unit_because, up_because, sensor)


def _require_near(path: Path, points_world_m: FloatArray, origins_world_m: FloatArray) -> None:
    beyond_m = np.fmax(points_world_m.min(axis=0) - np.nanmin(origins_world_m, axis=0), 0.0)
    beyond_m = np.fmax(np.nanmax(origins_world_m, axis=0) - points_world_m.max(axis=0), beyond_m)
    if (farthest_m := float(beyond_m.max())) > foreign_mesh.EXTENT_M[1]:
        raise InputError(
            f"{path}: a sensor would be {farthest_m:.4g} m from the points, at most {foreign_mesh.EXTENT_M[1]:g} m may "
            "be: its positions are in another unit or frame"
        )


def _stacked(columns: Mapping[str, NDArray[np.generic]], names: tuple[str, ...]) -> FloatArray:
    points = np.empty((len(columns[names[0]]), len(names)))
    for k, name in enumerate(names):
        points[:, k] = columns[name]
    return points


def _viewpoints(path: Path, columns: Mapping[str, NDArray[np.generic]]) -> FloatArray:
    if missing := [name for name in VIEWPOINT if name not in columns]:
        if (place := point_file.viewpoint(path)) is not None:
            return np.tile(np.array(place), (len(columns["x"]), 1))
        raise FormatError(
            f"{path}: its points have no {', '.join(missing)}, and no header names a VIEWPOINT besides 0 0 0, which "
            "programs write that know none; give --sensor or --sensor-poses instead"
        )
    origins = _stacked(columns, VIEWPOINT)
    known = origins[np.isfinite(origins).all(axis=1)]
    if not len(known) or (path.suffix.lower() not in _OF_POSES and not np.any(known)):
        raise FormatError(
            f"{path}: its points' places of measurement are all 0 or not known, which programs write that know none; "
            "give --sensor or --sensor-poses instead"
        )
    origins[~np.isfinite(origins).all(axis=1)] = np.nan
    return origins


def _times(path: Path, columns: Mapping[str, NDArray[np.generic]]) -> NDArray[np.generic]:
    name = next((name for name in TIMES if name in columns), None)
    if name is None:
        names = ", ".join(TIMES)
        raise FormatError(f"{path}: its points have no time ({names}), which --sensor-poses needs; give --sensor")
    times = columns[name]
    largest = np.nanmax(np.abs(times.astype(np.float64)))
    if times.dtype.kind == "f" and np.spacing(largest.astype(times.dtype)) > _LARGEST_TIME_STEP_S:
        raise InputError(
            f"{path}: its {name} of {8 * times.dtype.itemsize} bits goes to {largest:.6g}, where numbers are "
            f"{np.spacing(largest.astype(times.dtype)):.2g} apart; export it in 64 bits, or from the first point on"
        )
    return times


def _within(low_s: float, high_s: float, first_s: float, last_s: float) -> bool:
    """Whether at least half of the points' times are among those of the poses."""
    return min(high_s, last_s) - max(low_s, first_s) >= 0.5 * (high_s - low_s)


def _sensor_at(path: Path, times: NDArray[np.generic]) -> tuple[FloatArray, str]:
    """(n, 3) where the sensor was at each point's time, in the frame of its poses; NaN where no pose is near.

    Returns:
        With the unit of the times: the largest that makes most of them times of the poses.
    """
    recorded = trajectory.read(path)
    first_s, last_s = recorded.time_s[[0, -1]]
    numbers = times.astype(np.float64)
    low, high = np.nanmin(numbers), np.nanmax(numbers)
    unit = next((unit for unit, s in _TIME_UNITS_S.items() if _within(low * s, high * s, first_s, last_s)), None)
    if unit is None:
        raise InputError(
            f"{path}: its times go from {first_s:.3f} to {last_s:.3f} s, those of the points from {low:.6g} to "
            f"{high:.6g}, by another clock; export both by one clock, in seconds"
        )
    time_s = numbers * _TIME_UNITS_S[unit]
    positions_m = recorded.T_start_body[:, :3, 3]
    origins = np.stack([np.interp(time_s, recorded.time_s, positions_m[:, axis]) for axis in range(3)], axis=1)
    origins[~recorded.interpolates(time_s)] = np.nan
    if not np.isfinite(origins[:, 0]).any():
        raise InputError(f"{path} has no poses near the times of the points, {low:.6g} to {high:.6g}")
    return origins, unit


def joined(clouds: Sequence[PointCloud]) -> PointCloud:
    """Scans of one place and frame as one cloud.

    Raises:
        InputError: they were read in different units, or hold too many points.
    """
    first = clouds[0]
    if units := {cloud.unit.split(" ")[0] for cloud in clouds[1:]} - {first.unit.split(" ")[0]}:
        raise InputError(f"the unit of the first file is {first.unit}, of another one {units.pop()}: give --unit")
    count = sum(len(cloud.points_world_m) for cloud in clouds)
    if count > point_file.MOST_POINTS:
        raise InputError(
            f"together the files hold {count / 1e6:.4g} million points, at most "
            f"{point_file.MOST_POINTS / 1e6:g} million are read: thin them"
        )
    known = [
        np.full(c.points_world_m.shape, np.nan) if c.origins_world_m is None else c.origins_world_m for c in clouds
    ]
    return PointCloud(
        np.concatenate([cloud.points_world_m for cloud in clouds]),
        None if all(c.origins_world_m is None for c in clouds) else np.concatenate(known),
        sum(cloud.not_finite for cloud in clouds),
        first.unit,
        first.up,
        None if first.sensor is None else f"of each of {len(clouds)} files: {first.sensor}",
    )
