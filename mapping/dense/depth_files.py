"""Depth images on disk: a long sequence is read one by one, as often as needed, and never held in memory whole."""

import dataclasses
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from flight import Progress
from mapping import workers
from mapping.dense import stereo
from mapping.dense.stereo import DepthImage, StereoOptions
from mapping.dense.views import ImageView
from mapping.workers import Arrays, Pool, Task

STAGE = "dense depth"
_ARRAYS = ("inverse_range", "deviation", "facing", "bound")


class DepthFiles(Sequence[DepthImage | None]):
    """The depth images that `write` put into a folder."""

    def __init__(self, folder: Path) -> None:
        self._paths = sorted(folder.glob("*.npz"))

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> DepthImage | None:  # type: ignore[override]  # one image at a time
        kept = workers.arrays(self._paths[index])
        return DepthImage(*(kept[name] for name in _ARRAYS), scale=float(kept["scale"])) if kept else None


def write(folder: Path, depths: Iterable[DepthImage | None]) -> None:
    """Write depth images, as they come, into an existing folder."""
    for number, depth in enumerate(depths):
        np.savez(folder / f"{number:06d}.npz", allow_pickle=False, **_arrays(depth))


def _arrays(depth: DepthImage | None) -> Arrays:
    return {} if depth is None else {name: np.asarray(getattr(depth, name)) for name in (*_ARRAYS, "scale")}


def find(
    images: Sequence[ImageView], options: StereoOptions, folder: Path, *, tasks: Path, pool: Pool, progress: Progress
) -> None:
    """Write the depth of each image, without what masks leave out, into an existing folder: a task of each image.

    Args:
        tasks: keeps what is done if this is interrupted.

    Raises:
        MapError: none of them has any depth.
    """

    def task(number: int) -> Task:
        chosen = [number, *stereo.choose_partners(images, number, options)]
        view, *partners = (dataclasses.replace(images[k], pixels=images[k].grey) for k in chosen)
        return view, partners, options

    files = workers.files_of(depth_of, len(images), task, folder=tasks, pool=pool, stage=STAGE, progress=progress)
    ranges = (workers.arrays(file).get("inverse_range") for file in files)
    stereo.require_depth([known is not None and bool(known.any()) for known in ranges], options)
    for file in files:
        _put_beside(file, folder / file.name)


def _put_beside(file: Path, place: Path) -> None:
    """One file under two names, so that an interrupt before the stage is finished costs nothing."""
    try:
        os.link(file, place)
    except OSError:  # a disk without such links: the interrupt then costs the depth
        file.replace(place)


def depth_of(view: ImageView, partners: list[ImageView], options: StereoOptions) -> Arrays:
    """The task: depth of an image beside its partners, as `DepthFiles` reads it."""
    depth = stereo.depth_beside(view, partners, options)
    return _arrays(depth if depth is None or view.used is None else depth.where(view.used))
