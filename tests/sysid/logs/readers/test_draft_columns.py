"""Drafted column maps: many namings are understood, units come from names or sizes, each guess has a reason."""

import tomllib

import numpy as np
import pytest

from flight import FlightLog, FormatError, InputError
from sysid.logs.motors import full_throttle, rotor_places
from sysid.logs.readers import draft_columns, read_csv
from sysid.logs.sensors import low_pass

T = np.arange(50) / 100.0


def written(tmp_path, columns: dict[str, np.ndarray], separator: str = ","):
    path = tmp_path / "log.csv"
    rows = np.column_stack(list(columns.values()))
    text = separator.join(columns) + "\n" + "\n".join(separator.join(f"{v:.9g}" for v in row) for row in rows)
    path.write_text(text + "\n")
    return path


def drafted(path):
    text = draft_columns.draft(path).text
    document = tomllib.loads(text)
    (path.parent / "map.toml").write_text(text)
    return document, read_csv.read(path, read_csv.load_map(path.parent / "map.toml"))


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", " "])
def test_every_separator_is_found_and_the_log_reads_back(tmp_path, separator):
    columns = {"t": T, "x": np.sin(T), "y": np.cos(T), "z": 1 + T}
    document, log = drafted(written(tmp_path, columns, separator))
    assert document["separator"] == separator
    np.testing.assert_allclose(log.vector("position_world_m")[:, 2], 1 + T, rtol=1e-8)


@pytest.mark.parametrize(
    ("names", "quantity"),
    [
        (("x", "y", "z"), "position_world_m"),
        (("pos_x", "pos_y", "pos_z"), "position_world_m"),
        (("mocap.x [m]", "mocap.y [m]", "mocap.z [m]"), "position_world_m"),
        (("stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz"), "velocity_world_m_s"),
        (("vel_x(m/s)", "vel_y(m/s)", "vel_z(m/s)"), "velocity_world_m_s"),
        (("gyro.x", "gyro.y", "gyro.z"), "rate_body_rad_s"),
        (("wx_radps", "wy_radps", "wz_radps"), "rate_body_rad_s"),
        (("p", "q", "r"), "rate_body_rad_s"),
        (("acc.x", "acc.y", "acc.z"), "specific_force_body_m_s2"),
        (("ref_x_m", "ref_y_m", "ref_z_m"), "setpoint_position_world_m"),
        (("m1", "m2", "m3", "m4"), "rotor_speed_rad_s"),
        (("rpm0", "rpm1", "rpm2", "rpm3"), "rotor_speed_rad_s"),
        (("qw", "qx", "qy", "qz"), "q_world_body"),
        (("roll", "pitch", "yaw"), "q_world_body"),
    ],
)
def test_names_of_many_houses_are_understood(tmp_path, names, quantity):
    size = 100.0 if "rotor" in quantity else 0.1
    columns = {"t": T} | {name: size * (i + 1) + 0.01 * np.sin(T) for i, name in enumerate(names)}
    document, _ = drafted(written(tmp_path, columns))
    assert document["quantity"][quantity]["columns"] == list(names)


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_the_clock_s_unit_follows_from_its_steps(tmp_path, factor, unit):
    document, log = drafted(written(tmp_path, {"timestamp": factor * (5.0 + T), "x": T, "y": T, "z": T}))
    assert document["time"]["unit"] == unit
    assert log.time_s[0] == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("names", "quantity", "size", "unit"),
    [
        (("x", "y", "z"), "position_world_m", 1500.0, "mm"),
        (("wx", "wy", "wz"), "rate_body_rad_s", 120.0, "deg/s"),
        (("ax", "ay", "az"), "specific_force_body_m_s2", 0.577, "g"),
        (("m1", "m2", "m3", "m4"), "rotor_speed_rad_s", 9000.0, "rpm"),
        (("m1", "m2", "m3", "m4"), "rotor_speed_rad_s", 950.0, "rad/s"),
        (("roll", "pitch", "yaw"), "q_world_body", 40.0, "deg"),
        (("vx_mmps", "vy_mmps", "vz_mmps"), "velocity_world_m_s", 1.0, "mm/s"),
        (("w_x_deg_s", "w_y_deg_s", "w_z_deg_s"), "rate_body_rad_s", 1.0, "deg/s"),
        (("vel_x_m_s", "vel_y_m_s", "vel_z_m_s"), "velocity_world_m_s", 1.0, "m/s"),
    ],
)
def test_units_come_from_the_name_or_else_from_the_size(tmp_path, names, quantity, size, unit):
    columns = {"t": T} | {name: size * (1.0 + 0.01 * np.sin(9 * T)) for name in names}
    document, _ = drafted(written(tmp_path, columns))
    assert document["quantity"][quantity]["unit"] == unit


