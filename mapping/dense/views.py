"""One image with its lens and its pose in the world: the input of dense reconstruction."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, InputError
from mapping.camera.rig import Camera

THREADS = 2
"""CPU threads of a kernel, or images that are worked on at once by a thread each."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageView:
    """An image, the camera that took it and where that camera was."""

    camera: Camera
    """Its lens; only the lens is used, not its place on the body."""
    T_world_camera: FloatArray
    """(4, 4), metres."""
    pixels: NDArray[np.uint8]
    """(height, width) grey or (height, width, 3) RGB."""
    near_m: float | None = None
    """Range of the nearest thing in view, if known (from the sparse map); otherwise the option's."""
    far_m: float | None = None
    """Range of the farthest thing in view, if known."""
    instant: int | None = None
    """Its number in the sequence; between images of numbers that do not follow each other the carrier may have been
    anywhere. None: it follows the camera's image before it in the list."""
    used: NDArray[np.bool_] | None = None
    """(height, width) pixels that are not masked; None: all of them."""
    grey: NDArray[np.uint8] = field(init=False)
    """(height, width), the pixels or, of RGB, their luma: kept, as each image is a partner of many."""

    def __post_init__(self) -> None:
        expected = (self.camera.height, self.camera.width)
        if self.pixels.dtype != np.uint8 or self.pixels.shape not in (expected, (*expected, 3)):
            raise InputError(
                f"image of camera {self.camera.name}: expected uint8 of shape {expected} or {(*expected, 3)}, "
                f"got {self.pixels.dtype} of shape {self.pixels.shape}"
            )
        if self.T_world_camera.shape != (4, 4) or not np.isfinite(self.T_world_camera).all():
            raise InputError(f"a pose of camera {self.camera.name} is not a finite (4, 4) matrix")
        object.__setattr__(self, "grey", self.pixels if self.pixels.ndim == 2 else _luma(self.pixels))

    @property
    def position_world_m(self) -> FloatArray:
        return self.T_world_camera[:3, 3]


def _luma(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.round(pixels @ np.array([0.299, 0.587, 0.114])).astype(np.uint8)


def lens_row(camera: Camera, scale: float = 1.0) -> FloatArray:
    """The lens as the kernels read it, for the image enlarged by `scale` (a size that comes out whole)."""
    width, height = round(camera.width * scale), round(camera.height * scale)
    sx, sy = width / camera.width, height / camera.height
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_point_px
    place = [fx * sx, fy * sy, cx * sx, cy * sy]
    return np.array([*place, *camera.lens.row, camera.half_field_rad, width, height], dtype=np.float64)
