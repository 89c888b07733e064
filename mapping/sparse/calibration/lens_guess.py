"""A first guess of an unknown lens: from the images' EXIF data, then by self-calibration.

EXIF gives the focal length of most ordinary cameras; self-calibration places images with a few likely lenses, keeps the
one that explains most matches once it is freed, and goes on from there until it stays.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import InputError, MapError, Progress, silent
from mapping import child
from mapping.camera.rig import FOCAL_WIDTHS, Camera, Rig, forward_camera
from mapping.input import image_file
from mapping.input.image_file import SUFFIXES
from mapping.input.images import ImageSet, read_folder
from mapping.sparse.calibration import self_calibration

MODEL = "RADIAL_FISHEYE"
"""Holds fisheye lenses, and, with tan(x) = x + x^3/3 + 2 x^5/15 + ..., ordinary ones up to 40 degrees off the axis."""
FISHEYE, ORDINARY = (0.0, 0.0), (1.0 / 3.0, 2.0 / 15.0)
STARTS = ((0.45, FISHEYE), (0.8, FISHEYE), (1.1, ORDINARY))
"""Focal lengths as a share of the width, and shapes, tried where nothing is known: 127, 72 and 50 degrees across."""
MOST_IMAGES = 60
"""That self-calibration places: 30 of a walk straight on leave the focal length open by a quarter."""
GIVEN_STD, EXIF_STD, DEFAULT_STD = 0.05, 0.1, 0.4
"""Standard deviations of a first focal length, as a share of it, by where it comes from."""
LEAST_STD = 0.005
"""Of a focal length from self-calibration, as a share: images along one path leave this much."""
DIAGONAL_35MM = 43.2666


@dataclass(frozen=True, slots=True)
class LensGuess:
    """A camera, with how its lens was found."""

    camera: Camera
    focal_std: float
    """Standard deviation of the focal length, as a share of it."""
    source: str
    """Source of the guess, as text."""
    is_calibrated: bool
    """Whether self-calibration confirmed it."""


def from_pictures(
    folder: Path,
    *,
    name: str = "camera",
    focal_px: float | None = None,
    calibrate: bool = True,
    progress: Progress = silent,
) -> LensGuess:
    """Guess the lens of the camera that took the images in `folder`.

    Args:
        focal_px: a known focal length; None: from EXIF, else from the pictures alone.
        calibrate: also self-calibrate, which takes minutes.

    Raises:
        InputError: no such folder, no image, or images of different sizes.
    """
    paths = pictures(Path(folder))
    width, height = sizes(paths)
    guess = _first(paths, width, height, focal_px, name)
    if not calibrate:
        return guess
    starts = STARTS if guess.focal_std == DEFAULT_STD else None
    return calibrated(Path(folder), guess, starts=starts, progress=progress) or guess


def pictures(folder: Path) -> list[Path]:
    """The images of a flat folder, in order.

    Raises:
        InputError: it is no folder, or holds none.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder of images: it does not exist or is a file")
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith("."))
    inner = sorted(
        p.name for p in folder.iterdir() if p.is_dir() and any(q.suffix.lower() in SUFFIXES for q in p.iterdir())
    )
    if not found and inner:
        raise InputError(
            f"{folder} holds images of {len(inner)} cameras ({', '.join(inner[:4])}): where they sit cannot be "
            f"guessed; import the rig from Kalibr or COLMAP, or make a file for one of them, {folder / inner[0]}"
        )
    if not found:
        raise InputError(f"{folder} has no image ({', '.join(SUFFIXES)})")
    return found


