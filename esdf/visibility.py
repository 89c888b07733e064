"""Smallest obstacle the images could resolve: a 12 mm cable may be missing from a map taken from too far away.

For every voxel the mask holds the thinnest object the cameras could have resolved there: the pixels it must span, times
the angle of a pixel, times the distance of the nearest view with a free line of sight. A planner can query where an
object of a given thickness may be missing from the map, and keep more distance there.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esdf import _esdf
from esdf.field import checked_points
from esdf.grid import Grid, StateArray, checked_state
from flight import FloatArray, FormatError, InputError, file_format

_SURE, _NEVER = 0.995, 0.00005
"""Probabilities from which, and below which, words do not give the number."""


@dataclass(frozen=True, slots=True)
class View:
    """Pose and angular resolution of one image."""

    centre_world_m: tuple[float, float, float]
    axis_world: tuple[float, float, float]
    """Direction of the optical axis."""
    half_angle_rad: float
    """Half the field of view, from the optical axis: 1.44 for a field of 165 degrees."""
    pixel_rad: float
    """Angle between neighbouring pixels: about 1 / focal length in pixels."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """The thinnest object that the images could have resolved, voxel by voxel."""

    grid: Grid
    finest_m: NDArray[np.float32] = field(repr=False)
    """(nx, ny, nz); infinite where no image has a free line of sight."""

    def finest(self, points_world_m: ArrayLike) -> FloatArray:
        """Thickness (n,) of the thinnest object that could have been resolved at each point (n, 3); inf outside."""
        points = checked_points(points_world_m)
        index = np.clip(self.grid.index(points), 0, np.array(self.grid.shape) - 1)
        return np.where(self.grid.contains(points), self.finest_m[tuple(index.T)].astype(np.float64), np.inf)

    def could_hide(self, points_world_m: ArrayLike, thickness_m: float) -> NDArray[np.bool_]:
        """Whether an object of that thickness could be at each point (n, 3) without any image resolving it."""
        return self.finest(points_world_m) > thickness_m


@dataclass(frozen=True, slots=True)
class Stretch:
    """Part of a path, and how likely the map misses an obstacle within reach of it."""

    start_s: float
    end_s: float
    probability: float
    """That something thicker than the threshold is there and missing from the map."""
    thickness_m: float
    """Thinnest obstacle that the images resolve at the place; infinite where no image looked."""
    point_world_m: tuple[float, float, float]
    """Where that is likeliest."""
    image: str
    """That shows the place from nearest by; empty if none does."""

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; the thickness is None where no image looked."""
        finite = self.thickness_m if np.isfinite(self.thickness_m) else None
        return asdict(self) | {"point_world_m": list(self.point_world_m), "thickness_m": finite}

    def describe(self) -> str:
        """In words: how likely, when, where, and where to look."""
        x, y, z = self.point_world_m
        look = f"look at {self.image}" if self.image else "no image shows it"
        when = f"{self.start_s:.1f} to {self.end_s:.1f} s"
        return f"{percent(self.probability)} at {when}, near ({x:.2f}, {y:.2f}, {z:.2f}) m, {look}"


@dataclass(frozen=True, slots=True)
class CouldHide:
    """How thick an obstacle could be along a path, within reach of it, and still be missing from the map."""

    reach_m: float
    """Distance from the path within which free space was asked."""
    thickness_m: float
    """Thinnest obstacle that the images resolve, where that is worst: a thinner one could be there. Infinite where no
    image looked; 0 where nothing could hide at all."""
    time_s: float
    """When the path is nearest to that place; the first time, if it is one of several. 0 if there is none."""
    point_world_m: tuple[float, float, float]
    """That place; the path's beginning if there is none."""
    threshold_m: float
    """The thickness that the share is about."""
    length_share: float
    """Share of the path's length, 0 to 1, along which an obstacle thicker than that could hide within reach."""
    probability: float | None = None
    """That one thicker than the threshold is there; None where the map states no probabilities."""
    stretches: tuple[Stretch, ...] = ()
    """Where that is worth a look, the likeliest first; none in well-seen space."""

    @property
    def unobserved(self) -> bool:
        """Whether no image looked at some of the space: an obstacle of any thickness could hide there."""
        return bool(np.isinf(self.thickness_m))

    def as_dict(self) -> dict[str, Any]:
        """JSON-able; the thickness is None where no image looked."""
        body = asdict(self) | {"point_world_m": list(self.point_world_m), "unobserved": self.unobserved}
        body |= {"stretches": [stretch.as_dict() for stretch in self.stretches]}
        return body | {"thickness_m": None if self.unobserved else self.thickness_m}

    def describe(self) -> str:
        """In words: how thick, along how much of the path, and how likely and where, or without probabilities where."""
        if self.probability is None or not self.thickness_m > 0.0:
            return self.describe_thickness()
        likeliest = f". Most: {self.stretches[0].describe()}" if self.stretches else ""
        rest = f"; {len(self.stretches) - 1} more stretches" if len(self.stretches) > 1 else ""
        return (
            f"{self._what()} could hide within {self.reach_m:.2f} m{self._share()}. Chance that a thicker pole, cable "
            f"or net (not glass) is missing there: {percent(self.probability)}{likeliest}{rest}"
        )

    def describe_thickness(self) -> str:
        """In words: how thick, where, and along how much of the path."""
        if not self.thickness_m > 0.0:
            return f"no obstacle could hide in the free space within {self.reach_m:.2f} m"
        x, y, z = self.point_world_m
        return (
            f"{self._what()} could hide within {self.reach_m:.2f} m at {self.time_s:.2f} s, at "
            f"({x:.2f}, {y:.2f}, {z:.2f}) m{' (no image looked there)' if self.unobserved else ''}{self._share()}"
        )

    def _what(self) -> str:
        if self.unobserved:
            return "an obstacle of any thickness"
        return f"an obstacle up to {1e3 * self.thickness_m:.0f} mm thick"

    def _share(self) -> str:
        return f"; more than {1e3 * self.threshold_m:.0f} mm along {100.0 * self.length_share:.0f} % of the way"


