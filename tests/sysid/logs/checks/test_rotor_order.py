"""Order and spins of rotors are found in a flight whatever was swapped; without excitation they are inconclusive."""

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight import FlightLog
from flight.flight_log import COLUMNS, from_vectors
from sysid.logs.check import check_log
from sysid.logs.checks import rotor_order
from sysid.logs.fix import fix
from sysid.logs.motors.full_throttle import COMMAND, RATIOS

ROTORS = [f"rotor_speed_{i}_rad_s" for i in range(4)]
RATES = [f"rate_body_{axis}_rad_s" for axis in "xyz"]


def changed(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **columns}, log.metadata)


def in_columns(log: FlightLog, order: tuple[int, ...]) -> FlightLog:
    """The log with rotor `order[i]` in column i."""
    return changed(log, **{name: log.columns[ROTORS[k]] for name, k in zip(ROTORS, order, strict=True)})


def examine(log: FlightLog, vehicle) -> rotor_order.Rotors:
    return rotor_order.examine(log, (log.time_s, log.vector("rate_body_rad_s")), vehicle)


def rolled(log: FlightLog, rows: int) -> FlightLog:
    return changed(log, **{name: np.roll(log.columns[name], rows) for name in ROTORS})


@settings(max_examples=30)
@given(
    order=st.permutations(range(4)),
    spin=st.sampled_from(list(product((-1.0, 1.0), repeat=4))),
    late_rows=st.integers(-3, 3),
    unit=st.sampled_from([1.0, 30.0 / np.pi]),
)
def test_any_order_and_any_spins_come_out_whatever_the_clock_and_the_unit(log, truth, order, spin, late_rows, unit):
    shuffled = rolled(in_columns(log, tuple(order)), late_rows)
    shuffled = changed(shuffled, **{name: unit * shuffled.columns[name] for name in ROTORS})
    found = examine(shuffled, replace(truth, spin=np.array(spin)))
    assert found.order == tuple(np.argsort(order))
    assert found.spin == tuple(truth.spin)


@pytest.mark.parametrize("late_rows", [-60, -30, 15, 60])
def test_a_clock_too_far_off_never_gives_another_order(log, truth, late_rows):
    found = examine(rolled(log, late_rows), truth)
    assert found.order in (None, (0, 1, 2, 3))
    assert found.spin in (None, tuple(truth.spin))


def test_yaw_shows_wrong_spins_where_roll_and_pitch_show_no_order(log, truth):
    """As of a vehicle whose roll and pitch balance a moment of the air that its file does not know."""
    rng = np.random.default_rng(0)
    pose = [name for name in log.columns if name.startswith(("position", "q_world"))]
    rest = FlightLog({name: values for name, values in log.columns.items() if name not in pose}, log.metadata)
    rest = changed(rest, **{name: rng.standard_normal(len(log)) for name in RATES[:2]})
    assert examine(rest, truth).order is None
    assert not check_log(rest, truth).findings
    for spin, which in ((-truth.spin, "every spin"), (truth.spin * [-1, -1, 1, 1], "the spins of rotors [0, 1]")):
        (found,) = check_log(rest, replace(truth, spin=spin)).findings
        assert (found.level, found.what, found.repair) == ("error", "rotor spin", None)
        assert f"turn the sign of {which} in the vehicle file, or take the columns" in found.fix


def tumbling(truth, rng: np.random.Generator) -> FlightLog:
    """Rolls and loops with 8 rad/s: the rotors counteract what Euler's equations make of them in yaw."""
    inertia = np.array([truth.value(f"inertia_{2 * axis}_kg_m2") for axis in "xyz"])
    hub, step_s, steps = truth.hub_body_m, 0.0025, 4800
    by_square = 2.6e-6 * np.stack([hub[:, 1], -hub[:, 0], -0.012 * truth.spin, np.ones(4)])
    size = np.array([[8.0], [8.0], [0.8]]) * rng.uniform(0.5, 1.0, (3, 3))
    turns, phase = 2.0 * np.pi * rng.uniform(0.2, 2.0, (3, 3)), rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    rate, squared, kept = np.zeros(3), np.full(4, 950.0**2), []
    for i in range(steps):
        wanted = (size * np.sin(turns * i * step_s + phase)).sum(axis=1)
        torque = 20.0 * inertia * (wanted - rate)
        demand = np.linalg.solve(by_square, np.r_[torque, by_square[3].sum() * 950.0**2])
        squared = squared + (np.clip(demand, 300.0**2, 1700.0**2) - squared) * step_s / 0.03
        rate = rate + step_s * (by_square[:3] @ squared - np.cross(rate, inertia * rate)) / inertia
        kept.append(np.r_[rate, np.sqrt(squared)])
    logged = np.array(kept[::4])
    logged += np.array([0.02] * 3 + [4.0] * 4) * rng.standard_normal(logged.shape)
    vectors = {"rate_body_rad_s": logged[:, :3], "rotor_speed_rad_s": logged[:, 3:]}
    return from_vectors(np.arange(len(logged), dtype=np.float64) * (4.0 * step_s), vectors)


