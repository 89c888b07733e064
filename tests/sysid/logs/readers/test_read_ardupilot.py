"""ArduPilot logs, written by pymavlink's own classes, arrive in our frames and units, cut and damaged ones too."""

import contextlib
import io

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

import sysid
from flight import FlightError, InputError
from flight.flight_log import FlightLog
from sysid.logs.reading import read_log
from tests.sysid.logs.readers.encode_dataflash import OURS_OF_MOTOR, encode

MOTOR_OF_OURS = [OURS_OF_MOTOR.index(i) for i in range(4)]


@pytest.fixture(scope="module")
def flight(log) -> FlightLog:
    """Two seconds with an accelerometer."""
    piece = log.slice(0.0, 2.0)
    force = {f"specific_force_body_{a}_m_s2": np.sin(k + piece.time_s) for k, a in enumerate("xyz")}
    velocity = {f"velocity_world_{a}_m_s": np.cos(k + piece.time_s) for k, a in enumerate("xyz")}
    return FlightLog({**piece.columns, **force, **velocity}, {})


@pytest.fixture(scope="module")
def content(flight) -> bytes:
    return encode(flight)


@pytest.fixture
def recorded(tmp_path, content):
    path = tmp_path / "00000042.BIN"
    path.write_bytes(content)
    return path


def as_text(path) -> str:
    """The log as lines of text, by pymavlink."""
    lines = []
    with contextlib.redirect_stdout(io.StringIO()):
        reader = DFReader_binary(str(path))
        while (message := reader.recv_msg()) is not None:
            values = message.to_dict()
            kind = values.pop("mavpackettype")
            cells = values["Columns"].split(",") if kind == "FMT" else []
            known = [*list(values.values())[:4], *cells] if kind == "FMT" else values.values()
            lines.append(", ".join([kind, *(v if isinstance(v, str) else f"{v:.9g}" for v in known)]))
    return "\n".join(lines) + "\n"


def test_a_binary_log_arrives_in_our_frames_units_and_rows(recorded, flight):
    read = read_log(recorded)
    assert len(read) == len(flight)
    for quantity, tolerance in (
        ("position_world_m", 1e-6), ("velocity_world_m_s", 1e-6), ("q_world_body", 1e-6),
        ("rate_body_rad_s", 1e-6), ("specific_force_body_m_s2", 1e-6),
    ):  # fmt: skip
        np.testing.assert_allclose(read.vector(quantity), flight.vector(quantity), atol=tolerance, rtol=1e-6)
    speeds = read.vector("rotor_speed_rad_s")[:, MOTOR_OF_OURS]
    np.testing.assert_allclose(speeds, flight.vector("rotor_speed_rad_s"), rtol=1e-6)
    assert read.columns["motor_command_0_ratio"].max() <= 1.0
    assert read.columns["battery_v"][-1] == pytest.approx(16.0 - 0.01 * flight.time_s[-1], abs=1e-5)


def test_places_of_motors_are_those_of_the_x_frame(tmp_path, recorded, flight):
    places = ["front right", "rear left", "front left", "rear right"]
    assert read_log(recorded).metadata["rotor_places"] == places
    (tmp_path / "plus.bin").write_bytes(encode(flight, frame_type=0))
    assert "rotor_places" not in read_log(tmp_path / "plus.bin").metadata


def test_the_text_form_reads_as_the_binary_one(tmp_path, recorded):
    path = tmp_path / "00000042.log"
    path.write_text(as_text(recorded))
    text, binary = read_log(path), read_log(recorded)
    for name, values in binary.columns.items():
        np.testing.assert_allclose(text.columns[name], values, rtol=1e-5, atol=1e-6, err_msg=name)


def test_the_kind_goes_by_content_not_by_ending(tmp_path, content, recorded):
    for name in ("flight.csv", "flight", "flight.parquet"):
        (tmp_path / name).write_bytes(content)
        assert len(read_log(tmp_path / name)) == len(read_log(recorded))


