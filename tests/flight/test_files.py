"""Files are whole or absent; logs name their units; old versions of a file survive a failed write."""

import json
from pathlib import Path

import numpy as np
import pytest

from flight import file_format, flight_log, project
from flight.errors import FormatError, InputError
from flight.flight_log import FlightLog


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.json"
    file_format.write_json(path, format="f", version=1, body={"x": 1})

    def write_and_fail() -> None:
        with file_format.atomic_file(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_and_fail()
    assert file_format.read_json(path, format="f", version=1)["x"] == 1
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


def test_a_failed_folder_leaves_the_old_folder(tmp_path):
    folder = tmp_path / "map"
    with file_format.atomic_folder(folder) as temporary:
        (temporary / "old").write_text("old")

    def replace_and_fail() -> None:
        with file_format.atomic_folder(folder) as temporary:
            (temporary / "new").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replace_and_fail()
    assert [p.name for p in folder.iterdir()] == ["old"]
    with file_format.atomic_folder(folder) as temporary:
        (temporary / "new").write_text("new")
    assert [p.name for p in folder.iterdir()] == ["new"]
    assert [p.name for p in tmp_path.iterdir()] == ["map"]


def test_a_number_that_is_not_finite_is_not_written(tmp_path):
    with pytest.raises(InputError, match="not finite"):
        file_format.write_json(tmp_path / "a.json", format="f", version=1, body={"x": float("nan")})
    assert not (tmp_path / "a.json").exists()


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("{", "valid JSON"),
        ("\n", "is empty; expected a f file"),
        ("[]", "names no format"),
        ('{"format": "g"}', "a g file"),
        ('{"format": "f"}', "whole number"),
        ('{"format": "f", "version": 7}', "update Goshawk"),
    ],
)
def test_a_foreign_file_is_refused_with_its_format(tmp_path, text, word):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=word):
        file_format.read_json(path, format="f", version=1)


@pytest.mark.parametrize("read", [file_format.read_json, file_format.read_toml])
def test_bytes_that_are_no_text_are_refused_as_such(tmp_path, read):
    path = tmp_path / "a"
    path.write_bytes(b"\x86\xff\x00")
    with pytest.raises(FormatError, match="a is not a text file; expected a f file"):
        read(path, format="f", version=1)


def test_toml_reads_back(tmp_path):
    file_format.write_toml(tmp_path / "a.toml", format="f", version=2, body={"mass_kg": {"value": 0.7}})
    assert file_format.read_toml(tmp_path / "a.toml", format="f", version=2)["mass_kg"]["value"] == 0.7


def example_log() -> FlightLog:
    rng = np.random.default_rng(0)
    vectors = {"position_world_m": rng.normal(size=(5, 3)), "q_world_body": rng.normal(size=(5, 4))}
    scalars = {"battery_v": np.full(5, 15.2), "gap_left_m": np.array([0.0, np.nan, 2, 3, 4])}
    return flight_log.from_vectors(np.arange(5) / 100, vectors, scalars=scalars, metadata={"vehicle": "kestrel"})


def test_a_log_reads_back_exactly(tmp_path):
    log = example_log()
    flight_log.save(tmp_path / "f.parquet", log)
    back = flight_log.load(tmp_path / "f.parquet")
    assert back.metadata == log.metadata
    for name, values in log.columns.items():
        np.testing.assert_array_equal(back.columns[name], values)
    np.testing.assert_array_equal(back.vector("q_world_body"), log.vector("q_world_body"))


def test_the_pieces_of_a_log_are_the_log(tmp_path, monkeypatch):
    monkeypatch.setattr(flight_log, "PIECE_ROWS", 2)
    log, path = example_log(), tmp_path / "f.parquet"
    flight_log.save(path, log)
    pieces = list(flight_log.pieces(path, ["gap_left_m"]))
    assert [len(piece) for piece in pieces] == [2, 2, 1]
    assert all(set(piece.columns) == {"time_s", "gap_left_m"} for piece in pieces)
    for name in ("time_s", "gap_left_m"):
        np.testing.assert_array_equal(np.concatenate([piece.columns[name] for piece in pieces]), log.columns[name])
    with pytest.raises(InputError, match="has no height_m"):
        next(flight_log.pieces(path, ["height_m"]))
    with pytest.raises(InputError, match="does not exist"):
        next(flight_log.pieces(tmp_path / "none.parquet"))


def test_time_that_goes_back_from_one_piece_to_the_next_is_refused(tmp_path, monkeypatch):
    import pyarrow as pa
    import pyarrow.parquet as pq

    monkeypatch.setattr(flight_log, "PIECE_ROWS", 2)
    path = tmp_path / "f.parquet"
    flight_log.save(path, example_log())
    table = pq.read_table(path)
    jumping = table.set_column(0, "time_s", pa.array([0.0, 1.0, 0.5, 2.0, 3.0]))
    pq.write_table(jumping.replace_schema_metadata(table.schema.metadata), path, row_group_size=2)
    with pytest.raises(InputError, match=r"time does not increase \(1\.000000 s, then 0\.500000 s\)"):
        list(flight_log.pieces(path))


