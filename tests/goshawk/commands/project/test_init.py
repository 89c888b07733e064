"""`goshawk init`: a project from nothing, and the ground station's words about what one lacks."""

import json

import numpy as np

import vehicle
from flight import flight_log, project
from tests.goshawk.running import run
from tests.mapping.test_map_folder import made_map


def log(path):
    time_s = np.arange(100) / 100.0
    flight_log.save(path, flight_log.from_vectors(time_s, {"position_world_m": np.ones((100, 3))}))
    return path


def test_an_empty_project_lists_the_command_that_adds_each_part(tmp_path):
    document = json.loads(run("init", tmp_path / "room", "--json"))
    assert project.open_project(tmp_path / "room").name == "room"
    for part in ("map", "vehicle", "waypoints", "trajectories", "flights"):
        assert document["parts"][part]["found"] is None
        assert document["parts"][part]["give_it_with"].startswith("goshawk ")


def test_parts_are_copied_in_and_the_originals_stay(tmp_path):
    vehicle.save(tmp_path / "v.toml", vehicle.example())
    made_map(tmp_path / "m")
    run("init", tmp_path / "room", "--vehicle", tmp_path / "v.toml", "--map", tmp_path / "m",
        log(tmp_path / "a.parquet"), log(tmp_path / "b.parquet"))  # fmt: skip
    opened = project.open_project(tmp_path / "room")
    assert vehicle.load(opened.vehicle).name == "rigter2019"
    assert (opened.map / "map.toml").read_bytes() == (tmp_path / "m" / "map.toml").read_bytes()
    assert [p.name for p in opened.flights()] == ["a.parquet", "b.parquet"]
    assert (tmp_path / "v.toml").exists()


def test_nothing_in_a_project_is_replaced(tmp_path):
    vehicle.save(tmp_path / "v.toml", vehicle.example())
    arguments = ("--vehicle", tmp_path / "v.toml")
    run("init", tmp_path / "room", *arguments)
    assert "exists and is kept" in run("init", tmp_path / "room", *arguments, code=2)
    run("init", tmp_path / "room", log(tmp_path / "a.parquet"))
    assert "exists and is kept" in run("init", tmp_path / "room", tmp_path / "a.parquet", code=2)


def test_a_vehicle_brings_its_history_along(tmp_path):
    vehicle.save(tmp_path / "v.toml", vehicle.example())
    run("vehicle", "effect", "remove", tmp_path / "v.toml", "parasitic_drag", "--yes")
    run("init", tmp_path / "room", "--vehicle", tmp_path / "v.toml")
    run("vehicle", "undo", tmp_path / "room" / "vehicle.toml", "--yes")
    assert "parasitic_drag" in vehicle.load(tmp_path / "room" / "vehicle.toml").effects


def test_a_folder_or_file_that_is_no_map_vehicle_or_log_is_refused(tmp_path):
    (tmp_path / "v.toml").write_text("format = 'goshawk-camera'\nversion = 1\n")
    assert "goshawk-vehicle" in run("init", tmp_path / "room", "--vehicle", tmp_path / "v.toml", code=2)
    assert "is not a map" in run("init", tmp_path / "room", "--map", tmp_path, code=2)
    (tmp_path / "field").mkdir()
    (tmp_path / "field" / "esdf.toml").touch()
    assert "esdf.load" in run("init", tmp_path / "room", "--map", tmp_path / "field", code=2)
    assert "does not exist" in run("init", tmp_path / "new", tmp_path / "none.ulg", code=2)
    assert not (tmp_path / "new").exists()
    assert "is a file" in run("init", tmp_path / "v.toml", code=2)


def test_a_part_that_is_refused_leaves_nothing_new(tmp_path):
    vehicle.save(tmp_path / "v.toml", vehicle.example())
    good = ("--vehicle", tmp_path / "v.toml", log(tmp_path / "a.parquet"))
    (tmp_path / "b.parquet").write_bytes(b"PAR1")
    bad = ("--map", tmp_path)
    run("init", tmp_path / "new" / "room", *good, *bad, code=2)
    assert not (tmp_path / "new").exists()
    run("init", tmp_path / "room", tmp_path / "b.parquet", code=2)
    assert not (tmp_path / "room").exists()
    run("init", tmp_path / "room")
    before = sorted((tmp_path / "room").rglob("*"))
    run("init", tmp_path / "room", *good, *bad, code=2)
    assert sorted((tmp_path / "room").rglob("*")) == before
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "notes.txt").write_text("mine")
    run("init", tmp_path / "own", *good, *bad, code=2)
    assert [path.name for path in (tmp_path / "own").iterdir()] == ["notes.txt"]


def test_the_ground_station_needs_a_project_with_a_vehicle_and_names_the_commands_that_add_them(tmp_path):
    said = run("gcs", tmp_path / "none", code=2)
    assert f"goshawk init {tmp_path / 'none'}" in said
    assert "no project.toml" in run("gcs", tmp_path, code=2)
    run("init", tmp_path / "room")
    said = run("gcs", tmp_path / "room", code=2)
    assert "goshawk vehicle new" in said
    assert "map" not in said
