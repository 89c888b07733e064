"""Saved trajectories beside each other, as a page of their own, and those that were moved aside."""

import contextlib
import os
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flight import FlightError, FloatArray, FormatError, InputError, TrajectoryFile, trajectory
from flight.project import Project
from gcs_web.planning import page_values
from gcs_web.protocol.trajectories import Aside, PlanSummary, SavedTrajectory
from mapping import Map
from mapping.free_space import FreeSpace
from planner import GateReport, PlanOptions
from planner.gate import could_hide, gate, plan_report
from vehicle import Limits, Vehicle

_ASIDE = "*.json.old-*"
"""As `flight.results` names what was discarded or replaced; nothing of Goshawk's ever deletes these."""


class Judged(NamedTuple):
    """A trajectory under the gate, for the map and the vehicle as they are now."""

    report: GateReport
    options: PlanOptions
    limits: Limits


def judge(item: TrajectoryFile, area: Map, free: FreeSpace | None, believed: Vehicle) -> Judged:
    """Under the gate as it was planned, and the vehicle's limits where they are stricter now.

    Args:
        free: the map's free space, `area.free_space()`.
    """
    options = gate.options_of(item)
    options = replace(options, limits=options.limits and options.limits.stricter(believed.limits))
    report = gate.check_file(item, area.field, believed, options)
    report = could_hide.add(report, item.trajectory, free, could_hide.asked_of(item))
    return Judged(report, options, options.limits_for(believed))


def summary(item: TrajectoryFile, area: Map, believed: Vehicle) -> PlanSummary:
    """What two trajectories are compared by."""
    judged = judge(item, area, area.free_space(), believed)
    series = page_values.series(item.trajectory, believed, area.field, judged.limits)
    judged_m = page_values.judged_clearance(item.trajectory, area.field, judged.report, series)
    path_m = np.stack([series.x_m, series.y_m, series.z_m], axis=1)
    return PlanSummary(
        name=item.name,
        passes=judged.report.passed,
        failures=[check.name for check in judged.report.failures],
        duration_s=item.trajectory.duration_s,
        length_m=_length_m(path_m),
        top_speed_m_s=max(series.speed_m_s),
        limits=page_values.limits(judged.report, series, judged_m),
    )


def _length_m(path_m: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(path_m, axis=0), axis=1).sum())


def page(item: TrajectoryFile, area: Map, believed: Vehicle) -> str:
    """One HTML file that shows the trajectory without this station, or any network."""
    judged = judge(item, area, area.free_space(), believed)
    return plan_report.page(item, judged.report, area.field, believed, judged.limits)


def aside(project: Project) -> list[Aside]:
    """Trajectories that were discarded or replaced, newest first."""
    found: list[tuple[Path, os.stat_result]] = []
    for path in (project.folder / "trajectories").glob(_ASIDE):
        with contextlib.suppress(OSError):  # restored just now, or a link that leads nowhere
            found.append((path, path.stat()))
    return [_aside(*each) for each in sorted(found, key=lambda each: (-each[1].st_ctime_ns, each[0].name))]


def restore(project: Project, file: str) -> str:
    """Give a trajectory that was moved aside its name back; returns the name.

    Raises:
        InputError: it is not there (any more), or the name is taken.
    """
    found = next((each for each in aside(project) if each.file == file), None)
    if found is None:
        raise InputError(f"{file!r} is not in the bin (any more)")
    path = project.trajectory(found.name)
    try:
        path.hardlink_to(path.with_name(file))  # never over another file
    except FileExistsError as error:
        raise InputError(
            f"there is a trajectory {found.name}; discard that one first, then restore this one"
        ) from error
    path.with_name(file).unlink()
    return found.name


def listed(path: Path, hashes: tuple[str, str]) -> SavedTrajectory:
    """A saved trajectory, checked if it was for this map and vehicle (their hashes)."""
    saved_at = ""
    try:
        saved_at = datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="seconds")
        file = trajectory.load(path)
    except (FormatError, InputError, OSError):
        return SavedTrajectory(path.stem, 0.0, False, saved_at)
    current = file.checked and file.as_checked and (file.map_hash, file.vehicle_hash) == hashes
    return SavedTrajectory(path.stem, file.trajectory.duration_s, current, saved_at)


def _aside(path: Path, status: os.stat_result) -> Aside:
    name = path.name.rpartition(".json.old-")[0]
    moved_at = datetime.fromtimestamp(status.st_ctime, UTC).isoformat(timespec="seconds")
    duration_s = _duration_s(path, (status.st_ino, status.st_mtime_ns, status.st_size))
    return Aside(path.name, name, duration_s, moved_at)


@lru_cache(maxsize=1000)
def _duration_s(path: Path, _seen: tuple[int, int, int]) -> float:
    """Of a trajectory, 0 if it cannot be read; read again only where it is another file: there may be many."""
    try:
        return trajectory.load(path).trajectory.duration_s
    except (FlightError, OSError):
        return 0.0
