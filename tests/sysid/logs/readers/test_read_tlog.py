"""Telemetry logs, packed by pymavlink, arrive in our frames; cut and damaged ones too."""

import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flight import FlightError
from sysid.logs.reading import read_log

TIME_S = 0.1 * np.arange(200)
BOOT_S = 1_700_000_000.0


def encode(version: int = 2, sender: int = 1, vehicle: int = mavlink.MAV_TYPE_QUADROTOR) -> bytes:
    link = mavlink.MAVLink(None, srcSystem=sender, srcComponent=1)
    out = b""
    for k, t in enumerate(TIME_S):
        ms = 5000 + 100 * k
        messages = [
            mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, 3, 0, 0, 4, 3),
            mavlink.MAVLink_heartbeat_message(vehicle, 3, 0, 0, 4, 3),
            mavlink.MAVLink_attitude_message(ms, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
            mavlink.MAVLink_local_position_ned_message(ms, np.sin(t), t, -1.0 - t, np.cos(t), 1.0, -1.0),
            mavlink.MAVLink_scaled_imu_message(ms, 0, 0, -1000, 400, 500, 600, 0, 0, 0),
            mavlink.MAVLink_servo_output_raw_message(1000 * ms, 0, 1500, 1400, 1300, 1200, 1600, 1700, 1800, 1900),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 16000, 0, 50, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_vfr_hud_message(1.0, 1.0, 3, 4, 5.0, 6.0),
        ]
        if version == 2:
            messages.append(
                mavlink.MAVLink_esc_telemetry_1_to_4_message(
                    [20] * 4, [0] * 4, [0] * 4, [0] * 4, [6000, 5000, 4000, 3000], [k] * 4
                )
            )
            messages.append(
                mavlink.MAVLink_esc_telemetry_5_to_8_message(
                    [20] * 4, [0] * 4, [0] * 4, [0] * 4, [7000, 8000, 0, 0], [k] * 4
                )
            )
        for message in messages:
            stamp = struct.pack(">Q", round(1e6 * (BOOT_S + 0.001 * ms)) + 3000)
            out += stamp + message.pack(link, force_mavlink1=version == 1)
    return out


@pytest.mark.parametrize("version", [1, 2])
def test_telemetry_arrives_in_our_frames(tmp_path, version):
    (tmp_path / "flight.tlog").write_bytes(encode(version))
    log = read_log(tmp_path / "flight.tlog")
    rows = np.isfinite(log.columns["position_world_x_m"])
    np.testing.assert_allclose(log.time_s[rows], TIME_S, atol=1e-6)
    np.testing.assert_allclose(
        log.vector("position_world_m")[rows], np.column_stack([np.sin(TIME_S), -TIME_S, 1 + TIME_S]), atol=1e-5
    )
    np.testing.assert_allclose(log.vector("rate_body_rad_s")[rows][3], [0.4, -0.5, -0.6], atol=1e-6)
    np.testing.assert_allclose(log.vector("specific_force_body_m_s2")[rows][3], [0, 0, 9.80665], atol=1e-6)
    assert np.nanmax(log.columns["motor_command_0_ratio"]) == pytest.approx(0.5)
    assert np.nanmax(log.columns["battery_v"]) == pytest.approx(16.0)
    if version == 2:
        assert np.nanmax(log.columns["rotor_speed_1_rad_s"]) == pytest.approx(5000 * np.pi / 30)
    assert "lost" not in log.metadata


@pytest.mark.parametrize(
    ("kind", "count"),
    [(mavlink.MAV_TYPE_QUADROTOR, 4), (mavlink.MAV_TYPE_HEXAROTOR, 6), (mavlink.MAV_TYPE_VTOL_TILTROTOR, 4)],
)
def test_the_heartbeat_says_how_many_outputs_are_rotors(tmp_path, kind, count):
    (tmp_path / "flight.tlog").write_bytes(encode(vehicle=kind))
    log = read_log(tmp_path / "flight.tlog")
    commands = np.array([0.5, 0.4, 0.3, 0.2, 0.6, 0.7])[:count]
    speeds = np.array([6000, 5000, 4000, 3000, 7000, 8000])[:count] * np.pi / 30
    assert [n for n in log.columns if n.startswith("motor")] == [f"motor_command_{i}_ratio" for i in range(count)]
    for i in range(count):
        np.testing.assert_allclose(np.nanmax(log.columns[f"motor_command_{i}_ratio"]), commands[i])
    np.testing.assert_allclose(np.nanmax(log.vector("rotor_speed_rad_s"), axis=0), speeds)


def test_a_second_vehicle_is_left_out(tmp_path):
    other = encode(sender=7)
    (tmp_path / "flight.tlog").write_bytes(encode() + other[: len(other) // 4])
    assert np.isfinite(read_log(tmp_path / "flight.tlog").columns["position_world_x_m"]).sum() == len(TIME_S)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_a_cut_log_is_read_as_far_as_it_goes(tmp_path, share):
    content = encode()
    (tmp_path / "cut.tlog").write_bytes(content[: int(share * len(content))])
    log = read_log(tmp_path / "cut.tlog")
    assert log.time_s[-1] == pytest.approx(share * TIME_S[-1], abs=0.3)


def test_a_damaged_frame_is_left_out_and_told(tmp_path):
    content = bytearray(encode())
    content[len(content) // 2 + 20] ^= 0xFF
    (tmp_path / "bad.tlog").write_bytes(content)
    log = read_log(tmp_path / "bad.tlog")
    assert np.isfinite(log.columns["position_world_x_m"]).sum() >= len(TIME_S) - 2
    assert "damaged at byte" in log.metadata["lost"]


@pytest.mark.parametrize("content", [b"", b"\xfe" * 300, bytes(8) + b"\xfd" + bytes(400)])
def test_hostile_files_are_refused_in_a_sentence_with_their_name(tmp_path, content):
    (tmp_path / "x.tlog").write_bytes(content)
    with pytest.raises(FlightError, match=r"x\.tlog"):
        read_log(tmp_path / "x.tlog")
