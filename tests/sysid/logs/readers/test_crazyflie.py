"""Crazyflie's logs: the SD card's binary and cfclient's CSV arrive alike, without a column map."""

import re
import struct
import zlib

import numpy as np
import pytest

from flight import FlightError, rotations
from sysid.logs.reading import read_log
from sysid.logs.sensors import low_pass

ROWS = 300
TIME_S = 0.01 * np.arange(ROWS)
ROLL, PITCH, YAW = (0.2 * np.sin(TIME_S + k) for k in range(3))
VALUES = {
    "stateEstimate.x": np.sin(TIME_S), "stateEstimate.y": np.cos(TIME_S), "stateEstimate.z": 1.0 + 0.1 * TIME_S,
    "stateEstimate.vx": np.cos(TIME_S), "stateEstimate.vy": -np.sin(TIME_S), "stateEstimate.vz": 0.1 + 0.0 * TIME_S,
    "stabilizer.roll": np.rad2deg(ROLL), "stabilizer.pitch": -np.rad2deg(PITCH), "stabilizer.yaw": np.rad2deg(YAW),
    "gyro.x": 10.0 * np.sin(TIME_S), "gyro.y": 5.0 * np.cos(TIME_S), "gyro.z": 1.0 + 0.0 * TIME_S,
    "acc.x": 0.0 * TIME_S, "acc.y": 0.01 + 0.0 * TIME_S, "acc.z": 1.0 + 0.0 * TIME_S,
    "motor.m1": np.rint(30000 + 10000 * np.sin(TIME_S)), "motor.m2": 31000 + 0 * TIME_S,
    "motor.m3": 32000 + 0 * TIME_S, "motor.m4": 33000 + 0 * TIME_S,
    "pm.vbat": 4.0 - 0.01 * TIME_S,
}  # fmt: skip
TYPES = {name: "H" if name.startswith("motor") else "f" for name in VALUES}


def sd_card(version: int = 2) -> bytes:
    head = struct.pack("<BHHH", 0xBC, version, 2, 7) + b"fixedFrequency\0" + struct.pack("<H", len(VALUES))
    head += b"".join(f"{name}({TYPES[name]})".encode() + b"\0" for name in VALUES)
    head += struct.pack("<H", 9) + b"other\0" + struct.pack("<H", 1) + b"a.b(I)\0"
    packed = struct.Struct("<" + "".join(TYPES.values()))
    body = b""
    for k in range(ROWS):
        stamp = struct.pack("<HQ", 7, 4_000_000 + 10_000 * k) if version == 2 else struct.pack("<HI", 7, 4000 + 10 * k)
        row = [values[k] for values in VALUES.values()]
        body += stamp + packed.pack(*(int(v) if t == "H" else v for v, t in zip(row, TYPES.values(), strict=True)))
        if k % 10 == 0:
            body += (b"\x09\0" + stamp[2:]) + struct.pack("<I", k)
    return head + body + struct.pack("<I", zlib.crc32(head + body))


def check(log) -> None:
    assert len(log) == ROWS
    np.testing.assert_allclose(log.time_s - log.time_s[0], TIME_S, atol=1e-9)
    np.testing.assert_allclose(log.columns["position_world_y_m"], np.cos(TIME_S), atol=1e-6)
    np.testing.assert_allclose(log.columns["velocity_world_x_m_s"], np.cos(TIME_S), atol=1e-6)
    np.testing.assert_allclose(log.columns["rate_body_x_rad_s"], np.deg2rad(10.0) * np.sin(TIME_S), atol=1e-6)
    np.testing.assert_allclose(log.columns["specific_force_body_z_m_s2"], 9.80665, rtol=1e-6)
    np.testing.assert_allclose(log.columns["motor_command_0_ratio"], VALUES["motor.m1"] / 65535, rtol=1e-6)
    np.testing.assert_allclose(log.columns["battery_v"], VALUES["pm.vbat"], rtol=1e-6)
    R = rotations.matrix(log.vector("q_world_body"))
    np.testing.assert_allclose(-np.arcsin(R[:, 2, 0]), PITCH, atol=1e-6)  # Crazyflie's pitch has the other sign
    np.testing.assert_allclose(np.arctan2(R[:, 2, 1], R[:, 2, 2]), ROLL, atol=1e-6)


@pytest.mark.parametrize("version", [1, 2])
def test_the_sd_cards_log_arrives_in_our_units(tmp_path, version):
    (tmp_path / "log00").write_bytes(sd_card(version))
    log = read_log(tmp_path / "log00")
    check(log)
    assert "lost" not in log.metadata
    assert log.metadata["rotor_places"] == ["front right", "rear right", "rear left", "front left"]


