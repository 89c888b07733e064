"""Logs of six and eight rotors: columns, readers, order and spins, and a vehicle file with another number."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from flight import FlightLog, InputError, flight_log
from flight.flight_log import from_vectors, rotor_columns
from sysid.logs.apply import apply, words
from sysid.logs.check import check_log
from sysid.logs.checks import rotor_order
from sysid.logs.checks.rotor_order import examine
from sysid.logs.events.repair import Repair
from sysid.logs.motors.full_throttle import by_limit, ratios
from sysid.logs.readers.read_ulog import _motor_values
from tests.vehicle import frames
from vehicle import allocation, draft

SPEED = "rotor_speed_rad_s"


def made(frame: str):
    return draft.draft(frames.small(frame))


def turning(truth, rng: np.random.Generator, *, own: float = 3e4) -> FlightLog:
    """Rolls, pitches and yaws, the rotors sharing what torque it takes.

    Args:
        own: standard deviation of what each rotor's squared speed (rad2/s2) does beside the mixer, which moves no body:
            no vehicle of ours flew so, it is put in by the test. Without it rotors move in a mixer's four ways alone,
            and show no order.
    """
    inertia = np.array([truth.value(f"inertia_{2 * axis}_kg_m2") for axis in "xyz"])
    by_wrench = allocation.shares(truth) if truth.rotors > 4 else None
    assert by_wrench is not None
    by_square, step_s = np.linalg.pinv(by_wrench), 0.0025
    size = np.array([[2.0], [2.0], [0.5]]) * rng.uniform(0.5, 1.0, (3, 3))
    turns, phase = 2.0 * np.pi * rng.uniform(0.5, 3.0, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    rate, squared, kept = np.zeros(3), np.full(truth.rotors, 500.0**2), []
    idle = np.eye(truth.rotors) - by_wrench @ by_square
    for i in range(6000):
        wanted = (size * np.sin(turns * i * step_s + phase)).sum(axis=1)
        demand = by_wrench @ np.r_[truth.mass_kg * 9.81, 20.0 * inertia * (wanted - rate)]
        demand += idle @ rng.normal(0.0, own, truth.rotors)
        squared = squared + (np.clip(demand, 200.0**2, 900.0**2) - squared) * step_s / 0.03
        rate = rate + step_s * ((by_square @ squared)[1:] - np.cross(rate, inertia * rate)) / inertia
        kept.append(np.r_[rate, np.sqrt(squared)])
    logged = np.array(kept[::4])
    logged += np.array([0.01] * 3 + [1.0] * truth.rotors) * rng.standard_normal(logged.shape)
    vectors = {"rate_body_rad_s": logged[:, :3], SPEED: logged[:, 3:]}
    return from_vectors(np.arange(len(logged), dtype=np.float64) * (4.0 * step_s), vectors)


def with_columns(log: FlightLog, order) -> FlightLog:
    names = log.names(SPEED)
    return FlightLog({**log.columns, **{n: log.columns[names[k]] for n, k in zip(names, order, strict=True)}}, {})


@pytest.mark.parametrize("count", [4, 6, 8])
def test_a_log_of_any_rotors_reads_back(tmp_path, count):
    values = np.arange(5.0 * count).reshape(5, count)
    log = from_vectors(np.arange(5.0), {SPEED: values})
    flight_log.save(tmp_path / "log.parquet", log)
    read = flight_log.load(tmp_path / "log.parquet")
    assert read.names(SPEED) == rotor_columns(SPEED, count)
    np.testing.assert_array_equal(read.vector(SPEED), values)


@pytest.mark.parametrize("count", [3, 9])
def test_other_numbers_of_rotors_are_no_log(count):
    with pytest.raises(InputError, match="expected shape"):
        from_vectors(np.arange(5.0), {SPEED: np.zeros((5, count))})


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (1, 0, 2, 3, 4, 5), (0, 4, 2, 3, 1, 5)])
def test_the_order_of_six_rotors_that_also_move_beside_the_mixer_is_found_and_mended(order):
    truth = made("hex")
    log = turning(truth, np.random.default_rng(1))
    shown = with_columns(log, order)
    rate = (shown.time_s, shown.vector("rate_body_rad_s"))
    found = examine(shown, rate, truth)
    assert found.order == tuple(np.argsort(order))
    assert found.spin == tuple(truth.spin)
    assert found.order is not None
    assert found.columns == rotor_columns(SPEED, 6)
    repair = Repair("rotor order", found.columns, order=found.order)
    assert words(repair).endswith("as rotors 0 to 5")
    mended = apply(shown, repair)
    np.testing.assert_array_equal(mended.vector(SPEED), log.vector(SPEED))


@pytest.mark.parametrize("noise", [True, False])
def test_six_rotors_that_one_mixer_drives_are_said_to_show_no_order(noise):
    """By the rank of their squares where speeds are exact, and by clear motion that leaves the order open."""
    log, truth = turning(made("hex"), np.random.default_rng(1), own=0.0), made("hex")
    if not noise:
        squares = log.vector(SPEED) ** 2
        by_wrench = allocation.shares(truth)
        exact = np.sqrt(squares @ np.linalg.pinv(by_wrench).T @ by_wrench.T)
        log = FlightLog({**log.columns, **dict(zip(log.names(SPEED), exact.T, strict=True))}, {})
    report = check_log(log, truth)
    assert not any(f.what.startswith("rotor") for f in report.findings)
    (sentence,) = report.inconclusive
    assert "6 rotors that one mixer drives do not show their order" in sentence
    assert len(sentence.split()) <= 30
    still = FlightLog({**log.columns, **{name: np.full(len(log), 500.0) for name in log.names(SPEED)}}, {})
    assert "there is no motion" in rotor_order.check(still, (log.time_s, np.zeros((len(log), 3))), truth)[1][0]


@pytest.mark.parametrize("count", [5, 7])
def test_the_spins_of_an_odd_number_of_rotors_are_not_judged(count):
    rng, noise = np.random.default_rng(5), np.array([0.02, 0.02, 0.02])
    angle = 2.0 * np.pi * np.arange(count) / count
    hex_of = made("hex")
    hub = 0.16 * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    body = replace(hex_of, hub_body_m=hub, spin=np.where(np.arange(count) % 2, 1.0, -1.0))
    time_s, step_s = 0.01 * np.arange(1500, dtype=np.float64), 0.01
    squares = 500.0**2 + np.cumsum(rng.normal(0.0, 4e3, (1500, count)), axis=0) * 0.3
    squares -= squares.mean(axis=0) - 500.0**2
    torque = np.stack([squares @ hub[:, 1], -squares @ hub[:, 0], -0.02 * squares @ body.spin], axis=1)
    rate = np.cumsum(torque - torque.mean(axis=0), axis=0) * step_s * 1e-3 + noise * rng.standard_normal((1500, 3))
    log = from_vectors(time_s, {"rate_body_rad_s": rate, SPEED: np.sqrt(squares)})
    found = examine(log, (time_s, rate), body)
    assert found.order == tuple(range(count))
    assert found.spin is None
    assert any(f"those of {count} rotors never balance" in sentence for sentence in check_log(log, body).inconclusive)


def test_tilted_rotors_are_not_judged():
    truth = made("hex")
    log = with_columns(turning(truth, np.random.default_rng(1)), (1, 0, 2, 3, 4, 5))
    axis = np.tile([0.0, 0.0, 1.0], (6, 1))
    axis[:, 0] = np.where(np.arange(6) % 2, 0.4, -0.4)
    tilted = replace(truth, axis_body=axis / np.linalg.norm(axis, axis=1, keepdims=True))
    report = check_log(log, tilted)
    assert not any(f.what.startswith("rotor") for f in report.findings)
    assert "rotor order and spins: not judged, as the file's rotors are tilted" in report.inconclusive


@pytest.mark.slow
def test_the_order_of_eight_rotors_is_never_found_wrong():
    """Neighbours of eight are alike: it may stay inconclusive."""
    truth = made("octo")
    log = turning(truth, np.random.default_rng(2))
    assert examine(log, (log.time_s, log.vector("rate_body_rad_s")), truth).order in (None, tuple(range(8)))


@pytest.mark.parametrize(("log_of", "file_of"), [("hex", "octo"), ("octo", "hex"), ("hex", "x")])
def test_a_file_of_another_number_of_rotors_is_refused_at_once(log_of, file_of):
    log, other = turning(made(log_of), np.random.default_rng(3)), made(file_of)
    (found,) = [f for f in check_log(log, other).findings if f.what == "rotor count"]
    assert found.level == "error"
    assert f"the log has {made(log_of).rotors} rotors, {file_of} has {other.rotors}" in found.sentence
    with pytest.raises(InputError, match=rf"has {made(log_of).rotors} rotors, {file_of} has {other.rotors}"):
        sysid.identify([log], other)


def test_motor_commands_of_six_become_six_speeds():
    columns = {f"motor_command_{i}_ratio": np.full(5, 0.1 * (i + 1)) for i in range(6)}
    log = FlightLog({"time_s": np.arange(5.0), **columns}, {})
    assert len(ratios(log)) == 6
    speeds = by_limit(log, 1000.0).vector("rotor_speed_command_rad_s")
    np.testing.assert_allclose(speeds[0], 100.0 * np.arange(1, 7))


def test_a_ulog_has_as_many_motors_as_ever_had_a_value():
    data = {"timestamp": np.arange(3), **{f"control[{i}]": np.full(3, 0.5 if i < 6 else np.nan) for i in range(12)}}
    assert _motor_values(data, "control").shape == (3, 6)
    data |= {f"control[{i}]": np.full(3, np.nan) for i in (4, 5)}
    assert _motor_values(data, "control").shape == (3, 4)
