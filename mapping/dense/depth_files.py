"""Depth images on disk: a long sequence is read one by one, as often as needed, and never held in memory whole."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from mapping.dense.stereo import DepthImage

_ARRAYS = ("inverse_range", "deviation", "facing", "bound")


class DepthFiles(Sequence[DepthImage | None]):
    """The depth images that `write` put into a folder."""

    def __init__(self, folder: Path) -> None:
        self._paths = sorted(folder.glob("*.npz"))

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> DepthImage | None:  # type: ignore[override]  # one image at a time
        with np.load(self._paths[index], allow_pickle=False) as kept:
            if not kept.files:
                return None
            return DepthImage(*(kept[name] for name in _ARRAYS), scale=float(kept["scale"]))


def write(folder: Path, depths: Iterable[DepthImage | None]) -> None:
    """Write depth images, as they come, into an existing folder."""
    for number, depth in enumerate(depths):
        arrays = {} if depth is None else {name: np.asarray(getattr(depth, name)) for name in (*_ARRAYS, "scale")}
        np.savez(folder / f"{number:06d}.npz", allow_pickle=False, **arrays)