def test_a_numbered_quaternion_is_ordered_by_which_is_near_one(tmp_path):
    columns = {"t": T, "q0": 0.01 * T, "q1": 0.02 * T, "q2": 0.0 * T, "q3": 1.0 - 0.001 * T}
    assert drafted(written(tmp_path, columns))[0]["quantity"]["q_world_body"]["order"] == "x y z w"


def test_a_vehicle_that_would_fly_underground_has_z_down(tmp_path):
    columns = {"t": T, "x": T, "y": T, "z": -1.0 - T, "qw": 1 + 0 * T, "qx": 0 * T, "qy": 0 * T, "qz": 0 * T}
    document, log = drafted(written(tmp_path, columns))
    assert document["quantity"]["position_world_m"]["frame"] == "z down"
    assert document["quantity"]["q_world_body"]["frame"] == "z down"
    assert log.vector("position_world_m")[0, 2] == pytest.approx(1.0)


def test_every_guess_has_a_reason_as_a_comment_and_unused_columns_are_named(tmp_path):
    columns = {"t": T, "x": T, "y": T, "z": T, "flux": T**2}
    path = written(tmp_path, columns)
    draft = draft_columns.draft(path)
    assert all(guess.reasons for guess in draft.guesses)
    assert all(f"# {reason}" in draft.text for guess in draft.guesses for reason in guess.reasons)
    assert draft.unused == ("flux",)
    assert "# Not used: flux" in draft.text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "0 lines"),
        ("a,b\n" + "1,2\n" * 30, "could be the time"),
        ("t;x\n" + "".join(f"{i}.0;1,5\n" for i in range(30)), "decimal commas"),
        ("".join(f"{i},2\n" for i in range(30)), "first line holds numbers"),
        ("t,t\n" + "".join(f"{i},2\n" for i in range(30)), "same name"),
        ("t,x\n" + "".join(f"{i},2{',3' * (i % 3)}\n" for i in range(30)), "same number in each"),
        ("\x00\xff", "readable CSV"),
    ],
)
def test_what_is_no_table_of_numbers_is_refused_in_one_sentence(tmp_path, text, words):
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises((InputError, FormatError), match=words):
        draft_columns.draft(path)


def test_duty_cycles_are_no_rotor_speeds(tmp_path):
    """Crazyflie's `motor.m1` counts to 65535 and stands before `rpm.m1`."""
    columns = {"t": T} | {f"motor.m{i}": 40_000.0 + T for i in range(1, 5)}
    assert "quantity" not in drafted(written(tmp_path, columns))[0]
    columns |= {f"rpm.m{i}": 16_000.0 + T for i in range(1, 5)}
    document, _ = drafted(written(tmp_path, columns))
    assert document["quantity"]["rotor_speed_rad_s"]["columns"] == [f"rpm.m{i}" for i in range(1, 5)]


@pytest.mark.parametrize("names", [[f"m{i}_pwm16" for i in (1, 2, 3, 4)], [f"motor_{i}_pwm" for i in range(4)]])
def test_motor_commands_of_sixteen_bits_become_shares_of_full_throttle(tmp_path, names):
    share = 0.5 + 0.4 * np.sin(T)
    columns = {"t": T} | {name: np.round(65535.0 * share) for name in names}
    document, log = drafted(written(tmp_path, columns))
    for i, name in enumerate(names):
        assert document["scalar"][f"motor_command_{i}_ratio"]["column"] == name
        np.testing.assert_allclose(log.columns[f"motor_command_{i}_ratio"], share, atol=1e-5)


@pytest.mark.parametrize("names", [[f"motor_{i}_pwm_us" for i in range(4)], [f"PWM{i}" for i in (1, 2, 3, 4)]])
def test_pulses_become_shares_of_full_throttle(tmp_path, names):
    share = 0.5 + 0.4 * np.sin(T)
    document, log = drafted(written(tmp_path, {"t": T} | dict.fromkeys(names, 1000.0 + 1000.0 * share)))
    assert document["scalar"]["motor_command_3_ratio"]["column"] == names[3]
    np.testing.assert_allclose(log.columns["motor_command_3_ratio"], share, atol=1e-6)


SHARE = 0.5 + 0.3 * np.sin(20.0 * T)
BETAFLIGHT = {"t": T, "gyroADC[0]": T, "gyroADC[1]": T, "gyroADC[2]": T}


@pytest.mark.parametrize("name", ["motor_{}_pwm", "pwm_{}", "motor_{}_us"])
@pytest.mark.parametrize(
    "values",
    [SHARE, 100.0 * SHARE, np.round(255.0 * SHARE), 48.0 + 1999.0 * SHARE, 3000.0 * np.sin(T) - 800.0],
    ids=["0 to 1", "percent", "8 bits", "DShot", "3000"],
)
def test_outputs_that_are_pulses_by_their_names_but_of_another_range_are_left_out(tmp_path, name, values):
    names = [name.format(i) for i in range(4)]
    document, _ = drafted(written(tmp_path, {"t": T, "x": T, "y": T, "z": T} | dict.fromkeys(names, values)))
    assert "scalar" not in document
    assert "rotor_speed_rad_s" not in document["quantity"]


