"""Depth from a moving fisheye camera: pairs of its own images, rectified on the sphere, matched, and compared.

For a pair, columns of the rectified images are the angle from the baseline and rows the angle round it. A point lies
in the same row of both, and its shift is the angle under which it sees the baseline. Nothing is flattened to a
pinhole, so forward motion and the whole field of view work alike.
"""

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, InputError, MapError, frames
from mapping import _mapping
from mapping.camera.rig import Camera
from mapping.dense import consistency
from mapping.dense.views import ImageView, lens_row

FloatImage = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class StereoOptions:
    """How images are paired and matched."""

    near_m: float = 0.4
    """Nearest surface to search for, where the image view gives no range."""
    far_m: float = 8.0
    """Farthest surface of interest; baselines are not lengthened for the sake of what lies beyond."""
    partners: int = 4
    """How many other images each image is matched with, at most."""
    least_agreeing: int = 2
    """How many partners must agree on a depth."""
    baseline_ratio: float = 0.08
    """Baseline to aim for, over the typical distance of the scene."""
    tolerance: float = 2.0
    """Depths agree when they differ by at most this many standard deviations."""


DEPTH_SCALE = 0.5
"""Size of the depth images over that of the images."""
COLUMN_PX = 1.3
"""Width of a rectified column, in pixels of the image's centre."""
ROW_PX = 2.0
"""Height of a rectified row."""
BLOCK_COLUMNS = 5
"""Edge of the blocks that are compared; larger ones bridge weak texture and blur edges."""
DISPARITY_STD = 0.35
"""Standard deviation of a match, in columns."""
LARGEST_RELATIVE_STD = 0.12
"""Depths less certain than this share of themselves are dropped."""
LARGEST_BASELINE_RATIO = 0.5
"""Over the typical distance; from farther apart, two images look too different to be matched."""
BOUND_DEVIATIONS = 3.0
"""How much nearer than measured, in standard deviations, a surface may be."""
LARGEST_STEP = 1.15
"""Ratio of the ranges within 5x5 pixels beyond which they belong to two surfaces."""
UNSURE_FACING = 0.5
"""Taken beside jumps of depth: half the distance along the ray, so that free space is not overstated."""
MOST_DISPARITIES = 112
LEAST_ANGLE_RAD = 0.05  # nearer the baseline than this, parallax does not determine depth


@dataclass(frozen=True, slots=True, eq=False)
class DepthImage:
    """Range along each ray of one image, with its uncertainty and bound."""

    inverse_range: FloatImage
    """(h, w) 1/m along the ray, 0 where nothing is known."""
    deviation: FloatImage
    """(h, w) its standard deviation, 1/m."""
    facing: FloatImage
    """(h, w) cosine between the ray and the surface normal, 1 where the surface is met squarely."""
    bound: FloatImage
    """(h, w) 1/m, the largest inverse range that is possible, 0 where nothing is known: space nearer than that is open.
    Known also where parallax is too small for a depth, above all ahead of a camera that moves forward."""
    scale: float
    """Size of this image over that of the image it belongs to."""

    def where(self, used: NDArray[np.bool_]) -> "DepthImage":
        """The same without what a mask leaves out: neither depth nor a bound on it.

        Args:
            used: (height, width) of the image: pixels that are not masked.
        """
        import cv2

        height, width = self.inverse_range.shape
        # a pixel of a smaller depth image that is masked in part is masked
        kept = cv2.resize(used.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA) > 0.999
        zero = np.float32(0.0)
        return dataclasses.replace(
            self, inverse_range=np.where(kept, self.inverse_range, zero), bound=np.where(kept, self.bound, zero)
        )


def typical_distance_m(view: ImageView, options: StereoOptions) -> float:
    """The geometric middle of the near and far end of what is in view, as far as it is of interest."""
    near_m = view.near_m or options.near_m
    return float(np.sqrt(near_m * max(min(view.far_m or options.far_m, options.far_m), near_m)))


def choose_partners(views: Sequence[ImageView], index: int, options: StereoOptions) -> list[int]:
    """The images to match one image with: a good baseline, much common view, different sides."""
    centre, axis = views[index].position_world_m, views[index].T_world_camera[:3, 2]
    offsets = np.array([v.position_world_m for v in views]) - centre
    turns = np.array([v.T_world_camera[:3, 2] for v in views]) @ axis
    lengths = np.linalg.norm(offsets, axis=1)
    typical_m = typical_distance_m(views[index], options)
    wanted = options.baseline_ratio * typical_m
    usable = (lengths > 0.2 * wanted) & (lengths < LARGEST_BASELINE_RATIO * typical_m) & (turns > 0.5)
    usable[index] = False
    with np.errstate(divide="ignore"):
        cost = np.abs(np.log(lengths / wanted)) + 2.0 * (1.0 - turns)
    cost[~usable] = np.inf
    chosen: list[int] = []
    while len(chosen) < options.partners and np.isfinite(cost).any():
        best = int(np.argmin(cost))
        chosen.append(best)
        # A second partner from the same side sees what the first saw; one from the other side fills its shadows.
        same_side = offsets @ offsets[best] / np.maximum(lengths * lengths[best], 1e-12)
        cost = cost + 0.3 * np.maximum(same_side, 0.0)
        cost[best] = np.inf
    return chosen


