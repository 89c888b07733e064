"""What relocalization needs of a map: its points with their descriptors, and their file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, InputError, file_format
from mapping.sparse import features

FORMAT = "goshawk-localization"
VERSION = 1


@dataclass(frozen=True, slots=True, eq=False)
class LocalizationMap:
    """Map points with descriptors."""

    points_world_m: FloatArray
    """(m, 3)."""
    descriptors: np.ndarray
    """(m, 128) float32 of unit length."""


def save(folder: Path, known: LocalizationMap) -> None:
    """Write `points.npz` and `localization.toml` into a new folder."""
    folder.mkdir(parents=True)
    descriptors = np.clip(np.round(512.0 * known.descriptors), 0, 255).astype(np.uint8)
    np.savez(folder / "points.npz", points_world_m=known.points_world_m, descriptors=descriptors)
    body = {"points": len(known.points_world_m), "hash": file_format.file_hash(folder / "points.npz")}
    file_format.write_toml(folder / "localization.toml", format=FORMAT, version=VERSION, body=body)


def load(folder: Path) -> LocalizationMap:
    """Read what `save` wrote.

    Raises:
        InputError: the folder has no localization map.
        FormatError: it is damaged.
    """
    document = file_format.read_toml(folder / "localization.toml", format=FORMAT, version=VERSION)
    if not (folder / "points.npz").is_file():
        raise InputError(f"{folder} has no points.npz; build the map again")
    if file_format.file_hash(folder / "points.npz") != document.get("hash"):
        raise FormatError(f"{folder / 'points.npz'} does not match its hash; build the map again")
    with np.load(folder / "points.npz", allow_pickle=False) as data:
        return LocalizationMap(data["points_world_m"], features.unit(data["descriptors"]))
