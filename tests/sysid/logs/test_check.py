"""Each planted fault is named with its fix; a clean log has no findings."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

import vehicle
from flight import FlightLog, frames
from flight.flight_log import COLUMNS
from sysid.estimator.flights.sampling import Signal
from sysid.logs.check import check_log as check
from vehicle import flights as vehicle_flights
from vehicle import manoeuvres

ROTORS = [f"rotor_speed_{i}_rad_s" for i in range(4)]
QUATERNION = [f"q_world_body_{i}" for i in "wxyz"]


def _changed(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **columns}, log.metadata)


def _whats(log, vehicle=None) -> dict[str, str]:
    return {f.what: f.fix for f in check(log, vehicle).findings}


def test_clean_flights_have_no_findings(campaign, log, truth):
    for one in (*campaign, log):
        report = check(one, truth)
        assert report.findings == ()
        assert report.worst == "fine"
        assert report.rate_hz == pytest.approx(100.0)


@pytest.mark.parametrize("pole_pairs", [6, 7])
def test_electrical_revolutions_are_not_taken_for_rpm(log, truth, pole_pairs):
    electrical = _changed(log, **{name: log.columns[name] * pole_pairs for name in ROTORS})
    (found,) = [f for f in check(electrical, truth).findings if f.what == "unit"]
    assert f"of a motor with {2 * pole_pairs} poles" in found.sentence
    assert found.repair is None


def test_rpm_in_a_rad_s_column(log, truth):
    rpm = _changed(log, **{name: log.columns[name] * 60.0 / (2.0 * np.pi) for name in ROTORS})
    assert "2 pi / 60" in _whats(rpm, truth)["unit"]


def test_degrees_in_the_gyro_column(log, truth):
    names = [f"rate_body_{axis}_rad_s" for axis in "xyz"]
    degrees = _changed(log, **{name: np.rad2deg(log.columns[name]) for name in names})
    assert "57.2958" in _whats(degrees, truth)["unit"]


def test_a_gyro_axis_with_the_wrong_sign(log):
    flipped = _changed(log, rate_body_y_rad_s=-log.columns["rate_body_y_rad_s"])
    assert "rate_body_y" in _whats(flipped)["frame"]


def test_a_gyro_that_comes_late(log):
    names = [f"rate_body_{axis}_rad_s" for axis in "xyz"]
    late = _changed(log, **{name: np.roll(log.columns[name], 3) for name in names})
    assert float(_whats(late)["clock"].split()[-2]) == pytest.approx(-30.0, abs=0.5)


def test_quaternions_in_another_order(log, truth):
    shuffled = _changed(log, **{q: log.columns[QUATERNION[(i + 1) % 4]] for i, q in enumerate(QUATERNION)})
    assert "x y z w" in _whats(shuffled, truth)["frame"]


def test_quaternions_from_world_to_body(log, truth):
    conjugated = _changed(log, **{name: -log.columns[name] for name in QUATERNION[1:]})
    assert "conjugate" in _whats(conjugated, truth)["frame"]


def _down(log: FlightLog) -> dict[str, np.ndarray]:
    names = [f"position_world_{axis}_m" for axis in "xyz"]
    return dict(zip(names, frames.flip_vector(log.vector("position_world_m")).T, strict=True))


def test_gravity_the_wrong_way_round(log, truth):
    """Positions with z down, alone or with the attitude, and an attitude with z down among positions with z up."""
    attitude = dict(zip(QUATERNION, frames.flip_attitude(log.vector("q_world_body")).T, strict=True))
    everything = _whats(_changed(log, **_down(log), **attitude), truth)["frame"]
    assert everything == "turn attitude and all vectors from z down (NED/FRD) to z up"
    assert "the positions from z down" in _whats(_changed(log, **_down(log)), truth)["frame"]
    assert "the attitude from NED/FRD" in _whats(_changed(log, **attitude), truth)["frame"]


def test_rotors_in_another_order(log, truth):
    order = (2, 0, 3, 1)
    shuffled = _changed(log, **{name: log.columns[ROTORS[k]] for name, k in zip(ROTORS, order, strict=True)})
    inverse = [order.index(i) for i in range(4)]
    assert str(inverse) in _whats(shuffled, truth)["rotor order"]


def test_spins_the_other_way(log, truth):
    assert "rotor spin" in _whats(log, replace(truth, spin=-truth.spin))


@pytest.mark.parametrize("rows", [4, 2, -1])
def test_rotor_speed_that_comes_late_or_early_against_the_gyro(log, truth, rows):
    late = _changed(log, **{name: np.roll(log.columns[name], rows) for name in ROTORS})
    fix = _whats(late, truth)["clock"]
    assert fix.endswith("against the gyro")
    assert float(fix.split()[4]) == pytest.approx(-10.0 * rows, abs=1.0)


@pytest.mark.parametrize("late_ms", [2.0, -5.0, 8.0])
def test_rotor_speed_late_by_less_than_a_sample_is_read_to_a_millisecond(log, truth, late_ms):
    speed = Signal.through(log.time_s, log.vector("rotor_speed_rad_s")).value(log.time_s - 1e-3 * late_ms)
    fix = _whats(_changed(log, **dict(zip(ROTORS, speed.T, strict=True))), truth)["clock"]
    assert float(fix.split()[4]) == pytest.approx(-late_ms, abs=1.0)


def test_slow_torque_that_something_else_balances_moves_no_clock(log, truth):
    """Below 1 Hz, a third of all torque: read at all frequencies it looks like rotors 30 ms later."""
    slow = sosfiltfilt(
        butter(4, 1.0, fs=100.0, output="sos"), np.random.default_rng(1).normal(size=(len(log), 2)), axis=0
    )
    slow *= 1e5 / slow.std(axis=0)
    squares = log.vector("rotor_speed_rad_s") ** 2 + slow @ np.sign([truth.hub_body_m[:, 1], -truth.hub_body_m[:, 0]])
    speed = Signal.through(log.time_s, np.sqrt(np.maximum(squares, 1e4))).value(log.time_s - 5e-3)
    pushed = _changed(log, **dict(zip(ROTORS, speed.T, strict=True)))
    assert float(_whats(pushed, truth)["clock"].split()[4]) == pytest.approx(-5.0, abs=3.0)


def test_a_controller_that_answers_its_noisy_gyro_moves_no_clock():
    """Read from smoothed streams, these rotors seem early by more than five standard errors."""
    own, path, rng = vehicle.example(), manoeuvres.make("oblique"), np.random.default_rng(7)
    tracker, noise = vehicle.tracking.Tracker(own, path), 0.02 * rng.normal(size=(1600, 1, 3))
    fleet = vehicle.simulate.Fleet(own, [vehicle.simulate.hovering(own, path.evaluate(np.zeros(1))[0, :3])])

    def answer(flown: vehicle.simulate.Fleet) -> np.ndarray:
        now = noise[round(flown.time_s / 0.005)]
        read = {"rate_body_rad_s": flown.rate_body_rad_s + now, "time_s": flown.time_s}
        read |= {name: getattr(flown, name) for name in ("position_world_m", "velocity_world_m_s", "q_world_body")}
        return tracker(cast("Any", SimpleNamespace(**read)))

    flown = vehicle_flights.fly(fleet, answer, 8.0)
    log = vehicle_flights.measure(flown, noise=vehicle_flights.Noise(gyroscope_rad_s=0.0), rng=rng)
    rates = log.vector("rate_body_rad_s") + noise[:, 0]
    names = [f"rate_body_{axis}_rad_s" for axis in "xyz"]
    noisy = _changed(log, **dict(zip(names, rates.T, strict=True)))
    assert not [f for f in check(noisy, own).findings if f.sentence.startswith("rotor speed")]


def test_rotor_speed_that_comes_late_where_there_is_no_gyro(log, truth):
    late = {name: np.roll(log.columns[name], 4) for name in ROTORS}
    blind = {name: values for name, values in log.columns.items() if not name.startswith("rate_body")}
    fix = _whats(FlightLog({**blind, **late}, log.metadata), truth)["clock"]
    assert fix.endswith("against the motion")
    assert float(fix.split()[4]) == pytest.approx(-40.0, abs=3.0)


def test_time_in_milliseconds(log):
    assert "1000" in _whats(_changed(log, time_s=1000.0 * log.time_s))["time unit"]


def test_a_gap_is_said_with_its_place(log):
    keep = (log.time_s < 4.0) | (log.time_s > 4.6)
    report = check(FlightLog({k: v[keep] for k, v in log.columns.items()}, {}))
    assert any(f.what == "gap" and "3.99" in f.sentence for f in report.findings)
    assert report.worst == "error"


def test_a_position_that_jumps(log):
    z = log.columns["position_world_z_m"].copy()
    z[500] += 0.4
    found = [f for f in check(_changed(log, position_world_z_m=z)).findings if f.what == "position excursion"]
    assert "5.00" in found[0].sentence


@pytest.mark.parametrize("name", ["position_world_z_m", "q_world_body_w", ROTORS[2]])
def test_rows_with_a_part_of_a_sample(log, name):
    values = log.columns[name].copy()
    values[[300, 301, 500]] = np.nan
    found = [f for f in check(_changed(log, **{name: values})).findings if f.what == "partial"]
    assert "in 3 rows (the first at 3.000 s)" in found[0].sentence
    assert found[0].spans == ((3.0, 3.01), (5.0, 5.0))


def test_a_frozen_channel(log):
    held = {name: log.columns[name].copy() for name in ROTORS}
    for values in held.values():
        values[300:400] = values[300]
    assert "frozen" in _whats(_changed(log, **held))
    one = {ROTORS[0]: held[ROTORS[0]]}
    assert "frozen" not in _whats(_changed(log, **one)), "a single component may repeat: its resolution may be coarse"


def test_a_position_that_never_moves_is_told_and_the_rest_is_checked(log):
    """PX4 without a fix writes zeros."""
    zero = {
        name: np.zeros(len(log))
        for quantity in ("position_world_m", "velocity_world_m_s")
        for name in COLUMNS[quantity][:2]
    }
    rising = np.gradient(log.columns["position_world_z_m"], log.time_s)
    found = check(_changed(log, **zero, velocity_world_z_m_s=rising)).findings
    assert {f.sentence for f in found if f.what == "constant"} == {f"{name} never changes" for name in zero}


def test_a_saturated_gyro(log):
    clipped = np.clip(log.columns["rate_body_x_rad_s"], -2.0, 2.0)
    assert "saturated" in _whats(_changed(log, rate_body_x_rad_s=clipped))


def test_saturated_rotors_and_accelerometer(log):
    rotors = {name: np.minimum(log.columns[name], np.quantile(log.columns[name], 0.9)) for name in ROTORS}
    assert "saturated" in _whats(_changed(log, **rotors))
    rng = np.random.default_rng(1)
    force = {f"specific_force_body_{axis}_m_s2": rng.standard_normal(len(log)) for axis in "xy"}
    force["specific_force_body_z_m_s2"] = np.minimum(9.8 + 2.0 * rng.standard_normal(len(log)), 12.0)
    assert "saturated" in _whats(_changed(log, **force))


def test_uneven_sampling(log):
    rng = np.random.default_rng(2)
    uneven = log.time_s + rng.uniform(-0.004, 0.004, len(log))
    assert "stamp samples" in _whats(_changed(log, time_s=uneven))["jitter"]


def test_nothing_is_changed_in_a_log_and_every_finding_says_what_to_do(log, truth):
    faulty = _changed(log, **{name: np.roll(log.columns[name], 4) * 60.0 / (2.0 * np.pi) for name in ROTORS})
    before = {name: values.copy() for name, values in faulty.columns.items()}
    findings = check(faulty, truth).findings
    assert findings
    assert all(f.fix and f.sentence for f in findings)
    for name, values in before.items():
        np.testing.assert_array_equal(faulty.columns[name], values)


def test_an_accelerometer_in_g_or_upside_down(log):
    rng = np.random.default_rng(0)
    noise = 0.05 * rng.standard_normal((len(log), 3))
    names = [f"specific_force_body_{axis}_m_s2" for axis in "xyz"]
    in_g = {name: noise[:, i] + (i == 2) for i, name in enumerate(names)}
    assert "9.80665" in _whats(_changed(log, **in_g))["unit"]
    downward = {name: noise[:, i] - 9.81 * (i == 2) for i, name in enumerate(names)}
    assert "accelerometer from z down" in _whats(_changed(log, **downward))["frame"]


def _with_velocity(name: str) -> FlightLog:
    """A simulated flight with the true velocity, of the centre of mass though the pose sensor sits on an arm."""
    truth = vehicle_flights.fly_trajectory(vehicle.example(), manoeuvres.make(name))
    log = vehicle_flights.measure(truth, rng=np.random.default_rng(0))
    velocity = np.stack([np.interp(log.time_s, truth.time_s, v) for v in truth.rows[:, 0, 3:6].T], axis=1)
    return _changed(log, **{f"velocity_world_{a}_m_s": velocity[:, i] for i, a in enumerate("xyz")})


@pytest.mark.parametrize("name", ["hover", "vertical", "yaw_sweep", "doublets", "rotation"])
def test_the_velocity_of_another_point_of_the_body_is_no_fault(name):
    assert "unit" not in _whats(_with_velocity(name))


@pytest.mark.parametrize("name", ["vertical", "rotation"])
def test_a_velocity_three_times_too_large_is_named(name):
    log = _with_velocity(name)
    names = [f"velocity_world_{a}_m_s" for a in "xyz"]
    tripled = _changed(log, **{n: 3.0 * log.columns[n] for n in names})
    sentences = [f.sentence for f in check(tripled).findings]
    assert any("velocity_world_z is 3.0" in s for s in sentences)


def test_a_column_without_a_number_is_a_finding_and_no_failure(log, truth):
    for names in ([f"rate_body_{a}_rad_s" for a in "xyz"], ROTORS[:1], QUATERNION):
        empty = _changed(log, **{n: np.full(len(log), np.nan) for n in names})
        assert "empty" in _whats(empty, truth)
