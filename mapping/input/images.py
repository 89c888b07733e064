"""The image folder: which image was taken by which camera at which instant, checked before any work starts.

One sub-folder per camera of the rig (or a flat folder for a single camera); equal file names are one instant.
Optional beside the images: `times.csv` (image,time_s) and `references.csv` (see `alignment`).
"""

import csv
import dataclasses
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, InputError, Progress, cells, file_format, silent
from mapping.camera.rig import Camera, Rig
from mapping.input import depth_images, image_file, masks, trajectory
from mapping.input.depth_images import DepthFolder
from mapping.input.image_file import SUFFIXES
from mapping.input.trajectory import Motion, MotionKind


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
    masks: Path | None = None
    """Folder of the masks, see `masks`."""
    depths: DepthFolder | None = None
    """What a depth camera measured with each image."""
    motions: tuple[Motion, ...] = ()
    """Recorded poses and odometry."""
    notes: tuple[str, ...] = ()
    """What was done, or not, in reading the files."""

    @property
    def count(self) -> int:
        return int(self.present.sum())

    @property
    def has_pairs(self) -> bool:
        """Whether two cameras have an image of one instant: without, the distance between them gives no scale."""
        return bool((self.present.sum(axis=1) > 1).any())

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
        import cv2

        path, expected = self.path(instant, camera), self.rig.cameras[camera]
        image = image_file.decode(path, cv2.IMREAD_GRAYSCALE)
        height, width = image.shape
        if (width, height) != (expected.width, expected.height):
            shown = image_file.orientation(path)
            tag = f" as stored (its tag says {shown})" if shown else ""
            raise InputError(
                f"{path} is {width}x{height} pixels{tag}; camera {expected.name!r} of the camera file has "
                f"{expected.width}x{expected.height}; use the camera file of these images"
            )
        return np.asarray(image, dtype=np.uint8)

    def mask_path(self, instant: int, camera: int) -> Path | None:
        """The file of an image's mask; None if all of the image is used."""
        if self.masks is None:
            return None
        return masks.of_image(self.masks, self.relative(instant, camera), self.rig.cameras[camera])

    def used(self, instant: int, camera: int) -> np.ndarray | None:
        """(height, width) bool: pixels that are not masked; None if all of the image is used."""
        path = self.mask_path(instant, camera)
        return None if path is None else masks.read(path, self.rig.cameras[camera])

    def depth_m(self, instant: int, camera: int) -> FloatArray:
        """(height, width) metres along the optical axis, 0 where a depth camera measured nothing or a mask lies."""
        assert self.depths is not None
        depth_m = self.depths.read(self.relative(instant, camera), self.rig.cameras[camera])
        used = self.used(instant, camera)
        return depth_m if used is None else np.where(used, depth_m, 0.0)

    def digests(self) -> list[object]:
        """What the set is: names, times, and the content of images, masks and depth images."""
        files = [self.path(*shot) for shot in self.pairs()]
        files += sorted({path for shot in self.pairs() if (path := self.mask_path(*shot)) is not None})
        if self.depths is not None:
            files += [self.depths.path(self.relative(*shot)) for shot in self.pairs()]
        shots = [self.relative(*shot) for shot in self.pairs()]
        unit_m = self.depths.unit_m if self.depths is not None else None
        return [self.time_s.tobytes(), shots, unit_m, *((f.name, file_format.file_hash(f)) for f in files)]

    def motion_digests(self) -> list[object]:
        """What recorded motion there is: kind and content of each file."""
        return [(motion.kind, file_format.file_hash(motion.trajectory.path)) for motion in self.motions]

    def beside(self, recorded: Mapping[MotionKind, Path]) -> "ImageSet":
        """The set with motion that was recorded while the images were taken, one file of each kind.

        Raises:
            InputError, FormatError: as `trajectory.read_motion`.
        """
        motions = tuple(trajectory.read_motion(kind, path, self.time_s) for kind, path in recorded.items())
        return dataclasses.replace(self, motions=motions)

    def only(self, instants: np.ndarray) -> "ImageSet":
        """The set with some of its instants; `instants` are their numbers, in order."""
        return dataclasses.replace(
            self,
            instants=tuple(self.instants[k] for k in instants),
            present=self.present[instants],
            time_s=self.time_s[instants],
        )

    def pixels(self, instant: int, camera: int) -> np.ndarray:
        """(height, width, 3) RGB, or (height, width) if the image is grey."""
        import cv2

        read = image_file.decode(self.path(instant, camera), cv2.IMREAD_ANYCOLOR)
        return np.asarray(read if read.ndim == 2 else np.ascontiguousarray(read[:, :, ::-1]), dtype=np.uint8)

    def pairs(self) -> list[tuple[int, int]]:
        """All (instant, camera) with an image, instant by instant."""
        return [(int(i), int(c)) for i, c in np.argwhere(self.present)]


