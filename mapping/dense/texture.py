"""The texture of a mesh: every texel from the images that show its surface best, all made equally bright.

How well an image shows a vertex is its resolution there: focal length times cosine of incidence over distance, none
where the vertex is hidden. A vertex takes the images near its best (weights of a high power of the ratio), and a texel
the weights of its face's vertices: images change softly along the surface, and also across seams of the atlas. Rays
decide texel by texel what is hidden. Images are read one at a time, with their true lens.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, InputError, Progress, frames, silent
from mapping.camera.rig import Camera
from mapping.dense import atlas, exposure
from mapping.dense.atlas import FlattenedMesh, Texels
from mapping.dense.exposure import Brightness, Exposure

_LEAST_COSINE = 0.2
"""Of the angle of incidence: flatter views smear."""
_RIM = 0.08
"""Width of an image's rim, of its width and of the lens's half field, over which its weight falls to nothing."""
_SHARPNESS = 24.0
"""Power of the weights. Lower ones mix more images, whose small shifts against each other blur; higher ones show
where images change."""
_LEAST_WEIGHT = 0.1
"""Images below this share of the best one's weight are not mixed in."""
_SMOOTHING_PX = 2.0
"""Standard deviation of the blur under which brightness is compared."""
_LEVELS = (8.0, 248.0)
"""Grey levels that tell brightness: darker ones are noise, brighter ones are clipped."""
_LEAST_SHARED = 50
"""Surface points an image must show before it is judged whether it shows this mesh."""
_LEAST_CORRELATION = 0.3
"""Of an image's logarithmic brightness with the mesh's colours: an image of something else has about 0, one that was
used for the mesh 0.7 and more."""


@dataclass(frozen=True, slots=True, eq=False)
class TextureView:
    """An image to take colours from."""

    name: str
    """For messages."""
    camera: Camera
    """Its lens; only the lens is used, not its place on the body."""
    T_world_camera: FloatArray
    """(4, 4), metres."""
    read: Callable[[], tuple[NDArray[np.uint8], NDArray[np.bool_] | None]]
    """Pixels, (height, width) grey or (height, width, 3) RGB, and which of them may be used (None: all)."""


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """Colours of the atlas."""

    pixels: NDArray[np.uint8]
    """(size, size, 3) RGB, first row at v = 0."""
    painted: float
    """Share of the texels on faces that have their colour from an image; the others have the mesh's vertex colours."""
    exposure: Exposure
    """Of the images."""
    left_out: tuple[str, ...]
    """Images that do not show this mesh."""


class _Surface:
    """The mesh, with rays to tell what is hidden."""

    def __init__(self, mesh: FlattenedMesh, tolerance_m: float) -> None:
        import open3d

        self._to_open3d: Any = open3d.core.Tensor  # its stub knows no NumPy arrays
        self.vertices, self.faces, self.tolerance_m = mesh.vertices_world_m, mesh.faces, tolerance_m
        self._scene = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(self._tensor(self.vertices), self._to_open3d(self.faces.astype(np.uint32)))
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        of_faces = np.cross(b - a, c - a)  # as long as the face is large: its weight at its vertices
        summed = np.zeros_like(self.vertices)
        for corner in range(3):
            np.add.at(summed, self.faces[:, corner], of_faces)
        self.normals = summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12)

    def _tensor(self, values: FloatArray) -> Any:
        return self._to_open3d(np.ascontiguousarray(values, dtype=np.float32))

    def seen_from(self, centre_world_m: FloatArray, points_world_m: FloatArray) -> NDArray[np.bool_]:
        """Whether nothing farther than the tolerance before a point (n, 3) hides it."""
        towards = centre_world_m - points_world_m
        distance = np.linalg.norm(towards, axis=1)
        start = points_world_m + towards * (self.tolerance_m / np.maximum(distance, self.tolerance_m))[:, None]
        hidden = self._scene.test_occlusions(
            self._tensor(np.concatenate([start, centre_world_m - start], axis=1)), tnear=0.0, tfar=1.0
        )
        return ~np.asarray(hidden.numpy(), dtype=bool)


