"""One image file, decoded whole or refused with the reason."""

import os
from pathlib import Path

import numpy as np

from flight import InputError

SUFFIXES = (".jpg", ".jpeg", ".png", ".pgm", ".tif", ".tiff", ".bmp")
"""Of files that are taken for images, in lower case."""
MOST_PIXELS = 1 << 28
"""Larger images are refused before memory is set aside for them; OpenCV asks for it when it is first imported."""
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))


def decode(path: Path, flags: int) -> np.ndarray:
    """The image as OpenCV decodes it.

    Args:
        flags: `cv2.IMREAD_...`.

    Raises:
        InputError: it is damaged, cut off or too large.
    """
    import cv2

    data = np.fromfile(path, dtype=np.uint8)
    whole = data.size and not _cut_off(data)  # checked first: decoders write to stderr about a truncated file
    try:
        image = cv2.imdecode(data, flags) if whole else None
    except cv2.error as error:
        said = error.err if hasattr(error, "err") else str(error)
        raise InputError(f"{path} cannot be decoded ({said}); an image has at most {MOST_PIXELS:.2g} pixels") from None
    if image is None:
        raise InputError(f"{path} is damaged: it cannot be decoded as a whole image; restore it or take it out")
    return np.asarray(image)


def _cut_off(data: np.ndarray) -> bool:
    """Whether a JPEG or PNG lacks its end mark: decoders fill the missing part with grey and report no error."""
    head, tail = data[:4].tobytes(), data[-64:].tobytes()
    if head.startswith(b"\xff\xd8"):
        return b"\xff\xd9" not in tail
    return head == b"\x89PNG" and b"IEND" not in tail