def read_folder(
    folder: Path,
    rig: Rig,
    *,
    minimum: int = 2,
    masks: Path | None = None,
    depths: DepthFolder | None = None,
    progress: Progress = silent,
) -> ImageSet:
    """List and check the images of `folder`, and what belongs to them.

    Every file is decoded once: a cut-off image among a hundred is named here, not after ten minutes of work.

    Args:
        masks: folder of masks, see `masks`.
        depths: folder of depth images, see `depth_images`.

    Raises:
        InputError: no such folder, no camera, fewer than `minimum` instants, a damaged image, or one of another size
            than its camera's; a mask or a depth image that is missing or does not fit; times of other images.
    """
    folder = Path(folder)
    for place in (folder, masks, depths and depths.folder):
        if place is not None and not place.is_dir():
            raise InputError(f"{place} is not a folder of images: it does not exist or is a file")
    if not rig.cameras:
        raise InputError(f"images of {folder} need at least one camera; the rig has none")
    if depths is not None:
        depth_images.require_camera(rig.cameras)
    listed = [_names(folder, camera) for camera in rig]
    instants = tuple(sorted(set().union(*listed)))
    if len(instants) < minimum:
        found = "no image" if not instants else "one image" if len(instants) == 1 else f"{len(instants)} images"
        raise InputError(f"{folder} has {found}; at least {minimum} are needed")
    present = np.array([[name in names for names in listed] for name in instants])
    images = ImageSet(folder, rig, instants, present, _times(folder, instants), masks, depths)
    _decode_all(images, progress)
    return dataclasses.replace(images, notes=_tag_notes(images))


def _decode_all(images: ImageSet, progress: Progress) -> None:
    measured = images.depths is None
    masked = images.masks is None
    if images.masks is not None:
        masks.require_known(images.masks, images.rig)
    for step, shot in enumerate(images.pairs()):
        progress("checking images", step / images.count)
        images.gray(*shot)
        masked = images.used(*shot) is not None or masked
        measured = (images.depths is not None and bool(images.depth_m(*shot).any())) or measured
    if not masked:
        names = ", ".join(f"{camera.name}.png" for camera in images.rig)
        raise InputError(f"{images.masks} has no mask of these images: it should hold {names} or masks of their names")
    if images.depths is not None and not measured:
        raise InputError(f"{images.depths.folder}: all depths are 0; no depth image has measured anything")
    progress("checking images", 1.0)


def _tag_notes(images: ImageSet) -> tuple[str, ...]:
    """Orientation tags, by camera."""
    notes: list[str] = []
    for number, camera in enumerate(images.rig):
        shots = [shot for shot in images.pairs() if shot[1] == number]
        tags = Counter(tag for shot in shots if (tag := image_file.orientation(images.path(*shot))))
        for tag, count in sorted(tags.items()):
            notes.append(
                f"{count} of {len(shots)} images of camera {camera.name!r} have an orientation tag ({tag}); pixels "
                "were taken as they are stored"
            )
    return tuple(notes)


def _names(folder: Path, camera: Camera) -> set[str]:
    where = folder / camera.folder
    if not where.is_dir():
        raise InputError(f"{folder} has no sub-folder {camera.folder!r} with the images of camera {camera.name!r}")
    names = {p.name for p in where.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith(".")}
    if not names:
        raise InputError(f"{where} has no image ({', '.join(SUFFIXES)})")
    return names


def _times(folder: Path, instants: tuple[str, ...]) -> FloatArray:
    path = folder / "times.csv"
    if not path.is_file():
        return np.full(len(instants), np.nan)
    table = read_table(path, ("image", "time_s"))
    if table and not table.keys() & set(instants):
        raise InputError(
            f"{path} names none of the images in {folder}; its first column is the file name without a folder, as in "
            f"{instants[0]}, not {next(iter(table))!r}"
        )
    return np.array([table.get(name, (math.nan,))[0] for name in instants], dtype=np.float64)


def read_table(path: Path, columns: tuple[str, ...]) -> dict[str, tuple[float, ...]]:
    """Rows of a CSV file with a header: the first of `columns` is the key, the others are numbers, NaN where missing.

    Raises:
        FormatError: it is not text, a column is missing, a cell is not a number, or a key comes twice.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()  # with or without a byte order mark
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not a CSV file: it holds bytes that are no text") from None
    reader = csv.DictReader(lines, skipinitialspace=True)
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