def percent(probability: float) -> str:
    """A probability in words, as exact as it is known."""
    if probability >= _SURE:
        return "over 99 %"
    return f"about {100.0 * probability:.2g} %" if probability >= _NEVER else "none"


def look(state: ArrayLike, grid: Grid, views: Sequence[View], *, pixels: float = 2.0, coarser: int = 4) -> Visibility:
    """Compute the visibility mask of a map from the views.

    Args:
        pixels: How many pixels an object must span to be reconstructed.
        coarser: The mask's voxels are this many map voxels long; the distance to a view is taken to the far corner.
    """
    states: StateArray = checked_state(state, grid)
    if not views:
        raise InputError("visibility needs at least one view; none was given")
    shape = tuple(-(-n // coarser) for n in grid.shape)
    coarse = Grid(grid.origin_world_m, tuple(coarser * np.array(grid.voxel_m)), shape)  # pyright: ignore[reportArgumentType]
    finest = np.full(coarse.voxels, np.inf, np.float32)
    centres = coarse.centres().reshape(-1, 3)
    for view in views:
        offset = centres - np.array(view.centre_world_m)
        distance = np.linalg.norm(offset, axis=1)
        axis = np.array(view.axis_world) / np.linalg.norm(view.axis_world)
        thinnest = pixels * view.pixel_rad * (distance + coarse.half_diagonal_m)
        # Only where this view would be the best so far is the line of sight worth walking.
        wanted = np.flatnonzero((offset @ axis >= np.cos(view.half_angle_rad) * distance) & (thinnest < finest))
        visible = line_of_sight(states, grid, view.centre_world_m, centres[wanted])
        finest[wanted[visible]] = thinnest[wanted[visible]]
    return Visibility(coarse, finest.reshape(shape))


def line_of_sight(
    state: StateArray, grid: Grid, eye_world_m: ArrayLike, points_world_m: ArrayLike
) -> NDArray[np.bool_]:
    """Whether no OCCUPIED voxel lies between the eye (3,) and each point (n, 3); the point's own voxel does not count.

    Args:
        state: (nx, ny, nz) of the grid, as `checked_state` returns it.
    """
    voxel_m = np.array(grid.voxel_m)
    targets = np.ascontiguousarray((checked_points(points_world_m) - grid.low_world_m) / voxel_m)
    eye = (np.asarray(eye_world_m, dtype=np.float64) - grid.low_world_m) / voxel_m
    visible = np.empty(len(targets), bool)
    _esdf.line_of_sight(state, tuple(eye.tolist()), targets, visible)
    return visible


def save_visibility(path: Path, visibility: Visibility) -> None:
    """Write the mask as a compressed `.npz`."""
    grid = visibility.grid
    origin, voxel = np.array(grid.origin_world_m), np.array(grid.voxel_m)
    file_format.write_arrays(path, version=1, origin_world_m=origin, voxel_m=voxel, finest_m=visibility.finest_m)


def load_visibility(path: Path) -> Visibility:
    """Read what `save_visibility` wrote; raises `InputError` if missing, `FormatError` if damaged or newer."""
    names, fault = ("origin_world_m", "voxel_m", "finest_m"), "a damaged visibility mask"
    origin, voxel, finest = file_format.read_arrays(path, *names, version=1, fault=fault, remedy="build the map again")
    try:
        grid = Grid(tuple(origin), tuple(voxel), finest.shape)
    except (InputError, TypeError, ValueError) as error:
        raise FormatError(f"{path} is {fault}: {error}; build the map again") from error
    if finest.ndim != 3 or not (finest > 0.0).all():  # neither is NaN, which would compare as resolved
        raise FormatError(f"{path} is {fault}: not all thicknesses are positive; build the map again")
    return Visibility(grid, finest)
