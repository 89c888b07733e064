"""ROS recordings that were cut, or never indexed, are read as far as they go; where they end is said."""

import sqlite3

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from flight import FlightError, FormatError, InputError
from sysid.logs.reading import read_log
from tests.sysid.logs.readers.test_read_bag import MAP, record


@pytest.fixture
def map_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    return path


def recorded(folder, kind: str) -> bytes:
    path = folder / ("a.bag" if kind == "bag" else f"a_{kind}")
    record(path, kind)
    return (path if kind == "bag" else next(path.glob(f"*.{kind}"))).read_bytes()


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3"])
def test_a_cut_recording_is_read_as_far_as_it_goes(tmp_path, map_file, kind):
    content = recorded(tmp_path, kind)
    (tmp_path / f"whole.{kind}").write_bytes(content)
    whole = read_log(tmp_path / f"whole.{kind}", map_file)
    end = int(0.95 * len(content))
    (tmp_path / f"cut.{kind}").write_bytes(content[:end])
    log = read_log(tmp_path / f"cut.{kind}", map_file)
    rows = len(log)
    assert rows > 5
    for name, values in log.columns.items():
        np.testing.assert_allclose(values[: rows - 2], whole.columns[name][: rows - 2], atol=1e-9, err_msg=name)
    assert f"of {end}" in log.metadata["lost"]
    assert "s after its first message" in log.metadata["lost"]
    assert "lost" not in whole.metadata


def test_a_bag_that_was_never_indexed_is_read_whole(tmp_path, map_file):
    content = bytearray(recorded(tmp_path, "bag"))
    place = content.find(b"index_pos=")
    content[place + 10 : place + 18] = bytes(8)
    (tmp_path / "killed.bag.active").write_bytes(content)
    (tmp_path / "whole.bag").write_bytes(recorded(tmp_path / "b", "bag") if (tmp_path / "b").mkdir() is None else b"")
    log, whole = read_log(tmp_path / "killed.bag.active", map_file), read_log(tmp_path / "whole.bag", map_file)
    for name, values in whole.columns.items():
        np.testing.assert_array_equal(log.columns[name], values)


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3"])
def test_a_recording_with_nothing_left_is_refused_with_its_name(tmp_path, map_file, kind):
    content = recorded(tmp_path, kind)
    for end in (20, 60, 130):
        (tmp_path / f"cut.{kind}").write_bytes(content[:end])
        with pytest.raises(FlightError, match=rf"cut\.{kind}"):
            read_log(tmp_path / f"cut.{kind}", map_file)


def test_a_type_that_the_recording_does_not_define_is_named_with_the_way_out(tmp_path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64[] speed\n", "my_msgs/msg/Rotors"))
    with Writer(tmp_path / "old", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/rotors", "my_msgs/msg/Rotors", typestore=store)
        message = store.types["my_msgs/msg/Rotors"](speed=np.ones(4))
        writer.write(topic, 1, store.serialize_cdr(message, "my_msgs/msg/Rotors"))
    base = sqlite3.connect(next((tmp_path / "old").glob("*.db3")))
    base.execute("DROP TABLE IF EXISTS message_definitions")
    base.commit()
    base.close()
    fields = (
        '[quantity.rotor_speed_rad_s]\ntopic = "/rotors"\nfields = ["speed[0]", "speed[1]", "speed[2]", "speed[3]"]\n'
    )
    (tmp_path / "map.toml").write_text('format = "goshawk-bag-map"\nversion = 1\n[imu]\ntopic = "/rotors"\n' + fields)
    with pytest.raises((InputError, FormatError), match=r"/rotors is my_msgs/msg/Rotors.*Iron"):
        read_log(tmp_path / "old", tmp_path / "map.toml")
