"""Poles, wires and edges, which block matching misses: straight edges of several images that lie on one line in space.

edges of each image  ->  put into depth by those of its partners  ->  lines that enough images show  ->  voxels

After Hofer, Maurer and Bischof, "Efficient 3D scene abstraction using line segments", 2017.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esdf import OCCUPIED, Grid
from flight import FloatArray
from mapping import _mapping, workers
from mapping.dense import stereo
from mapping.dense.stereo import StereoOptions
from mapping.dense.views import THREADS, ImageView

PARTNERS, BASELINE_RATIO = 8, 0.25
"""Images whose edges are compared with those of an image, at most, and the baseline to aim for, over the typical
distance: more and farther apart than for blocks, as an edge looks alike from farther apart."""
LEAST_PX, LONGEST_PX = 12.0, 32.0
"""Shorter edges are dropped; longer ones are cut up, as a lens bends them."""
STD_PX = 0.35
"""Standard deviation of an end of an edge, across it."""
TOLERANCE = 2.5
"""Depths of an edge agree when they differ by at most this many standard deviations."""
LARGEST_RELATIVE_STD = 0.1
"""Of a depth by one partner: an edge along the baseline has none."""
LEAST_OVERLAP = 0.3
"""Share of the shorter of two edges that the other covers, if they are of one line."""
LEAST_AGREEING = 2
"""Partners that must agree on the depth of an edge; on any other depth fewer may."""
LARGEST_STD_M = 0.05
"""Less certain lines are dropped."""
LONGEST_M = 1.0
"""So are longer ones: 32 pixels that long are seen too obliquely."""
LEAST_IMAGES = 4
"""Images whose edges, each put into depth by itself, must show a line."""


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Straight edges of one image. The lighter side of all lies on the same hand of the way from first to last end."""

    first: FloatArray
    """(n, 3) unit direction from the camera to one end, in world axes."""
    last: FloatArray
    """(n, 3) to the other end."""
    position_world_m: FloatArray
    """(3,) of the camera."""
    std_rad: float
    """Standard deviation of an end, across the edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Straight edges in space, each as one image shows it."""

    first_world_m: FloatArray
    """(n, 3)."""
    last_world_m: FloatArray
    """(n, 3)."""
    image: NDArray[np.int64]
    """(n,) number of the image."""


def detect(view: ImageView) -> Edges:
    """The straight edges of an image (LSD: von Gioi et al., "LSD: a line segment detector", 2012)."""
    import cv2

    found = cv2.createLineSegmentDetector().detect(view.grey)[0]
    ends = np.zeros((0, 4)) if found is None else np.reshape(found, (-1, 4)).astype(np.float64) + 0.5
    length_px = np.hypot(*(ends[:, 2:] - ends[:, :2]).T)
    ends, length_px = ends[length_px >= LEAST_PX], length_px[length_px >= LEAST_PX]
    parts = np.ceil(length_px / LONGEST_PX).astype(np.int64)
    edge, part = _numbered(parts)
    start, step = ends[edge, :2], (ends[edge, 2:] - ends[edge, :2]) / parts[edge, None]
    start = start + part[:, None] * step
    pixels = np.stack([start, start + step])
    rays = view.camera.unproject(pixels)
    rays = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)) @ view.T_world_camera[:3, :3].T
    good = np.isfinite(rays).all(axis=(0, 2))
    if view.used is not None:
        column, line = np.moveaxis(np.clip(pixels, 0, np.array(view.used.shape[::-1]) - 1).astype(np.int64), -1, 0)
        good &= view.used[line, column].all(axis=0)
    first, last = rays[:, good]
    return Edges(first, last, view.position_world_m, STD_PX / min(view.camera.focal_px))


def sweep(images: Sequence[ImageView], options: StereoOptions, *, farthest_m: float) -> Lines:
    """The edges of all images that enough partners put into depth alike."""
    edges = list(workers.in_order(detect, images, threads=THREADS))
    wider = dataclasses.replace(options, partners=PARTNERS, baseline_ratio=BASELINE_RATIO)
    first, last, image = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0, np.int64)]
    for index, own in enumerate(edges):
        partners = [edges[p] for p in stereo.choose_partners(images, index, wider)]
        if len(partners) < LEAST_AGREEING:
            continue
        nearest_m = images[index].near_m or options.near_m
        range_m, std_m, sure = _ranges(own, partners, nearest_m=nearest_m, farthest_m=farthest_m)
        good = sure & (range_m.max(axis=1) < farthest_m) & (std_m < LARGEST_STD_M)
        ends = own.position_world_m + np.stack([own.first, own.last]) * range_m.T[:, :, None]
        good &= np.linalg.norm(ends[1] - ends[0], axis=1) < LONGEST_M
        first.append(ends[0, good])
        last.append(ends[1, good])
        image.append(np.full(int(good.sum()), index))
    return Lines(np.concatenate(first), np.concatenate(last), np.concatenate(image))


