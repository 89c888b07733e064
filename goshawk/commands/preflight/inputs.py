"""What a preflight rests on: a plan with its map and vehicle, and what all of them say of themselves."""

import math
from dataclasses import dataclass, replace
from typing import Any

import mapping
import preflight
import vehicle
from firmware_bridge import controller, wire
from firmware_bridge.link import refuse_unfit
from flight import FormatError, TrajectoryFile
from goshawk.terminal import console
from mapping.map_folder import read_report

DEFAULT = preflight.Uncertainty()


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """What is flown, and how."""

    item: TrajectoryFile
    area: mapping.Map
    vehicle: vehicle.Vehicle
    options: preflight.Options
    """With what the map says of itself."""

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


def subject(item: TrajectoryFile, area: mapping.Map, believed: vehicle.Vehicle, options: preflight.Options) -> Subject:
    """What is flown, if the trajectory was checked in this map for this vehicle.

    Raises:
        InputError: it was not, or the vehicle has other rotors than the controller's mixer.
        MapError: the map was refused.
        FormatError: as `of_map`.
    """
    controller.require_four(believed, "a preflight flies our controller")
    area.require_not_refused()
    refuse_unfit(item, area.hash, vehicle.vehicle_hash(believed), False)
    return Subject(item, area, believed, replace(options, uncertainty=of_map(area, options.uncertainty)))


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


def of_map(area: mapping.Map, uncertainty: preflight.Uncertainty) -> preflight.Uncertainty:
    """With what the map says of itself: its scale's standard deviation, and its voxels' on top of the surfaces'.

    Raises:
        FormatError: its report does not hold sources of scale as `goshawk map build` writes them.
    """
    voxel = max(area.field.grid.voxel_m) / math.sqrt(12.0)  # of a surface anywhere in its voxel
    surface = math.hypot(uncertainty.map_error_std_m, voxel)
    scale = scale_std(read_report(area.folder).get("scale_witnesses")) or uncertainty.map_scale_std_ratio
    return replace(uncertainty, map_scale_std_ratio=scale, map_error_std_m=surface)


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
