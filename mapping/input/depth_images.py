"""The depth images of a depth camera: one for each image, of its name and size, perhaps without some pixels."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, InputError
from mapping.camera.rig import Camera
from mapping.input import image_file

SUFFIXES = (".png", ".tif", ".tiff")
NEAREST_M, FARTHEST_M = 0.05, 50.0
"""A depth camera's median depth lies between; one that does not is in another unit."""
_MILLIMETRE = 0.001
_SATURATED = np.iinfo(np.uint16).max
"""What some sensors write where they measured nothing; as a distance it would clear what lies before it."""


@dataclass(frozen=True, slots=True)
class DepthFolder:
    """Depth along the optical axis, aligned with the images: 16-bit PNG or TIFF, or floating-point TIFF."""

    folder: Path
    """Where they are; sub-folders as the images have them."""
    unit_m: float | None = None
    """Metres that a pixel's value of 1 means; None: millimetres in whole numbers, metres in floating-point ones."""

    def __post_init__(self) -> None:
        if self.unit_m is not None and not 1e-6 <= self.unit_m <= 10.0:
            raise InputError(f"a unit of depth of {self.unit_m:g} m is not from 1e-6 to 10 m; millimetres are 0.001")

    def path(self, relative: str) -> Path:
        """The file of the image `relative`.

        Raises:
            InputError: there is none.
        """
        files = [self.folder / Path(relative).with_suffix(suffix) for suffix in SUFFIXES]
        for file in files:
            if file.is_file():
                return file
        raise InputError(
            f"{files[0]} does not exist: each image needs a depth image of its name ({', '.join(SUFFIXES)})"
        )

    def read(self, relative: str, camera: Camera) -> FloatArray:
        """(height, width) metres, 0 where nothing was measured.

        Raises:
            InputError: it is missing, damaged, no depth image, of another size than the image, or in another unit.
        """
        import cv2

        path = self.path(relative)
        read = image_file.decode(path, cv2.IMREAD_UNCHANGED)
        if read.ndim != 2 or read.dtype not in (np.uint16, np.float32, np.float64):
            raise InputError(
                f"{path} is not a depth image: one channel of 16-bit whole or of floating-point numbers is expected, "
                f"not {read.dtype} of shape {read.shape}"
            )
        if read.shape != (camera.height, camera.width):
            raise InputError(
                f"{path} is {read.shape[1]}x{read.shape[0]} pixels, its image {camera.width}x{camera.height}: "
                "a depth image must be aligned with its image, pixel by pixel"
            )
        whole = read.dtype == np.uint16
        measured = np.isfinite(read) | (read < 0.0) if not whole else read < _SATURATED
        depth_m = np.where(measured, read, 0.0).astype(np.float64) * (self.unit_m or (_MILLIMETRE if whole else 1.0))
        if (depth_m < 0.0).any():
            raise InputError(
                f"{path} has a depth of {depth_m.min():g} m; depths are positive, 0 where nothing was seen"
            )
        self._require_metres(path, depth_m)
        return depth_m

    def _require_metres(self, path: Path, depth_m: FloatArray) -> None:
        measured = depth_m[depth_m > 0.0]
        if not measured.size or NEAREST_M <= (middle_m := float(np.median(measured))) <= FARTHEST_M:
            return
        other = "millimetres" if middle_m > FARTHEST_M else "metres"
        raise InputError(
            f"{path}: its median depth would be {middle_m:.3g} m, not {NEAREST_M:g} to {FARTHEST_M:g} m; it seems to "
            f"be in {other}: give the metres of 1 by --depth-unit (0.001 or 1)"
        )


def require_camera(cameras: tuple[Camera, ...]) -> None:
    """
    Raises:
        InputError: several cameras, or a lens with distortion: a depth camera's images come without.
    """
    camera, *others = cameras
    if others:
        raise InputError(f"depth images go with one camera; the camera file has {len(cameras)}")
    if camera.model not in ("SIMPLE_PINHOLE", "PINHOLE"):
        raise InputError(
            f"depth images go with images without distortion (PINHOLE); camera {camera.name!r} is "
            f"{camera.model}: undistort both, as the depth camera's software does"
        )
