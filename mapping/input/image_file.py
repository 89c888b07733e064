"""One image file, decoded whole or refused with the reason."""

import os
from pathlib import Path
from typing import Literal

import numpy as np

from flight import InputError

SUFFIXES = (".jpg", ".jpeg", ".png", ".pgm", ".tif", ".tiff", ".bmp")
"""Of files that are taken for images, in lower case."""
MOST_PIXELS = 1 << 28
"""Larger images are refused before memory is set aside for them; OpenCV asks for it when it is first imported."""
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))


ORIENTATIONS = {
    2: "mirrored",
    3: "turned by 180 deg",
    4: "mirrored upside down",
    5: "mirrored and turned by 90 deg",
    6: "turned by 90 deg",
    7: "mirrored and turned by 270 deg",
    8: "turned by 270 deg",
}
"""How a viewer shows an image with this orientation tag (EXIF 0x0112); 1: as it is stored."""
_STANDALONE = (0x01, *range(0xD0, 0xD9))
"""Second bytes of JPEG markers without a length (ITU-T T.81, table B.1)."""


def decode(path: Path, flags: int) -> np.ndarray:
    """The image as it is stored: an orientation tag turns no pixels, and what follows the image's end is not read.

    Args:
        flags: `cv2.IMREAD_...`.

    Raises:
        InputError: it is damaged, cut off or too large.
    """
    import cv2

    if flags != cv2.IMREAD_UNCHANGED:
        flags |= cv2.IMREAD_IGNORE_ORIENTATION
    data = np.fromfile(path, dtype=np.uint8)
    _remove_tiff_orientation(data)
    end = _end(data)  # checked first: decoders fill the missing part with grey, and write to stderr about it
    try:
        image = cv2.imdecode(data[:end], flags) if end else None
    except cv2.error as error:
        said = error.err if hasattr(error, "err") else str(error)
        raise InputError(f"{path} cannot be decoded ({said}); an image has at most {MOST_PIXELS:.2g} pixels") from None
    if image is None:
        raise InputError(f"{path} is damaged: it cannot be decoded as a whole image; restore it or take it out")
    return np.asarray(image)


def orientation(path: Path) -> str:
    """How the orientation tag asks to show it; empty: as it is stored, without such a tag, or too large to be asked."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            return ORIENTATIONS.get(int(image.getexif().get(0x0112, 1)), "")
    except (OSError, ValueError, TypeError, SyntaxError, Image.DecompressionBombError):  # also of damaged EXIF
        return ""


def _remove_tiff_orientation(data: np.ndarray) -> None:
    """In place, in the first directory of a TIFF (TIFF 6.0, section 2): OpenCV obeys it, whatever its flags."""
    order: Literal["little", "big"] = "little" if data[:2].tobytes() == b"II" else "big"
    if data[:4].tobytes() not in (b"II*\0", b"MM\0*"):
        return

    def number(at: int, size: int) -> int:
        return int.from_bytes(data[at : at + size].tobytes(), order)

    first = number(4, 4) + 2
    for at in range(first, first + 12 * number(first - 2, 2), 12):
        if number(at, 2) == 0x0112 and at + 12 <= len(data):
            data[at + 8 : at + 10] = np.frombuffer((1).to_bytes(2, order), np.uint8)


def _end(data: np.ndarray) -> int:
    """Bytes up to the end mark of a JPEG or PNG, all of another file; 0: there is none, it is empty or cut off."""
    head = data[:8].tobytes()
    if head.startswith(b"\xff\xd8"):
        return _jpeg_end(data)
    return _png_end(data.tobytes()) if head == b"\x89PNG\r\n\x1a\n" else len(data)


def _jpeg_end(data: np.ndarray) -> int:
    """From marker to marker; within a scan, 0xFF is followed by 0 or a restart mark."""
    after = np.append(data[1:], np.uint8(0))
    marks = np.flatnonzero((data == 0xFF) & (after != 0) & (after != 0xFF) & ((after < 0xD0) | (after > 0xD7)))
    at = 2
    while (k := int(np.searchsorted(marks, at))) < len(marks):
        place = int(marks[k])
        kind = int(data[place + 1])
        if kind == 0xD9:
            return place + 2
        if kind in _STANDALONE:
            at = place + 2
        elif place + 4 <= len(data):
            at = place + 2 + 256 * int(data[place + 2]) + int(data[place + 3])
        else:
            break
    return 0


def _png_end(data: bytes) -> int:
    """From chunk to chunk."""
    at = 8
    while at + 12 <= len(data):
        length, kind = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8]
        at += 12 + length
        if kind == b"IEND":
            return at if at <= len(data) else 0
    return 0
