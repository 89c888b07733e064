"""Pairs of images, matched in tasks: what COLMAP itself makes of them, whoever does the tasks."""

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight import frames, rotations, silent
from mapping.sparse.features import features, matching
from mapping.sparse.mapper import matched_pairs
from mapping.workers import Threads

pycolmap = pytest.importorskip("pycolmap")
IMAGES, POINTS, SEED = 6, 300, 3
FEW, AT_RANDOM = 8, 24
"""Points that the last but one and the last image show, elsewhere than they are."""


def lens(*focal_px: float) -> Any:
    """A camera as `colmap_model.colmap_camera` makes it: of a known focal length."""
    camera = pycolmap.Camera(model="PINHOLE", width=640, height=480, params=[*focal_px, 320.0, 240.0], camera_id=1)
    camera.has_prior_focal_length = True
    return camera


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Images of one camera along a line, of points with descriptors; the last two show something else."""
    rng = np.random.default_rng(1)
    points = rng.uniform([-2.0, -2.0, 4.0], [2.0, 2.0, 9.0], (POINTS, 3))
    looks = rng.integers(0, 120, (POINTS, 128))
    made = tmp_path_factory.mktemp("database") / "database.db"
    camera = lens(400.0, 410.0)
    with pycolmap.Database.open(made) as opened:
        opened.write_camera(camera, use_camera_id=True)
        for number in range(IMAGES):
            turn = rotations.exp(0.03 * rng.normal(size=3))
            at_camera = frames.apply(frames.transform(turn, np.array([0.4 * number, 0.0, 0.0])), points)
            pixels = at_camera[:, :2] / at_camera[:, 2:] * [400.0, 410.0] + [320.0, 240.0]
            shown = np.flatnonzero((np.abs(pixels - [320.0, 240.0]) < [320.0, 240.0]).all(axis=1))
            shown = rng.permutation(shown)
            pixels = pixels[shown] + 0.3 * rng.normal(size=(len(shown), 2))
            seen = np.clip(looks[shown] + rng.integers(-4, 5, (len(shown), 128)), 0, 255)
            if number >= IMAGES - 2:
                kept = FEW if number == IMAGES - 2 else AT_RANDOM
                seen[kept:] = rng.integers(0, 120, (len(seen) - kept, 128))
                pixels = rng.uniform([0.0, 0.0], [640.0, 480.0], pixels.shape)
            image = opened.write_image(pycolmap.Image(name=f"{number}.png", keypoints=np.zeros((0, 2)), camera_id=1))
            opened.write_keypoints(image, pixels.astype(np.float32))
            kind = pycolmap.FeatureExtractorType.SIFT
            opened.write_descriptors(image, pycolmap.FeatureDescriptors(kind, seen.astype(np.uint8)))
    return made


def names() -> list[tuple[str, str]]:
    return [(f"{a}.png", f"{b}.png") for a in range(IMAGES) for b in range(a + 1, IMAGES)]


def written(database: Path) -> dict[str, list[Any]]:
    with sqlite3.connect(database) as opened:
        return {name: opened.execute(f"select * from {name}").fetchall() for name in ("matches", "two_view_geometries")}


def ours(database: Path, folder: Path, pool: Any = None) -> dict[str, list[Any]]:
    """What is written, with answers of tasks in `folder`, which exists."""
    copy = folder / "database.db"
    shutil.copy(database, copy)
    (folder / "tasks").mkdir(exist_ok=True)
    matched_pairs.write(copy, names(), seed=SEED, folder=folder / "tasks", pool=pool or Threads(2), progress=silent)
    return written(copy)


def test_pairs_are_verified_as_colmap_verifies_them(database: Path, tmp_path: Path) -> None:
    theirs = tmp_path / "theirs.db"
    shutil.copy(database, theirs)
    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.random_seed, options.ransac.min_num_trials = SEED, matched_pairs.LEAST_TRIALS
    with pycolmap.Database.open(theirs) as opened:
        ids = {row.name: row.image_id for row in opened.read_all_images()}
        for a, b in names():
            units = [features.unit(opened.read_descriptors(ids[name]).data) for name in (a, b)]
            opened.write_matches(ids[a], ids[b], matching.match(*units).astype(np.uint32))
    (tmp_path / "pairs.txt").write_text("\n".join(f"{a} {b}" for a, b in names()))
    pycolmap.verify_matches(theirs, tmp_path / "pairs.txt", options)
    found = ours(database, tmp_path)
    assert found == written(theirs)
    assert sum(row[1] >= 50 for row in found["two_view_geometries"]) == 6  # of the four images that belong together
    assert sum(row[1] == 0 for row in found["two_view_geometries"]) == 9
    matches = [row[1] for row in found["matches"]]
    assert sum(count == 0 for count in matches) == 5  # too few of them
    assert sum(15 <= count <= AT_RANDOM for count in matches) == 4  # enough, of which too few agree


def test_an_interrupted_matching_goes_on_with_the_tasks_that_are_left(
    database: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(matched_pairs, "PAIRS", 3)
    done: list[int] = []

    class Interrupted(Threads):
        most = 2

        def each(self, work, tasks, take, stage="", progress=silent) -> None:
            def count(number, answer) -> None:
                if len(done) == self.most:
                    raise KeyboardInterrupt
                done.append(number)
                take(number, answer)

            super().each(work, tasks, count, stage, progress)

    with pytest.raises(KeyboardInterrupt):
        ours(database, tmp_path, Interrupted(1))
    assert done == [0, 1]
    Interrupted.most = 9
    found = ours(database, tmp_path, Interrupted(1))
    assert done == [0, 1, 2, 3, 4]
    (tmp_path / "whole").mkdir()
    assert found == ours(database, tmp_path / "whole")


def test_matches_that_are_there_are_kept_and_verified_again(database: Path, tmp_path: Path) -> None:
    first = ours(database, tmp_path)
    again = tmp_path / "again"
    again.mkdir()
    with pycolmap.Database.open(tmp_path / "database.db") as opened:
        opened.clear_two_view_geometries()
        opened.update_camera(lens(200.0, 200.0))
    bent = ours(tmp_path / "database.db", again)
    assert bent["matches"] == first["matches"]
    assert bent["two_view_geometries"] != first["two_view_geometries"]
