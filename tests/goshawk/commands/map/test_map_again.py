"""`goshawk map again`: places in free space, as waypoints that can be planned as they are."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import esdf
import mapping
import vehicle
from esdf.solids import Box
from flight import InputError, project, silent
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from goshawk.station_jobs import look_again
from planner import PlanOptions
from tests.goshawk.running import answer, run

UNSEEN = Box((2.6, 0.3, 0.4), (3.4, 1.0, 1.6))


@pytest.fixture(scope="module")
def folder(made_once, pillar_map: Path) -> Path:
    """The room with two pillars, and a box in it that no image saw."""

    def make(new: Path) -> None:
        shutil.copytree(pillar_map, new, dirs_exist_ok=True, ignore=shutil.ignore_patterns("esdf"))
        field = mapping.open_map(pillar_map).field
        state = field.state.copy()
        inside = UNSEEN.distance(field.grid.centres().reshape(-1, 3)) < 0.0
        state[inside.reshape(state.shape)] = esdf.UNKNOWN
        esdf.save(new / "esdf", esdf.build(state, field.grid))

    return made_once("unseen_box_map", make)


@pytest.fixture(scope="module")
def drone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("again") / "vehicle.toml"
    vehicle.save(path, vehicle.example())
    return path


def test_the_waypoints_show_the_box_and_are_planned_as_they_are(folder: Path, drone: Path, tmp_path: Path) -> None:
    out = tmp_path / "again.json"
    said = json.loads(run("map", "again", folder, "--vehicle", drone, "--out", out, "--json"))
    assert said["shown_m3"] > 0.8 * 0.8 * 0.7 * 1.2
    points = project.load_waypoints(out)
    np.testing.assert_allclose(points.positions_world_m, [view["position_world_m"] for view in said["views"]])
    np.testing.assert_allclose(np.degrees(points.yaw_rad), [view["heading_deg"] for view in said["views"]], atol=0.06)
    near = mapping.open_map(folder).field.proven_distance(points.positions_world_m)
    assert (near >= said["clearance_m"] - 1e-6).all()
    plan = ("--map", folder, "--vehicle", drone, "--out", tmp_path / "flight.json", "--speed", "1", "--json")
    assert json.loads(run("plan", out, *plan))["waypoints"] == len(said["views"])


def test_the_views_keep_what_the_planner_asks_of_a_waypoint(folder: Path, drone: Path) -> None:
    said = json.loads(run("map", "again", folder, "--vehicle", drone, "--margin", "0.2", "--json"))
    assert said["clearance_m"] == PlanOptions(margin_m=0.2).sized(vehicle.example()).waypoint_clearance_m
    said = json.loads(run("map", "again", folder, "--radius", "0.3", "--json"))
    assert said["clearance_m"] == PlanOptions(radius_m=0.3).waypoint_clearance_m


def test_without_anything_to_see_no_file_is_written_and_an_earlier_one_is_kept_beside(
    pillar_map: Path, tmp_path: Path
) -> None:
    out = tmp_path / "again.json"
    said = json.loads(run("map", "again", pillar_map, "--out", out, "--json"))
    assert (said["views"], said["written"]) == ([], None)
    assert not out.exists()
    out.write_text("mine")
    assert "again.json" in run("map", "again", pillar_map, "--out", out, code=2)
    assert out.read_text() == "mine"
    ended = answer("map", "again", pillar_map, "--out", out, "--overwrite")
    assert (ended.returncode, out.exists()) == (0, False), "an earlier proposal would pass for this one"
    assert (tmp_path / "again.json.old-1").read_text() == "mine"
    assert "kept: again.json.old-1" in ended.stderr
    assert "ends in .json" in run("map", "again", pillar_map, "--out", tmp_path / "again.csv", code=2)


def test_where_the_earlier_waypoints_are_a_link_it_is_moved_aside_and_the_next_run_works(
    pillar_map: Path, tmp_path: Path
) -> None:
    link, file = tmp_path / "again.json", tmp_path / "elsewhere.json"
    file.write_text("mine")
    link.symlink_to(file.name)
    for _ in range(2):
        run("map", "again", pillar_map, "--out", link, "--overwrite")
        assert not link.is_symlink()
        assert (tmp_path / "again.json.old-1").read_text() == file.read_text() == "mine"


def test_only_what_is_near_the_flight_to_come_is_asked_for(folder: Path, tmp_path: Path) -> None:
    csv = tmp_path / "far.csv"
    csv.write_text("x_m,y_m,z_m\n5.5,3.5,1\n5.5,2.5,1\n")
    assert json.loads(run("map", "again", folder, "--near", csv, "--within", "1", "--json"))["unknown_m3"] == 0.0
    table = run("map", "again", folder, "--on-foot")
    assert re.search(r"^\s+1\s", table, re.MULTILINE)  # counted as the messages of `goshawk plan` do
    assert re.search(r"views would show about 0\.\d+ m3", table)


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--least", "nan", "least_m3"),
        ("--within", "-1", "within_m"),
        ("--range", "1e300", "at most 1000 m"),
        ("--radius", "50", "smaller clearance"),
    ],
)
def test_wrong_numbers_are_refused_by_name(folder: Path, option: str, value: str, words: str) -> None:
    assert words in run("map", "again", folder, option, value, code=2)


def test_a_flight_of_another_map_is_refused(folder: Path, tmp_path: Path) -> None:
    csv = tmp_path / "elsewhere.csv"
    csv.write_text("x_m,y_m,z_m\n500,500,1\n501,500,1\n")
    assert "is it of another map?" in run("map", "again", folder, "--near", csv, code=2)


def test_the_report_shows_where_to_look_again_and_says_why_it_cannot(folder: Path, tmp_path: Path) -> None:
    run("map", "report", folder, "--out", tmp_path / "map.html")
    page = (tmp_path / "map.html").read_text()
    assert "Where to look again, from above" in page
    assert "views would show about" in page
    blind = tmp_path / "blind"
    shutil.copytree(folder, blind)
    (blind / "poses.csv").write_text("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n")
    run("map", "report", blind, "--out", tmp_path / "blind.html")
    assert "no poses of images" in (tmp_path / "blind.html").read_text()


def test_on_the_page_the_views_become_waypoints_that_undo_takes_back(folder: Path, tmp_path: Path) -> None:
    opened = project.create(tmp_path / "project", "again")
    shutil.copytree(folder, opened.map)
    vehicle.save(opened.vehicle, vehicle.example())
    with pytest.raises(InputError, match="no waypoints yet"):
        look_again.KIND.check(opened, look_again.Arguments(near_plan=True))
    asked = look_again.Arguments()
    look_again.KIND.check(opened, asked)
    result = look_again.KIND.run(opened.folder, asked, silent)
    session = Session(opened, Settings(margin_m=0.15))
    try:
        desk: Any = SimpleNamespace(session=session)
        assert "the plan's waypoints now" in look_again.KIND.done(desk, result)
        assert [point.position_world_m for point in session.content.points] == result.positions_world_m
        look_again.KIND.check(opened, look_again.Arguments(near_plan=True))
        session.undo("Ada")
        assert session.content.points == ()
    finally:
        session.close()
    opened.vehicle.unlink()  # people on foot may have none: then the carrier's radius is kept clear
    assert look_again.KIND.run(opened.folder, asked, silent).positions_world_m
    with pytest.raises(InputError, match="no map"):
        look_again.KIND.check(project.create(tmp_path / "empty", "empty"), asked)