@pytest.mark.parametrize("seed", range(3))
def test_rotors_that_counteract_what_roll_and_pitch_do_to_yaw_reverse_no_spin(truth, seed):
    """By a file whose hubs show no order, so that yaw alone has to tell."""
    in_a_row = replace(truth, hub_body_m=truth.hub_body_m * np.array([1.0, 0.0, 1.0]))
    found = examine(tumbling(truth, np.random.default_rng(seed)), in_a_row)
    assert found.order is None
    assert found.spin in (None, tuple(truth.spin))


def test_a_single_oscillation_does_not_decide_between_an_order_and_its_opposite(log, truth):
    """Half a period later the same motion would be that of the opposite rotors."""
    phase = 2.0 * np.pi * 5.0 * log.time_s
    roll, pitch = np.sin(phase), np.sin(1.37 * phase)
    rng = np.random.default_rng(0)
    arms = np.sign(truth.hub_body_m)
    torque = np.outer(np.gradient(roll, log.time_s), arms[:, 1]) - np.outer(np.gradient(pitch, log.time_s), arms[:, 0])
    speeds = 900.0 + torque + 0.5 * rng.standard_normal((len(log), 4))
    rates = np.stack([roll, pitch, 0.0 * roll], axis=1) + 0.02 * rng.standard_normal((len(log), 3))
    columns = dict(zip(ROTORS, speeds.T, strict=True)) | dict(zip(RATES, rates.T, strict=True))
    for late_rows in (0, 4, 8):
        assert examine(rolled(changed(log, **columns), late_rows), truth).order in (None, (0, 1, 2, 3))


@pytest.mark.parametrize("order", [(0, 2, 1, 3), (1, 0, 3, 2), (3, 0, 1, 2)])
def test_the_fix_brings_each_rotor_back_to_its_column(log, truth, order):
    fixed = fix(in_columns(log, order), truth)
    assert fixed.left == ()
    for name in ROTORS:
        np.testing.assert_array_equal(fixed.log.columns[name], log.columns[name])


def test_spins_are_named_rotor_by_rotor_and_are_the_vehicle_files_to_correct(log, truth):
    def finding(spin):
        (found,) = check_log(log, replace(truth, spin=spin)).findings
        assert found.repair is None
        return found

    assert "every spin" in finding(-truth.spin).fix
    assert "the spins of rotors [1, 2]" in finding(truth.spin * np.array([1.0, -1.0, -1.0, 1.0])).fix


def test_gusts_that_the_controller_counteracts_reverse_nothing(flying, truth):
    """In a closed loop a disturbance and the torque that counteracts it are of opposite sign."""
    rng = np.random.default_rng(0)
    gusty = flying.Truth(gust=1.0, gust_torque=10.0, gust_time=0.2)
    reference = flying.paper_flights(rng, 3, 0.2)
    for log in flying.fly(gusty, reference, 9, duration_s=8.0, rng=rng, rate_hz=100.0, gyro_noise_rad_s=0.02):
        found = examine(log, truth)
        assert found.order in (None, (0, 1, 2, 3))
        assert found.spin in (None, tuple(truth.spin))


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_is_inconclusive(log, truth, seed):
    rng = np.random.default_rng(seed)
    noise = {name: 900.0 + 4.0 * rng.standard_normal(len(log)) for name in ROTORS}
    noise |= {name: 0.02 * rng.standard_normal(len(log)) for name in RATES}
    found = examine(changed(log, **noise), truth)
    assert (found.order, found.spin) == (None, None)
    assert np.all(found.explained < 0.3)  # eight numbers fitted to some 300 explain a few per cent


