"""Logs of other kinds arrive in our frames and units: CSV by its map, PX4 ULog, our own."""

import gzip
import re
import struct

import numpy as np
import pytest

from flight import FlightLog, FormatError, InputError, flight_log, rotations
from sysid.logs.check import check_log
from sysid.logs.readers.read_csv import from_roll_pitch_yaw
from sysid.logs.reading import read_log as read

MAP = """
format = "goshawk-csv-map"
version = 1
[time]
column = "t_ms"
unit = "ms"
[quantity.position_world_m]
columns = ["x", "y", "z"]
unit = "mm"
frame = "z down"
[quantity.q_world_body]
columns = ["qx", "qy", "qz", "qw"]
order = "x y z w"
[quantity.rotor_speed_rad_s]
columns = ["m2", "m1", "m3", "m4"]
unit = "rpm"
[scalar.battery_v]
column = "vbat"
unit = "mV"
[keep]
column = "flying"
equals = 1
[metadata]
name = "bench"
"""
HEADER = "t_ms,x,y,z,qx,qy,qz,qw,m1,m2,m3,m4,vbat,flying\n"
ROWS = ["0,1,2,3,0,0,0,1,60,120,180,240,3700,0\n", "10,1000,2000,3000,0.6,0,0,0.8,60,120,180,240,3700,1\n"]


@pytest.fixture
def map_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    return path


@pytest.mark.parametrize("packed", [False, True])
def test_csv_arrives_in_our_units_order_and_frame(tmp_path, map_file, packed):
    path = tmp_path / ("log.csv.gz" if packed else "log.csv")
    text = (HEADER + "".join(ROWS)).encode()
    path.write_bytes(gzip.compress(text) if packed else text)
    log = read(path, map_file)
    assert len(log) == 1
    assert log.time_s[0] == pytest.approx(0.01)
    np.testing.assert_allclose(log.vector("position_world_m"), [[1.0, -2.0, -3.0]])
    np.testing.assert_allclose(log.vector("q_world_body"), [[0.8, 0.6, 0.0, 0.0]])
    np.testing.assert_allclose(log.vector("rotor_speed_rad_s"), [2.0 * np.pi * np.array([2.0, 1.0, 3.0, 4.0])])
    assert log.columns["battery_v"][0] == pytest.approx(3.7)
    assert log.metadata["name"] == "bench"


@pytest.mark.parametrize("word", ["error", "1.2.3", "0x10", "-", "N/A", "null", "1 2", "12,5"])
def test_a_word_where_a_number_is_expected_is_named_with_file_line_column_and_value(tmp_path, map_file, word):
    """It was read as missing, and nobody was told."""
    rows = [*ROWS, f'20,1000,"{word}",3000,0.6,0,0,0.8,60,120,180,240,3700,1\n']
    (tmp_path / "log.csv").write_text(HEADER + "".join(rows))
    with pytest.raises(FormatError, match=rf"log\.csv, line 4, column y: '{re.escape(word)}' is not a number"):
        read(tmp_path / "log.csv", map_file)


@pytest.mark.parametrize("marker", ["", "nan", "NaN", "NA", "-nan", " "])
def test_the_markers_of_a_missing_value_are_read_as_missing(tmp_path, map_file, marker):
    rows = [*ROWS, f"20,1000,2000,3000,0.6,0,0,0.8,60,120,180,240,{marker},1\n"]
    (tmp_path / "log.csv").write_text(HEADER + "".join(rows))
    log = read(tmp_path / "log.csv", map_file)
    np.testing.assert_allclose(log.columns["battery_v"], [3.7, np.nan])


def test_words_in_columns_and_rows_that_the_map_does_not_use_do_no_harm(tmp_path, map_file):
    lines = [HEADER.strip() + ",mode", "0,err,2,3,0,0,0,1,60,120,180,240,3700,0,idle"]
    lines += ["", "# a comment", ROWS[1].strip() + ",flying"]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    assert read(tmp_path / "log.csv", map_file).time_s == pytest.approx([0.01])


@pytest.mark.parametrize("row", ["10,1000,2000", ",,,,,,,,,,,,,,", "10,1000"])
def test_a_row_of_another_length_is_named_by_its_line(tmp_path, map_file, row):
    (tmp_path / "log.csv").write_text(HEADER + "".join(ROWS) + row + "\n")
    with pytest.raises(FormatError, match=r"log\.csv, line 4: \d+ values below 14 names"):
        read(tmp_path / "log.csv", map_file)


def test_a_column_that_is_not_there_is_named(tmp_path, map_file):
    path = tmp_path / "log.csv"
    path.write_text(HEADER.replace("vbat", "other") + "".join(ROWS))
    with pytest.raises(InputError, match="no column vbat"):
        read(path, map_file)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mm", "parsec", "unknown unit"),
        ("x y z w", "w z y x", "order"),
        ("position_world_m", "place", "unknown quantity"),
    ],
)
def test_a_wrong_map_is_refused(tmp_path, map_file, old, new, message):
    map_file.write_text(MAP.replace(f'"{old}"', f'"{new}"').replace(f"quantity.{old}", f"quantity.{new}"))
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "".join(ROWS))
    with pytest.raises(InputError, match=message):
        read(path, map_file)


def test_a_csv_without_a_map_is_read_by_a_drafted_one_that_is_told(tmp_path):
    rows = "".join(f"{0.01 * i:.2f},{i},2,3,1,0,0,0,{100 + i}\n" for i in range(40))
    (tmp_path / "log.csv").write_text("time,x,y,z,qw,qx,qy,qz,other\n" + rows)
    log = read(tmp_path / "log.csv")
    np.testing.assert_allclose(log.vector("position_world_m")[2], [2.0, 2.0, 3.0])
    said = log.metadata["drafted"]
    assert said[0] == "time: time, unit s"
    assert {"position_world_m: x, y, z, unit m", "q_world_body: qw, qx, qy, qz, w x y z"} <= set(said)
    assert said[-1] == "not used: other"