def paint(
    mesh: FlattenedMesh,
    colours: NDArray[np.uint8],
    views: Sequence[TextureView],
    *,
    size: int,
    tolerance_m: float,
    progress: Progress = silent,
) -> Texture:
    """The texture of a flattened mesh.

    Args:
        colours: (v, 3) of its vertices, for what no image shows; their brightness is the texture's.
        size: edge of the atlas in texels.
        tolerance_m: what lies nearer than this before a surface does not hide it; the mesh's own error.

    Raises:
        InputError: the images do not show this mesh.
    """
    surface = _Surface(mesh, tolerance_m)
    resolution, seen = _survey(surface, views, progress)
    left_out = _strangers(seen, colours, len(views))
    resolution[left_out] = 0.0
    weights = _weights(resolution)
    numbers = {name: number for number, name in enumerate(dict.fromkeys(view.camera.name for view in views))}
    kept = ~np.isin(seen.image, left_out)
    seen = Brightness(seen.image[kept], seen.point[kept], seen.log[kept], seen.angle[kept])
    exposures = exposure.solve(seen, [numbers[view.camera.name] for view in views])
    brightness = _brightness_of(seen, exposures, colours)
    shown = atlas.texels(mesh, size)
    total, weight = _blend(surface, shown, views, weights, exposures, progress)
    painted = weight > 0.0
    on_faces = np.einsum("nk,nkc->nc", shown.share, colours[mesh.faces[shown.face]])
    on_faces[painted] = brightness * total[painted] / weight[painted, None]
    pixels = _spread(shown, np.clip(np.round(on_faces), 0, 255).astype(np.uint8), size)
    return Texture(pixels, float(painted.mean()), exposures, tuple(views[k].name for k in left_out))


def _survey(
    surface: _Surface, views: Sequence[TextureView], progress: Progress
) -> tuple[NDArray[np.float32], Brightness]:
    """How well each image shows each vertex, (images, v) pixels per metre, and how bright it is there."""
    import cv2

    resolution = np.zeros((len(views), len(surface.vertices)), np.float32)
    seen: list[tuple[Any, ...]] = []
    for number, view in enumerate(views):
        progress("compare brightness", number / len(views))
        pixels, used = view.read()
        px, quality, angle = _shown(view, surface.vertices, used, surface.normals)
        (candidates,) = np.nonzero(quality > 0.0)
        points = candidates[surface.seen_from(view.T_world_camera[:3, 3], surface.vertices[candidates])]
        resolution[number, points] = quality[points]
        soft = cv2.GaussianBlur(_grey(pixels).astype(np.float32), (0, 0), _SMOOTHING_PX)
        level = _sample(soft, px[points])
        fit = (level > _LEVELS[0]) & (level < _LEVELS[1])
        points = points[fit]
        seen.append((np.full(len(points), number), points, np.log(level[fit]), angle[points]))
    progress("compare brightness", 1.0)
    image, point, log, angle = (np.concatenate(column) for column in zip(*seen, strict=True))
    return resolution, Brightness(image.astype(np.int64), point.astype(np.int64), log, angle)


