"""TUM files, EuRoC folders and pairs of files: by content, on their clocks."""

import numpy as np
import pytest

from flight import FlightError, FlightLog, FormatError, InputError
from flight.flight_log import COLUMNS
from sysid.logs.motors import rotor_places
from sysid.logs.readers.read_poses import joined_on_clocks
from sysid.logs.reading import read_joined, read_log

START_NS = 1_403_636_579_758_555_392
TIME_S = 0.01 * np.arange(300)


def tum(path, *, unit: float = 1.0, ending: str = "\n") -> None:
    rows = [f"{unit * (100.0 + t):.6f} {np.sin(t):.9f} {np.cos(t):.9f} 1 0 0 0.6 0.8" for t in TIME_S]
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(rows) + ending)


def euroc(folder, *, late_s: float = 0.0) -> None:
    """Pose at 100 Hz, IMU at 200 Hz."""
    pose, imu = folder / "mav0" / "state_groundtruth_estimate0", folder / "mav0" / "imu0"
    names = [f" p_RS_R_{a} [m]" for a in "xyz"] + [f" q_RS_{a} []" for a in "wxyz"]
    table = np.column_stack([np.sin(TIME_S), TIME_S, 1 + TIME_S, 1 + 0 * TIME_S, *[0 * TIME_S] * 3])
    _csv(pose, names, table, TIME_S)
    time_s = 0.005 * np.arange(600)
    names = [f"w_RS_S_{a} [rad s^-1]" for a in "xyz"] + [f"a_RS_S_{a} [m s^-2]" for a in "xyz"]
    table = np.column_stack([np.cos(time_s), time_s, 2 * time_s, 0 * time_s, 0 * time_s, 9.8 + 0.1 * time_s])
    _csv(imu, names, table, time_s + late_s)


def _csv(folder, names, table, time_s) -> None:
    folder.mkdir(parents=True)
    rows = [
        ",".join([str(START_NS + round(1e9 * t)), *map(repr, map(float, row))])
        for t, row in zip(time_s, table, strict=True)
    ]
    (folder / "data.csv").write_text("\n".join([",".join(["#timestamp [ns]", *names]), *rows]) + "\n")


@pytest.mark.parametrize("name", ["walk.tum", "walk.txt", "walk", "walk.csv"])
def test_a_tum_file_is_told_by_its_content(tmp_path, name):
    tum(tmp_path / name)
    log = read_log(tmp_path / name)
    np.testing.assert_allclose(log.columns["position_world_x_m"], np.sin(TIME_S), atol=1e-8)
    np.testing.assert_allclose(log.vector("q_world_body")[5], [0.8, 0.0, 0.0, 0.6])
    np.testing.assert_allclose(np.diff(log.time_s), 0.01, atol=1e-6)


@pytest.mark.parametrize(("unit", "word"), [(1e9, "nanoseconds"), (1e6, "microseconds"), (1e3, "milliseconds")])
def test_tum_times_in_another_unit_are_refused_with_the_unit(tmp_path, unit, word):
    tum(tmp_path / "a.tum", unit=unit)
    with pytest.raises(InputError, match=word):
        read_log(tmp_path / "a.tum")


def test_a_cut_tum_file_names_the_line(tmp_path):
    tum(tmp_path / "a.tum", ending="\n103.0 0.5 0.")
    with pytest.raises(FormatError, match=r"a\.tum, line 302: '103\.0 0\.5 0\.' is not"):
        read_log(tmp_path / "a.tum")


def test_a_euroc_folder_is_one_log_of_pose_and_imu(tmp_path):
    euroc(tmp_path / "MH_01")
    log = read_log(tmp_path / "MH_01")
    assert log.metadata["name"] == "MH_01"
    np.testing.assert_allclose(log.columns["rate_body_x_rad_s"], np.cos(log.time_s), atol=1e-4)
    np.testing.assert_allclose(log.columns["specific_force_body_z_m_s2"], 9.8 + 0.1 * log.time_s, atol=1e-4)
    np.testing.assert_allclose(log.columns["position_world_x_m"], np.sin(log.time_s), atol=1e-4)
    assert read_log(tmp_path / "MH_01" / "mav0").has("position_world_m")


