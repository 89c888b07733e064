"""A blackbox log that Betaflight itself wrote of a body with known truth is read, checked and fitted."""

import json

import numpy as np
import pytest

import vehicle
from firmware_bridge.betaflight_sitl import firmware
from sysid.logs.readers import read_blackbox
from tests import waiting
from tests.firmware_bridge.betaflight import stick_flight

pytestmark = pytest.mark.slow
COMMANDS = np.array([0.3, 0.5, 0.7, 0.9])
INERTIAS = tuple(f"inertia_{2 * axis}_kg_m2" for axis in "xyz")
LAGS = ("motor_lag.rise_s", "motor_lag.fall_s")
IDLE = 0.055
"""Output of the firmware at a logged command of 0."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    try:
        firmware.program()
    except firmware.UnavailableError as reason:
        pytest.skip(str(reason))
    return stick_flight.fly(tmp_path_factory.mktemp("betaflight"), np.random.default_rng(3))


@pytest.fixture(scope="module")
def log(flown):
    return read_blackbox.read(flown.log)


@pytest.fixture(scope="module")
def fitted(flown):
    """What the command line says of the fit, and the vehicle file that it writes."""
    folder = flown.log.parent
    (folder / "diff.txt").write_text(flown.settings)
    said = {"--mass": stick_flight.MASS_KG, "--arm": stick_flight.ARM_M, "--prop-diameter": stick_flight.PROPELLER_M}
    options = [word for option in said.items() for word in option]
    done = waiting.goshawk("vehicle", "new", folder / "my.toml", "--import", folder / "diff.txt", *options)
    assert done.returncode == 0, done.stderr
    out = ("--vehicle", folder / "my.toml", "--out", folder / "fitted.toml", "--json")
    done = waiting.goshawk("identify", flown.log, *out)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), vehicle.load(folder / "fitted.toml")


def test_the_firmware_flies_the_body_and_lands_it(flown):
    height_m = flown.position_world_m[:, 2]
    assert 20.0 < height_m.max() < 40.0
    assert height_m[-1] == pytest.approx(0.0, abs=0.05)


def test_every_frame_of_the_real_encoder_is_read(flown, log):
    assert "lost" not in log.metadata
    armed_s = stick_flight.ENDS_S[6] - stick_flight.ENDS_S[0]
    assert log.time_s[-1] == pytest.approx(armed_s, abs=0.3)
    assert np.diff(log.time_s) == pytest.approx(0.0005, rel=0.01)
    sampled = np.column_stack([np.interp(log.time_s[::2], log.time_s, g) for g in log.vector("rate_body_rad_s").T])
    begins = range(round((stick_flight.ENDS_S[0] - 0.2) * 1000), round((stick_flight.ENDS_S[0] + 0.2) * 1000))
    length = min(len(sampled), len(flown.rate_body_rad_s) - begins.stop)
    errors = [np.abs(sampled[:length] - flown.rate_body_rad_s[b : b + length]).mean() for b in begins]
    assert min(errors) < 0.07  # its noise and shaking; turned axes or another unit are rad/s off
    for name in (f"motor_command_{i}_ratio" for i in range(4)):
        assert (log.columns[name].min(), log.columns[name].max()) == pytest.approx((0.0, 1.0), abs=0.15)


def test_the_checks_find_no_fault_in_it(flown, fitted):
    done = waiting.goshawk("log", "check", flown.log, "--vehicle", flown.log.parent / "my.toml")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_fit_to_it_finds_the_body(flown, fitted):
    document, found = fitted
    truth = flown.truth
    assert document["verdict"]["use"] == "usable"
    for name in (*INERTIAS, *LAGS):
        assert found.value(name) == pytest.approx(truth.value(name), rel=0.02), name
    for name in LAGS:
        estimate = document["parameters"][name]
        assert abs(estimate["value"] - truth.value(name)) < estimate["interval90"]
    fastest = vehicle.load(flown.log.parent / "my.toml").limits.rotor_speed_max_rad_s
    speeds = stick_flight.FULL_RAD_S * (IDLE + (1.0 - IDLE) * COMMANDS), fastest * COMMANDS
    assert static_thrust_n(found, speeds[1]) == pytest.approx(static_thrust_n(truth, speeds[0]), rel=0.02)


def static_thrust_n(quad: vehicle.Vehicle, speed_rad_s: np.ndarray) -> np.ndarray:
    """Of one rotor in air at rest."""
    k, slope = quad.value("thrust_quadratic.k_n_s2"), quad.value("thrust_affine.slope_n_s")
    return k * speed_rad_s**2 + slope * speed_rad_s + quad.value("thrust_affine.constant_n")


def test_cut_and_damaged_copies_are_read_as_far_as_they_go(flown, log, tmp_path):
    content, gyro = flown.log.read_bytes(), log.vector("rate_body_rad_s")
    (tmp_path / "cut.bfl").write_bytes(content[: 6 * len(content) // 10])
    cut = read_blackbox.read(tmp_path / "cut.bfl")
    assert 0.5 < len(cut) / len(log) < 0.7
    assert (cut.vector("rate_body_rad_s") == gyro[: len(cut)]).all()
    damaged, rng = bytearray(content), np.random.default_rng(5)
    for place in rng.integers(len(content) // 10, len(content), 20):
        damaged[place] ^= int(rng.integers(1, 256))
    (tmp_path / "damaged.bfl").write_bytes(damaged)
    rest = read_blackbox.read(tmp_path / "damaged.bfl")
    assert "damaged at byte" in rest.metadata["lost"]
    assert len(rest) > 0.95 * len(log)
    rows = np.searchsorted(log.time_s, rest.time_s - 2.5e-4).clip(max=len(log) - 1)
    assert (rest.vector("rate_body_rad_s") == gyro[rows]).all(axis=1).mean() > 0.99
