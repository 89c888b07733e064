"""`goshawk map crop`, `origin`, `align` and `merge`: new folders, and plans of the old map that no longer hold."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

import esdf
import mapping
from esdf import Edit
from esdf.solids import Box
from flight import file_format, frames, rotations
from goshawk.rendered import world as rendered_world
from mapping import map_parts
from mapping.dense import confidence
from mapping.map_parts import MapParts
from mapping.sparse.features import features
from mapping.sparse.localization_map import LocalizationMap
from tests.goshawk.running import run


@pytest.fixture
def folder(tmp_path: Path, pillar_map: Path) -> Path:
    """The room with two pillars, with points and a mesh, and a no-fly zone."""
    opened, rng = mapping.open_map(pillar_map), np.random.default_rng(0)
    floor = np.column_stack([rng.uniform([0.0, 0.0], [6.0, 4.0], (300, 2)), np.zeros(300)])
    parts = MapParts(
        name="map",
        field=opened.field,
        edits=(Edit("no-fly", Box((0.5, 3.0, 0.0), (1.5, 3.8, 2.0)), "desk"),),
        vertices_world_m=floor,
        faces=np.arange(300, dtype=np.int32).reshape(-1, 3),
        colours=np.full((300, 3), 90, np.uint8),
        confidence=confidence.unknown(300),
        known=LocalizationMap(floor, features.unit(rng.gamma(0.6, 1.0, (300, 128)))),
        rig=rendered_world.default_rig(),
        images=opened.images,
        time_s=opened.time_s,
        T_world_body=opened.T_world_body,
        seen=opened.visibility(),
        inferred=opened.inferred(),
        facts=opened.facts,
        report=None,
    )
    map_parts.write(tmp_path / "map", parts)
    return tmp_path / "map"


def test_the_origin_moves_and_nothing_else(folder: Path, tmp_path: Path) -> None:
    said = json.loads(run("map", "origin", folder, "--place", "1,0.5,0", "--out", tmp_path / "new", "--json"))
    old, new = mapping.open_map(folder), mapping.open_map(tmp_path / "new")
    points = np.random.default_rng(1).uniform([0.2, 0.2, 0.2], [5.8, 3.8, 2.3], (200, 3))
    np.testing.assert_allclose(new.field.distance(points - [1.0, 0.5, 0.0]), old.field.distance(points), atol=1e-5)
    assert new.hash == said["hash"] != old.hash  # a plan of the old map does not hold in this one
    assert said["edits"] == 1
    assert "origin set to 1, 0.5, 0 m" in new.facts["history"][0]


def test_a_heading_turns_the_x_axis(folder: Path, tmp_path: Path) -> None:
    run("map", "origin", folder, "--place", "0,0,0", "--turn", "90", "--out", tmp_path / "new")
    # what was ahead along y is now ahead along x
    np.testing.assert_allclose(mapping.open_map(tmp_path / "new").T_world_body[0, :3, 3], [1.0, -1.0, 1.0], atol=1e-8)


def test_a_part_is_cut_out(folder: Path, tmp_path: Path) -> None:
    said = json.loads(run("map", "crop", folder, "--box", "0,0,0,3,4,2.5", "--out", tmp_path / "new", "--json"))
    new = mapping.open_map(tmp_path / "new")
    assert new.field.status([[2.5, 3.0, 1.0], [3.5, 3.0, 1.0]]).tolist() == [esdf.KNOWN, esdf.OUTSIDE]
    assert (said["poses"], said["poses_of_old"]) == (len(new.images), len(mapping.open_map(folder).images))
    assert "cropped map" in new.facts["history"][0]
    assert "with --box 0,0,0,3,4,2.5" in new.facts["history"][0]
    assert "--box" in run("map", "crop", folder, "--out", tmp_path / "none", code=2)


@pytest.mark.parametrize("turn_rad", [0.0, 0.4])
def test_measured_points_are_where_they_were_measured(folder: Path, tmp_path: Path, turn_rad: float) -> None:
    T = frames.transform(rotations.from_yaw(turn_rad), [10.0, -4.0, 2.0])
    points = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 4.0, 0.0], [0.0, 4.0, 2.5]])
    write_points(tmp_path / "points.csv", points, frames.apply(T, points))
    said = json.loads(
        run("map", "align", folder, "--points", tmp_path / "points.csv", "--out", tmp_path / "new", "--json")
    )
    np.testing.assert_allclose(said["T_new_old"], T, atol=1e-5)
    assert said["residual_m"] == pytest.approx(0.0, abs=1e-5)
    assert mapping.open_map(tmp_path / "new").facts["up_source"] == "measured points"


def test_a_map_can_be_set_upright(folder: Path, tmp_path: Path) -> None:
    tilt_rad = math.radians(3.0)
    up = f"{math.sin(tilt_rad)},0,{math.cos(tilt_rad)}"
    said = json.loads(run("map", "align", folder, "--up", up, "--out", tmp_path / "new", "--json"))
    assert said["turned_rad"] == pytest.approx(tilt_rad)
    R = np.array(said["T_new_old"])[:3, :3]
    np.testing.assert_allclose(R @ [math.sin(tilt_rad), 0.0, math.cos(tilt_rad)], [0.0, 0.0, 1.0], atol=1e-9)
    assert mapping.open_map(tmp_path / "new").facts["up_source"] == "a stated direction"


def write_points(path: Path, of_map: np.ndarray, measured: np.ndarray) -> None:
    rows = [",".join(f"{x:.6f}" for x in row) for row in np.hstack([of_map, measured])]
    path.write_text("\n".join(["map_x_m,map_y_m,map_z_m,x_m,y_m,z_m", *rows]) + "\n")


CORNERS = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 4.0, 0.0]])
SQUARE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.5], [0.0, 4.0, 2.5]])


@pytest.mark.parametrize(
    ("of_map", "measured", "said"),
    [
        (CORNERS[:2], CORNERS[:2], "at least 3 are needed"),
        (CORNERS, 1.05 * CORNERS, "0.952 times as large as the measured points"),
        (CORNERS * [1.0, 0.0, 0.0], CORNERS * [1.0, 0.0, 0.0], "on one line"),
        (CORNERS, np.full((3, 3), np.nan), "not finite"),
        (CORNERS, 0.0 * CORNERS, "on one line"),
        (SQUARE, SQUARE[[0, 3, 2, 1]] * [-1.0, 1.0, 1.0] + [0.0, 0.0, 1.0], "do not fit"),
        (SQUARE, SQUARE[:, [1, 0, 2]] * [1.0, 1.0, -1.0], "upside down"),
        (CORNERS, np.add(CORNERS, [0.0, 5.4e6, 0.0]), "5,400 km from the origin"),
    ],
)
def test_points_that_cannot_be_right_are_refused(
    folder: Path, tmp_path: Path, of_map: np.ndarray, measured: np.ndarray, said: str
) -> None:
    write_points(tmp_path / "points.csv", of_map, measured)
    message = run("map", "align", folder, "--points", tmp_path / "points.csv", "--out", tmp_path / "new", code=2)
    assert said in message
    assert not (tmp_path / "new").exists()


def test_points_of_a_spreadsheet_are_read_and_no_table_is_refused(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    write_points(path, CORNERS, CORNERS + 1.0)
    path.write_text("\ufeff" + path.read_text(), encoding="utf-8")
    run("map", "align", folder, "--points", path, "--out", tmp_path / "new")
    path.write_text(path.read_text() + '"' + 200_000 * "1" + '",0,0,0,0,0')
    assert "a number for each" in run("map", "align", folder, "--points", path, "--out", tmp_path / "other", code=2)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["origin", "{map}", "--place", "1,2", "--out", "{new}"], "--place '1,2' is not 3 finite numbers"),
        (["origin", "{map}", "--place", "1,2,nan", "--out", "{new}"], "3 finite numbers"),
        (["origin", "{map}", "--place", "0,0,0", "--turn", "inf", "--out", "{new}"], "must be from -360 to 360"),
        (["align", "{map}", "--out", "{new}"], "either --points or --up"),
        (["align", "{map}", "--up", "0,0,0", "--out", "{new}"], "has no direction"),
        (["align", "{map}", "--points", "{new}", "--out", "{new}"], "does not exist"),
        (["align", "{map}", "--points", "{map}/poses.csv", "--out", "{new}"], "a number for each of map_x_m"),
        (["crop", "{new}", "--sphere", "0,0,0,1", "--out", "{map}2"], "is not a map"),
        (["origin", "{map}", "--place", "0,0,0", "--out", "{map}"], "exists; give another name, or --overwrite"),
        (["merge", "{map}", "{new}", "--out", "{map}2"], "is not a map"),
    ],
)
def test_bad_requests_are_refused_in_one_sentence(
    folder: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    before = mapping.open_map(folder).hash
    message = run("map", *(a.format(map=folder, new=tmp_path / "new") for a in arguments), code=2)
    assert said in message
    assert mapping.open_map(folder).hash == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map"]


def test_a_map_is_replaced_only_when_asked_and_kept_beside(folder: Path, tmp_path: Path) -> None:
    run("map", "origin", folder, "--place", "0,0,1", "--out", folder, "--overwrite")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map", "map.old-1"]
    assert mapping.open_map(folder).hash != mapping.open_map(tmp_path / "map.old-1").hash


def test_a_map_joined_with_its_moved_copy_is_the_map(folder: Path, tmp_path: Path) -> None:
    run("map", "origin", folder, "--place", "1,0.5,0", "--turn", "20", "--out", tmp_path / "moved")
    said = json.loads(run("map", "merge", folder, tmp_path / "moved", "--out", tmp_path / "both", "--json"))
    T = frames.transform(rotations.from_yaw(math.radians(20.0)), [1.0, 0.5, 0.0])
    np.testing.assert_allclose(said["T_first_second"], T, atol=2e-3)
    both = mapping.open_map(tmp_path / "both")
    assert both.facts["verdict"] == "good"
    assert both.images == ("0.png", "moved/0.png")
    assert len(both.localization_map().points_world_m) == 300


def test_a_map_of_nothing_in_common_is_refused(folder: Path, tmp_path: Path) -> None:
    parts = map_parts.read(folder)
    other = LocalizationMap(parts.known.points_world_m, parts.known.descriptors[::-1][:, ::-1])
    map_parts.write(tmp_path / "other", dataclasses.replace(parts, known=other))
    assert "too little in common" in run("map", "merge", folder, tmp_path / "other", "--out", tmp_path / "both", code=1)
    assert not (tmp_path / "both").exists()


def test_a_damaged_history_is_refused(folder: Path, tmp_path: Path) -> None:
    opened = mapping.open_map(folder)
    body = {"hash": opened.field.hash, "history": "once upon a time"}
    file_format.write_toml(folder / "map.toml", format="goshawk-map", version=1, body=body)
    assert "a list of sentences" in run("map", "origin", folder, "--place", "0,0,1", "--out", tmp_path / "new", code=2)