def test_two_files_are_joined_on_their_clocks(tmp_path):
    euroc(tmp_path / "a", late_s=0.5)
    files = [tmp_path / "a" / "mav0" / name / "data.csv" for name in ("state_groundtruth_estimate0", "imu0")]
    log = read_joined(*files)
    known = np.isfinite(log.columns["rate_body_x_rad_s"])
    assert log.time_s[known][0] == pytest.approx(0.5, abs=1e-6)
    np.testing.assert_allclose(log.columns["rate_body_x_rad_s"][known], np.cos(log.time_s[known] - 0.5), atol=1e-4)


def test_two_clocks_are_aligned_and_what_is_faster_than_the_poses_is_averaged(tmp_path):
    """A gyro at 2 kHz, on a clock of its own, with a ripple that would fold into the poses."""
    time_s, fine_s = 0.01 * np.arange(1500), 0.0005 * np.arange(26000)
    turned = np.cumsum(np.sin(0.4 * time_s**1.6)) * 0.01
    q = np.column_stack([np.cos(0.5 * turned), 0 * turned, 0 * turned, np.sin(0.5 * turned)])
    pose = FlightLog(
        {"time_s": time_s, **dict.fromkeys(COLUMNS["position_world_m"], turned),
         **dict(zip(COLUMNS["q_world_body"], q.T, strict=True))}, {"source": "poses.tum"},
    )  # fmt: skip
    rate = np.sin(0.4 * (fine_s + 1.0) ** 1.6) + 0.5 * np.cos(2.0 * np.pi * 100.0 * (fine_s + 1.0))
    motors = {f"motor_command_{i}_ratio": 0.5 + 0.1 * np.cos(2.0 * np.pi * 100.0 * fine_s) for i in range(4)}
    gyro = dict(zip(COLUMNS["rate_body_rad_s"], (0 * rate, 0 * rate, rate), strict=True))
    imu = FlightLog({"time_s": fine_s - 7.0, **gyro, **motors}, {"source": "LOG.BFL"})
    with pytest.raises(InputError, match="no gyro"):
        joined_on_clocks(tmp_path, pose, FlightLog({"time_s": fine_s, **motors}, {}), align=True)
    log = joined_on_clocks(tmp_path, pose, imu, align=True)
    inside = (log.time_s > 1.5) & (log.time_s < 13.5)
    np.testing.assert_allclose(
        log.columns["rate_body_z_rad_s"][inside], np.sin(0.4 * log.time_s[inside] ** 1.6), atol=0.05
    )
    np.testing.assert_allclose(log.columns["motor_command_0_ratio"][inside], 0.5, atol=0.01)
    assert "+8.0" in str(log.metadata["read"]) or "+7.99" in str(log.metadata["read"])


def test_what_a_firmware_tells_of_its_motors_is_kept_where_a_pose_is_joined(tmp_path):
    imu_columns = {name: np.cos(TIME_S) for name in COLUMNS["rate_body_rad_s"]}
    imu_columns["time_s"] = START_NS * 1e-9 + TIME_S
    imu = rotor_places.with_places(FlightLog(imu_columns, {}), rotor_places.BETAFLIGHT)
    euroc(tmp_path / "a")
    pose = read_log(tmp_path / "a" / "mav0" / "state_groundtruth_estimate0" / "data.csv")
    assert tuple(joined_on_clocks(tmp_path, pose, imu).metadata[rotor_places.KEY]) == rotor_places.BETAFLIGHT


def test_files_whose_clocks_share_no_time_are_refused(tmp_path):
    euroc(tmp_path / "a", late_s=500.0)
    with pytest.raises(InputError, match="share no time"):
        read_log(tmp_path / "a")


def test_the_wrong_file_in_a_pair_is_named(tmp_path):
    euroc(tmp_path / "a")
    pose, imu = (tmp_path / "a" / "mav0" / name / "data.csv" for name in ("state_groundtruth_estimate0", "imu0"))
    with pytest.raises(InputError, match="no position"):
        read_joined(imu, pose)
    with pytest.raises(InputError, match="no gyro"):
        read_joined(pose, pose)


def test_an_empty_euroc_folder_is_refused(tmp_path):
    (tmp_path / "mav0" / "imu0").mkdir(parents=True)
    with pytest.raises(FlightError, match="neither imu0"):
        read_log(tmp_path)