@pytest.mark.parametrize("at_rest", [0.0, 900.0])
@pytest.mark.parametrize("beside", [{}, {f"eRPM[{i}]": 900.0 + T for i in range(4)}], ids=["alone", "with eRPM"])
def test_a_disarmed_motor_does_not_turn_pulses_into_dshot(tmp_path, at_rest, beside):
    pulses = np.where(np.arange(len(T)) < 3, at_rest, 1000.0 + 1000.0 * SHARE)
    _, log = drafted(written(tmp_path, {"t": T} | beside | {f"motor_{i}_pwm_us": pulses for i in range(4)}))
    np.testing.assert_allclose(log.columns["motor_command_1_ratio"][3:], SHARE[3:], atol=1e-6)
    speed = full_throttle.with_command_speeds(FlightLog(dict(log.columns), {}), 1000.0)
    assert speed.columns["rotor_speed_command_1_rad_s"][0] == 0.0


@pytest.mark.parametrize("spare", [0.0, 1500.0])
def test_outputs_that_nothing_moves_and_inputs_of_the_pilot_are_no_motors(tmp_path, spare):
    columns = {f"rc_pwm_{i}": 1500.0 + T for i in range(4)} | {f"pwm_{i}": spare + 0.0 * T for i in range(4)}
    columns |= {f"pwm_{i}": 1000.0 + 1000.0 * SHARE for i in range(4, 8)}
    document, _ = drafted(written(tmp_path, {"t": T} | columns))
    assert [document["scalar"][f"motor_command_{i}_ratio"]["column"] for i in range(4)] == [
        f"pwm_{i}" for i in range(4, 8)
    ]


def test_a_motor_that_was_not_logged_does_not_renumber_the_others(tmp_path):
    columns = {f"pwm_{i}": 1000.0 + 1000.0 * SHARE if i != 2 else np.nan * T for i in range(6)}
    assert "scalar" not in drafted(written(tmp_path, {"t": T} | columns))[0]


@pytest.mark.parametrize("values", [600.0 + 200.0 * np.sin(T), 1000.0 + 300.0 * np.sin(T)])
def test_rotor_speeds_named_as_betaflight_names_its_outputs_stay_rotor_speeds(tmp_path, values):
    document, _ = drafted(written(tmp_path, {"t": T} | {f"motor[{i}]": values for i in range(4)}))
    assert document["quantity"]["rotor_speed_rad_s"]["unit"] == "rad/s"
    assert "scalar" not in document


@pytest.mark.parametrize("values", [SHARE, 100.0 * np.round(SHARE, 1), np.round(255 * SHARE), 600.5 + T])
def test_of_betaflights_outputs_only_whole_numbers_of_dshots_range_are_taken(tmp_path, values):
    document, _ = drafted(written(tmp_path, BETAFLIGHT | {f"motor[{i}]": values for i in range(4)}))
    assert "scalar" not in document
    assert "rotor_speed_rad_s" not in document["quantity"]


def test_commands_from_0_to_1_beside_pulses_are_no_speeds_and_no_further_motors(tmp_path):
    columns = {f"motor_command_{i}": SHARE for i in range(4)}
    columns |= {f"motor_{i}_pwm_us": 1000.0 + 1000.0 * SHARE for i in range(4)}
    document, _ = drafted(written(tmp_path, {"t": T} | columns))
    assert len(document["scalar"]) == 4
    assert "quantity" not in document


@pytest.mark.parametrize("name", ["eRPM[{}]", "eRPM(/100)[{}]", "erpm{}", "eRPM{}", "motor_{}_erpm"])
@pytest.mark.parametrize("hundreds", [1.0, 100.0])
def test_electrical_revolutions_are_scaled_by_those_that_turn(tmp_path, name, hundreds):
    turning = np.where(np.arange(len(T)) > 35, 60_000.0 / hundreds, 0.0)
    _, log = drafted(written(tmp_path, {"t": T} | {name.format(i): turning for i in range(4)}))
    assert log.vector("rotor_speed_rad_s").max() == pytest.approx(60_000.0 / 7.0 * 2.0 * np.pi / 60.0, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "factor", "v"), [("vbatLatest", 100.0, 16.0), ("vbatLatest (V)", 1.0, 16.0), ("vbatLatest", 100.0, 3.9)]
)
def test_betaflights_battery_is_in_hundredths_unless_its_name_says_more(tmp_path, name, factor, v):
    _, log = drafted(written(tmp_path, BETAFLIGHT | {name: factor * v + 0.0 * T}))
    assert log.columns["battery_v"][0] == pytest.approx(v)