def sizes(paths: Sequence[Path]) -> tuple[int, int]:
    """Width and height that all images share."""
    import cv2

    found: dict[tuple[int, int], Path] = {}
    for path in [*paths[:5], paths[len(paths) // 2], paths[-1]]:
        image = image_file.decode(path, cv2.IMREAD_GRAYSCALE)
        found.setdefault((image.shape[1], image.shape[0]), path)
    if len(found) > 1:
        (one, first), (other, second) = list(found.items())[:2]
        raise InputError(
            f"{first} is {one[0]}x{one[1]} pixels and {second} {other[0]}x{other[1]}; one camera makes one size: "
            "put each size into a folder of its own, and do not turn single pictures"
        )
    return next(iter(found))


def _first(paths: Sequence[Path], width: int, height: int, focal_px: float | None, name: str) -> LensGuess:
    if focal_px is not None:
        shortest_px, longest_px = (ratio * width for ratio in FOCAL_WIDTHS)
        if not shortest_px <= focal_px <= longest_px:
            raise InputError(
                f"a focal length of {focal_px:g} px is not from {shortest_px:g} to {longest_px:g} px, as that of "
                f"images {width} px wide must be; give it in pixels"
            )
        return LensGuess(_camera(name, width, height, focal_px, ORDINARY), GIVEN_STD, "focal length as given", False)
    for path in paths[:3]:
        if (found := exif_focal_px(path, width, height)) is not None:
            camera = _camera(name, width, height, found[0], ORDINARY)
            return LensGuess(camera, EXIF_STD, f"EXIF of {path.name}: {found[1]}", False)
    source = "default: EXIF names no focal length; an ordinary lens of 50 degrees was assumed"
    return LensGuess(_camera(name, width, height, 1.1 * width, ORDINARY), DEFAULT_STD, source, False)


def _camera(name: str, width: int, height: int, focal_px: float, shape: tuple[float, float]) -> Camera:
    return forward_camera(MODEL, width, height, [focal_px, width / 2.0, height / 2.0, *shape], name=name)


def exif_focal_px(path: Path, width: int, height: int) -> tuple[float, str] | None:
    """Focal length in pixels from EXIF, and from which entry; None where it has none."""
    from PIL import ExifTags, Image

    try:
        with Image.open(path) as image:
            tags = image.getexif().get_ifd(ExifTags.IFD.Exif)
        focal_35 = float(tags.get(ExifTags.Base.FocalLengthIn35mmFilm) or 0.0)
        focal_mm = float(tags.get(ExifTags.Base.FocalLength) or 0.0)
        per_unit = float(tags.get(ExifTags.Base.FocalPlaneXResolution) or 0.0)
        unit_mm = {2: 25.4, 3: 10.0, 4: 1.0}.get(int(tags.get(ExifTags.Base.FocalPlaneResolutionUnit) or 2), 25.4)
    except (OSError, ValueError, TypeError, ZeroDivisionError, SyntaxError):  # Pillow raises these on damaged EXIF
        return None
    if 1.0 < focal_35 < 2000.0:
        return focal_35 * float(np.hypot(width, height)) / DIAGONAL_35MM, f"{focal_35:g} mm on 35 mm film"
    focal_px = focal_mm * per_unit / unit_mm
    if 0.1 * width < focal_px < 50.0 * width:
        return focal_px, f"{focal_mm:g} mm and {per_unit / unit_mm:.4g} pixels a mm"
    return None


def calibrated(
    folder: Path,
    guess: LensGuess,
    *,
    starts: Sequence[tuple[float, tuple[float, float]]] | None,
    progress: Progress = silent,
) -> LensGuess | None:
    """The lens that explains most matches between the images; None if they could not be placed.

    If the work failed otherwise: the guess, with the error in its source.

    Args:
        starts: focal lengths (share of the width) and shapes to start from; None: only the guess, as an ordinary lens
            and as a fisheye.
    """
    camera = guess.camera
    width, focal_px = camera.width, camera.focal_px[0]
    shares = starts or ((focal_px / width, ORDINARY), (focal_px / width, FISHEYE))
    lenses = [_camera(camera.name, width, camera.height, share * width, shape) for share, shape in shares]
    images = _some(folder, Rig((lenses[0],), refine_intrinsics=True))
    try:
        found = child.run(self_calibration.calibrate, images, lenses, progress=progress)
    except (MapError, InputError) as error:
        return dataclasses.replace(guess, source=f"{guess.source}; self-calibration failed: {error}")
    if found is None:
        return None
    source = (
        f"self-calibration on {found.placed} of {images.count} images, {found.reprojection_error_px:.2f} px left"
        + ("" if found.is_converged else "; it did not converge")
        + (f"; start: {guess.source}" if starts is None else "")
    )
    std = max(LEAST_STD, found.focal_std) if found.is_converged else DEFAULT_STD
    return LensGuess(found.camera, std, source, True)


def _some(folder: Path, rig: Rig) -> ImageSet:
    """Neighbouring images from the middle of the sequence: they overlap."""
    images = read_folder(folder, rig)
    first = max(0, (len(images.instants) - MOST_IMAGES) // 2)
    kept = slice(first, first + MOST_IMAGES)
    return dataclasses.replace(
        images, instants=images.instants[kept], present=images.present[kept], time_s=images.time_s[kept]
    )
