"""Features on disk: they are found once, read image by image as often as needed, and never held in memory whole."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from mapping.sparse.features.features import Features

_ARRAYS = tuple(field.name for field in fields(Features))


class FeatureFiles(Sequence[Features]):
    """The features that `written` put into a folder."""

    def __init__(self, folder: Path) -> None:
        self._paths = sorted(folder.glob("*.npz"))

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> Features:  # type: ignore[override]  # one image at a time
        with np.load(self._paths[index], allow_pickle=False) as kept:
            return Features(*(kept[name] for name in _ARRAYS))


def written(folder: Path, found: Iterable[Features]) -> Iterator[Features]:
    """The features of image after image, each written into an existing folder before it is passed on."""
    for number, image in enumerate(found):
        np.savez(folder / f"{number:06d}.npz", allow_pickle=False, **{name: getattr(image, name) for name in _ARRAYS})
        yield image