def test_attitude_from_angles_agrees_with_the_quaternion(tmp_path, content, flight):
    (tmp_path / "a.bin").write_bytes(content.replace(b"XKQ\0", b"OLDQ"))
    read = read_log(tmp_path / "a.bin")
    apart = np.abs((read.vector("q_world_body") * flight.vector("q_world_body")).sum(axis=1))
    assert apart.min() > np.cos(0.5 * np.deg2rad(0.02))


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_cut_log_is_read_as_far_as_it_goes_and_says_where_it_ends(tmp_path, content, flight, share):
    end = int(share * len(content))
    (tmp_path / "cut.bin").write_bytes(content[:end])
    read = read_log(tmp_path / "cut.bin")
    assert read.time_s[-1] == pytest.approx(share * flight.time_s[-1], abs=0.05)
    lost = read.metadata.get("lost", "")
    assert not lost or f"of {end}" in lost


def test_damage_in_the_middle_costs_the_messages_it_hit(tmp_path, content, flight):
    middle = len(content) // 2
    (tmp_path / "bad.bin").write_bytes(content[:middle] + bytes(range(256)) * 4 + content[middle + 1024 :])
    read = read_log(tmp_path / "bad.bin")
    assert len(read) >= len(flight) - 5
    assert "is damaged at byte" in read.metadata["lost"]


def test_one_wild_stamp_costs_one_row(tmp_path, flight):
    broken = encode(flight).replace((31_000_000 + 500_000).to_bytes(8, "little"), (2**60).to_bytes(8, "little"))
    (tmp_path / "wild.bin").write_bytes(broken)
    read = read_log(tmp_path / "wild.bin")
    assert len(read) == len(flight) - 1
    assert "wild stamp" in {event["kind"] for event in read.metadata["events"]}


@pytest.mark.parametrize(
    "content",
    [b"\xa3\x95\x80", b"\xa3\x95\x80" * 400, b"FMT, 128, 89, FMT, BBnNZ, Type\nATT, 1\n", b"\xa3\x95\x80" + bytes(86)],
)
def test_hostile_files_are_refused_in_a_sentence_with_their_name(tmp_path, content):
    (tmp_path / "x.bin").write_bytes(content)
    with pytest.raises(FlightError, match=r"x\.bin"):
        read_log(tmp_path / "x.bin")


def test_a_log_without_motion_says_what_to_log(tmp_path, content):
    for name in (b"ATT", b"XKF1", b"XKQ", b"IMU"):
        content = content.replace(name.ljust(4, b"\0"), b"Z" + name[1:].ljust(3, b"\0"))
    (tmp_path / "x.bin").write_bytes(content)
    with pytest.raises(InputError, match="shows no motion"):
        read_log(tmp_path / "x.bin")


@pytest.mark.slow
def test_a_model_is_fitted_from_ardupilot_logs(tmp_path, campaign, wrong_start, truth):
    logs = []
    for i, log in enumerate(campaign):
        (tmp_path / f"{i}.BIN").write_bytes(encode(_with_rates(log)))
        logs.append(_reordered(read_log(tmp_path / f"{i}.BIN")))
    found = sysid.identify(logs, wrong_start)
    assert found.vehicle.value("inertia_xx_kg_m2") == pytest.approx(truth.value("inertia_xx_kg_m2"), rel=0.02)
    assert found.verdict.use == "usable"


def _with_rates(log: FlightLog) -> FlightLog:
    missing = {f"rate_body_{a}_rad_s" for a in "xyz"} - set(log.columns)
    more = {f"velocity_world_{a}_m_s": np.gradient(log.columns[f"position_world_{a}_m"], log.time_s) for a in "xyz"}
    return FlightLog({**dict.fromkeys(missing, np.zeros(len(log))), **more, **log.columns}, log.metadata)


def _reordered(log: FlightLog) -> FlightLog:
    """Rotors in our order; without what the encoder made up."""
    own = {n: v for n, v in log.columns.items() if not n.startswith(("specific", "rotor", "velocity", "rate", "motor"))}
    speeds = {f"rotor_speed_{i}_rad_s": log.columns[f"rotor_speed_{m}_rad_s"] for i, m in enumerate(MOTOR_OF_OURS)}
    return FlightLog(own | speeds, log.metadata)
