"""Blackbox logs arrive in our axes and units; every encoding, cut and damaged files too."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight import FlightError, rotations
from sysid.logs.readers import blackbox
from sysid.logs.reading import read_log
from sysid.logs.sensors import low_pass
from tests.sysid.logs.readers.encode_blackbox import FIELDS, NAMES, frames, header

COUNT, STEP_US = 400, 500
VALUES = st.integers(-(2**31) + 1, 2**31 - 1) | st.integers(-300, 300)


def rows() -> list[list[int]]:
    """A fifth of a second at 2 kHz."""
    k = np.arange(COUNT)
    wave = {f"gyroADC[{i}]": np.rint(400.0 * np.sin(0.02 * k + i)) for i in range(3)}
    wave |= {f"accSmooth[{i}]": np.rint(100.0 * np.sin(0.03 * k + i)) + 2048 * (i == 2) for i in range(3)}
    wave |= {f"imuQuaternion[{i}]": np.rint(12000.0 * np.sin(0.01 * k + i)) for i in range(3)}
    wave |= {f"motor[{i}]": np.rint(900.0 + 300.0 * np.sin(0.02 * k + i)) for i in range(4)}
    wave |= {f"eRPM[{i}]": np.rint(700.0 + 50.0 * np.sin(0.02 * k + i)) for i in range(4)}
    wave |= {f"axisI[{i}]": np.rint(40.0 * np.sin(0.5 * k)) ** (i + 1) for i in range(3)}
    wave |= {f"debug[{i}]": np.rint(9.0 * np.sin(0.7 * k)) ** (2 * i + 1) for i in range(3)}
    wave |= {f"setpoint[{i}]": np.rint(200.0 * np.sin(0.01 * k * (i + 1))) for i in range(4)}
    wave |= {"loopIteration": k, "time": 5_000_000 + STEP_US * k, "vbatLatest": 1650 - k // 20}
    return [[int(wave[name][i]) if name in wave else 0 for name in NAMES] for i in range(COUNT)]


@pytest.fixture(scope="module")
def content() -> bytes:
    return header() + frames(rows())


@pytest.fixture
def recorded(tmp_path, content):
    path = tmp_path / "LOG00001.BFL"
    path.write_bytes(content)
    return path


def column(name: str) -> np.ndarray:
    return np.array([row[NAMES.index(name)] for row in rows()], dtype=float)


def test_a_log_arrives_in_our_axes_and_units(recorded):
    log = read_log(recorded)
    assert len(log) == COUNT
    assert log.time_s[-1] == pytest.approx((COUNT - 1) * STEP_US * 1e-6)
    np.testing.assert_allclose(log.columns["rate_body_y_rad_s"], np.deg2rad(column("gyroADC[1]")))
    np.testing.assert_allclose(log.columns["specific_force_body_z_m_s2"], column("accSmooth[2]") / 2048 * 9.80665)
    np.testing.assert_allclose(log.columns["rotor_speed_3_rad_s"], column("eRPM[3]") * 100 / 7 * np.pi / 30)
    np.testing.assert_allclose(log.columns["motor_command_0_ratio"], (column("motor[0]") - 158) / (2047 - 158))
    np.testing.assert_allclose(log.columns["battery_v"], 0.01 * column("vbatLatest"))
    np.testing.assert_allclose(log.columns["setpoint_rate_body_x_rad_s"], np.deg2rad(column("setpoint[0]")))
    q = np.stack([column(f"imuQuaternion[{i}]") for i in range(3)], axis=1) / 32767
    apart = rotations.angle_between(log.vector("q_world_body"), np.column_stack([np.sqrt(1 - (q**2).sum(axis=1)), q]))
    assert np.max(np.minimum(apart, 2 * np.pi - apart)) < 1e-6
    assert any("no position" in sentence for sentence in log.metadata["read"])
    assert log.metadata["rotor_places"] == ["rear right", "front right", "rear left", "front left"]


@pytest.mark.parametrize(
    ("firmware", "natural_rad_s", "damping"),
    [("4.6.0 () SITL", 2.0 * np.pi * 25.0 * 1.553773974, 1.0), ("4.2.9 (abc) F7", 2.0 * np.pi * 25.0, np.sqrt(0.5))],
)
def test_the_low_pass_of_the_accelerometer_is_that_of_the_header(tmp_path, firmware, natural_rad_s, damping):
    """Both of them pass half the power at the 25 Hz that are set."""
    said = {"Firmware revision": f"Betaflight {firmware}", "acc_lpf_hz": "2500"}
    (tmp_path / "a.bbl").write_bytes(header(**said) + frames(rows()))
    found = low_pass.of(read_log(tmp_path / "a.bbl"))
    assert found is not None
    assert (found.natural_rad_s, found.damping) == (pytest.approx(natural_rad_s), pytest.approx(damping))
    s = 2j * np.pi * 25.0 / found.natural_rad_s
    assert abs(1.0 / (1.0 + 2.0 * found.damping * s + s * s)) == pytest.approx(np.sqrt(0.5))


def test_a_log_that_names_no_low_pass_has_none(recorded):
    assert low_pass.of(read_log(recorded)) is None


@given(table=st.lists(st.lists(VALUES, min_size=len(NAMES), max_size=len(NAMES)), min_size=1, max_size=6))
def test_all_numbers_come_back(tmp_path_factory, table):
    """Whatever the fields hold, in every encoding; differences of more than 32 bits cannot be written."""
    small = ("axisI", "debug", "setpoint", "vbat", "gyro", "acc", "imu", "motor")
    for k, row in enumerate(table):
        for i, name in enumerate(NAMES):
            row[i] = row[i] % 2**32 if name in ("rssi", "amperageLatest") or name.startswith("eRPM") else row[i]
            row[i] = row[i] % 8000 if name.startswith(small) else row[i] % 2**30
            row[i] = row[i] - 2**32 if row[i] >= 2**31 and FIELDS[i][1] else row[i]
        row[0], row[1] = k, 500 * k
    content = header() + frames(table, whole_every=4)
    ((begin, end),) = blackbox.flights(content)
    read = blackbox.read(tmp_path_factory.mktemp("b") / "x.bbl", content, begin, end)
    assert read.lost == ""
    for i, name in enumerate(NAMES):
        assert [row[i] for row in table] == read.fields[name].tolist(), name


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_cut_log_is_read_to_its_last_whole_frame(tmp_path, content, share):
    end = len(header()) + int(share * (len(content) - len(header())))
    (tmp_path / "cut.bbl").write_bytes(content[:end])
    log = read_log(tmp_path / "cut.bbl")
    assert len(log) == pytest.approx(share * COUNT, abs=0.1 * COUNT)
    np.testing.assert_allclose(log.columns["rate_body_x_rad_s"], np.deg2rad(column("gyroADC[0]"))[: len(log)])


def test_damage_costs_the_frames_to_the_next_whole_one(tmp_path, content):
    middle = (len(header()) + len(content)) // 2
    (tmp_path / "bad.bbl").write_bytes(content[:middle] + b"\xff" * 60 + content[middle + 60 :])
    log = read_log(tmp_path / "bad.bbl")
    assert COUNT - 40 < len(log) < COUNT
    assert "is damaged at byte" in log.metadata["lost"]
    known = np.interp(log.time_s, np.arange(COUNT) * STEP_US * 1e-6, np.deg2rad(column("gyroADC[0]")))
    assert (np.abs(log.columns["rate_body_x_rad_s"] - known) > 1e-9).mean() < 0.03


def test_a_clock_that_wraps_at_32_bits_goes_on(tmp_path):
    table = rows()
    for k, row in enumerate(table):
        row[1] = (2**32 - 100 * STEP_US + STEP_US * k) % 2**32
    (tmp_path / "wrap.bbl").write_bytes(header() + frames(table, whole_every=1))
    log = read_log(tmp_path / "wrap.bbl")
    assert log.time_s[-1] == pytest.approx((COUNT - 1) * STEP_US * 1e-6)


def test_the_longest_of_several_flights_is_read_and_told(tmp_path, content):
    short = header() + frames(rows()[:50])
    (tmp_path / "two.bbl").write_bytes(short + content)
    log = read_log(tmp_path / "two.bbl")
    assert len(log) == COUNT
    assert any(f"bytes {len(short)} to" in sentence for sentence in log.metadata["read"])


@pytest.mark.parametrize(
    "content",
    [
        header()[:60],
        header() + b"nothing",
        header(**{"Field P encoding": "1,2"}) + b"I",
        header(**{"Field I name": "a,b"}) + b"I",
        header().replace(b"Field I encoding", b"Field I encodinc"),
    ],
)
def test_hostile_files_are_refused_in_a_sentence_with_their_name(tmp_path, content):
    (tmp_path / "x.bbl").write_bytes(content)
    with pytest.raises(FlightError, match=r"x\.bbl"):
        read_log(tmp_path / "x.bbl")