def depth_of_pair(
    view: ImageView, partner: ImageView, rays_camera: FloatArray, options: StereoOptions
) -> tuple[FloatImage, FloatImage, FloatImage]:
    """Inverse range, its standard deviation and its bound along each ray (h, w, 3) of `view`, from one partner."""
    T_partner_camera = frames.invert(partner.T_world_camera) @ view.T_world_camera
    baseline_camera_m = frames.invert(T_partner_camera)[:3, 3]
    baseline_m = float(np.linalg.norm(baseline_camera_m))
    R_camera_grid = axes_about(baseline_camera_m / baseline_m)
    R_partner_grid = np.ascontiguousarray(T_partner_camera[:3, :3] @ R_camera_grid)
    near_m = view.near_m or options.near_m
    grid, disparities = _grid(view, rays_camera, R_camera_grid, baseline_m / near_m)
    left = _mapping.rectify(view.grey, lens_row(view.camera), R_camera_grid, grid)
    right = _mapping.rectify(partner.grey, lens_row(partner.camera), R_partner_grid, grid)
    disparity = _match(left, right, disparities, BLOCK_COLUMNS)
    return _mapping.inverse_range(
        disparity,
        consistency.nearest_disparity(left, right, disparity, disparities),
        grid,
        R_camera_grid,
        baseline_m,
        np.ascontiguousarray(T_partner_camera),
        lens_row(partner.camera),
        rays_camera,
        DISPARITY_STD,
        LARGEST_RELATIVE_STD,
        BOUND_DEVIATIONS,
    )


def axes_about(baseline: FloatArray) -> FloatArray:
    """(3, 3) rotation: first axis the baseline, second the optical axis as far as it is square to it."""
    second = np.array([0.0, 0.0, 1.0]) - baseline[2] * baseline
    if np.linalg.norm(second) < 1e-3:
        second = np.array([1.0, 0.0, 0.0]) - baseline[0] * baseline
    second = second / np.linalg.norm(second)
    axes = np.array([baseline, second, np.cross(baseline, second)], dtype=np.float64)
    return np.ascontiguousarray(axes.T)


def _grid(
    view: ImageView,
    rays_camera: FloatArray,
    R_camera_grid: FloatArray,
    baseline_over_near: float,
) -> tuple[FloatArray, int]:
    """The kernel's grid row, and the number of disparities, for the part of the sphere that `view` sees."""
    nearest, farthest = np.arccos(np.clip(_range(rays_camera @ R_camera_grid[:, 0])[::-1], -1.0, 1.0))
    low, high = max(nearest, LEAST_ANGLE_RAD), min(farthest, np.pi - LEAST_ANGLE_RAD)
    focal_px = min(view.camera.focal_px)
    angles = np.linspace(low, high, 64)
    towards = np.maximum(1.0 / baseline_over_near - np.cos(angles), 1e-3)
    parallax = min(float(np.arctan(np.sin(angles) / towards).max()), 1.2)
    column_step = max(COLUMN_PX / focal_px, parallax / MOST_DISPARITIES)
    disparities = 16 * int(np.ceil(parallax / column_step / 16))
    row_step = ROW_PX / focal_px
    if nearest < LEAST_ANGLE_RAD or farthest > np.pi - LEAST_ANGLE_RAD:
        first, last = -np.pi, np.pi  # the baseline is in view: all directions round it are
    else:
        first, last = _range(np.arctan2(rays_camera @ R_camera_grid[:, 2], rays_camera @ R_camera_grid[:, 1]))
    # OpenCV matches only columns beyond the largest disparity, so the grid starts that much before the image.
    start = high + disparities * column_step
    columns, rows = np.ceil((start - low) / column_step), np.ceil((last - first) / row_step)
    return np.array([start, column_step, first, row_step, rows, columns]), disparities


def _range(values: FloatArray) -> tuple[float, float]:
    """The least and the largest, NaN left out."""
    return np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)


def _match(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: int, block: int) -> NDArray[np.int16]:
    import cv2

    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=block,
        P1=8 * block * block,
        P2=32 * block * block,
        disp12MaxDiff=1,
        preFilterCap=31,
        uniquenessRatio=8,
        speckleWindowSize=80,
        speckleRange=2,
        mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
    return np.ascontiguousarray(matcher.compute(left, right), dtype=np.int16)


def depth_image(views: Sequence[ImageView], index: int, options: StereoOptions) -> DepthImage | None:
    """Depth of one image from its partners; None when it has too few partners."""
    return depth_beside(views[index], [views[p] for p in choose_partners(views, index, options)], options)


