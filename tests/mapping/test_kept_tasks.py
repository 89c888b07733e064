"""The answers of a map's many tasks are kept where an interrupted build finds them again."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from flight import silent
from mapping import placed_views, stages
from mapping.dense import depth_files
from mapping.placed_views import DEPTH
from mapping.sparse.mapper import colmap
from mapping.sparse.mapper.colmap import MATCHES, SparseOptions
from mapping.stages import Work
from mapping.workers import Threads

IMAGES = cast(Any, SimpleNamespace(depths=None, motion_digests=lambda: (), pairs=lambda: ()))


def interrupted(found: list[list[str]]) -> Callable[..., None]:
    """Work that leaves an answer and is interrupted; it lists those that it found."""

    def work(*_: Any, tasks: Path, **__: Any) -> None:
        found.append(sorted(file.name for file in tasks.iterdir() if file.suffix == ".npz"))
        (tasks / f"{len(found)}.npz").touch()
        raise KeyboardInterrupt

    return work


def test_matching_finds_the_pairs_that_were_matched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[list[str]] = []

    def extract(database: Path, *_: Any) -> tuple[list[np.ndarray], np.ndarray]:
        database.touch()
        return [np.zeros((1, 2))], np.zeros(1)

    monkeypatch.setattr(colmap, "extract", extract)
    monkeypatch.setattr(colmap, "match", interrupted(found))
    monkeypatch.setattr(colmap.pairing, "near_in_space", lambda *_: ())
    for _ in range(2):
        with contextlib.suppress(KeyboardInterrupt), stages.begin(tmp_path / "work", again=()) as work:
            colmap.place_images(IMAGES, SparseOptions(), work, Threads(1), progress=silent)
    assert found == [[], ["1.npz"]]
    assert (tmp_path / "work" / f"{MATCHES}.tasks" / "2.npz").is_file()


def test_dense_depth_finds_the_images_that_were_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[list[str]] = []
    monkeypatch.setattr(depth_files, "find", interrupted(found))
    placed = cast(Any, SimpleNamespace(images=IMAGES))

    def stage(work: Work) -> None:
        placed_views.depth_stage(placed, [], cast(Any, None), work, Threads(1), silent)

    for _ in range(2):
        with contextlib.suppress(KeyboardInterrupt), stages.begin(tmp_path / "work", again=()) as work:
            stage(work)
    assert found == [[], ["1.npz"]]
    assert (tmp_path / "work" / f"{DEPTH}.tasks" / "2.npz").is_file()
