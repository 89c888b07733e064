"""What the 3D view shows of a large map, cut into tiles, each with a coarse level for all and a fine one for near by.

Made in a process of its own and kept on disk; of an opened file, the fine levels are read one at a time.
"""

import threading
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, file_format


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """A part of a map."""

    low_m: FloatArray
    """(3,) corner of its box, world."""
    high_m: FloatArray
    coarse: np.ndarray
    """Always shown, until the fine level is; any array."""
    fine: np.ndarray | None
    """None where the coarse level is all there is."""
    size: int
    """Triangles or points of the fine level."""


class Tiles:
    """An opened file of tiles. Thread-safe."""

    def __init__(self, data: Any) -> None:
        self._data, self._lock = data, threading.Lock()
        self.key = str(self.array("key"))
        """Says what they were made of."""
        self.low_m, self.high_m, self.sizes = (self.array(name) for name in ("low_m", "high_m", "sizes"))
        """(n, 3), (n, 3), (n,); a size is 0 where there is no fine level."""

    def array(self, name: str) -> np.ndarray:
        with self._lock:
            return self._data[name]

    def level(self, tile: int, *, fine: bool) -> np.ndarray:
        return self.array(f"{'fine' if fine else 'coarse'}_{tile}")

    def __len__(self) -> int:
        return len(self.sizes)


def save(path: Path, key: str, tiles: Iterable[Tile], others: Mapping[str, np.ndarray]) -> None:
    """Write a file of tiles, one at a time: they need not be in memory together.

    Args:
        key: says what they were made of.
        others: further arrays.
    """
    boxes, sizes = [], []
    with file_format.atomic_file(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for k, tile in enumerate(tiles):
            _write(archive, f"coarse_{k}", tile.coarse)
            if tile.fine is not None:
                _write(archive, f"fine_{k}", tile.fine)
            boxes.append((tile.low_m, tile.high_m))
            sizes.append(0 if tile.fine is None else tile.size)
        low_m, high_m = np.array(boxes, dtype=np.float64).reshape(-1, 2, 3).transpose(1, 0, 2)
        about = {"key": np.array(key), "low_m": low_m, "high_m": high_m, "sizes": np.array(sizes, dtype=np.int64)}
        for name, array in {**about, **others}.items():
            _write(archive, name, array)


def load(path: Path, key: str) -> Tiles | None:
    """The tiles that `save` wrote; None where there are none made of this, or they are damaged."""
    try:
        shown = Tiles(np.load(path, allow_pickle=False))
        return shown if shown.key == key else None
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def _write(archive: zipfile.ZipFile, name: str, array: np.ndarray) -> None:
    """As `numpy.savez` does, for `numpy.load`."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
        np.lib.format.write_array(file, np.asarray(array, order="C"), allow_pickle=False)


def split(places_m: FloatArray, most: int, *, overlap_m: float = 0.0) -> list[np.ndarray]:
    """Indices of the parts, of at most `most` places, that halving along the longest side gives.

    Args:
        places_m: (n, 3).
        overlap_m: what is this close to a border belongs to the parts on both sides. A part that is not much larger
            than that is not halved any more, however many places it has.
    """
    parts: list[np.ndarray] = []
    left = [np.arange(len(places_m), dtype=np.int32)]
    while left:
        part = left.pop()
        inside = places_m[part]
        side_m = np.ptp(inside, axis=0) if len(part) else np.zeros(3)
        axis = int(np.argmax(side_m))
        if len(part) <= most or side_m[axis] <= 8.0 * overlap_m:
            parts.append(part)
            continue
        along_m = inside[:, axis]
        middle_m = 0.5 * (along_m.min() + along_m.max())
        left += [part[along_m <= middle_m + overlap_m], part[along_m > middle_m - overlap_m]]
    return parts


def near(tiles: Tiles, position_m: FloatArray, forward: FloatArray, most: int) -> frozenset[int]:
    """The tiles to show in full: those nearest to a camera that are not behind it, as long as their sizes add up to
    `most` at the most.

    Args:
        position_m: (3,) of the camera, world.
        forward: (3,) its direction, unit length.
    """
    toward_m = np.where(forward > 0.0, tiles.high_m, tiles.low_m)  # the corner that is farthest ahead
    ahead = (toward_m - position_m) @ forward > 0.0
    outside_m = np.maximum(np.maximum(tiles.low_m - position_m, position_m - tiles.high_m), 0.0)
    order = np.argsort(np.linalg.norm(outside_m, axis=1), kind="stable")
    order = order[ahead[order] & (tiles.sizes[order] > 0)]
    return frozenset(order[np.cumsum(tiles.sizes[order]) <= most].tolist())
