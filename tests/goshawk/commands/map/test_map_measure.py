"""`goshawk map measure`: lengths in a map, with the certainty of its scale."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from flight import file_format
from mapping import map_folder
from tests.goshawk.running import run

PILLAR = "2.0,1.5,1.2"
"""On the axis of a pillar of 25 cm radius."""


def measured(folder: Path, start: str, end: str) -> dict:
    return json.loads(run("map", "measure", folder, "--first", start, "--second", end, "--json"))


def test_a_length_is_that_of_the_two_points_either_way(pillar_map: Path) -> None:
    there, back = measured(pillar_map, "1,1,1", "4,1,1.4"), measured(pillar_map, "4,1,1.4", "1,1,1")
    assert there["length_m"] == back["length_m"] == pytest.approx(np.hypot(3.0, 0.4))
    assert there["horizontal_m"] == pytest.approx(3.0)
    assert (there["rise_m"], back["rise_m"]) == (pytest.approx(0.4), pytest.approx(-0.4))
    assert there["length_std_m"] is None, "this map has no report, so nothing is known of its scale"


def test_an_image_is_the_place_where_it_was_taken(pillar_map: Path) -> None:
    by_name = measured(pillar_map, "0.png", "1,1,2")
    assert by_name["points_world_m"][0] == [1.0, 1.0, 1.0]
    assert by_name["length_m"] == pytest.approx(1.0)


def test_the_clearance_is_the_distance_to_the_pillar_and_negative_inside(pillar_map: Path) -> None:
    found = measured(pillar_map, PILLAR, "2.75,1.5,1.2")["clearance_m"]
    assert found == pytest.approx([-0.25, 0.5], abs=0.06)
    table = run("map", "measure", pillar_map, "--first", PILLAR, "--second", "2.75,1.5,1.2")
    assert "inside an obstacle" in table
    assert "from obstacles and unknown space" in table


def test_a_place_that_is_not_mapped_has_no_clearance(pillar_map: Path) -> None:
    found = measured(pillar_map, "1,1,1", "1,1,90")
    assert found["clearance_m"][1] is None
    assert found["status"] == ["mapped", "outside of the map"]
    assert found["length_m"] == pytest.approx(89.0)


def test_the_standard_deviation_is_that_of_the_scale_in_use(pillar_map: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(pillar_map, tmp_path / "map")
    witnesses = [{"source": "rig baseline", "ratio": 1.0, "std": 0.02}, {"source": "length", "ratio": 1.1, "std": 0.5}]
    file_format.write_json(
        folder / "report.json", format=map_folder.REPORT_FORMAT, version=1, body={"scale_witnesses": witnesses}
    )
    assert measured(folder, "1,1,1", "4,1,1")["length_std_m"] == pytest.approx(0.06)
    assert "3.000 m ± 0.118 m" in run("map", "measure", folder, "--first", "1,1,1", "--second", "4,1,1")


@pytest.mark.parametrize("point", ["1,2", "1,2,nan", "7.png", ""])
def test_what_is_neither_a_point_nor_an_image_is_refused_by_name(pillar_map: Path, point: str) -> None:
    said = run("map", "measure", pillar_map, "--first", "1,1,1", "--second", point, code=2)
    assert f"--second '{point}' is neither X,Y,Z in metres nor an image" in said


def test_a_length_in_a_refused_map_comes_with_the_reasons(pillar_map: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(pillar_map, tmp_path / "map")
    facts = file_format.read_toml(folder / "map.toml", format=map_folder.FORMAT, version=1)
    facts |= {"verdict": "refused", "reasons": ["two sources of scale disagree"]}
    file_format.write_toml(folder / "map.toml", format=map_folder.FORMAT, version=1, body=facts)
    found = measured(folder, "1,1,1", "4,1,1")
    assert (found["verdict"], found["reasons"]) == ("refused", ["two sources of scale disagree"])
    ends = ("--first", "1,1,1", "--second", "4,1,1")
    assert "refused: two sources of scale disagree" in run("map", "measure", folder, *ends)
    assert measured(pillar_map, "1,1,1", "4,1,1")["verdict"] == "good"
    assert "good" not in run("map", "measure", pillar_map, *ends)


def test_a_point_farther_than_any_map_reaches_is_refused_with_the_bound(pillar_map: Path) -> None:
    assert measured(pillar_map, "1,1,1", "1,10000,1")["length_m"] == pytest.approx(9999.0)
    for far in ("10001,1,1", "1,-1e308,1"):
        refusal = run("map", "measure", pillar_map, "--first", "1,1,1", "--second", far, code=2)
        assert "--second is 1" in refusal
        assert "a map reaches at most 10000 m" in refusal
