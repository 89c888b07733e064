"""What a map calls free, and how thin an obstacle its images rule out there; see `esdf.visibility`."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

import esdf
from esdf import FREE, UNKNOWN, Edit, Field, Grid
from esdf.storage import EDITS
from esdf.visibility import CouldHide, Stretch, Visibility, line_of_sight
from flight import FloatArray, InputError, frames
from mapping.camera.rig import Camera, Rig
from mapping.dense import fusion, missing, occupancy, resolution

OF_HIDDEN = (occupancy.FILE, "visibility.npz", "map.toml", "poses.csv", f"esdf/{EDITS}")
"""What a map says of what it may have missed; an edit that changes no voxel's state may change it, too."""
THRESHOLD_M = 0.03
"""Obstacles thicker than a thumb and a half: poles, branches, chair legs, of which a map should know."""
PLAIN_M = 0.10
"""An obstacle so thick should be in every map."""
_NEIGHBOURS = 8
"""Places compared for the least distance between a voxel's box and a path, found by the distance of their centres."""
_TOUCH_M = 1e-9
"""What is just as far away as it must be is not within reach."""


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """An image, and where it was taken."""

    name: str
    camera: Camera
    T_world_camera: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """The free space of a map, and the evidence for it."""

    field: Field
    """The map's, the pilot's edits applied."""
    seen: Visibility
    """The thinnest obstacle that the images resolve, place by place."""
    empty: NDArray[np.bool_]
    """(nx, ny, nz) voxels of the field where nothing can hide, whatever the images resolve (`known_empty`)."""
    stated: NDArray[np.float16] | None = None
    """(nx, ny, nz) how likely each voxel holds something, see `mapping.dense.occupancy`; None: not known."""
    shots: tuple[Shot, ...] = ()

    def resolving(self, thickness_m: float) -> Field:
        """The field in which space is unknown, hence not free, where an obstacle this thick could hide.

        Occupied and unknown voxels stay as they are. It is what `goshawk map build --thinnest` leaves free, but for
        pockets that are free only apart from the recorded path: they stay.

        Raises:
            InputError: the thickness is not positive.
        """
        if not thickness_m > 0.0:
            raise InputError(f"the thinnest obstacle to be ruled out is {thickness_m:g} m; it must be positive")
        state, grid = self.field.state.copy(), self.field.grid
        state[resolution.could_hide(state, grid, self.seen, thickness_m, empty=self.empty)] = UNKNOWN
        return esdf.build(state, grid, cap_m=self.field.cap_m, unknown=self.field.unknown)

    def hidden_share(self, points_world_m: ArrayLike) -> FloatArray:
        """How thick an obstacle could hide at points (n, 3), as a share (n,) for a price.

        From 0, where none above `THRESHOLD_M` could, to 1, where one of `PLAIN_M` and more could.
        """
        points = np.asarray(points_world_m, dtype=np.float64)
        cells = np.clip(self.field.grid.index(points), 0, np.array(self.field.grid.shape) - 1)
        is_open = ~(self.field.grid.contains(points) & self.empty[tuple(cells.T)])
        thickness_m = np.minimum(self.seen.finest(points), PLAIN_M)
        return np.clip((thickness_m - THRESHOLD_M) / (PLAIN_M - THRESHOLD_M), 0.0, 1.0) * is_open

    def along(self, times_s: ArrayLike, positions_world_m: ArrayLike, reach_m: float) -> CouldHide:
        """How thick an obstacle could hide within reach of a path.

        Args:
            times_s: (n,) when the path is at each position; n is at least 1.
            positions_world_m: (n, 3) equally spaced along the path, much closer than `reach_m`.
        """
        times, path = np.asarray(times_s, dtype=np.float64), np.asarray(positions_world_m, dtype=np.float64)
        grid, half = self.field.grid, 0.5 * np.array(self.field.grid.voxel_m)
        places = grid.centre(self._cells_near(path, reach_m + grid.half_diagonal_m))
        nearest, distance_m = _nearest(path, places, half)
        within = distance_m < reach_m - _TOUCH_M
        if not within.any():
            none = None if self.stated is None else 0.0
            return CouldHide(reach_m, 0.0, 0.0, _point(path[0]), THRESHOLD_M, 0.0, none)
        places, nearest = places[within], nearest[within]
        thickness_m = self.seen.finest(places)
        worst = np.flatnonzero(thickness_m == thickness_m.max())
        first = worst[np.argmin(times[nearest[worst]])]
        is_thick = thickness_m > THRESHOLD_M
        thick = places[is_thick]
        probability, stretches = self._likely(thick, nearest[is_thick], times, path, reach_m)
        share = 0.0
        if len(thick):
            share = float((_nearest(thick, path, half)[1] < reach_m - _TOUCH_M).mean())
        time_s, point = float(times[nearest[first]]), _point(places[first])
        return CouldHide(reach_m, float(thickness_m[first]), time_s, point, THRESHOLD_M, share, probability, stretches)

    def _likely(
        self,
        places_world_m: FloatArray,
        nearest: NDArray[np.int64],
        times: FloatArray,
        path_world_m: FloatArray,
        reach_m: float,
    ) -> tuple[float | None, tuple[Stretch, ...]]:
        """How likely something is in one of the places (m, 3), and the stretches where that is worth a look."""
        if self.stated is None:
            return None, ()
        stated = self.stated[tuple(self.field.grid.index(places_world_m).T)].astype(np.float64)
        near = missing.Near(nearest, stated)
        things = missing.expected(near, reach_m, float(np.max(self.field.grid.voxel_m)))
        found = missing.parts(near, things, path_world_m, reach_m)
        return missing.probability(near, things), tuple(
            Stretch(
                float(times[part.first]),
                float(times[part.last]),
                part.probability,
                float(self.seen.finest(places_world_m[[part.place]])[0]),
                _point(places_world_m[part.place]),
                self.image_of(places_world_m[part.place]),
            )
            for part in found
        )

    def image_of(self, place_world_m: FloatArray) -> str:
        """The image that shows a place (3,) from nearest by, with nothing occupied before it; empty if none does."""
        by_distance = sorted(self.shots, key=lambda s: float(np.linalg.norm(s.T_world_camera[:3, 3] - place_world_m)))
        for shot in by_distance:
            pixel = shot.camera.project(frames.apply(frames.invert(shot.T_world_camera), place_world_m[None]))
            eye = shot.T_world_camera[:3, 3]
            if not (shot.camera.contains(pixel)[0] and self.field.grid.contains(eye[None])[0]):
                continue
            if line_of_sight(self.field.state, self.field.grid, eye, place_world_m[None])[0]:
                return shot.name
        return ""

    def profile(self, positions_world_m: ArrayLike, reach_m: float) -> FloatArray:
        """How thick an obstacle could hide at most within reach of each position (n, 3), for a chart.

        Asked of the cells in which `seen` resolves, each of which counts if it comes within reach and holds free space
        in which something could hide: never less than `along` finds, and quicker.

        Returns:
            (n,) metres; infinite where no image looked, 0 where nothing could hide.
        """
        path = np.asarray(positions_world_m, dtype=np.float64)
        coarse, grid = self.seen.grid, self.field.grid
        box = coarse.region(path.min(axis=0) - reach_m, path.max(axis=0) + reach_m)
        if box.empty:
            return np.zeros(len(path))
        ratio = np.rint(np.array(coarse.voxel_m) / grid.voxel_m).astype(np.int64)
        first = ratio * box.low
        within = tuple(slice(a, a + r * n) for a, r, n in zip(first, ratio, box.shape, strict=True))
        free = (self.field.state[within] == FREE) & ~self.empty[within]
        for axis, step in enumerate(ratio):  # a cell counts if one of its voxels does
            free = np.logical_or.reduceat(free, np.arange(0, free.shape[axis], step), axis=axis)
        thickness_m = np.where(free, self.seen.finest_m[box.slices][tuple(map(slice, free.shape))], 0.0)
        around = np.ceil(reach_m / np.array(coarse.voxel_m)).astype(np.int64)
        steps = np.stack(np.meshgrid(*(np.arange(-n, n + 1) for n in around), indexing="ij"), axis=-1).reshape(-1, 3)
        worst_m = np.zeros(len(path))
        for step in steps:
            cells = coarse.index(path) + step
            apart_m = np.maximum(np.abs(coarse.centre(cells) - path) - 0.5 * np.array(coarse.voxel_m), 0.0)
            at = cells - box.low
            inside = ((at >= 0) & (at < thickness_m.shape)).all(axis=1) & (np.linalg.norm(apart_m, axis=1) < reach_m)
            worst_m[inside] = np.maximum(worst_m[inside], thickness_m[tuple(at[inside].T)])
        return worst_m

    def _cells_near(self, path_world_m: FloatArray, distance_m: float) -> NDArray[np.int64]:
        """Free voxels (m, 3), not known to be empty otherwise, with their centre this near to one of the points."""
        from scipy.spatial import KDTree

        grid = self.field.grid
        box = grid.region(path_world_m.min(axis=0) - distance_m, path_world_m.max(axis=0) + distance_m)
        free = (self.field.state[box.slices] == FREE) & ~self.empty[box.slices]
        cells = np.argwhere(free) + np.array(box.low)
        far_m, _ = KDTree(path_world_m).query(grid.centre(cells), distance_upper_bound=distance_m)
        return cells[np.isfinite(far_m)]