def test_what_is_inconclusive_is_stated_with_the_manoeuvre_that_decides(log, truth):
    rng = np.random.default_rng(0)
    report = check_log(changed(log, **{n: 900.0 + rng.standard_normal(len(log)) for n in ROTORS}), truth)
    assert not any(f.what in ("rotor order", "rotor spin") for f in report.findings)
    (sentence,) = report.inconclusive
    assert "fly doublets" in sentence
    assert report.as_dict()["inconclusive"] == [sentence]
    assert check_log(log, truth).inconclusive == ()


def test_a_gyro_suffices_and_so_does_the_attitude(log, truth):
    pose = [name for name in log.columns if name.startswith(("position", "q_world"))]
    for left_out in (pose, RATES):
        rest = {name: values for name, values in log.columns.items() if name not in left_out}
        (found,) = check_log(in_columns(FlightLog(rest, log.metadata), (2, 1, 0, 3)), truth).findings
        assert found.what == "rotor order"
        assert str([2, 1, 0, 3]) in found.fix


def test_windows_with_gaps_are_left_out_and_a_short_log_is_inconclusive(log, truth):
    holes = np.arange(len(log)) % 150 < 140
    pieces = FlightLog({name: values[holes] for name, values in log.columns.items()}, log.metadata)
    assert examine(pieces, truth).order is None
    assert examine(log.slice(0.0, 5.0), truth).order is None


def test_rotors_that_stand_still_are_inconclusive(log, truth):
    still = {name: np.full(len(log), 900.0) for name in ROTORS}
    assert examine(changed(log, **still), truth).order is None
    assert examine(changed(log, **dict.fromkeys(RATES, np.zeros(len(log)))), truth).order is None


def test_every_order_has_its_own_pattern(truth):
    """No two orders, and no two sets of spins, predict gains in the same proportions."""
    hubs = truth.hub_body_m[:, :2]
    patterns = {tuple(hubs[list(order)].ravel()) for order in permutations(range(4))}
    assert len(patterns) == 24


def commanded(log: FlightLog, names: list[str], order: tuple[int, ...], lag_s: float = 0.05) -> FlightLog:
    """The log with what its rotors, which lag, were told instead of their speeds; rotor `order[i]` in column i."""
    speeds = np.stack([log.columns[name] for name in ROTORS], axis=1)
    told = speeds + lag_s * np.gradient(speeds, log.time_s, axis=0)
    driven = (*ROTORS, *COLUMNS[COMMAND], *RATIOS)
    rest = {name: values for name, values in log.columns.items() if name not in driven}
    return FlightLog({**rest, **dict(zip(names, told[:, list(order)].T, strict=True))}, log.metadata)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (1, 0, 3, 2), (2, 3, 0, 1), (0, 2, 1, 3)])
@pytest.mark.parametrize("names", [list(COLUMNS[COMMAND]), list(RATIOS)], ids=["speeds", "ratios"])
def test_commands_show_the_order_and_are_no_witness_of_the_spins(log, truth, order, names):
    told = commanded(log, names, order)
    for vehicle in (truth, replace(truth, spin=-truth.spin)):
        found = examine(told, vehicle)
        assert found.order == tuple(np.argsort(order))
        assert found.spin is None
    findings = [f for f in check_log(told, truth).findings if f.what.startswith("rotor")]
    assert [f.repair.order for f in findings if f.repair] == ([] if order == (0, 1, 2, 3) else [found.order])
    mended = fix(told, truth).log
    right = commanded(log, names, (0, 1, 2, 3))
    assert all(np.array_equal(mended.columns[name], right.columns[name]) for name in names)


def test_commands_that_answer_disturbances_show_no_order(log, truth):
    """What a controller does against gusts turns the body the other way."""
    rng = np.random.default_rng(4)
    told = commanded(log, list(RATIOS), (0, 1, 2, 3))
    rates = {name: -0.2 * told.columns[name] + rng.standard_normal(len(log)) for name in RATES}
    assert examine(changed(told, **rates), truth).order is None