@pytest.mark.parametrize("one_g", [512.0, 2048.0, 4096.0])
def test_betaflights_accelerometer_is_scaled_by_its_length_and_its_low_pass_is_asked_for(tmp_path, one_g):
    columns = BETAFLIGHT | {f"accSmooth[{i}]": 1.04 * one_g * (i == 2) + 0.0 * T for i in range(3)}
    path = written(tmp_path, columns)
    _, log = drafted(path)
    assert log.vector("specific_force_body_m_s2")[0, 2] == pytest.approx(1.04 * 9.80665, rel=1e-6)
    text = draft_columns.draft(path).text
    assert "CHECK acc_1G" in text
    assert "acc_lpf_hz" in text
    named = [line[2:].strip() for line in text.splitlines() if line.startswith("#     ")]
    (path.parent / "map.toml").write_text("\n".join([text, *named]))
    assert low_pass.of(read_csv.read(path, read_csv.load_map(path.parent / "map.toml"))) is not None


def test_units_in_brackets_and_the_unfiltered_gyro_are_understood(tmp_path):
    columns = {"time (us)": 1e6 * T} | {f"gyroADC[{i}] (deg/s)": 90.0 + 0.0 * T for i in range(3)}
    columns |= {f"accSmooth[{i}] (g)": 1.0 * (i == 2) + 0.0 * T for i in range(3)}
    document, log = drafted(written(tmp_path, columns))
    assert log.vector("specific_force_body_m_s2")[0, 2] == pytest.approx(9.80665)
    assert log.vector("rate_body_rad_s")[0, 0] == pytest.approx(np.pi / 2.0)
    columns |= {f"gyroUnfilt[{i}] (deg/s)": 90.0 + 0.0 * T for i in range(3)}
    document, _ = drafted(written(tmp_path, columns))
    assert document["quantity"]["rate_body_rad_s"]["columns"][0] == "gyroUnfilt[0] (deg/s)"


@pytest.mark.parametrize("name", ["time (us)", "time"])
def test_betaflights_time_is_in_microseconds_at_any_rate(tmp_path, name):
    _, log = drafted(
        written(tmp_path, {name: 250.0 * np.arange(50)} | {k: v for k, v in BETAFLIGHT.items() if k != "t"})
    )
    assert log.time_s[-1] == pytest.approx(49.0 / 4000.0)


def test_betaflights_outputs_tell_the_places_of_four_motors(tmp_path):
    for count in (4, 6):
        columns = BETAFLIGHT | {f"motor[{i}]": 48.0 + np.round(1999.0 * SHARE) for i in range(count)}
        document, log = drafted(written(tmp_path, columns))
        assert len(document["scalar"]) == count
        assert (log.metadata.get(rotor_places.KEY) == list(rotor_places.BETAFLIGHT)) == (count == 4)


def test_settings_above_the_names_are_refused_with_a_way_out(tmp_path):
    path = written(tmp_path, BETAFLIGHT)
    path.write_text("".join(f'"setting{i}",{i}\n' for i in range(150)) + path.read_text())
    with pytest.raises(FormatError, match=r"150 lines above .*tail -n \+151"):
        draft_columns.draft(path)


def test_a_table_of_betaflights_tools_has_outputs_by_dshot_and_electrical_revolutions(tmp_path):
    share, speed = 0.5 + 0.4 * np.sin(T), 1000.0 + 300.0 * np.cos(T)
    columns = {"time (us)": np.round(1e6 * T)}
    columns |= {f"gyroADC[{i}]": np.degrees(0.1 * (i + 1)) + 0.0 * T for i in range(3)}
    columns |= {f"accSmooth[{i}]": 2048.0 * (i == 2) + 0.0 * T for i in range(3)}
    columns |= {f"motor[{i}]": 48.0 + np.round(1999.0 * share) for i in range(4)}
    columns |= {f"eRPM[{i}]": np.round(speed * 60.0 / (2.0 * np.pi) * 7.0 / 100.0) for i in range(4)}
    columns |= {"vbatLatest (V)": 16.0 - T / 100.0}
    _, log = drafted(written(tmp_path, columns))
    np.testing.assert_allclose(log.vector("rate_body_rad_s")[0], [0.1, 0.2, 0.3], rtol=1e-4)
    np.testing.assert_allclose(log.vector("specific_force_body_m_s2")[0], [0.0, 0.0, 9.80665], rtol=1e-6)
    np.testing.assert_allclose(log.columns["motor_command_2_ratio"], share, atol=1e-3)
    np.testing.assert_allclose(log.vector("rotor_speed_rad_s")[:, 1], speed, rtol=1e-3)
    assert log.has("battery_v")