class Placed(Protocol):
    """Images of a map, as `mapping.Map` has them."""

    @property
    def images(self) -> tuple[str, ...]: ...
    @property
    def rig(self) -> Rig: ...
    @property
    def T_world_body(self) -> FloatArray: ...


def shots(placed: Placed) -> tuple[Shot, ...]:
    """All images of a map, each by its name within the folder of images."""
    return tuple(
        Shot(name if camera.folder == "." else f"{camera.folder}/{name}", camera, pose @ camera.T_body_camera)
        for name, pose in zip(placed.images, placed.T_world_body, strict=True)
        for camera in placed.rig
    )


def known_empty(
    grid: Grid, edits: Iterable[Edit], rig: Rig, T_world_body: FloatArray, carrier_radius_m: float
) -> NDArray[np.bool_]:
    """(nx, ny, nz) where nothing can hide: what carried the cameras went through, or the pilot freed the space.

    Args:
        T_world_body: (n, 4, 4) of the images. The way between two of them does not count, as the folder does not say
            where images between them are missing.
        carrier_radius_m: about each camera; 0 where it is not known.
    """
    places = np.array([(pose @ camera.T_body_camera)[:3, 3] for pose in T_world_body for camera in rig])
    empty = np.zeros(grid.shape, bool)
    if carrier_radius_m > 0.0 and len(places):
        empty |= fusion.within(grid, places, carrier_radius_m)
    for edit in edits:
        if edit.action in ("remove", "clear"):
            box = esdf.solids.covered_region(edit.solid, grid)
            empty[box.slices] |= edit.reaches(grid, box)
    return empty


def _nearest(of: FloatArray, asked: FloatArray, half_m: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Which of the points (n, 3) is nearest to each that is asked (m, 3), where one of both is the centre of a box.

    Returns:
        Its index (m,), and the distance (m,) between point and box, whose sides are twice `half_m`.
    """
    from scipy.spatial import KDTree

    count = min(_NEIGHBOURS, len(of))
    found = np.reshape(KDTree(of).query(asked, k=count)[1], (len(asked), count))  # one alone comes without its axis
    apart_m = np.linalg.norm(np.maximum(np.abs(of[found] - asked[:, None]) - half_m, 0.0), axis=2)
    best = apart_m.argmin(axis=1)[:, None]
    return np.take_along_axis(found, best, axis=1)[:, 0], np.take_along_axis(apart_m, best, axis=1)[:, 0]


def _point(point: FloatArray) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
