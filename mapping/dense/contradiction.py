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

from esdf import FREE, Grid
from flight import FloatArray, frames
from mapping import _mapping, workers
from mapping.dense import consistency, ranges, stereo
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
    """What the images say of the voxels that are free without them."""

    free: NDArray[np.bool_]
    """(nx, ny, nz) by the depth images."""
    looks: NDArray[np.uint8]
    """(nx, ny, nz) images within `FARTHEST_M` that tested what lies behind the voxel, at most 255; 0 where not free."""
    contradictions: NDArray[np.uint8]
    """(nx, ny, nz) of them, those that show something before it."""

    @property
    def contradicted(self) -> NDArray[np.bool_]:
        """(nx, ny, nz) voxels that are not free after all."""
        from scipy import ndimage

        looks, against = np.arange(256)[:, None], np.arange(256)
        strong = (against >= LEAST_CONTRADICTIONS) & (against >= SHARE * looks)
        weak = (against >= 1) & (against >= BESIDE_SHARE * looks)
        found = strong[self.looks, self.contradictions]
        beside = np.asarray(ndimage.binary_dilation(found, np.ones((3, 3, 3), bool)), bool)
        return found | (beside & weak[self.looks, self.contradictions])


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
    wider = dataclasses.replace(options, partners=PARTNERS, baseline_ratio=BASELINE_RATIO)
    partners = [stereo.choose_partners(images, index, wider) for index in range(len(images))]
    behind = ranges.of_surface(
        images, vertices_world_m, faces, state, grid, scale=RANGE_SCALE, farthest_m=farthest_m, threads=threads
    )
    shown = [_shown(view, range_m) for view, range_m in zip(images, behind, strict=True)]
    found = Looks(state == FREE, np.zeros(grid.shape, np.uint8), np.zeros(grid.shape, np.uint8))
    window_px, rate = _window(shown, partners)
    if not window_px:
        return found

    @functools.lru_cache(maxsize=_KEPT)
    def around(index: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        return _least_and_most(shown[index].grey, window_px)

    def verdict(index: int) -> NDArray[np.uint8]:
        return _verdict(shown, index, partners[index], around)

    for image, judged in zip(shown, workers.in_order(verdict, range(len(images)), threads=threads), strict=True):
        if judged.any():
            _mapping.count_looks(
                grid.low_world_m,
                grid.voxel_m[0],
                found.free.view(np.uint8),
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


def _shown(view: ImageView, range_m: NDArray[np.float32]) -> _Shown:
    grey = view.grey if view.used is None else np.where(view.used, view.grey, np.uint8(0))
    return _Shown(view, np.ascontiguousarray(grey), range_m, ranges.without_jumps(range_m), lens_row(view.camera))


def _least_and_most(grey: NDArray[np.uint8], window_px: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(h, w) of the grey values in the window round each pixel."""
    import cv2

    window = np.ones((window_px, window_px), np.uint8)
    return np.asarray(cv2.erode(grey, window), np.uint8), np.asarray(cv2.dilate(grey, window), np.uint8)


def _window(shown: Sequence[_Shown], partners: Sequence[Sequence[int]]) -> tuple[int, float]:
    """The window in which images explain each other, and the share that they leave unexplained; 0 where none does."""
    by_place = np.lexsort(np.array([image.view.position_world_m for image in shown]).T)  # whatever their order
    sampled = by_place[:: max(len(shown) // SAMPLED_IMAGES, 1)].tolist()
    pairs = [_pair(shown[i], shown[p]) for i in sampled for p in partners[i]]
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
