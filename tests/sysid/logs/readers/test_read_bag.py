"""ROS recordings of both generations arrive in our frames and units; what is missing is said."""

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from flight import FormatError, InputError
from sysid.logs.reading import read_log

MAP = """
format = "goshawk-bag-map"
version = 1
[pose]
topic = "/mocap"
[imu]
topic = "/imu"
[quantity.rotor_speed_rad_s]
topic = "/esc"
fields = ["data[1]", "data[0]", "data[2]", "data[3]"]
unit = "rpm"
[scalar.battery_v]
topic = "/battery"
fields = ["data"]
[metadata]
name = "loop"
"""
START_NS = 1_700_000_000_000_000_000
COUNT = 20


@pytest.fixture
def map_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    return path


def record(path, kind: str, pose_type: str = "geometry_msgs/msg/PoseStamped"):
    """Poses at 100 Hz, IMU at 200 Hz, rotor speeds half-way between poses, battery at each pose."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    types = store.types
    if kind == "bag":
        writer = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)

    def message(name, **fields):
        return types[name](**fields)

    def header(t_ns):
        stamp = message("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        more = {"seq": 0} if kind == "bag" else {}
        return message("std_msgs/msg/Header", stamp=stamp, frame_id="world", **more)

    def vector(x, y, z, name="geometry_msgs/msg/Vector3"):
        return message(name, x=x, y=y, z=z)

    with writer:
        names = {
            "/mocap": pose_type,
            "/imu": "sensor_msgs/msg/Imu",
            "/esc": "std_msgs/msg/Float64MultiArray",
            "/battery": "std_msgs/msg/Float64",
        }
        lines = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in names.items()}

        def write(topic, t_ns, value):
            serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
            writer.write(lines[topic], t_ns, serialize(value, names[topic]))

        layout = message("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
        turned = message("geometry_msgs/msg/Quaternion", x=0.6, y=0.0, z=0.0, w=0.8)
        for i in range(COUNT):
            t = START_NS + 10_000_000 * i
            pose = message(
                "geometry_msgs/msg/Pose", position=vector(i, 2.0, 3.0, "geometry_msgs/msg/Point"), orientation=turned
            )
            if pose_type.endswith("Odometry"):
                zeros = np.zeros(36)
                still = message("geometry_msgs/msg/Twist", linear=vector(0, 0, 0), angular=vector(0, 0, 0))
                stamped = message(
                    pose_type,
                    header=header(t),
                    child_frame_id="body",
                    pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=zeros),
                    twist=message("geometry_msgs/msg/TwistWithCovariance", twist=still, covariance=zeros),
                )
            else:
                stamped = message(pose_type, header=header(t), pose=pose)
            write("/mocap", t + 3_000_000, stamped)  # received 3 ms later than stamped
            write("/battery", t, message("std_msgs/msg/Float64", data=16.0))
            data = np.array([60.0, 120.0, 180.0, 240.0])
            write("/esc", t + 5_000_000, message("std_msgs/msg/Float64MultiArray", layout=layout, data=data))
            for half in (0, 5_000_000):
                imu = message(
                    "sensor_msgs/msg/Imu",
                    header=header(t + half),
                    orientation=turned,
                    orientation_covariance=np.zeros(9),
                    angular_velocity=vector(0.1 * i, 0.0, 0.0),
                    angular_velocity_covariance=np.zeros(9),
                    linear_acceleration=vector(0.0, 0.0, 9.8),
                    linear_acceleration_covariance=np.zeros(9),
                )
                write("/imu", t + half, imu)
    return path


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
@pytest.mark.parametrize("pose_type", ["geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry"])
def test_every_stream_arrives_at_its_instant(tmp_path, map_file, kind, pose_type):
    path = record(tmp_path / ("r.bag" if kind == "bag" else "recording"), kind, pose_type)
    log = read_log(path, map_file)
    posed = np.isfinite(log.vector("position_world_m")).all(axis=1)
    turning = np.isfinite(log.vector("rotor_speed_rad_s")).all(axis=1)
    np.testing.assert_allclose(log.time_s[posed], 0.01 * np.arange(COUNT), atol=1e-9)
    np.testing.assert_allclose(log.time_s[turning], 0.01 * np.arange(COUNT - 1) + 0.005, atol=1e-9)
    np.testing.assert_allclose(log.vector("position_world_m")[posed][:, 0], np.arange(COUNT))
    np.testing.assert_allclose(log.vector("q_world_body")[posed], [[0.8, 0.6, 0.0, 0.0]] * COUNT)
    np.testing.assert_allclose(log.vector("rate_body_rad_s")[posed][:, 0], 0.1 * np.arange(COUNT))
    np.testing.assert_allclose(
        log.vector("rotor_speed_rad_s")[turning][0], 2.0 * np.pi * np.array([2.0, 1.0, 3.0, 4.0])
    )
    assert log.columns["battery_v"][posed][3] == pytest.approx(16.0)
    assert log.metadata["name"] == "loop"


def test_a_single_file_of_a_folder_is_read_too(tmp_path, map_file):
    folder = record(tmp_path / "recording", "mcap")
    (file,) = folder.glob("*.mcap")
    assert len(read_log(file, map_file)) == len(read_log(folder, map_file))


def test_z_down_is_flipped(tmp_path, map_file):
    map_file.write_text(MAP.replace('topic = "/mocap"', 'topic = "/mocap"\nframe = "z down"'))
    log = read_log(record(tmp_path / "recording", "mcap"), map_file)
    np.testing.assert_allclose(log.vector("position_world_m")[0], [0.0, -2.0, -3.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"/mocap"', '"/vicon"', "no topic /vicon; it has /battery"),
        ('"data[1]"', '"data[9]"', "no number at data\\[9\\]"),
        ('"data[1]", ', "", "needs 4 fields"),
        ('"rpm"', '"furlong"', "furlong"),
        ('topic = "/imu"', 'topic = "/esc"', "an IMU comes as"),
        ("[quantity.rotor_speed_rad_s]", "[quantity.wings]", "unknown quantity wings"),
    ],
)
def test_what_the_map_gets_wrong_is_said(tmp_path, map_file, old, new, said):
    map_file.write_text(MAP.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        read_log(record(tmp_path / "recording", "mcap"), map_file)


@pytest.mark.parametrize("name", ["broken.bag", "broken.mcap", "broken.db3"])
def test_a_broken_file_is_a_sentence_with_and_without_a_map(tmp_path, map_file, name):
    path = tmp_path / name
    path.write_bytes(b"not a recording")
    with pytest.raises(FormatError, match="not a readable ROS recording"):
        read_log(path, map_file)
    with pytest.raises(FormatError, match="not a readable ROS recording"):
        read_log(path)