def test_a_csv_of_which_nothing_can_be_drafted_is_refused(tmp_path):
    (tmp_path / "log.csv").write_text(HEADER)
    with pytest.raises(FormatError, match=r"log\.csv has 1 lines"):
        read(tmp_path / "log.csv")
    (tmp_path / "log.mcap").write_text(HEADER)
    with pytest.raises(FormatError, match=r"log\.mcap is not a readable ROS recording"):
        read(tmp_path / "log.mcap")


def test_roll_pitch_yaw_turns_about_x_then_y_then_z():
    q = from_roll_pitch_yaw(np.array([[0.1, 0.2, 0.3], [0.0, 0.0, np.pi / 2.0]]))
    np.testing.assert_allclose(rotations.rotate(q[1], [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-12)
    assert rotations.yaw(q[0]) == pytest.approx(0.3)


def test_our_own_logs_keep_their_columns_and_get_a_name(tmp_path):
    log = FlightLog({"time_s": np.arange(3.0), "battery_v": np.ones(3)}, {})
    flight_log.save(tmp_path / "a.parquet", log)
    assert read(tmp_path / "a.parquet").metadata["name"] == "a"


def _message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), kind[0]) + body


def _ulog(topics: dict[str, tuple[str, list[tuple]]]) -> bytes:
    """A minimal ULog file: per topic its fields ("float x;float y") and rows (microseconds, values...)."""
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + _message(b"B", bytes(40))
    for name, (fields, _) in topics.items():
        data += _message(b"F", f"{name}:uint64_t timestamp;{fields}".encode())
    rows = []
    for i, (name, (_, values)) in enumerate(topics.items()):
        data += _message(b"A", struct.pack("<BH", 0, i) + name.encode())
        rows += [(row[0], i, row[1:]) for row in values]
    for stamp, i, values in sorted(rows):
        data += _message(b"D", struct.pack("<HQ", i, stamp) + struct.pack(f"<{len(values)}f", *values))
    return data


def test_ulog_arrives_in_our_frames(tmp_path):
    s = np.sqrt(0.5)
    position = [(k * 20000, 1.0, 2.0, -3.0, 0.1, 0.2, -0.3) for k in range(20)]
    attitude = [(k * 5000, s, s, 0.0, 0.0) for k in range(90)]
    rate = [(k * 5000, 0.5, 0.6, 0.7) for k in range(90)]
    esc = [(k * 10000 + 3000, 600.0, -1200.0, 1800.0, 2400.0) for k in range(40)]
    content = _ulog(
        {
            "vehicle_local_position": ("float x;float y;float z;float vx;float vy;float vz;", position),
            "vehicle_attitude": ("float[4] q;", attitude),
            "vehicle_angular_velocity": ("float[3] xyz;", rate),
            "esc_fake": ("float a;float b;float c;float d;", esc),
        }
    )
    (tmp_path / "flight.ulg").write_bytes(content)
    log = read(tmp_path / "flight.ulg")
    np.testing.assert_allclose(log.vector("position_world_m")[3], [1.0, -2.0, 3.0])
    np.testing.assert_allclose(log.vector("velocity_world_m_s")[3], [0.1, -0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(log.vector("rate_body_rad_s")[3], [0.5, -0.6, -0.7], rtol=1e-6)
    # rolled right by 90 degrees about the forward axis; forward and right-down flip together
    np.testing.assert_allclose(log.vector("q_world_body")[3], [s, s, 0.0, 0.0], rtol=1e-6)
    assert log.metadata["name"] == "flight"


def test_a_ulog_that_was_cut_or_damaged_says_what_is_missing(tmp_path):
    position = [(k * 20000, 1.0, 2.0, -3.0, 0.1, 0.2, -0.3) for k in range(200)]
    attitude = [(k * 5000, 1.0, 0.0, 0.0, 0.0) for k in range(800)]
    topics = {
        "vehicle_local_position": ("float x;float y;float z;float vx;float vy;float vz;", position),
        "vehicle_attitude": ("float[4] q;", attitude),
    }
    whole = _ulog(topics)
    path = tmp_path / "flight.ulg"
    path.write_bytes(whole)
    assert "incomplete file" not in {finding.what for finding in check_log(read(path)).findings}
    for cut in (len(whole) - 1, len(whole) // 2):
        path.write_bytes(whole[:cut])
        log = read(path)
        lost = next(finding.sentence for finding in check_log(log).findings if finding.what == "incomplete file")
        assert f"ends at byte {cut}" in lost
        assert float(lost.split("after ")[1].split()[0]) == pytest.approx(log.time_s[-1], abs=0.021)
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + bytes(500) + whole[middle + 500 :])
    assert any("damaged" in finding.sentence for finding in check_log(read(path)).findings)


def test_a_file_that_is_no_ulog_is_refused(tmp_path):
    (tmp_path / "flight.ulg").write_bytes(b"hello")
    with pytest.raises(FormatError, match="not a readable ULog"):
        read(tmp_path / "flight.ulg")


def test_an_offset_is_added_in_si(tmp_path, map_file):
    map_file.write_text(MAP.replace('unit = "rpm"', 'scale = 0.5\noffset = 10.0\nunit = "rad/s"'))
    (tmp_path / "log.csv").write_text(HEADER + "".join(ROWS))
    np.testing.assert_allclose(
        read(tmp_path / "log.csv", map_file).vector("rotor_speed_rad_s"), [[70.0, 40.0, 100.0, 130.0]]
    )