def depth_beside(view: ImageView, partners: Sequence[ImageView], options: StereoOptions) -> DepthImage | None:
    """The same from partners that are chosen already."""
    if len(partners) < options.least_agreeing:
        return None
    rays = depth_rays(view, DEPTH_SCALE)
    layers = [depth_of_pair(view, partner, rays, options) for partner in partners]
    values, deviations, bounds = (np.stack(part) for part in zip(*layers, strict=True))
    value, deviation = _mapping.fuse(values, deviations, options.tolerance, options.least_agreeing)
    bound = agreed_bound(bounds, value, deviation, options.least_agreeing)
    value = without_jumps(value)
    return DepthImage(value, deviation, facing(value, rays), bound, DEPTH_SCALE)


def require_depth(found: Sequence[bool], options: StereoOptions) -> None:
    """Check that there is depth in one of the images at least.

    Raises:
        MapError: there is none.
    """
    if not any(found):
        raise MapError(
            f"no depth was found in {len(found)} images: they need to show the same things from places "
            f"about {options.baseline_ratio:.0%} of the distance apart"
        )


def agreed_bound(bounds: FloatImage, value: FloatImage, deviation: FloatImage, least_agreeing: int) -> FloatImage:
    """(h, w) 1/m: at least so many partners exclude a larger inverse range; never below that of a known depth.

    Spread to the pixels around, because block matching may miss the edge of a near object before a far one.
    """
    import cv2

    smallest = np.full((least_agreeing, *value.shape), np.inf, np.float32)  # in order; `np.sort` takes 20 times as long
    for layer in np.where(bounds > 0.0, bounds, np.float32(np.inf)):
        for k in range(least_agreeing):
            smallest[k], layer = np.minimum(smallest[k], layer), np.maximum(smallest[k], layer)
    bound = np.maximum(smallest[-1], value + np.float32(BOUND_DEVIATIONS) * deviation)
    spread = np.asarray(cv2.dilate(bound, np.ones((3, 3), np.uint8)), dtype=np.float32)
    return np.where(np.isfinite(spread), spread, np.float32(0.0))


def without_jumps(inverse_range: FloatImage) -> FloatImage:
    """The same without the pixels beside a jump of depth: there, block matching smears the nearer surface outwards."""
    import cv2

    window = np.ones((5, 5), np.uint8)
    known = inverse_range > 0.0
    nearest = np.asarray(cv2.dilate(inverse_range, window), dtype=np.float32)
    farthest = np.asarray(cv2.erode(np.where(known, inverse_range, np.float32(1e30)), window), dtype=np.float32)
    inverse_range = np.where(known & (nearest < LARGEST_STEP * farthest), inverse_range, np.float32(0.0))
    return inverse_range.astype(np.float32)


def facing(inverse_range: FloatImage, rays_camera: FloatArray) -> FloatImage:
    """(h, w) cosine between each ray and the normal of the surface it meets."""
    step = 2  # pixels; the noise of closer neighbours tilts the normal
    return _mapping.facing(inverse_range, rays_camera, step, UNSURE_FACING)


def depth_rays(view: ImageView, scale: float) -> FloatArray:
    """(h, w, 3) unit rays of the depth image's pixels, read only."""
    return _rays(view.camera, scale)


@functools.lru_cache(maxsize=8)
def _rays(camera: Camera, scale: float) -> FloatArray:
    width, height = round(camera.width * scale), round(camera.height * scale)
    u, v = np.meshgrid(
        (np.arange(width) + 0.5) * camera.width / width, (np.arange(height) + 0.5) * camera.height / height
    )
    rays = np.ascontiguousarray(camera.unproject(np.stack([u, v], axis=-1)))
    rays.flags.writeable = False  # shared by all images of a camera
    return rays


def depth_from_sensor(view: ImageView, depth_m: NDArray[np.floating], *, relative_std: float = 0.01) -> DepthImage:
    """A depth camera's measurement in the form of a stereo depth image.

    Args:
        depth_m: (h, w) metres along the optical axis (not along the ray), aligned with the image, perhaps smaller;
            0 or NaN where nothing was measured.
        relative_std: standard deviation over the depth.
    """
    scale = depth_m.shape[1] / view.camera.width
    rays = depth_rays(view, scale)
    if depth_m.ndim != 2 or depth_m.shape != rays.shape[:2]:
        raise InputError(f"a depth image of {depth_m.shape} does not fit an image of {view.pixels.shape[:2]}")
    known = np.isfinite(depth_m) & (depth_m > 0.0) & (rays[..., 2] > 0.0)
    inverse_range = np.where(known, rays[..., 2] / np.where(known, depth_m, 1.0), 0.0).astype(np.float32)
    inverse_range = without_jumps(inverse_range)
    deviation = (relative_std * inverse_range).astype(np.float32)
    bound = (inverse_range + BOUND_DEVIATIONS * deviation).astype(np.float32)
    return DepthImage(inverse_range, deviation, facing(inverse_range, rays), bound, scale)
