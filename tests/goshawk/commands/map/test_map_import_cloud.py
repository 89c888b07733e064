"""`goshawk map import` of points: a scanned room whose free space is known."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import open3d
import pytest

import mapping
from esdf import FREE, OCCUPIED, UNKNOWN
from tests.goshawk.commands.map.test_map_import import refusal
from tests.goshawk.running import answer, run
from tests.mapping.cloud.test_occupancy import scan

EYE = np.array([0.7, 1.5, 1.0])
SIZE = ("--voxel", "0.1")


def written(file: Path, count: int = 60_000, scale: float = 1.0) -> Path:
    points = scale * scan(EYE, count)
    points[0] = np.nan
    library: Any = open3d  # its stubs know no arrays
    assert library.t.io.write_point_cloud(str(file), library.t.geometry.PointCloud(points))
    return file


def test_a_scan_becomes_a_map_in_which_only_what_was_seen_is_free(tmp_path: Path) -> None:
    asked = ("--out", tmp_path / "map", "--sensor", "0.7,1.5,1", *SIZE)
    said = json.loads(run("map", "import", written(tmp_path / "room.pcd"), *asked, "--json"))
    area = mapping.open_map(tmp_path / "map")
    places = {(1.2, 1.5, 1.0): FREE, (2.8, 1.5, 1.0): UNKNOWN, (2.0, 1.5, 1.0): UNKNOWN, (0.0, 1.55, 1.05): OCCUPIED}
    states = area.field.state[tuple(area.field.grid.index(np.array([*places])).T)]
    assert states.tolist() == [*places.values()]
    assert (said["points"], said["not_finite"], said["rays"]) == (59_999, 1, 59_999)
    assert said["hash"] == area.hash
    assert area.field.distance(np.array([[1.2, 1.5, 1.0]]))[0] <= 0.5 + 1e-6
    lines = run("map", "import", tmp_path / "room.pcd", *asked, "--dry-run", "--overwrite")
    assert "1 points that are not finite" in lines
    assert "stopped before their point" in lines


def test_a_file_without_faces_is_points_and_without_a_sensor_nothing_is_free(tmp_path: Path) -> None:
    file = written(tmp_path / "room.ply")
    said = json.loads(run("map", "import", file, "--out", tmp_path / "map", *SIZE, "--json"))
    assert said["free_m3"] == 0.0
    assert "--sensor" in run("map", "import", file, "--out", tmp_path / "none", *SIZE, "--dry-run")
    assert not (tmp_path / "none").exists()
    stated = ("--observed", "1,1,1", "--gap", "0.3")
    assert json.loads(run("map", "import", file, "--out", tmp_path / "m", *SIZE, *stated, "--json"))["free_m3"] > 5.0


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_scan_in_another_unit_is_the_same_map(tmp_path: Path, scale: float) -> None:
    asked = ("--out", tmp_path / "map", "--sensor", "0.7,1.5,1", *SIZE, "--json", "--dry-run")
    said = json.loads(run("map", "import", written(tmp_path / "room.ply", scale=scale), *asked))
    seen_m3 = 4.0 / 3.0 * np.pi * (np.linalg.norm(scan(EYE, 60_000) - EYE, axis=1) ** 3).mean()
    assert 0.8 * seen_m3 < said["free_m3"] < seen_m3


def test_an_option_that_would_be_ignored_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path / "room.pcd", 100)
    assert "two-dimensional" in refusal(file, "--heights", "0,2")
    assert "--gap is 0 m" in refusal(file, "--gap", "0")
    assert "give one of" in refusal(file, "--sensor", "0,0,0", "--viewpoints")
    (tmp_path / "room.stl").write_text("")
    for option in (("--sensor", "0,0,0"), ("--gap", "0.3"), ("--least-points", "2"), ("--viewpoints",)):
        assert f"{option[0]} is for points" in refusal(tmp_path / "room.stl", *option)


def test_what_is_no_cloud_is_refused_in_a_sentence_and_leaves_nothing(tmp_path: Path) -> None:
    file = written(tmp_path / "room.pcd", 1000)
    (tmp_path / "cut.pcd").write_bytes(file.read_bytes()[:9000])
    assert "cut off" in refusal(tmp_path / "cut.pcd")
    (tmp_path / "empty.pcd").write_bytes(b"")
    assert "no PCD file" in refusal(tmp_path / "empty.pcd")
    assert "does not exist" in refusal(tmp_path / "none.pcd")
    assert "convert it" in refusal(tmp_path / "scan.las")
    before = sorted(path.name for path in tmp_path.iterdir())
    ended = answer("map", "import", file, "--out", tmp_path / "map", "--sensor", "0,9e3,0")
    assert ended.returncode == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == before
