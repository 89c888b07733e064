"""What a preflight rests on: a plan with its map and vehicle, and what all of them say of themselves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import mapping
import preflight
import vehicle
from firmware_bridge import controller, wire
from firmware_bridge.link import refuse_unfit
from flight import FloatArray, FormatError, Trajectory, TrajectoryFile
from goshawk.commands.preflight.like import Like
from goshawk.terminal import console
from mapping.map_folder import read_report
from planner.gate import could_hide, gate
from preflight.draws import LOCALIZATION_STD_M

DEFAULT = preflight.Uncertainty()
_PATH_STEP_S = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """What is flown, and how."""

    item: TrajectoryFile
    area: mapping.Map
    vehicle: vehicle.Vehicle
    options: preflight.Options
    """With what the map says of itself."""
    sources: Mapping[str, str] = field(default_factory=dict)
    """Name of an uncertainty to where it is from, if it was not asked for."""
    said: tuple[str, ...] = ()
    """Sentences on these."""

    @property
    def radius_m(self) -> float:
        """Of the sphere that the plan was checked for; to the farthest propeller tip where the file does not tell."""
        told = self.item.check.get("body_radius_m")
        if isinstance(told, int | float) and math.isfinite(told) and told > 0.0:
            return float(told)
        return self.vehicle.reach_m

    @property
    def margin_m(self) -> float:
        """Room that the plan was proved to have beyond the sphere; 0: not stated."""
        return wire.proved_clearance_m(self.item)

    @property
    def scenario(self) -> preflight.Scenario:
        return preflight.Scenario(
            self.vehicle, self.item.trajectory, self.area.field, radius_m=self.radius_m, clearance_m=self.margin_m
        )


def subject(
    item: TrajectoryFile,
    area: mapping.Map,
    believed: vehicle.Vehicle,
    options: preflight.Options,
    like: Like | None = None,
) -> Subject:
    """What is flown, if the trajectory was checked in this map for this vehicle.

    Args:
        like: what the options have from flights.

    Raises:
        InputError: it was not, or the vehicle has other rotors than the controller's mixer.
        MapError: the map was refused.
        FormatError: as `of_map`.
    """
    controller.require_four(believed, "a preflight flies our controller")
    area.require_not_refused()
    refuse_unfit(item, area.hash, vehicle.vehicle_hash(believed), False)
    uncertainty = of_map(area, options.uncertainty, item.trajectory)
    sources, said = _localized(options.uncertainty, area, item.trajectory)
    like = like or Like()
    flown = Subject(item, area, believed, replace(options, uncertainty=uncertainty), {**sources, **like.sources})
    found = hidden(flown, item.trajectory)
    untold = () if found is not None else ("what the map misses is not counted: it states no probabilities",)
    return replace(flown, options=replace(flown.options, hidden=found), said=(*said, *like.said, *untold))


def hidden(of: Subject, path: Trajectory) -> preflight.Hidden | None:
    """What the map may have missed within the vehicle's sphere along a path; None where it does not state it.

    Raises:
        FormatError: a file of the map is damaged.
    """
    free = of.area.free_space()
    if free is None:
        return None
    ground = gate.asked_of(of.item).ground_world_m
    return preflight.Hidden.of(could_hide.near(path, free, ground, of.radius_m + of.margin_m, of.radius_m))


def _localized(
    given: preflight.Uncertainty, area: mapping.Map, path: Trajectory
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Where the lasting error of the pose is from, and a sentence if the map has a part in it; empty if asked for."""
    if given.localization_std_m is not None:
        return {}, ()
    own_m = position_std_m(area, path)
    if own_m is None:
        return {"localization_std_m": "assumed; the map states none"}, ()
    assumed = f"{100.0 * LOCALIZATION_STD_M:g} cm of the localizer"
    said = f"the pose errs by {assumed}, assumed, and {100.0 * own_m:.2g} cm from the map's images along the path"
    return {"localization_std_m": f"the map along the path ({100.0 * own_m:.2g} cm), and {assumed}, assumed"}, (said,)


def blowing(wind: str) -> preflight.Uncertainty:
    """The wind of `--wind`: a speed from anywhere, or x,y,z.

    Raises:
        InputError: it is neither.
    """
    if "," not in wind:
        return replace(DEFAULT, wind_m_s=console.numbers("--wind", wind, 1)[0])
    x, y, z = console.numbers("--wind", wind, 3)
    size = math.sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        return DEFAULT
    return replace(DEFAULT, wind_m_s=size, wind_direction=(x / size, y / size, z / size))


def of_map(
    area: mapping.Map, uncertainty: preflight.Uncertainty, path: Trajectory | None = None
) -> preflight.Uncertainty:
    """With what the map says of itself: its scale's standard deviation, its voxels' on top of the surfaces', and its
    images' along the path on top of the localizer's unless that of the pose is given.

    Args:
        path: None: all the map.

    Raises:
        FormatError: its report does not hold sources of scale, or standard deviations, as `goshawk map build` writes
            them.
    """
    voxel = max(area.field.grid.voxel_m) / math.sqrt(12.0)  # of a surface anywhere in its voxel
    surface = math.hypot(uncertainty.map_error_std_m, voxel)
    scale = scale_std(read_report(area.folder).get("scale_witnesses")) or uncertainty.map_scale_std_ratio
    pose = uncertainty.localization_std_m
    if pose is None:
        pose = math.hypot(LOCALIZATION_STD_M, position_std_m(area, path) or 0.0)
    return replace(uncertainty, map_scale_std_ratio=scale, map_error_std_m=surface, localization_std_m=pose)


def position_std_m(area: mapping.Map, path: Trajectory | None = None) -> float | None:
    """Of the positions of the map's images but for its scale, each axis; None if its report tells none.

    Root mean square over the images, or over the path of what the nearest image has.

    Raises:
        FormatError: the report's list is no list of standard deviations.
    """
    try:
        told = np.array(read_report(area.folder).get("shape_std_m") or (), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FormatError("the map's report.json holds no numbers as shape_std_m; build the map again") from error
    if told.shape != (len(area.images),) or not (known := np.isfinite(told)).any():
        return None
    std_m, at = told[known], area.T_world_body[known, :3, 3]
    if path is not None:
        std_m = std_m[_nearest(at, path)]
    return float(np.sqrt(np.mean(std_m**2) / 3.0))  # they are of all three axes together


def _nearest(points_m: FloatArray, path: Trajectory) -> list[int]:
    """The nearest of (n, 3) points to each of the path's."""
    times_s = np.linspace(0.0, path.duration_s, 1 + math.ceil(path.duration_s / _PATH_STEP_S))
    return [int(np.argmin(np.linalg.norm(points_m - point, axis=1))) for point in path.position(times_s)]


def scale_std(witnesses: Any) -> float:
    """Of a map's scale by its sources: the first's, and how far beyond their own the others are off it.

    0 if there are none, or the first tells none.
    """
    try:
        stds = [float(witness.get("std") or 0.0) for witness in witnesses or ()]
        ratios = [float(witness.get("ratio") or 1.0) for witness in witnesses or ()]
    except (TypeError, ValueError, AttributeError) as error:
        raise FormatError("the map's report.json holds no list of scale_witnesses; build the map again") from error
    if not stds or not stds[0] > 0.0:
        return 0.0
    beyond = [max((ratio - 1.0) ** 2 - std**2, 0.0) for ratio, std in zip(ratios, stds, strict=True)]
    return math.sqrt(stds[0] ** 2 + max(beyond))
