"""`goshawk localize`: what it says of poses that were found, of images that were not, and of what has changed."""

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import mapping
from flight import frames
from goshawk.rendered import world as rendered_world
from mapping import ChangedRegion, Changes, Localization
from tests.goshawk.running import answer, run

NAMES = ("0.png", "1.png", "2.png")
REGION = ChangedRegion((1.0, 2.0, 0.0), (1.5, 2.5, 0.6), 40, 200, 20)


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """Images that can be read; what is found in them is given by each test."""
    for camera in rendered_world.default_rig():
        (tmp_path / "walk" / camera.folder).mkdir(parents=True)
        for name in NAMES:
            cv2.imwrite(str(tmp_path / "walk" / camera.folder / name), np.zeros((480, 640), np.uint8))
    return tmp_path / "walk"


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Localization:
    """The first two images at 1 cm and 1 mrad along each axis, the third nowhere."""
    poses, covariance = np.full((3, 4, 4), np.nan), np.full((3, 6, 6), np.nan)
    poses[:2] = frames.transform([[1.0, 0.0, 0.0, 0.0]] * 2, [[1.0, 1.0, 1.0], [2.0, 1.0, 1.0]])
    covariance[:2] = np.diag([1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6])
    counts = np.array([100, 90, 0])
    made = Localization(NAMES, poses, covariance, counts, counts, {"2.png": "12 features look like points of the map"})
    monkeypatch.setattr(mapping, "localize", lambda *_, **given: made)
    monkeypatch.setattr(mapping, "find_changes", lambda *_, **given: Changes((REGION,), 0.5))
    return made


@pytest.mark.usefixtures("found")
def test_poses_come_with_their_certainty_and_failures_with_their_reason(
    walk: Path, pillar_map: Path, tmp_path: Path
) -> None:
    table = run("localize", walk, "--map", pillar_map, "--out", tmp_path / "walk.csv")
    assert "2 of 3" in table
    assert "2.png: 12 features look like points of the map" in " ".join(table.split())
    assert "17.3 mm, 0.099 deg in the map" in table
    assert "(1.0, 2.0, 0.0) to (1.5, 2.5, 0.6) m, where 10% is found again, not 50%" in " ".join(table.split())
    said = json.loads(run("localize", walk, "--map", pillar_map, "--out", tmp_path / "again.csv", "--json"))
    assert said["failed"] == ["2.png"]
    assert said["reasons"] == {"2.png": "12 features look like points of the map"}
    np.testing.assert_allclose(np.diag(said["covariance"][0]), [1e-4] * 3 + [1e-6] * 3)
    assert said["covariance"][2] is None
    assert said["changed"][0]["high_world_m"] == [1.5, 2.5, 0.6]


@pytest.mark.usefixtures("found")
def test_the_file_holds_standard_deviations_and_is_read_as_poses(walk: Path, pillar_map: Path, tmp_path: Path) -> None:
    out = tmp_path / "walk.csv"
    run("localize", walk, "--map", pillar_map, "--out", out)
    with open(out, encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["image"] for row in rows] == ["0.png", "1.png"]
    assert [float(rows[0][f"{axis}_std_m"]) for axis in "xyz"] == pytest.approx([0.01] * 3)
    assert float(rows[0]["turn_std_rad"]) == pytest.approx(0.001)
    names, _, poses = mapping.read_poses(out)
    assert names == ("0.png", "1.png")
    np.testing.assert_allclose(poses[1, :3, 3], [2.0, 1.0, 1.0])


def test_without_any_pose_nothing_is_written(
    walk: Path, pillar_map: Path, tmp_path: Path, found: Localization, monkeypatch: pytest.MonkeyPatch
) -> None:
    found.T_world_body[:] = np.nan
    found.refused.update(dict.fromkeys(NAMES, "no texture"))
    monkeypatch.setattr(mapping, "find_changes", lambda *_, **given: Changes((), float("nan")))
    ended = answer("localize", walk, "--map", pillar_map, "--out", tmp_path / "walk.csv")
    assert ended.returncode == 1
    assert "changed regions" not in ended.stdout
    assert not (tmp_path / "walk.csv").exists()


@pytest.mark.usefixtures("found")
@pytest.mark.parametrize(
    ("usual_share", "regions", "words"), [(0.5, (), "none"), (0.1, (), "not known"), (0.5, (REGION,) * 7, "and 2 more")]
)
def test_changes_are_none_unknown_or_many(
    walk: Path,
    pillar_map: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    usual_share: float,
    regions: tuple[ChangedRegion, ...],
    words: str,
) -> None:
    monkeypatch.setattr(mapping, "find_changes", lambda *_, **given: Changes(regions, usual_share))
    table = run("localize", walk, "--map", pillar_map, "--out", tmp_path / "walk.csv")
    assert words in " ".join(table.split("changed regions")[1].split("written")[0].split())


@pytest.mark.parametrize("speed", ["0", "-1", "nan", "inf"])
def test_a_speed_that_is_none_is_refused(walk: Path, pillar_map: Path, tmp_path: Path, speed: str) -> None:
    said = run("localize", walk, "--map", pillar_map, "--out", tmp_path / "o.csv", "--fastest", speed, code=2)
    assert "--fastest" in said