def occupied(lines: Lines, state: NDArray[np.uint8], grid: Grid, *, skin_voxels: float) -> NDArray[np.bool_]:
    """(nx, ny, nz) voxels near lines that enough images show, but for lines on a surface that is in the map already.

    Args:
        state: (nx, ny, nz) of the voxels by depth images.
        skin_voxels: how far from a line the centre of its voxels lies at most.
    """
    points, line = _points(lines, 0.5 * min(grid.voxel_m))
    inside = grid.contains(points)
    points, image = points[inside], lines.image[line[inside]]
    apart = state[tuple(grid.index(points).T)] != OCCUPIED
    points, image = points[apart], image[apart]
    voxel, point = _voxels_near(points, grid, 1.0)
    several = int(image.max(initial=0)) + 1
    once_each = np.unique(voxel * several + image[point])
    voxel, images = np.unique(once_each // several, return_counts=True)
    own = np.ravel_multi_index(tuple(grid.index(points).T), grid.shape)
    shown = np.isin(own, voxel[images >= LEAST_IMAGES])
    near = np.zeros(grid.voxels, bool)
    near[_voxels_near(points[shown], grid, skin_voxels)[0]] = True
    return near.reshape(grid.shape)


def _ranges(
    own: Edges, partners: Sequence[Edges], *, nearest_m: float, farthest_m: float
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Ranges (n, 2) of the ends of the edges, standard deviation (n,) of the worse one, and whether (n,) it is sure."""
    inverse_range, deviation, agreeing, rivals = _mapping.sweep_lines(
        own.first,
        own.last,
        np.concatenate([each.first for each in partners]),
        np.concatenate([each.last for each in partners]),
        np.repeat(np.arange(len(partners), dtype=np.int32), [len(each.first) for each in partners]),
        np.array([each.position_world_m - own.position_world_m for each in partners]),
        max(each.std_rad for each in (own, *partners)),
        TOLERANCE,
        nearest_m,
        farthest_m,
        LARGEST_RELATIVE_STD,
        LEAST_OVERLAP,
        THREADS,
    )
    range_m = 1.0 / np.maximum(inverse_range, 1e-3 / farthest_m)
    return range_m, deviation * range_m.max(axis=1) ** 2, (agreeing >= LEAST_AGREEING) & (agreeing > rivals)


def _points(lines: Lines, step_m: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Points (m, 3) along the lines, both ends included, and the number (m,) of the line of each."""
    way = lines.last_world_m - lines.first_world_m
    counts = 2 + (np.linalg.norm(way, axis=1) / step_m).astype(np.int64)
    line, number = _numbered(counts)
    return lines.first_world_m[line] + (number / (counts[line] - 1))[:, None] * way[line], line


def _numbered(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of the parts of things, so many of each: the number of the thing, and that of the part within it."""
    of = np.repeat(np.arange(len(counts)), counts)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)


def _voxels_near(
    points_world_m: FloatArray, grid: Grid, reach_voxels: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each voxel, by its flat index, whose centre is within reach of a point, with the number of that point.

    Args:
        points_world_m: (n, 3).
        reach_voxels: at most 1.
    """
    cells, strides = grid.index(points_world_m), np.array([grid.shape[1] * grid.shape[2], grid.shape[2], 1])
    voxels: list[NDArray[np.int64]] = []
    points: list[NDArray[np.int64]] = []
    for step in itertools.product((-1, 0, 1), repeat=3):
        beside = cells + step
        near = np.linalg.norm(grid.centre(beside) - points_world_m, axis=1) <= reach_voxels * min(grid.voxel_m)
        near &= ((beside >= 0) & (beside < grid.shape)).all(axis=1)
        voxels.append(beside[near] @ strides)
        points.append(near.nonzero()[0])
    return np.concatenate(voxels), np.concatenate(points)