def _shown(
    view: TextureView, points_world_m: FloatArray, used: NDArray[np.bool_] | None, normals: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of points (n, 3): pixels (n, 2), resolution (n,) in pixels per metre, 0 where the image cannot show the point
    (what hides it is not asked), and the relative angle (n,) from the optical axis.

    Args:
        normals: (n, 3) of the surface; None: each point is met squarely.
    """
    camera = view.camera
    at_camera = frames.apply(frames.invert(view.T_world_camera), points_world_m)
    px = camera.project(at_camera)
    range_m = np.maximum(np.linalg.norm(at_camera, axis=1), 1e-6)
    angle = np.arctan2(np.hypot(at_camera[:, 0], at_camera[:, 1]), at_camera[:, 2]) / camera.half_field_rad
    inside = camera.contains(px)
    if used is not None:
        column, row = np.where(inside[:, None], px, 0.0).astype(np.int64).T
        inside &= used[row, column]
    to_edge = np.minimum(px, np.array([camera.width, camera.height]) - px).min(axis=1) / camera.width
    rim = np.clip(np.minimum(np.where(inside, to_edge, 0.0), 1.0 - angle) / _RIM, 0.0, 1.0)
    cosine = np.ones(len(px))
    if normals is not None:
        cosine = ((view.T_world_camera[:3, 3] - points_world_m) * normals).sum(axis=1) / range_m
    focal_px = float(np.mean(camera.focal_px))
    quality = np.where(cosine > _LEAST_COSINE, rim * focal_px * cosine / range_m, 0.0)
    return px, quality, angle


def _strangers(seen: Brightness, colours: NDArray[np.uint8], count: int) -> list[int]:
    """Images whose brightness is not that of the mesh's vertices: of another place, or moved since.

    Raises:
        InputError: that is half of them, or none shows enough of the mesh.
    """
    log_colour = np.log(np.maximum(_grey(colours), 1.0))
    judged: dict[int, float] = {}
    for image in range(count):
        own = seen.image == image
        a, b = seen.log[own], log_colour[seen.point[own]]
        if len(a) >= _LEAST_SHARED:
            spread = a.std() * b.std()
            judged[image] = float(((a - a.mean()) * (b - b.mean())).mean() / spread) if spread > 0.0 else 0.0
    if not judged:
        raise InputError(
            f"none of the {count} images shows {_LEAST_SHARED} vertices of the mesh; are they the map's images?"
        )
    strange = [image for image, correlation in judged.items() if correlation < _LEAST_CORRELATION]
    if 2 * len(strange) > len(judged):
        raise InputError(
            f"{len(strange)} of {len(judged)} images do not look like the map (correlation of their brightness with "
            f"its colours, median: {np.median(list(judged.values())):.2f}); give the images that it was made of"
        )
    return strange


def _weights(resolution: NDArray[np.float32]) -> NDArray[np.float32]:
    """(images, v): how much of each image a vertex takes; columns sum to one, or to nothing."""
    best = resolution.max(axis=0)
    ratio = np.divide(resolution, best, out=np.zeros_like(resolution), where=best > 0.0) ** np.float32(_SHARPNESS)
    ratio[ratio < _LEAST_WEIGHT] = 0.0
    total = ratio.sum(axis=0)
    return np.divide(ratio, total, out=ratio, where=total > 0.0)


def _brightness_of(seen: Brightness, exposures: Exposure, colours: NDArray[np.uint8]) -> float:
    """What to multiply evened images by, so that they are as bright as the mesh's colours."""
    evened = np.empty(len(seen.log))
    for image in range(len(exposures.log_gain)):
        own = seen.image == image
        evened[own] = seen.log[own] - np.log(exposures.gain(image, seen.angle[own]))
    return float(np.exp(np.median(np.log(np.maximum(_grey(colours), 1.0))[seen.point] - evened)))


def _blend(
    surface: _Surface,
    shown: Texels,
    views: Sequence[TextureView],
    weights: NDArray[np.float32],
    exposures: Exposure,
    progress: Progress,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Weighted sum (n, 3) of the evened colours of each texel, and the sum of the weights (n,)."""
    total, weight = np.zeros((len(shown.face), 3), np.float32), np.zeros(len(shown.face), np.float32)
    for number, view in enumerate(views):
        progress("paint", number / len(views))
        of_corners = weights[number][surface.faces]
        (at,) = np.nonzero((of_corners > 0.0).any(axis=1)[shown.face])
        if not len(at):
            continue
        pixels, used = view.read()
        corners, share = surface.faces[shown.face[at]], shown.share[at]
        points = np.einsum("nk,nkc->nc", share, surface.vertices[corners])
        px, quality, angle = _shown(view, points, used, None)
        seen = quality > 0.0
        seen[seen] = surface.seen_from(view.T_world_camera[:3, 3], points[seen])
        at, share, px, angle = at[seen], share[seen], px[seen], angle[seen]
        own = (share * of_corners[shown.face[at]]).sum(axis=1)
        colour = _sample(pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2), px)
        total[at] += (own / exposures.gain(number, angle))[:, None] * colour
        weight[at] += own
    progress("paint", 1.0)
    return total, weight


def _sample(image: np.ndarray, px: FloatArray) -> np.ndarray:
    """Bilinear values (n, ...) at pixels (n, 2)."""
    import cv2

    side = 1 << 14  # OpenCV takes no longer rows
    padded = np.zeros((-(-len(px) // side) * side, 2), np.float32)
    padded[: len(px)] = px - 0.5  # OpenCV's pixel centres are whole numbers
    u, v = np.moveaxis(padded.reshape(-1, side, 2), -1, 0)
    found = cv2.remap(image.astype(np.float32), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found.reshape(len(padded), *image.shape[2:])[: len(px)]


def _grey(colours: np.ndarray) -> FloatArray:
    """Brightness of grey or RGB values, (..., 3) or of an image (height, width)."""
    if colours.shape[-1] == 3:
        return colours @ np.array([0.299, 0.587, 0.114])
    return np.asarray(colours, dtype=np.float64)


def _spread(shown: Texels, colours: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    """The atlas with each texel beside the faces in its nearest neighbour's colour, so that no seam shows."""
    from scipy import ndimage

    beside = np.ones((size, size), dtype=bool)
    pixels = np.zeros((size, size, 3), np.uint8)
    beside[shown.row, shown.column] = False
    pixels[shown.row, shown.column] = colours
    nearest: Any = ndimage.distance_transform_edt(beside, return_distances=False, return_indices=True)
    return pixels[tuple(nearest)]
