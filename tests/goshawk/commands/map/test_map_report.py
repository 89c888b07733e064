"""`goshawk map report`: one file that needs no network, and says of a map what is known, and what is not."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import mapping
from flight import file_format
from goshawk.rendered import world as rendered_world
from mapping import map_folder
from mapping.camera import residual_field
from tests.goshawk.running import run


@pytest.fixture
def folder(tmp_path: Path, pillar_map: Path) -> Path:
    """The room with two pillars: a doubtful map, with what a mapping run writes down."""
    area = tmp_path / "<b>map"
    area.mkdir()
    for part in ("esdf", "camera.toml", "poses.csv"):
        (area / part).symlink_to(pillar_map / part)
    facts = {
        "verdict": "doubtful",
        "reasons": ["3 of 10 <images> could not be placed"],
        "hash": "0",
        "history": ["cut"],
        "surface_std_median_m": 0.009,
        "surface_std_90_percent_m": 0.017,
        "surface_share_worse_than_voxel": 0.001,
    }
    file_format.write_toml(area / "map.toml", format=map_folder.FORMAT, version=1, body=facts)
    camera = rendered_world.default_rig(0.5).cameras[0]
    rays = camera.unproject(np.random.default_rng(0).uniform([60.0, 60.0], [250.0, 180.0], (4000, 2)))
    seen = camera.project(rays) + np.array([0.2, 0.1])
    observed = (camera, np.broadcast_to(np.eye(4), (4000, 4, 4)), 2.0 * rays, seen)
    of_images = residual_field.over_time(*observed, np.arange(4000) % 3, 4)  # the fourth one saw nothing
    write_report(
        area,
        corrections=["down: its rotation"],
        not_placed=["front/7.png"],
        placed_by_motion=["front/5.png"],
        motion_notes=["odometry <o.tum>: too noisy"],
        unplaced_runs=[
            {"first": "7.png", "last": "<9>.png", "count": 3, "before": "6.png", "after": None, "matches_before": 18,
             "matches_after": 0, "pieces": [["7.png", "<9>.png"]]}
        ],
        scale_witnesses=[{"source": "rig baseline", "ratio": 1.0, "std": 0.006}],
        calibration=[
            {"camera": "down", "error": "rotation on the body", "verdict": "present", "size": [0.01, 0.0, 0.0],
             "std": [1e-4] * 3, "units": ["rad"] * 3, "shift_px": 2.0, "largest_shift_px": 2.1, "gain": 900.0}
        ],
        residual_field=[residual_field.field(*observed)],
        residual_radius=[residual_field.over_radius(*observed)],
        residual_time=[of_images | {"image": ["a", "b", "c", "d"], "time_s": [0.0, 0.1, None, 0.3]}],
    )  # fmt: skip
    return area


def write_report(area: Path, **body: object) -> None:
    file_format.write_json(area / "report.json", format=map_folder.REPORT_FORMAT, version=1, body=body)


def test_the_page_has_all_that_is_known_and_needs_no_network(folder: Path, tmp_path: Path) -> None:
    said = json.loads(run("map", "report", folder, "--out", tmp_path / "map.html", "--json"))
    assert said["verdict"] == "doubtful"
    page = (tmp_path / "map.html").read_text()
    for text in (
        "3 of 10 &lt;images&gt; could not be placed",
        "down: its rotation",
        "standard deviation 9 mm at the median, 17 mm at the 90th percentile; 0.1 % of it above one voxel",
        "<td>not placed</td><td class='word long'>front/7.png</td>",
        "<td>placed by recorded motion</td><td class='word long'>front/5.png</td>",
        "odometry &lt;o.tum&gt;: too noisy",
        "td.long { white-space: normal",
        "<td>7.png to &lt;9&gt;.png</td><td>3</td><td>18 (6.png)</td><td></td>",
        "<td class='word'>7.png to &lt;9&gt;.png</td>",
        "rig baseline",
        "rotation on the body",
        "present",
        "Reprojection errors, cell by cell",
        "Reprojection errors over angle and time",
        "What was seen",
        mapping.open_map(folder).hash,
    ):
        assert text in page
    assert "<b>map" not in page
    assert not re.findall(r"(?:src|href)=['\"](?!data:)", page)
    assert page.count("data:image/svg+xml") == 3


def test_a_map_without_a_report_says_so(folder: Path, tmp_path: Path) -> None:
    (folder / "report.json").unlink()
    run("map", "report", folder, "--out", tmp_path / "map.html")
    page = (tmp_path / "map.html").read_text()
    assert page.count("recorded in this map") == 3
    assert "What was seen" in page


def test_a_report_of_an_earlier_version_has_the_errors_over_the_image_alone(folder: Path, tmp_path: Path) -> None:
    body = json.loads((folder / "report.json").read_text())
    write_report(folder, residual_field=body["residual_field"])
    run("map", "report", folder, "--out", tmp_path / "map.html")
    page = (tmp_path / "map.html").read_text()
    assert "Reprojection errors, cell by cell" in page
    assert "over angle and time" not in page.lower()


@pytest.mark.parametrize(
    "body",
    [
        {"unplaced_runs": [{"first": "7.png"}]},
        {"residual_radius": [{"camera": "front"}], "residual_time": [{"camera": "front"}]},
        {"scale_witnesses": [{"source": "rig"}]},
        {"scale_witnesses": 3},
        {"calibration": [{"camera": "front"}]},
        {"residual_field": [{"count": [[1]], "rms_px": [["x"]], "mean_px": [[None]], "width": 3, "height": 3}]},
    ],
)
def test_a_damaged_report_is_refused_and_leaves_no_page(folder: Path, tmp_path: Path, body: dict) -> None:
    write_report(folder, **body)
    assert "report.json" in run("map", "report", folder, "--out", tmp_path / "map.html", code=2)
    assert not (tmp_path / "map.html").exists()


def test_a_page_is_replaced_only_when_asked(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "map.html").write_text("mine")
    assert "exists" in run("map", "report", folder, "--out", tmp_path / "map.html", code=2)
    run("map", "report", folder, "--out", tmp_path / "map.html", "--overwrite")
    assert (tmp_path / "map.html.old-1").read_text() == "mine"
