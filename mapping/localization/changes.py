"""Which parts of a map look different in new images: points that should be seen there, and are not found again.

A point counts as looked at where an image of the map saw it from a similar direction and distance, no camera of the map
was much nearer to it, and nothing that the map knows hides it: near images give a point its feature, which from farther
away often is another. Two thirds of these points are found again as features like theirs, wherever nothing has changed.
A cell in which far fewer are found than usual in these images has changed: moved, hidden by something new, or lit
differently.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import esdf
from flight import FloatArray, Progress, frames, silent
from mapping import connected
from mapping.camera.rig import Camera, Rig
from mapping.input.images import ImageSet
from mapping.localization.relocalization import Localization
from mapping.sparse.features import features
from mapping.sparse.features.features import Features
from mapping.sparse.localization_map import LocalizationMap

_CELL_M = 0.3
_SIMILAR_RAD, _SIMILAR_RANGE = np.radians(25.0), 1.4
"""A feature looks alike from directions and ranges no further apart than this. Of points 1.4 to 2 and 2 to 3 times as
far away as the nearest camera of the map was, 50 and 32 % are found again, of nearer ones 65 %."""
_NEAREST, _KEPT_LOOKS = 8, 64
"""Instants of the map that each image is compared with, and how many of their looks stay in memory."""
_FOUND_PX, _FOUND_COSINE = 5.0, 0.75
"""A point is found again if a feature so near to its place has a descriptor so like its own. In the rendered room 65 %
are; another feature by chance in 10 to 13 %."""
_LEAST_POINTS, _LEAST_IMAGES = 5, 3
"""A cell with fewer says nothing."""
_CHANGED = 0.35
"""Of the usual share."""
_REGION_POINTS = 20
"""Cells that touch make a region, if so many points are in them. With 10, 19 of 50 runs of 8 to 20 consecutive
queries of the unchanged room named a place on a wall; with 20 no run of 3 to 30 did."""
_LEAST_SHARE = 0.2
"""Usual share below which nothing is said: the images are too dark or blurred."""
_STEP_M, _BEFORE_M = 0.1, 0.15
"""Steps along a line of sight, and how far before a point it ends: surfaces are as thick."""


@dataclass(frozen=True, slots=True)
class ChangedRegion:
    """A part of the map that looks different."""

    low_world_m: tuple[float, float, float]
    high_world_m: tuple[float, float, float]
    points: int
    """Points of the map in it."""
    looks: int
    """How often one of them should have been seen."""
    found: int
    """How often it was."""


@dataclass(frozen=True, slots=True)
class Changes:
    """What looks different in a set of images."""

    regions: tuple[ChangedRegion, ...]
    """The one with the most points first."""
    usual_share: float
    """How many of the looks find their point in the median cell; NaN if no cell was looked at often enough."""

    @property
    def can_tell(self) -> bool:
        """Whether enough is found again to say anything."""
        return self.usual_share >= _LEAST_SHARE


def find(
    known: LocalizationMap,
    field: esdf.Field,
    placed: tuple[Rig, FloatArray],
    images: ImageSet,
    found: Sequence[Features],
    answer: Localization,
    *,
    progress: Progress = silent,
) -> Changes:
    """The parts of a map that look different in images that were found in it.

    Args:
        placed: the rig and the poses (n, 4, 4) of the map's own images.
        found: the features of `images`, in the order of `images.pairs()`.
    """
    seen = _Seen(known.points_world_m, *placed)
    looks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    shots = [(index, *shot) for index, shot in enumerate(images.pairs()) if answer.found[shot[0]]]
    for done, (index, instant, number) in enumerate(shots, start=1):
        image, camera = found[index], images.rig.cameras[number]
        T_world_camera = answer.T_world_body[instant] @ camera.T_body_camera
        points = seen.looked_at(T_world_camera, camera, field)
        again = _found_again(known, points, image, T_world_camera, camera)
        looks.append((np.full(len(points), instant), points, again))
        progress("comparing with the map", done / len(shots))
    if not looks:
        return Changes((), np.nan)
    return changed(known.points_world_m, *(np.concatenate(part) for part in zip(*looks, strict=True)))


def changed(points_world_m: FloatArray, instant: np.ndarray, point: np.ndarray, again: np.ndarray) -> Changes:
    """The changed regions, given all looks: their instants, points, and whether those were found again, (k,) each."""
    if not len(point):
        return Changes((), np.nan)
    cells, of_look = np.unique(np.floor(points_world_m[point] / _CELL_M).astype(np.int64), axis=0, return_inverse=True)
    of_look = of_look.reshape(-1)
    share = np.bincount(of_look, weights=again) / np.bincount(of_look)
    says = (_distinct(of_look, point) >= _LEAST_POINTS) & (_distinct(of_look, instant) >= _LEAST_IMAGES)
    usual = float(np.median(share[says])) if says.any() else np.nan
    if not usual >= _LEAST_SHARE:
        return Changes((), usual)
    regions = (
        _region(points_world_m, point, again, np.isin(of_look, those))
        for those in _touching(cells, np.flatnonzero(says & (share < _CHANGED * usual)))
    )
    large = [region for region in regions if region.points >= _REGION_POINTS]
    return Changes(tuple(sorted(large, key=lambda region: -region.points)), usual)


def _distinct(of_look: np.ndarray, values: np.ndarray) -> np.ndarray:
    """How many different values each cell has."""
    return np.bincount(np.unique(np.stack([of_look, values]), axis=1)[0])


def _touching(cells: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """The chosen numbers of cells (m, 3), in groups that touch, corners included."""
    from scipy.spatial import KDTree

    pairs = KDTree(cells[chosen]).query_pairs(1.0, p=np.inf, output_type="ndarray")
    group = connected.groups(pairs[:, 0], pairs[:, 1], len(chosen))
    return [chosen[group == k] for k in np.unique(group)]


def _region(points_world_m: FloatArray, point: np.ndarray, again: np.ndarray, inside: np.ndarray) -> ChangedRegion:
    there = np.unique(point[inside])
    (x, y, z), (x_high, y_high, z_high) = points_world_m[there].min(axis=0), points_world_m[there].max(axis=0)
    low, high = (float(x), float(y), float(z)), (float(x_high), float(y_high), float(z_high))
    return ChangedRegion(low, high, len(there), int(inside.sum()), int(again[inside].sum()))


def _found_again(
    known: LocalizationMap, points: np.ndarray, image: Features, T_world_camera: FloatArray, camera: Camera
) -> np.ndarray:
    """(k,) bool: whether a feature like each of the points lies where the point should be."""
    from scipy.spatial import KDTree

    if not len(points) or not len(image.pixels):
        return np.zeros(len(points), dtype=bool)
    expected_px = camera.project(frames.apply(frames.invert(T_world_camera), known.points_world_m[points]))
    descriptors = features.unit(image.descriptors)
    near: Sequence[list[int]] = KDTree(image.pixels).query_ball_point(expected_px, _FOUND_PX)
    return np.array(
        [
            bool((descriptors[those] @ known.descriptors[point] > _FOUND_COSINE).any())
            for point, those in zip(points, near, strict=True)
        ]
    )


class _Seen:
    """From where the images of the map saw its points."""

    def __init__(self, points_world_m: FloatArray, rig: Rig, T_world_body: FloatArray) -> None:
        from scipy.spatial import KDTree

        self._points_world_m, self._rig, self._T_world_body = points_world_m, rig, T_world_body
        self._look = functools.lru_cache(maxsize=_KEPT_LOOKS)(self._look_of)  # neighbours in time share most of them
        places_world_m = np.concatenate([T_world_body @ camera.T_body_camera for camera in rig])[:, :3, 3]
        self._nearest_m = KDTree(places_world_m).query(points_world_m)[0]

    def looked_at(self, T_world_camera: FloatArray, camera: Camera, field: esdf.Field) -> np.ndarray:
        """Numbers of the points that this image should show, as an image of the map from near it did."""
        here = _Look(self._points_world_m, T_world_camera, camera)
        apart_m = np.linalg.norm(self._T_world_body[:, :3, 3] - T_world_camera[:3, 3], axis=1)
        similar = np.zeros(len(self._points_world_m), dtype=bool)
        for instant in np.argsort(apart_m, kind="stable")[:_NEAREST]:
            for number in range(len(self._rig)):
                similar |= here.is_like(self._look(int(instant), number))
        candidates = np.flatnonzero(similar & (here.range_m < _SIMILAR_RANGE * self._nearest_m))
        return candidates[_in_sight(field, T_world_camera[:3, 3], self._points_world_m[candidates])]

    def _look_of(self, instant: int, number: int) -> "_Look":
        camera = self._rig.cameras[number]
        return _Look(self._points_world_m, self._T_world_body[instant] @ camera.T_body_camera, camera)


class _Look:
    """One camera's look at all points: which are in its view, and from where."""

    def __init__(self, points_world_m: FloatArray, T_world_camera: FloatArray, camera: Camera) -> None:
        away_m = T_world_camera[:3, 3] - points_world_m
        range_m = np.linalg.norm(away_m, axis=1)
        in_camera = frames.apply(frames.invert(T_world_camera), points_world_m)
        self.in_view = camera.contains(camera.project(in_camera))
        self.range_m = range_m.astype(np.float32)
        self.direction = (away_m / range_m[:, None]).astype(np.float32)

    def is_like(self, other: "_Look") -> np.ndarray:
        """(n,) bool: the points that both see, from similar directions and ranges."""
        both = np.flatnonzero(self.in_view & other.in_view)
        ratio = self.range_m[both] / other.range_m[both]
        cosine = (self.direction[both] * other.direction[both]).sum(axis=1)
        alike = (cosine > np.cos(_SIMILAR_RAD)) & (ratio < _SIMILAR_RANGE) & (ratio > 1.0 / _SIMILAR_RANGE)
        result = np.zeros(len(self.in_view), dtype=bool)
        result[both[alike]] = True
        return result


def _in_sight(field: esdf.Field, eye_world_m: FloatArray, points_world_m: FloatArray) -> np.ndarray:
    """(n,) bool: whether nothing that is known to be occupied lies between the eye and each point."""
    away_m = points_world_m - eye_world_m
    range_m = np.linalg.norm(away_m, axis=1)
    clear = np.ones(len(points_world_m), dtype=bool)
    for along_m in np.arange(_STEP_M, range_m.max(initial=0.0), _STEP_M):
        left = np.flatnonzero(clear & (along_m < range_m - _BEFORE_M))
        places = eye_world_m + away_m[left] * (along_m / range_m[left])[:, None]
        inside = field.grid.contains(places)
        i, j, k = field.grid.index(np.where(inside[:, None], places, field.grid.low_world_m)).T
        clear[left] = ~(inside & (field.state[i, j, k] == esdf.OCCUPIED))
    return clear
