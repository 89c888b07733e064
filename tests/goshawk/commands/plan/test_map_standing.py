"""Planning asks before it uses a doubtful map and refuses a refused one; a map's calibration is shown, kept, undone."""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import mapping
import vehicle
from flight import file_format
from goshawk.demo import chain
from mapping import map_folder
from mapping.camera.errors import Candidate, Kind
from mapping.camera.trial import Finding, Verdict
from tests.goshawk.running import run


@pytest.fixture
def area(pillar_map: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(pillar_map, tmp_path / "map"))


def judge(area: Path, verdict: str | None, *reasons: str) -> None:
    body = {"hash": mapping.open_map(area).field.hash}
    body |= {} if verdict is None else {"verdict": verdict, "reasons": list(reasons)}
    file_format.write_toml(area / "map.toml", format=map_folder.FORMAT, version=1, body=body)


def asked(area: Path, tmp_path: Path) -> list[object]:
    (tmp_path / "w.csv").write_text("x_m,y_m,z_m\n0.8,0.8,1\n5.2,3.2,1\n")
    vehicle.save(tmp_path / "v.toml", chain.vehicles()[1])
    return ["plan", tmp_path / "w.csv", "--map", area, "--vehicle", tmp_path / "v.toml", "--out", tmp_path / "p.json"]


def test_a_doubtful_map_is_planned_in_only_when_the_user_agrees(area: Path, tmp_path: Path) -> None:
    judge(area, "doubtful", "these images cannot tell")
    words = asked(area, tmp_path)
    assert "these images cannot tell" in run(*words, code=2)
    assert not (tmp_path / "p.json").exists()
    run(*words, "--accept-doubtful-map")
    assert (tmp_path / "p.json").exists()


def test_a_map_with_free_space_of_the_earlier_rule_is_planned_in_only_when_the_user_agrees(
    area: Path, tmp_path: Path
) -> None:
    body = {"hash": mapping.open_map(area).field.hash, "verdict": "good", "reasons": [], "scale_source": "rig baseline"}
    file_format.write_toml(area / "map.toml", format=map_folder.FORMAT, version=1, body=body)
    assert map_folder.EARLIER_FREE_SPACE in run(*asked(area, tmp_path), code=2)
    assert not (tmp_path / "p.json").exists()
    run(*asked(area, tmp_path), "--accept-doubtful-map")


def test_a_refused_map_is_never_planned_in(area: Path, tmp_path: Path) -> None:
    judge(area, "refused", "two sources of scale disagree")
    said = run(*asked(area, tmp_path), "--accept-doubtful-map", code=2)
    assert "two sources of scale disagree" in said
    assert not (tmp_path / "p.json").exists()


def report(area: Path) -> None:
    finding = Finding(
        Candidate("down", Kind.ROTATION), Verdict.PRESENT, np.array([0.01, 0.0, 0.0]), np.full(3, 1e-4), 3.2, 3.3, 900.0
    )
    body = {"calibration": [finding.as_dict()]}
    file_format.write_json(area / "report.json", format=map_folder.REPORT_FORMAT, version=map_folder.VERSION, body=body)


def test_the_trial_of_a_map_is_shown(area: Path) -> None:
    assert "no report.json" in run("camera", "diagnose", area, code=2)
    report(area)
    assert "down: rotation on the body" in run("camera", "diagnose", area)
    (found,) = json.loads(run("camera", "diagnose", area, "--json"))["calibration"]
    assert (found["verdict"], found["units"]) == ("present", ["rad"] * 3)


def test_a_maps_calibration_is_kept_and_undone(area: Path, tmp_path: Path) -> None:
    out = tmp_path / "camera.toml"
    rig = mapping.rig.load(area / "camera.toml")
    turned = dataclasses.replace(rig.cameras[1], params=rig.cameras[1].params * [1.01, 1.01, 1, 1, 1, 1, 1, 1])
    mapping.rig.save(out, dataclasses.replace(rig, cameras=(rig.cameras[0], turned)))
    first = out.read_text()
    assert "exists" in run("camera", "add", area, "--out", out, code=2)
    run("camera", "add", area, "--out", out, "--overwrite")
    compared = json.loads(run("camera", "compare", out, tmp_path / "camera.toml.old-1", "--json"))["cameras"]
    assert compared[0]["lens_largest_px"] == pytest.approx(0.0, abs=1e-9)
    assert 1.0 < compared[1]["lens_rms_px"] < compared[1]["lens_largest_px"] < 6.0
    assert compared[1]["turned_deg"] == pytest.approx(0.0, abs=1e-6)
    run("camera", "undo", out)
    assert out.read_text() == first


def test_undo_without_an_earlier_file_says_so(area: Path) -> None:
    assert "replaced no earlier file" in run("camera", "undo", area / "camera.toml", code=2)
