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
WINDOW_PX = 3
"""Edge of what counts as around: one pixel is left to errors of surface, pose and lens."""
FARTHEST_M = 3.0
"""Of the voxels that an image looks at: from farther away thin things are less than a pixel wide."""
NEAREST_M = 0.3
MARGIN_VOXELS = 2.0
"""How far behind a voxel the surface must lie."""
LEAST_TESTED_SHARE, LEAST_PIXELS, LEAST_PIXEL_SHARE = 0.125, 1, 0.125
"""Of a voxel's pixels that must be tested for a look, of which half are; and unexplained pixels, at least and over the
voxel's width, for a contradiction."""
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
_KEPT = 64
"""Images whose range images are kept: partners are mostly taken one soon after the other."""


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
    least: NDArray[np.uint8]
    """(h, w) of the grey values round each pixel."""
    most: NDArray[np.uint8]
    """(h, w)."""
    range_m: NDArray[np.float32]
    """Smaller; 0 where no surface was met."""
    lens: FloatArray
    """Row of the kernels."""


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

    @functools.lru_cache(maxsize=_KEPT)
    def shown(index: int) -> _Shown:
        return _shown(images[index], number, plane, grid, farthest_m)

    def judged(index: int) -> tuple[_Shown, NDArray[np.uint8]]:
        partners = stereo.choose_partners(images, index, wider)
        return shown(index), _verdict(shown, index, partners)

    marked = (state == FREE).astype(np.uint8)
    found = Looks(np.zeros(grid.shape, np.uint16), np.zeros(grid.shape, np.uint16))
    for image, verdict in workers.in_order(judged, range(len(images)), threads=threads):
        if verdict.any():
            _mapping.count_looks(
                grid.low_world_m,
                grid.voxel_m[0],
                marked,
                found.looks,
                found.contradictions,
                verdict,
                image.range_m,
                image.lens,
                frames.invert(image.view.T_world_camera),
                NEAREST_M,
                FARTHEST_M,
                MARGIN_VOXELS * grid.voxel_m[0],
                LEAST_TESTED_SHARE,
                LEAST_PIXELS,
                LEAST_PIXEL_SHARE,
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
    import cv2

    grey = view.grey if view.used is None else np.where(view.used, view.grey, np.uint8(0))
    window = np.ones((WINDOW_PX, WINDOW_PX), np.uint8)
    least, most = (np.asarray(work(grey, window), np.uint8) for work in (cv2.erode, cv2.dilate))
    range_m = _mapping.surface_ranges(
        grid.low_world_m,
        grid.voxel_m[0],
        number,
        plane,
        stereo.depth_rays(view, RANGE_SCALE),
        view.T_world_camera,
        farthest_m,
    )
    return _Shown(view, np.ascontiguousarray(grey), least, most, range_m, lens_row(view.camera))


def _verdict(shown: Callable[[int], _Shown], index: int, partners: Sequence[int]) -> NDArray[np.uint8]:
    """(h, w) 0 where too few partners see the surface behind a pixel, 1 where they explain it, 2 where not."""
    image = shown(index)
    counts = np.zeros((*image.grey.shape, 3), np.uint8)  # alike, lighter, darker
    if len(partners) < LEAST_TESTED:
        return counts[..., 0].copy()
    rays = stereo.depth_rays(image.view, 1.0)
    for partner in map(shown, partners):
        T_partner_camera = frames.invert(partner.view.T_world_camera) @ image.view.T_world_camera
        gain, noise = _brightness(image, partner, rays, T_partner_camera)
        _mapping.compare_through_surface(
            counts,
            image.grey,
            image.range_m,
            image.lens,
            rays,
            partner.least,
            partner.most,
            partner.range_m,
            partner.lens,
            T_partner_camera,
            gain,
            _STEP_PX,
            NOISE_DEVIATIONS * noise,
            ENOUGH,
        )
    alike, lighter, darker = np.moveaxis(counts, -1, 0)
    tested = alike + lighter + darker
    most = np.maximum(lighter, darker)
    differ = (alike < ENOUGH) & (most >= LEAST_TESTED) & (2 * most >= tested)
    return np.where(tested >= LEAST_TESTED, np.where(differ, np.uint8(2), np.uint8(1)), np.uint8(0))


def _brightness(
    image: _Shown, partner: _Shown, rays: FloatArray, T_partner_camera: FloatArray
) -> tuple[NDArray[np.float32], float]:
    """How bright the partner shows the image's surroundings, over the image, at each `_STEP_PX`th pixel; and the noise
    of what is left."""
    matched = _mapping.match_through_surface(
        image.grey,
        image.range_m,
        image.lens,
        rays,
        partner.grey,
        partner.range_m,
        partner.lens,
        T_partner_camera,
        _STEP_PX,
    )
    rows, columns = matched.shape
    first = _STEP_PX // 2
    own = image.grey[first::_STEP_PX, first::_STEP_PX][:rows, :columns].astype(np.float32)
    known = matched > 0.0
    if not known.any():
        return np.ones_like(own), _LEAST_NOISE
    gain = consistency.relative_brightness(known, own, matched, _BRIGHTNESS_BLOCK)
    noise = consistency.noise(np.abs(gain * own - matched)[known])
    return np.ascontiguousarray(gain), max(noise, _LEAST_NOISE)
