"""A drafted map of a ROS recording names the right topics with their reasons, and the recording reads back with it."""

import dataclasses
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from flight import FormatError, InputError, file_format
from flight.flight_log import rotor_columns
from sysid.logs.readers import draft_topics, read_bag
from sysid.logs.reading import read_log
from tests.sysid.logs.readers.test_read_bag import record

STORE = get_typestore(Stores.ROS2_HUMBLE)
POSE = "geometry_msgs/msg/PoseStamped"
ARRAY = "std_msgs/msg/Float64MultiArray"


def message(kind: str, values) -> object:
    """A pose at a place, four numbers, or one."""
    types = STORE.types
    if kind == ARRAY:
        layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        return types[kind](layout=layout, data=np.asarray(values, dtype=np.float64))
    if kind != POSE:
        return types[kind](data=float(values))
    stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    x, y, z = (float(v) for v in values)
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=x, y=y, z=z),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    return types[kind](header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="world"), pose=pose)


def recorded(path, topics: Mapping[str, tuple[str, object]], count: int = 5):
    """Every topic with so many equal messages."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, (kind, values) in topics.items():
            line = writer.add_connection(topic, kind, typestore=STORE)
            for i in range(count):
                writer.write(line, 10**9 + 10**7 * i, STORE.serialize_cdr(message(kind, values), kind))
    return path


def entries(path, tmp_path) -> dict:
    drafted = draft_topics.draft(path)
    file = tmp_path / "map.toml"
    file.write_text(drafted.text)
    assert all(guess.reasons for guess in drafted.guesses)
    assert all(f"# {reason}" in drafted.text for guess in drafted.guesses for reason in guess.reasons)
    return file_format.read_toml(file, format=read_bag.FORMAT, version=read_bag.VERSION)


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3"])
def test_a_recording_reads_back_with_its_drafted_map(tmp_path, kind):
    path = record(tmp_path / ("flight.bag" if kind == "bag" else "flight"), kind)
    found = entries(path, tmp_path)
    assert found["pose"]["topic"] == "/mocap"
    assert found["imu"]["topic"] == "/imu"
    assert found["quantity"]["rotor_speed_rad_s"]["fields"] == [f"data[{i}]" for i in range(4)]
    assert found["scalar"]["battery_v"]["topic"] == "/battery"
    log = read_log(path, tmp_path / "map.toml")
    assert log.has("position_world_m")
    assert np.isfinite(log.vector("rotor_speed_rad_s")).any()


def test_a_measured_pose_goes_before_an_estimate_and_a_set_point_is_none(tmp_path):
    place = (POSE, (1.0, 2.0, 3.0))
    topics = {"/goal_pose": place, "/odometry/pose": place, "/vicon/quad": place}
    assert entries(recorded(tmp_path / "bag", topics), tmp_path)["pose"]["topic"] == "/vicon/quad"
    del topics["/vicon/quad"]
    assert entries(recorded(tmp_path / "bag2", topics), tmp_path)["pose"]["topic"] == "/odometry/pose"


def test_commands_and_speeds_are_told_apart_and_ratios_are_neither(tmp_path):
    topics = {
        "/pose": (POSE, (1.0, 2.0, 3.0)),
        "/motors/ratio": (ARRAY, (0.4, 0.5, 0.6, 0.7)),
        "/motors/cmd": (ARRAY, (900.0,) * 4),
        "/motors/rpm": (ARRAY, (9000.0,) * 4),
    }
    found = entries(recorded(tmp_path / "bag", topics), tmp_path)["quantity"]
    assert found["rotor_speed_rad_s"] | {"fields": []} == {"topic": "/motors/rpm", "unit": "rpm", "fields": []}
    assert found["rotor_speed_command_rad_s"] | {"fields": []} == {
        "topic": "/motors/cmd", "unit": "rad/s", "fields": [],
    }  # fmt: skip


@pytest.mark.parametrize("count", [4, 6, 8])
def test_as_many_rotors_are_mapped_and_read_as_have_a_speed(tmp_path, count):
    speeds = tuple([9000.0 + 100.0 * i for i in range(count)] + [0.0] * (8 - count))
    path = recorded(tmp_path / "bag", {"/pose": (POSE, (1.0, 2.0, 3.0)), "/motors/rpm": (ARRAY, speeds)})
    found = entries(path, tmp_path)["quantity"]["rotor_speed_rad_s"]
    assert found["fields"] == [f"data[{i}]" for i in range(count)]
    messages = [cast(Any, message(ARRAY, speeds))] * 3
    stream = read_bag._stream("rotor_speed_rad_s", found, ARRAY, np.arange(3.0), messages)
    assert list(stream) == ["time_s", *rotor_columns("rotor_speed_rad_s", count)]
    assert stream[f"rotor_speed_{count - 1}_rad_s"] == pytest.approx(speeds[count - 1] * np.pi / 30.0)


def test_a_recording_without_motion_says_what_it_has(tmp_path):
    path = recorded(tmp_path / "bag", {"/battery": ("std_msgs/msg/Float64", 15.0)})
    with pytest.raises(InputError, match=r"no topic with a pose .* it has /battery \(std_msgs/msg/Float64\)"):
        draft_topics.draft(path)


def test_what_is_no_recording_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        draft_topics.draft(tmp_path / "none.mcap")
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\x00" * 40)
    with pytest.raises(FormatError, match="not a readable ROS recording"):
        draft_topics.draft(tmp_path / "broken.mcap")


def test_speeds_of_joints_are_those_of_rotors_without_the_sign_of_their_spin(tmp_path):
    types: Any = STORE.types
    kind = "sensor_msgs/msg/JointState"
    path = tmp_path / "flight"
    names = ["gimbal_joint", "rotor_0_joint", "rotor_1_joint", "rotor_2_joint", "rotor_3_joint"]
    speeds = np.array([0.1, 700.0, -710.0, 720.0, -730.0])
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        poses = writer.add_connection("/pose", POSE, typestore=STORE)
        joints = writer.add_connection("/joint_states", kind, typestore=STORE)
        for i in range(20):
            ns = 10**9 + 10**7 * i
            stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=10**7 * i)
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="world")
            pose = cast("Any", dataclasses.replace)(message(POSE, (0.0, 0.0, 1.0)), header=header)
            writer.write(poses, ns, STORE.serialize_cdr(pose, POSE))
            empty = np.zeros(5)
            one = types[kind](header=header, name=names, position=empty, velocity=speeds, effort=empty)
            writer.write(joints, ns, STORE.serialize_cdr(one, kind))
    found = entries(path, tmp_path)["quantity"]["rotor_speed_rad_s"]
    assert found["fields"] == [f"velocity[{i}]" for i in range(1, 5)]
    log = read_log(path, tmp_path / "map.toml")
    np.testing.assert_allclose(log.vector("rotor_speed_rad_s"), np.tile(np.abs(speeds[1:]), (len(log), 1)))