def test_the_accelerometer_is_behind_the_firmwares_low_pass(tmp_path):
    """What it feels at 30 Hz arrives with half its power."""
    (tmp_path / "log00").write_bytes(sd_card())
    found = low_pass.of(read_log(tmp_path / "log00"))
    assert found is not None
    s = 2j * np.pi * 30.0 / found.natural_rad_s
    assert abs(1.0 / (1.0 + 2.0 * found.damping * s + s**2)) == pytest.approx(np.sqrt(0.5))


def test_a_csv_of_log_variables_needs_no_map(tmp_path):
    rows = [",".join(["Timestamp", *VALUES])]
    rows += [",".join([str(4000 + 10 * k), *(f"{v[k]:.9g}" for v in VALUES.values())]) for k in range(ROWS)]
    (tmp_path / "estimate.csv").write_text("\n".join(rows) + "\n")
    log = read_log(tmp_path / "estimate.csv")
    check(log)
    assert log.metadata["drafted"][0] == "time: Timestamp, unit ms"


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_cut_log_says_where_it_ends(tmp_path, share):
    content = sd_card()
    end = int(share * len(content))
    (tmp_path / "log01").write_bytes(content[:end])
    log = read_log(tmp_path / "log01")
    assert len(log) == pytest.approx(share * ROWS, abs=0.05 * ROWS)
    assert f"of {end}" in log.metadata["lost"]


@pytest.mark.parametrize("back", range(2000, 2080, 8))
def test_a_flipped_byte_costs_a_record_at_most_and_is_told(tmp_path, back):
    content = bytearray(sd_card())
    content[-back] ^= 0x10
    (tmp_path / "log02").write_bytes(content)
    log = read_log(tmp_path / "log02")
    assert len(log) >= ROWS - 2
    assert re.search("checksum|damaged", log.metadata["lost"])


@pytest.mark.parametrize(
    "content", [sd_card()[:200], sd_card()[:7] + b"\xff" * 300, b"\xbc\x02\x00\x01\x00" + b"\0" * 90]
)
def test_hostile_files_are_refused_in_a_sentence_with_their_name(tmp_path, content):
    (tmp_path / "log03").write_bytes(content)
    with pytest.raises(FlightError, match="log03"):
        read_log(tmp_path / "log03")


def test_columns_named_north_east_down_are_drafted(tmp_path):
    names = ["TimeUS", "PN", "PE", "PD", "VN", "VE", "VD", "Roll", "Pitch", "Yaw", "GyrX", "GyrY", "GyrZ"]
    table = np.column_stack([1e6 * TIME_S, TIME_S, 2.0 * TIME_S, -1.0 - TIME_S, *[0.0 * TIME_S] * 9])
    text = [",".join(names), *(",".join(f"{v:.9g}" for v in row) for row in table)]
    (tmp_path / "a.csv").write_text("\n".join(text))
    log = read_log(tmp_path / "a.csv")
    np.testing.assert_allclose(log.vector("position_world_m"), np.column_stack([TIME_S, -2 * TIME_S, 1 + TIME_S]))
    assert log.has("velocity_world_m_s")
    assert log.has("q_world_body")


def test_columns_as_euroc_names_them_are_drafted(tmp_path):
    names = ["#timestamp [ns]"]
    names += [f" p_RS_R_{a} [m]" for a in "xyz"] + [f" q_RS_{a} []" for a in "wxyz"]
    names += [f" v_RS_R_{a} [m s^-1]" for a in "xyz"] + [f" b_w_RS_S_{a} [rad s^-1]" for a in "xyz"]
    table = np.column_stack([np.sin(TIME_S), *[0.1 + TIME_S] * 2, 1 + 0 * TIME_S, *[0 * TIME_S] * 3, *[TIME_S] * 6])
    stamps = 1_403_636_579_758_555_392 + 10_000_000 * np.arange(ROWS)
    text = [",".join(names), *(",".join([str(t), *map(str, row)]) for t, row in zip(stamps, table, strict=True))]
    (tmp_path / "data.csv").write_text("\n".join(text))
    log = read_log(tmp_path / "data.csv")
    np.testing.assert_allclose(log.columns["position_world_x_m"], np.sin(TIME_S))
    assert log.has("velocity_world_m_s")
    assert log.has("q_world_body")
    assert not log.has("rate_body_rad_s")
