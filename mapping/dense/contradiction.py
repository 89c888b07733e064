"""Free space that images contradict: thin things that no depth image shows, such as nets, branches and wires.

surface -> range images -> each pixel, predicted by other images -> looks of each free voxel, and contradictions

Where a pixel shows what the other images show at the surface point behind it, its ray is empty. Where most of them show
something else, all lighter or all darker, something stands before the surface. A voxel on such rays from several places
is not free, though each single ray does not say where on it the thing is.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, Grid
from flight import FloatArray, frames
from mapping import _mapping, workers
from mapping.dense import consistency, stereo
from mapping.dense.stereo import StereoOptions
from mapping.dense.views import THREADS, ImageView, lens_row

PARTNERS, BASELINE_RATIO = 6, 0.25
"""Images that predict an image, at most, and the baseline to aim for, over the typical distance: what stands a voxel
before the surface must move against it by some pixels."""
LEAST_TESTED, ENOUGH = 2, 3
"""Partners that must see the surface behind a pixel, and differ from it if it is unexplained; so many that show what it
shows explain it."""
NOISE_DEVIATIONS = 3.0
"""By which a pixel must be lighter or darker than all around its place in a partner."""
WINDOWS_PX = (3, 5, 7, 9, 13)
"""Edge of what counts as around: the first that leaves no more than `LARGEST_RATE` unexplained, so that errors of
surface, poses and lenses are no contradiction. Where none does, the images say nothing."""
LARGEST_RATE = 0.01
"""Of the pixels that one other image does not explain, in the median of the pairs of images."""
FARTHEST_M = 3.0
"""Of the voxels that an image looks at: from farther away thin things are less than a pixel wide."""
NEAREST_M = 0.3
MARGIN_VOXELS = 2.0
"""How far behind a voxel the surface must lie."""
LEAST_TESTED_SHARE, LEAST_PIXELS, LEAST_PIXEL_SHARE, TIMES_RATE = 0.125, 1, 0.125, 8.0
"""Of a voxel's pixels that must be tested for a look, of which half are; and unexplained pixels for a contradiction: at
least, over the voxel's width, and over what the rate of unexplained pixels lets expect anywhere."""
SAMPLED_IMAGES = 16
"""Of which the rate is taken."""
SHARE, BESIDE_SHARE = 0.4, 0.25
"""Of a voxel's looks that must contradict it; beside such a voxel less is enough."""
LEAST_CONTRADICTIONS = 2
"""One image alone contradicts nothing."""
RANGE_SCALE = 0.25
"""Size of the range images over that of the images."""
_STEP_PX = 8
"""Brightness and noise of two images are compared on every eighth pixel of every eighth row."""
_BRIGHTNESS_BLOCK = 5
"""Edge of the blocks, in these, over which the brightness is compared."""
_LEAST_NOISE = 2.0
"""Grey levels: the difference of two values that are rounded and noisy."""
_LEAST_COMPARED = 100
"""Of these pixels, for a rate."""
_KEPT = 32
"""Images of which what is around each pixel is kept: partners are mostly taken one soon after the other."""


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """What the images say of the voxels that were free without them."""

    looks: NDArray[np.uint16]
    """(nx, ny, nz) images within `FARTHEST_M` that tested what lies behind the voxel; 0 where it was not free."""
    contradictions: NDArray[np.uint16]
    """(nx, ny, nz) of them, those that show something before it."""

    @property
    def contradicted(self) -> NDArray[np.bool_]:
        """(nx, ny, nz) voxels that are not free after all."""
        from scipy import ndimage

        looks, against = self.looks.astype(np.float32), self.contradictions
        strong = (against >= LEAST_CONTRADICTIONS) & (against >= SHARE * looks)
        weak = (against >= 1) & (against >= BESIDE_SHARE * looks)
        beside = np.asarray(ndimage.binary_dilation(strong, np.ones((3, 3, 3), bool)), bool)
        return strong | (weak & beside)


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """An image with the range of the surface behind each pixel."""

    view: ImageView
    grey: NDArray[np.uint8]
    """(h, w), 0 where masked."""
    range_m: NDArray[np.float32]
    """Smaller; 0 where no surface was met."""
    smooth_m: NDArray[np.float32]
    """The same without the pixels beside a jump, where a small error of pose or surface shows something else."""
    lens: FloatArray
    """Row of the kernels."""

    @property
    def rays(self) -> FloatArray:
        """(h, w, 3) of the pixels."""
        return stereo.depth_rays(self.view, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """An image, one of those that predict it, and how their brightness compares."""

    image: _Shown
    partner: _Shown
    T_partner_camera: FloatArray
    gain: NDArray[np.float32]
    """Brightness of the partner over that of the image, at every `_STEP_PX`th pixel."""
    noise: float
    """Of what is left, grey levels."""


def find(
    images: Sequence[ImageView],
    vertices_world_m: FloatArray,
    faces: NDArray[np.int32],
    state: NDArray[np.uint8],
    grid: Grid,
    *,
    options: StereoOptions,
    farthest_m: float,
    threads: int = THREADS,
) -> Looks:
    """The looks of all images at the free voxels, through which they show the surface.

    Args:
        vertices_world_m, faces: (v, 3), (f, 3) the surface.
        state: (nx, ny, nz) with all that is occupied, and may lie before the surface.
        farthest_m: of the surface.
    """
    number, plane = planes_in_voxels(vertices_world_m, faces, state, grid)
    wider = dataclasses.replace(options, partners=PARTNERS, baseline_ratio=BASELINE_RATIO)
    partners = [stereo.choose_partners(images, index, wider) for index in range(len(images))]
    shown = list(workers.in_order(lambda view: _shown(view, number, plane, grid, farthest_m), images, threads=threads))
    found = Looks(np.zeros(grid.shape, np.uint16), np.zeros(grid.shape, np.uint16))
    window_px, rate = _window(shown, partners)
    if not window_px:
        return found

    @functools.lru_cache(maxsize=_KEPT)
    def around(index: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        return _least_and_most(shown[index].grey, window_px)

    def verdict(index: int) -> NDArray[np.uint8]:
        return _verdict(shown, index, partners[index], around)

    marked = (state == FREE).astype(np.uint8)
    for image, judged in zip(shown, workers.in_order(verdict, range(len(images)), threads=threads), strict=True):
        if judged.any():
            _mapping.count_looks(
                grid.low_world_m,
                grid.voxel_m[0],
                marked,
                found.looks,
                found.contradictions,
                judged,
                image.range_m,
                image.lens,
                frames.invert(image.view.T_world_camera),
                NEAREST_M,
                FARTHEST_M,
                MARGIN_VOXELS * grid.voxel_m[0],
                LEAST_TESTED_SHARE,
                LEAST_PIXELS,
                LEAST_PIXEL_SHARE,
                TIMES_RATE * rate,
                threads,
            )
    return found


def planes_in_voxels(
    vertices_world_m: FloatArray, faces: NDArray[np.int32], state: NDArray[np.uint8], grid: Grid
) -> tuple[NDArray[np.int32], FloatArray]:
    """The surface as a plane in each voxel that it passes through.

    Returns:
        (nx, ny, nz) number of the plane, -1 where there is none, -2 where something is occupied that is not on the
        surface; and (n, 6) a point and the unit normal of each plane.
    """
    from scipy import ndimage

    number = np.full(grid.shape, -1, np.int32)
    corners = vertices_world_m[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    of_vertices = np.zeros_like(vertices_world_m)
    for axis in range(3):
        weights = np.repeat(normals[:, axis], 3)
        of_vertices[:, axis] = np.bincount(faces.ravel(), weights, minlength=len(vertices_world_m))
    points, normals = np.concatenate([vertices_world_m, corners.mean(axis=1)]), np.concatenate([of_vertices, normals])
    inside = grid.contains(points)
    points, normals = points[inside], normals[inside]
    voxels, of = np.unique(np.ravel_multi_index(tuple(grid.index(points).T), grid.shape), return_inverse=True)
    count = np.bincount(of, minlength=len(voxels))
    sums = [np.bincount(of, values, minlength=len(voxels)) for values in (*points.T, *normals.T)]
    place, normal = np.stack(sums[:3], axis=1) / count[:, None], np.stack(sums[3:], axis=1)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    number.ravel()[voxels] = np.where(length > 0.0, np.arange(len(voxels)), -1)
    near = np.asarray(ndimage.binary_dilation(number >= 0, np.ones((3, 3, 3), bool), iterations=2), bool)
    number[(state == OCCUPIED) & ~near] = -2
    return number, np.ascontiguousarray(np.concatenate([place, normal], axis=1))


def _shown(view: ImageView, number: NDArray[np.int32], plane: FloatArray, grid: Grid, farthest_m: float) -> _Shown:
    grey = view.grey if view.used is None else np.where(view.used, view.grey, np.uint8(0))
    range_m = _mapping.surface_ranges(
        grid.low_world_m,
        grid.voxel_m[0],
        number,
        plane,
        stereo.depth_rays(view, RANGE_SCALE),
        view.T_world_camera,
        farthest_m,
    )
    return _Shown(view, np.ascontiguousarray(grey), range_m, _without_jumps(range_m), lens_row(view.camera))


def _without_jumps(range_m: NDArray[np.float32]) -> NDArray[np.float32]:
    import cv2

    window = np.ones((3, 3), np.uint8)
    nearest = np.asarray(cv2.erode(np.where(range_m > 0.0, range_m, np.float32(1e9)), window))
    farthest = np.asarray(cv2.dilate(range_m, window))
    return np.where(farthest < stereo.LARGEST_STEP * nearest, range_m, np.float32(0.0))


def _least_and_most(grey: NDArray[np.uint8], window_px: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(h, w) of the grey values in the window round each pixel."""
    import cv2

    window = np.ones((window_px, window_px), np.uint8)
    return np.asarray(cv2.erode(grey, window), np.uint8), np.asarray(cv2.dilate(grey, window), np.uint8)


def _window(shown: Sequence[_Shown], partners: Sequence[Sequence[int]]) -> tuple[int, float]:
    """The window in which images explain each other, and the share that they leave unexplained; 0 where none does."""
    step = max(len(shown) // SAMPLED_IMAGES, 1)
    pairs = [_pair(shown[i], shown[p]) for i in range(0, len(shown), step) for p in partners[i]]
    for window_px in WINDOWS_PX:
        rates = [rate for pair in pairs if (rate := _rate(pair, window_px)) is not None]
        if rates and (rate := float(np.median(rates))) <= LARGEST_RATE:
            return window_px, rate
    return 0, 1.0


def _pair(image: _Shown, partner: _Shown) -> _Pair:
    T_partner_camera = frames.invert(partner.view.T_world_camera) @ image.view.T_world_camera
    matched, own = _matched(image, partner, T_partner_camera, partner.grey)
    known = matched > 0.0
    if not known.any():
        return _Pair(image, partner, T_partner_camera, np.ones_like(own), _LEAST_NOISE)
    gain = np.ascontiguousarray(consistency.relative_brightness(known, own, matched, _BRIGHTNESS_BLOCK))
    noise = consistency.noise(np.abs(gain * own - matched)[known])
    return _Pair(image, partner, T_partner_camera, gain, max(noise, _LEAST_NOISE))


def _matched(
    image: _Shown, partner: _Shown, T_partner_camera: FloatArray, values: NDArray[np.uint8]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The partner's values at the surface behind every `_STEP_PX`th pixel, 0 where it does not see that; and the
    image's own."""
    matched = _mapping.match_through_surface(
        image.grey,
        image.smooth_m,
        image.lens,
        image.rays,
        values,
        partner.range_m,
        partner.lens,
        T_partner_camera,
        _STEP_PX,
    )
    rows, columns = matched.shape
    middle = _STEP_PX // 2
    return matched, image.grey[middle::_STEP_PX, middle::_STEP_PX][:rows, :columns].astype(np.float32)


def _rate(pair: _Pair, window_px: int) -> float | None:
    """Share of the pixels that the partner does not explain; None where it sees too few."""
    least, most = (
        _matched(pair.image, pair.partner, pair.T_partner_camera, each)[0]
        for each in _least_and_most(pair.partner.grey, window_px)
    )
    _, own = _matched(pair.image, pair.partner, pair.T_partner_camera, pair.partner.grey)
    known = least > 0.0
    if known.sum() < _LEAST_COMPARED:
        return None
    expected, allowed = pair.gain * own, NOISE_DEVIATIONS * pair.noise
    return float(((expected > most + allowed) | (expected < least - allowed))[known].mean())


def _verdict(
    shown: Sequence[_Shown],
    index: int,
    partners: Sequence[int],
    around: Callable[[int], tuple[NDArray[np.uint8], NDArray[np.uint8]]],
) -> NDArray[np.uint8]:
    """(h, w) 0 where too few partners see the surface behind a pixel, 1 where they explain it, 2 where not."""
    image = shown[index]
    counts = np.zeros((*image.grey.shape, 3), np.uint8)
    for number in partners:
        pair, (least, most) = _pair(image, shown[number]), around(number)
        _mapping.compare_through_surface(
            counts,
            image.grey,
            image.smooth_m,
            image.lens,
            image.rays,
            least,
            most,
            pair.partner.range_m,
            pair.partner.lens,
            pair.T_partner_camera,
            pair.gain,
            _STEP_PX,
            NOISE_DEVIATIONS * pair.noise,
            ENOUGH,
        )
    alike, lighter, darker = counts[..., 0], counts[..., 1], counts[..., 2]
    tested, differing = alike + lighter + darker, np.maximum(lighter, darker)
    unexplained = (alike < ENOUGH) & (differing >= LEAST_TESTED) & (2 * differing >= tested)
    return (tested >= LEAST_TESTED).astype(np.uint8) + unexplained
