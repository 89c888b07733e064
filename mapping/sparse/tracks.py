"""Where the images of a map see its points: a file of a map folder, beside the points of its localization map.

Without it a map is whole but for this: maps of earlier versions have none.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, file_format

FILE = "tracks.npz"
VERSION = 1


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Observations of points in images."""

    index: np.ndarray
    """(o, 3) int32: point of the localization map, instant of `poses.csv`, camera of the rig."""
    pixels: FloatArray
    """(o, 2) where each is seen."""

    def part(self, points: np.ndarray, instants: np.ndarray) -> "Tracks":
        """The observations of kept points (m,) in kept instants (n,), both bool, numbered as these are then."""
        point, instant, camera = self.index.T
        kept = points[point] & instants[instant]
        new_point, new_instant = (np.cumsum(each) - 1 for each in (points, instants))
        index = np.column_stack([new_point[point[kept]], new_instant[instant[kept]], camera[kept]])
        return Tracks(index.astype(np.int32), self.pixels[kept])

    def shifted(self, points: int, instants: int) -> "Tracks":
        """The same with so many points and instants before its own."""
        return Tracks((self.index + np.array([points, instants, 0])).astype(np.int32), self.pixels)


def none() -> Tracks:
    return Tracks(np.zeros((0, 3), np.int32), np.zeros((0, 2)))


def joined(first: Tracks, second: Tracks) -> Tracks:
    """Both, whose numbers are of one map already."""
    return Tracks(np.concatenate([first.index, second.index]), np.concatenate([first.pixels, second.pixels]))


def save(folder: Path, tracks: Tracks) -> None:
    """Write it into the folder of a localization map; pixels to 1/1000."""
    index, pixels = tracks.index.astype(np.int32), tracks.pixels.astype(np.float32)
    file_format.write_arrays(folder / FILE, version=VERSION, index=index, pixels=pixels)


def load(folder: Path, points: int, instants: int, cameras: int) -> Tracks:
    """Read what `save` wrote, for a map of so many points, instants and cameras; none where there is no file.

    Raises:
        FormatError: the file is damaged, newer, or of another map.
    """
    path = folder / FILE
    if not path.is_file():
        return none()
    index, pixels = file_format.read_arrays(
        path, "index", "pixels", version=VERSION, fault="damaged", remedy="build the map again"
    )
    fits = index.dtype == np.int32 and index.ndim == 2 and index.shape[1:] == (3,) and pixels.shape == (len(index), 2)
    if not fits or (index < 0).any() or (index >= [points, instants, cameras]).any() or not np.isfinite(pixels).all():
        raise FormatError(f"{path} is not of this map's points and images; build the map again")
    return Tracks(index, pixels.astype(np.float64))
