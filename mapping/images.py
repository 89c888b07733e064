"""The image folder: which image was taken by which camera at which instant, checked before any work starts.

One sub-folder per camera of the rig (or a flat folder for a single camera); equal file names are one instant.
Optional beside the images: `times.csv` (image,time_s) and `references.csv` (see `alignment`).
"""

import csv
import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, InputError, Progress, cells, silent
from mapping.camera.rig import Camera, Rig

MOST_PIXELS = 1 << 28
"""Larger images are refused before memory is set aside for them; OpenCV asks for it when it is first imported."""
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
SUFFIXES = (".jpg", ".jpeg", ".png", ".pgm", ".tif", ".tiff", ".bmp")


@dataclass(frozen=True, slots=True, eq=False)
class ImageSet:
    """A checked folder of images."""

    folder: Path
    """The image folder."""
    rig: Rig
    """Which cameras took them."""
    instants: tuple[str, ...]
    """File names in order; every one was seen by at least one camera."""
    present: np.ndarray
    """(instants, cameras) bool: whether that camera has an image of that instant."""
    time_s: FloatArray
    """(instants,) NaN where no `times.csv` gave one."""

    @property
    def count(self) -> int:
        return int(self.present.sum())

    def relative(self, instant: int, camera: int) -> str:
        """Path below the image folder, with forward slashes: the image's name in every file we write."""
        folder = Path(self.rig.cameras[camera].folder)
        return (folder / self.instants[instant]).as_posix()

    def path(self, instant: int, camera: int) -> Path:
        return self.folder / self.relative(instant, camera)

    def gray(self, instant: int, camera: int) -> np.ndarray:
        """(height, width) uint8.

        Raises:
            InputError: the file is not a whole image of this camera's size.
        """
        return _gray(self.path(instant, camera), self.rig.cameras[camera])

    def pixels(self, instant: int, camera: int) -> np.ndarray:
        """(height, width, 3) RGB, or (height, width) if the image is grey."""
        import cv2

        read = cv2.imread(str(self.path(instant, camera)), cv2.IMREAD_ANYCOLOR)
        if read is None:
            raise InputError(f"{self.path(instant, camera)} can no longer be read")
        return np.asarray(read if read.ndim == 2 else np.ascontiguousarray(read[:, :, ::-1]), dtype=np.uint8)

    def pairs(self) -> list[tuple[int, int]]:
        """All (instant, camera) with an image, instant by instant."""
        return [(int(i), int(c)) for i, c in np.argwhere(self.present)]


def read_folder(folder: Path, rig: Rig, *, minimum: int = 2, progress: Progress = silent) -> ImageSet:
    """List and check the images of `folder`.

    Every file is decoded once: a cut-off image among a hundred is named here, not after ten minutes of work.

    Raises:
        InputError: no such folder, fewer than `minimum` instants, a damaged image, or one of another size than its
            camera's.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder of images: it does not exist or is a file")
    listed = [_names(folder, camera) for camera in rig]
    instants = tuple(sorted(set().union(*listed)))
    if len(instants) < minimum:
        found = "no image" if not instants else "one image" if len(instants) == 1 else f"{len(instants)} images"
        raise InputError(f"{folder} has {found}; at least {minimum} are needed")
    present = np.array([[name in names for names in listed] for name in instants])
    images = ImageSet(folder, rig, instants, present, _times(folder, instants))
    for step, (instant, camera) in enumerate(images.pairs()):
        progress("checking images", step / images.count)
        images.gray(instant, camera)
    progress("checking images", 1.0)
    return images


def _names(folder: Path, camera: Camera) -> set[str]:
    where = folder / camera.folder
    if not where.is_dir():
        raise InputError(f"{folder} has no sub-folder {camera.folder!r} with the images of camera {camera.name!r}")
    names = {p.name for p in where.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith(".")}
    if not names:
        raise InputError(f"{where} has no image ({', '.join(SUFFIXES)})")
    return names


def _gray(path: Path, camera: Camera) -> np.ndarray:
    import cv2

    data = np.fromfile(path, dtype=np.uint8)
    whole = data.size and not _cut_off(data)  # checked first: decoders write to stderr about a truncated file
    try:
        image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if whole else None
    except cv2.error as error:
        said = error.err if hasattr(error, "err") else str(error)
        raise InputError(f"{path} cannot be decoded ({said}); an image has at most {MOST_PIXELS:.2g} pixels") from None
    if image is None:
        raise InputError(f"{path} is damaged: it cannot be decoded as a whole image; restore it or take it out")
    height, width = image.shape
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"{path} is {width}x{height} pixels; camera {camera.name!r} of the camera file has "
            f"{camera.width}x{camera.height}; use the camera file of these images"
        )
    return np.asarray(image, dtype=np.uint8)


def _cut_off(data: np.ndarray) -> bool:
    """Whether a JPEG or PNG lacks its end mark: decoders fill the missing part with grey and report no error."""
    head, tail = data[:4].tobytes(), data[-64:].tobytes()
    if head.startswith(b"\xff\xd8"):
        return b"\xff\xd9" not in tail
    return head == b"\x89PNG" and b"IEND" not in tail


def _times(folder: Path, instants: tuple[str, ...]) -> FloatArray:
    path = folder / "times.csv"
    if not path.is_file():
        return np.full(len(instants), np.nan)
    table = read_table(path, ("image", "time_s"))
    return np.array([table.get(name, (math.nan,))[0] for name in instants], dtype=np.float64)


def read_table(path: Path, columns: tuple[str, ...]) -> dict[str, tuple[float, ...]]:
    """Rows of a CSV file with a header: the first of `columns` is the key, the others are numbers, NaN where missing.

    Raises:
        FormatError: it is not text, a column is missing, a cell is not a number, or a key comes twice.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not a CSV file: it holds bytes that are no text") from None
    reader = csv.DictReader(lines)
    missing = [c for c in columns if c not in (reader.fieldnames or [])]
    if missing:
        raise FormatError(f"{path} has no column {missing[0]!r}; its first line must name {','.join(columns)}")
    rows: dict[str, tuple[float, ...]] = {}
    for number, row in enumerate(reader, start=2):
        key = row[columns[0]]
        if key in rows:
            raise FormatError(f"{path}, line {number}: {key} is listed twice; each may have one line")
        rows[key] = tuple(cells.number(row[c], path, number, c) for c in columns[1:])
    return rows
