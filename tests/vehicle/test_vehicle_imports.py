"""Vehicle files of ArduPilot, Betaflight and drone-models; impossible vehicles are refused at the import."""

import numpy as np
import pytest

from flight import FlightError, FormatError, InputError
from goshawk.commands.learn.vehicle_new import imported, with_options
from vehicle import Vehicle, commented, draft, load, presets

DIFF = """
# version
# Betaflight / STM32F7X2 (S7X2) 4.5.1 Jul 27 2024 / 07:40:58 (77d01ba3b) MSP API: 1.46

# mixer
{mixer}
# master
set yaw_motors_reversed = {reversed}
set motor_poles = 14
"""
DRONE = """
[cf]
mass = 0.033
L = 0.0325
J = [[16.8e-6, 0.0, 0.0], [0.0, 16.8e-6, 0.0], [0.0, 0.0, 29.8e-6]]
rpm2thrust = [0.0, {linear}, 3.16e-10]
rpm2torque = [0.0, 0.0, 1.9e-12]
thrust_tau = 0.03
prop_radius = 0.0235
mixing_matrix = [[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0]]
"""
FR, FL, RR, RL = (1, -1), (1, 1), (-1, -1), (-1, 1)


def made(tmp_path, name: str, text: str, arm_m: float | None = 0.125) -> Vehicle:
    """As `goshawk vehicle new --import` makes it, written and read again."""
    (tmp_path / name).write_text(text)
    known = with_options(imported(tmp_path / name), 0.7, arm_m, None, 0.127, None, None)
    commented.write(tmp_path / "made.toml", draft.draft(known))
    return load(tmp_path / "made.toml")


def corners(vehicle: Vehicle) -> list[tuple[int, ...]]:
    return [tuple(np.sign(hub[:2]).astype(int)) for hub in vehicle.hub_body_m]


@pytest.mark.parametrize(
    ("kind", "places", "spins"),
    [
        (1, [FR, RL, FL, RR], [1, 1, -1, -1]),
        (12, [RR, FR, RL, FL], [-1, 1, 1, -1]),
        (13, [FR, FL, RL, RR], [1, -1, 1, -1]),
    ],
)
def test_ardupilots_frame_gives_order_and_spins(tmp_path, kind, places, spins):
    vehicle = made(tmp_path, "quad.param", f"FRAME_CLASS,1\nFRAME_TYPE,{kind}\nMOT_SPIN_MIN,0.15\n")
    assert corners(vehicle) == places
    assert vehicle.spin.tolist() == spins
    np.testing.assert_allclose(np.hypot(*vehicle.hub_body_m[:, :2].T), 0.125, atol=1e-5)


@pytest.mark.parametrize(("reversed_", "sign"), [("OFF", 1), ("ON", -1)])
def test_betaflights_diff_gives_order_and_spins(tmp_path, reversed_, sign):
    vehicle = made(tmp_path, "diff.txt", DIFF.format(mixer="", reversed=reversed_))
    assert corners(vehicle) == [RR, FR, RL, FL]
    assert vehicle.spin.tolist() == [-sign, sign, sign, -sign]


RATES = """
# rateprofile
rateprofile {number}
# rateprofile {number}
set roll_srate = {rate}
set pitch_srate = {rate}
set yaw_srate = 30
"""


@pytest.mark.parametrize(("number", "deg_s"), [(0, 400.0), (1, 300.0), (2, 900.0)])
def test_betaflights_rate_profile_in_use_bounds_the_turn_rates_and_is_kept_in_the_file(tmp_path, number, deg_s):
    text = DIFF.format(mixer="", reversed="OFF")
    text += "".join(RATES.format(number=n, rate=rate) for n, rate in enumerate((40, 30, 90)))
    vehicle = made(tmp_path, "diff.txt", text + f"# restore original rateprofile selection\nrateprofile {number}\n")
    assert vehicle.provenance["full_stick_rad_s"] == pytest.approx(np.deg2rad([deg_s, deg_s, 300.0]))
    raised = presets.limits(vehicle, "race")
    assert raised.rate_rad_s == pytest.approx(min(0.8 * np.deg2rad(deg_s), 14.0), rel=0.05)
    other = made(tmp_path, "diff.txt", text + "rateprofile 0\nset rates_type = BETAFLIGHT\n")
    assert "full_stick_rad_s" not in other.provenance


@pytest.mark.parametrize(
    ("lines", "deg_s", "untold"),
    [
        ("set roll_srate = 50\nset yaw_srate = 30\n", (500.0, 1998.0, 300.0), "pitch"),
        ("set roll_srate = 50\nset roll_rate_limit = 360\n", (360.0, 1998.0, 1998.0), "pitch, yaw"),
        ("set rates_type = BETAFLIGHT\nset yaw_rate_limit = 400\n", (1998.0, 1998.0, 400.0), "roll, pitch"),
    ],
)  # fmt: skip
def test_each_axis_that_betaflights_diff_tells_is_bounded_and_the_others_are_named(tmp_path, lines, deg_s, untold):
    text = DIFF.format(mixer="", reversed="OFF") + "rateprofile 0\n" + lines
    vehicle = made(tmp_path, "diff.txt", text)
    assert vehicle.provenance["full_stick_rad_s"] == pytest.approx(np.deg2rad(deg_s))
    assert f"diff.txt tells no turn rate at full stick for {untold}" in vehicle.provenance["notes"]


