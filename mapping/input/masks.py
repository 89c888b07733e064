"""Masks: the pixels of an image that show the vehicle itself, or anything else that no map should hold.

A mask is an image of the camera's size: black (below 128) is left out, white is used. A folder of masks holds, for each
camera that needs some, `CAMERA.png` for all its images or one mask of each image's name.
"""

from pathlib import Path

import numpy as np

from flight import InputError
from mapping.camera.rig import Camera, Rig
from mapping.input import image_file

_LEAST_USED = 0.01


def require_known(folder: Path, rig: Rig) -> None:
    """Check that no mask of a rig's is misspelled: its camera would be used unmasked.

    Raises:
        InputError: the folder holds an image or a folder that belongs to no camera. The images of a rig's cameras lie
            in sub-folders, so images beside them can only be masks of whole cameras.
    """
    if len(rig) == 1:
        return  # each mask may then be that of one image, of which not all may be in use
    known = {f"{camera.name}.png" for camera in rig} | {Path(camera.folder).parts[0] for camera in rig}
    for entry in sorted(folder.iterdir()):
        is_mask = any(map(_is_image, entry.iterdir())) if entry.is_dir() else _is_image(entry)
        if is_mask and entry.name not in known:
            raise InputError(
                f"{entry} is the mask of no camera and no image; {folder} may hold {', '.join(sorted(known))}"
            )


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in image_file.SUFFIXES and not path.name.startswith(".")


def of_camera(folder: Path, camera: Camera) -> Path | None:
    """The one mask of all images of a camera, if there is one."""
    path = folder / f"{camera.name}.png"
    return path if path.is_file() else None


def of_image(folder: Path, relative: str, camera: Camera) -> Path | None:
    """The mask of one image; None if its camera has none.

    Args:
        relative: the image's path below the image folder.

    Raises:
        InputError: other images of the camera have one, this one has none.
    """
    if (path := of_camera(folder, camera)) is not None:
        return path
    path = (folder / relative).with_suffix(".png")
    if path.is_file():
        return path
    if path.parent.is_dir() and any(map(_is_image, path.parent.iterdir())):
        raise InputError(f"{path} does not exist: give a mask for each image, or {camera.name}.png for all of them")
    return None


def read(path: Path, camera: Camera) -> np.ndarray:
    """(height, width) bool: pixels that may be used.

    Raises:
        InputError: it is damaged, of another size than the camera's images, or leaves out all of them.
    """
    import cv2

    read = image_file.decode(path, cv2.IMREAD_GRAYSCALE)
    if read.shape != (camera.height, camera.width):
        raise InputError(
            f"{path} is {read.shape[1]}x{read.shape[0]} pixels, camera {camera.name!r} {camera.width}x{camera.height}"
        )
    used = read >= 128
    if used.mean() < _LEAST_USED:
        raise InputError(f"{path} leaves out {1 - used.mean():.0%} of the image; black is left out, white is used")
    return used
