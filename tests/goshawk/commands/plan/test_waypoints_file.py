"""Waypoints from CSV: the same as from our JSON, and every damage has its line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flight import FormatError, InputError, project
from flight.project import Waypoints
from goshawk.commands.plan import waypoints_file


@settings(suppress_health_check=[HealthCheck.too_slow])  # a busy machine is no fault
@given(st.lists(st.tuples(*[st.floats(-50, 50)] * 3, st.none() | st.floats(-3, 3)), min_size=2, max_size=9))
def test_csv_and_json_give_the_same_waypoints(tmp_path_factory, rows):
    folder = tmp_path_factory.mktemp("w")
    lines = [f"{x!r},{y!r},{z!r},{'' if yaw is None else repr(yaw)}" for x, y, z, yaw in rows]
    (folder / "w.csv").write_text("\n".join(["x_m,y_m,z_m,yaw_rad", *lines]))
    yaws = np.array([np.nan if row[3] is None else row[3] for row in rows])
    project.save_waypoints(folder / "w.json", Waypoints(np.array([row[:3] for row in rows]), yaws))
    one, other = waypoints_file.load(folder / "w.csv"), waypoints_file.load(folder / "w.json")
    np.testing.assert_array_equal(one.positions_world_m, other.positions_world_m)
    np.testing.assert_array_equal(one.yaw_rad, other.yaw_rad)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_plain_names_degrees_and_other_separators_are_read(tmp_path, separator):
    rows = [("X", "Y", "Z", "yaw_deg"), ("1", "2", "3", "90"), ("4", "5", "6", "")]
    (tmp_path / "w.csv").write_text("\n".join(separator.join(row) for row in rows))
    read = waypoints_file.load(tmp_path / "w.csv")
    assert read.positions_world_m.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert read.yaw_rad[0] == pytest.approx(np.pi / 2)
    assert np.isnan(read.yaw_rad[1])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_m,y_m\n1,2\n3,4\n", "no column z_m"),
        ("x,y,z\n1,2,3\n", r"1 waypoint\(s\); a path has at least two"),
        ("x,y,z\n1,2,3\n1,up,3\n", "line 3: y is 'up'"),
        ("x,y,z\n1,2,3\n1,2\n", "line 3: z is ''"),
        ("x,y,z\n1,2,nan\n1,2,3\n", "line 2: z is 'nan'"),
        ("x,y,z,yaw_deg,yaw_rad\n1,2,3,4,5\n1,2,3,4,5\n", "keep one"),
        ("", "no column x_m"),
        ("\xff\xfe\x00", "no text"),
    ],
)
def test_damage_is_refused_with_its_line(tmp_path, text, words):
    (tmp_path / "w.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises((InputError, FormatError), match=words):
        waypoints_file.load(tmp_path / "w.csv")