def test_a_missing_quantity_of_a_log_is_named():
    log = example_log()
    assert log.has("position_world_m")
    assert not log.has("rotor_speed_rad_s")
    with pytest.raises(InputError, match="rotor_speed_0_rad_s"):
        log.vector("rotor_speed_rad_s")
    assert len(log.slice(0.01, 0.03)) == 2


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ({"x_m": np.zeros(3)}, "needs a column time_s"),
        ({"time_s": np.zeros(3)}, "does not increase at row 1"),
        ({"time_s": np.array([0.0, np.nan])}, "not finite"),
        ({"time_s": np.arange(3.0), "speed_rpm": np.zeros(3)}, "names no unit"),
        ({"time_s": np.arange(3.0), "x_m": np.zeros(2)}, "3 rows"),
    ],
)
def test_an_inconsistent_log_is_refused(columns, word):
    with pytest.raises(InputError, match=word):
        FlightLog(columns, {})


@pytest.mark.parametrize("damage", ["cut", "foreign", "newer"])
def test_a_damaged_log_is_refused(tmp_path, damage):
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "f.parquet"
    flight_log.save(path, example_log())
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-50])
    else:
        header = {"format": "goshawk-flight-log" if damage == "newer" else "x", "version": 99, "metadata": {}}
        table = pa.table({"time_s": [0.0]}).replace_schema_metadata({"goshawk": json.dumps(header)})
        pq.write_table(table, path)
    with pytest.raises(FormatError):
        flight_log.load(path)
    with pytest.raises(FormatError):
        list(flight_log.pieces(path))


def test_a_project_opens_where_it_was_made(tmp_path):
    made = project.create(tmp_path / "p", "barn")
    assert project.create(tmp_path / "p", "other").name == "barn"
    assert project.open_project(made.folder) == made
    with pytest.raises(InputError, match=r"no project\.toml"):
        project.open_project(tmp_path)


def test_waypoints_read_back_with_free_headings(tmp_path):
    points = project.Waypoints(np.arange(6.0).reshape(2, 3), np.array([np.nan, 1.0]))
    project.save_waypoints(tmp_path / "w.json", points)
    back = project.load_waypoints(tmp_path / "w.json")
    np.testing.assert_array_equal(back.positions_world_m, points.positions_world_m)
    np.testing.assert_array_equal(back.yaw_rad, points.yaw_rad)


def test_a_waypoint_that_is_not_finite_is_named():
    with pytest.raises(InputError, match="waypoint 2 is not finite"):
        project.Waypoints(np.array([[0.0, 0, 0], [0, np.nan, 0]]), np.zeros(2))


def test_json_holds_null_for_numbers_that_are_not_finite_and_lists_them():
    document = {"a": [1.0, np.float64("inf")], "b": {"c": float("nan")}, "d": np.arange(2), "e": True}
    text = file_format.json_text(document)
    found = json.loads(text, parse_constant=pytest.fail)
    assert found["a"] == [1.0, None]
    assert (found["b"]["c"], found["d"], found["e"]) == (None, [0, 1], True)
    assert found["not_finite"] == {"a[1]": "inf", "b.c": "nan"}
    assert "not_finite" not in json.loads(file_format.json_text({"a": 1.0}))


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda: {}["segments"], "the key 'segments' is missing"),
        (lambda: float("long"), "'long' is not a number"),
        (lambda: int("wide"), "'wide' is not a whole number"),
        (lambda: np.array([[1.0], [1.0, 2.0]], dtype=np.float64), "too few entries where a number is expected"),
        (lambda: np.arange(8.0).reshape(-1, 3), "a point has three numbers"),
        (lambda: dict("word"), "keys and values is expected"),
    ],
)
def test_damage_is_described_in_words_of_the_file(read, words):
    with pytest.raises(Exception) as raised:
        read()
    assert words in file_format.damage_text(raised.value)


def test_what_is_being_written_is_no_part_of_a_project_yet(tmp_path):
    (tmp_path / "project.toml").touch()
    for folder, name in (("flights", "lap.parquet"), ("trajectories", "walk.json")):
        (tmp_path / folder).mkdir()
        for written in (name, f"..{name}.abc{Path(name).suffix}"):
            (tmp_path / folder / written).write_bytes(b"")
    opened = project.Project(tmp_path, "room")
    assert opened.flights() == [tmp_path / "flights" / "lap.parquet"]
    assert opened.trajectories() == [tmp_path / "trajectories" / "walk.json"]
