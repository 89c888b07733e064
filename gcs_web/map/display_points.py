"""The map's points as the 3D view shows them: tiles with levels of detail, made once per map."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flight import MapError, Progress, silent
from gcs_web.map.prepared import load_or_make
from gcs_web.scene import tiles
from gcs_web.scene.tiles import Tile, Tiles
from mapping.sparse import localization_map

COARSE_POINTS = 150_000
"""Of all coarse tiles: 1.8 MB."""
MOST_FINE_POINTS = 2_000_000
"""Of the fine level in one browser: 24 MB."""
TILE_POINTS = 50_000
CACHE = "display_points.npz"

_VERSION = 1
"""Of what is made: a cache of another one is made again."""


def load(path: Path, folder: Path, *, progress: Progress = silent) -> Tiles:
    """The points to show, from the cache in `folder` or made anew: levels (m, 3) in metres, world.

    Args:
        path: file of a localization map.

    Raises:
        MapError: they cannot be read.
    """
    try:
        found = path.stat()
    except OSError as error:
        raise MapError(f"the map has no points ({path.name}: {error.strerror})") from error
    key = f"{_VERSION} {found.st_mtime_ns} {found.st_size}"
    return load_or_make(folder / CACHE, key, path, _make, (path, key), progress)


def _make(folder: Path, asked: tuple[Path, str], progress: Progress) -> None:
    """In a process of its own: write the cache."""
    path, key = asked
    points = localization_map.load_points(path).astype(np.float32)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise MapError(f"{path.name} holds no points; build the map again")
    tiles.save(folder / CACHE, key, cut(points, progress=progress), {})


def cut(points_world_m: np.ndarray, *, progress: Progress = silent) -> Iterator[Tile]:
    """Tiles of (n, 3) float32 points; the coarse level of each is a random part of it."""
    rng = np.random.default_rng(0)
    share = min(COARSE_POINTS / len(points_world_m), 1.0)
    parts = tiles.split(points_world_m, TILE_POINTS)
    for k, part in enumerate(parts):
        progress("cutting the points", k / len(parts))
        inside = points_world_m[rng.permutation(part)]
        coarse = inside[: max(round(share * len(inside)), 1)]
        fine = inside if len(coarse) < len(inside) else None
        yield Tile(inside.min(axis=0), inside.max(axis=0), coarse, fine, len(inside))