@pytest.mark.parametrize("name", ["quad.param", "diff.txt"])
def test_without_an_arm_the_missing_length_is_asked_for(tmp_path, name):
    text = "FRAME_CLASS,1\nFRAME_TYPE,1\n" if name == "quad.param" else DIFF.format(mixer="", reversed="ON")
    with pytest.raises(InputError, match="--arm"):
        made(tmp_path, name, text, arm_m=None)


def test_drone_models_gives_the_whole_vehicle(tmp_path):
    (tmp_path / "params.toml").write_text(DRONE.format(linear=0.0))
    vehicle = draft.draft(imported(tmp_path / "params.toml"))
    assert corners(vehicle) == [FR, RR, RL, FL]
    assert vehicle.spin.tolist() == [1, -1, 1, -1]
    assert vehicle.value("mass_kg") == pytest.approx(0.033)
    assert vehicle.value("thrust_quadratic.k_n_s2") == pytest.approx(3.16e-10 / (np.pi / 30) ** 2)


def test_an_affine_thrust_curve_lifts_the_weight_at_the_same_speed(tmp_path):
    (tmp_path / "params.toml").write_text(DRONE.format(linear=2.67e-6))
    k = draft.draft(imported(tmp_path / "params.toml")).value("thrust_quadratic.k_n_s2")
    hover_rpm = np.sqrt(0.033 * 9.80665 / 4 / k) * 30 / np.pi
    assert 2.67e-6 * hover_rpm + 3.16e-10 * hover_rpm**2 == pytest.approx(0.033 * 9.80665 / 4)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.param", "FRAME_CLASS,7\n", "FRAME_CLASS"),
        ("a.param", "FRAME_CLASS,1\nFRAME_TYPE,77\n", "FRAME_TYPE"),
        ("a.txt", "hello", "diff all"),
        ("a.txt", DIFF.format(mixer="mixer HEX6H", reversed="OFF"), "HEX6H"),
        ("a.toml", "a = 1\n", "no vehicle"),
        ("a.toml", "[", "TOML"),
        ("a.toml", DRONE.format(linear=0.0) + DRONE.format(linear=0.0).replace("[cf]", "[cf2]"), "cf, cf2"),
        ("a.toml", DRONE.format(linear=0.0).replace("0.033", '"heavy"'), "mass"),
        ("a.toml", DRONE.format(linear=0.0).replace("rpm2torque = [0.0, 0.0, 1.9e-12]", ""), "rpm2torque"),
        ("a.params", "1\t1\tCA_ROTOR_COUNT\t4\t6\n2\t1\tCA_ROTOR_COUNT\t4\t6\n", "vehicles 1 and 2"),
    ],
)
def test_what_cannot_be_modelled_is_refused_with_the_file(tmp_path, name, text, words):
    with pytest.raises((InputError, FormatError), match=words) as refused:
        made(tmp_path, name, text)
    assert name in str(refused.value)


def hubs(*places: tuple[int, int], arm_m: float = 0.1) -> np.ndarray:
    return np.column_stack([arm_m * np.array(places, dtype=float), np.zeros(4)])


@pytest.mark.parametrize(
    ("hub_body_m", "spin", "words"),
    [
        (hubs(FL, RL, RR, FR), [1, 1, 1, 1], "two each way"),
        (hubs(FL, RL, RR, FR), [1, -1, 1, 1], "two each way"),
        (hubs(FL, RL, RR, FR), [1, 1, -1, -1], "neighbours"),
        (hubs(FL, RL, RR, FR, arm_m=170.0), [-1, 1, -1, 1], "arms of"),
        (hubs(FL, FL, RR, RR), [-1, 1, -1, 1], "cannot lift and turn"),
    ],
)
def test_impossible_vehicles_are_refused(hub_body_m, spin, words):
    with pytest.raises(FlightError, match=words):
        draft.require_controllable(hub_body_m, np.array(spin, dtype=float))


def test_possible_ones_are_not():
    draft.require_controllable(hubs(FL, RL, RR, FR), np.array([-1.0, 1.0, -1.0, 1.0]))
    draft.require_controllable(hubs((1, 0), (0, 1), (-1, 0), (0, -1)), np.array([-1.0, 1.0, -1.0, 1.0]))
    long = np.array([[0.3, 0.1, 0.0], [-0.3, 0.1, 0.0], [-0.3, -0.1, 0.0], [0.3, -0.1, 0.0]])
    draft.require_controllable(long, np.array([-1.0, 1.0, -1.0, 1.0]))


def test_an_integer_saved_as_the_bits_of_a_float_is_read(tmp_path):
    rows = ["1 1 CA_ROTOR_COUNT 5.60519e-45 6"]
    for i, (x, y, km) in enumerate([(0.1, 0.1, 0.05), (-0.1, -0.1, 0.05), (0.1, -0.1, -0.05), (-0.1, 0.1, -0.05)]):
        rows += [f"1 1 CA_ROTOR{i}_PX {x} 9", f"1 1 CA_ROTOR{i}_PY {y} 9", f"1 1 CA_ROTOR{i}_KM {km} 9"]
    assert corners(made(tmp_path, "px4.params", "\n".join(rows), arm_m=None)) == [FR, RL, FL, RR]
