"""`goshawk map import` of points: a scanned room whose free space is known."""

import json
import tomllib
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


def test_two_scans_far_apart_in_one_file_are_told(tmp_path: Path) -> None:
    points = scan(EYE, 20_000)
    library: Any = open3d
    both = library.t.geometry.PointCloud(np.concatenate([points, points + np.array([30.0, 0.0, 0.0])]))
    assert library.t.io.write_point_cloud(str(tmp_path / "two.ply"), both)
    assert "2 parts" in run("map", "import", tmp_path / "two.ply", "--out", tmp_path / "m", *SIZE, "--dry-run")
    one = run("map", "import", written(tmp_path / "one.ply"), "--out", tmp_path / "m", *SIZE, "--dry-run", "--json")
    assert json.loads(one)["parts"] == 1


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
    assert "does not exist" in refusal(tmp_path / "scan.las")
    before = sorted(path.name for path in tmp_path.iterdir())
    ended = answer("map", "import", file, "--out", tmp_path / "map", "--sensor", "0,9e3,0")
    assert ended.returncode == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_scans_from_two_places_free_what_either_sees(tmp_path: Path) -> None:
    eyes = ("0.7,1.5,1", "1.2,0.5,1")
    files = []
    for k, eye in enumerate(eyes):
        points = scan(np.array([float(word) for word in eye.split(",")]), 40_000)
        files.append(tmp_path / f"{k}.pcd")
        library: Any = open3d
        assert library.t.io.write_point_cloud(str(files[-1]), library.t.geometry.PointCloud(points))
    sensors = [word for eye in eyes for word in ("--sensor", eye)]
    rest = ("--out", tmp_path / "map", "--dry-run", "--json", *SIZE)
    both = json.loads(run("map", "import", *files, *sensors, *rest))
    alone = [
        json.loads(run("map", "import", file, "--sensor", eye, *rest)) for file, eye in zip(files, eyes, strict=True)
    ]
    assert both["rays"] == 80_000
    assert both["free_m3"] > max(one["free_m3"] for one in alone)
    assert both["imported_from"] == ["0.pcd", "1.pcd"]
    kept = json.loads(run("map", "import", *files, *sensors, *rest[:2], "--origin", "0.5,0,-0.25", "--json", *SIZE))
    found = str(tomllib.loads((tmp_path / "map" / "map.toml").read_text()))
    assert "['0.pcd', '1.pcd']" in found
    assert "'origin': [0.5, 0.0, -0.25]" in found
    assert "imported from 0.pcd, 1.pcd;" in found
    assert kept["origin"] == [0.5, 0.0, -0.25]
    assert alone[0]["imported_from"] == "0.pcd"
    assert alone[0]["origin"] is None
    assert "3 times for 2 files" in refusal(*files, *sensors, "--sensor", "0,0,0")


def test_an_octomap_is_the_map_it_was_exported_of(tmp_path: Path) -> None:
    asked = ("--out", tmp_path / "map", "--sensor", "0.7,1.5,1", *SIZE)
    run("map", "import", written(tmp_path / "room.pcd"), *asked)
    run("map", "export", tmp_path / "map", "--out", tmp_path / "room.bt")
    said = json.loads(run("map", "import", tmp_path / "room.bt", "--out", tmp_path / "back", "--json"))
    first, second = mapping.open_map(tmp_path / "map").field, mapping.open_map(tmp_path / "back").field
    assert said["unknown_m3"] > 0.0
    cells = np.argwhere(second.state != UNKNOWN)
    places = second.grid.centre(cells)
    assert np.array_equal(first.state[tuple(first.grid.index(places).T)], second.state[tuple(cells.T)])
    assert len(cells) == (first.state != UNKNOWN).sum()
    assert "--observed is for" in refusal(tmp_path / "room.bt", "--observed", "1,1,1")
    assert "scans of points" in refusal(tmp_path / "room.bt", tmp_path / "room.pcd")
