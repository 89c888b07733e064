"""Clocks of streams: how late each is comes out of the fit with its error, and a late stream spoils nothing."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from flight import FlightLog
from flight.flight_log import COLUMNS
from sysid.diagnosis.examined import examine
from sysid.estimator.flights.clocks import Clock, delay_name, gyro_is_early, pose_is_late
from sysid.estimator.flights.sampling import Signal
from sysid.estimator.joint_problem.unknowns import nuisances
from sysid.estimator.motors import motor, rotor_speed

ROTORS, GYRO = "rotor_speed_rad_s", "rate_body_rad_s"
PLANTED_S = {ROTORS: (0.005, -0.008, 0.002), GYRO: (0.0, 0.003, -0.005)}
"""By flight."""
NOISE = {ROTORS: 4.0, GYRO: 0.01}


def late(log: FlightLog, delays_s: dict[str, float], rng: np.random.Generator) -> FlightLog:
    """A log of exact streams as recorders make it that stamp some of them late, with noise; ends dropped."""
    columns = dict(log.columns)
    for quantity, delay_s in delays_s.items():
        exact = Signal.through(log.time_s, log.vector(quantity)).value(log.time_s - delay_s)
        noisy = exact + NOISE[quantity] * rng.standard_normal(exact.shape)
        columns |= dict(zip(COLUMNS[quantity], noisy.T, strict=True))
    return FlightLog({name: values[4:-4] for name, values in columns.items()}, log.metadata)


@pytest.fixture(scope="module")
def fitted(flying, truth) -> sysid.Identification:
    rng = np.random.default_rng(3)
    exact = flying.fly(
        flying.Truth(),
        flying.paper_flights(rng),
        3,
        duration_s=8.0,
        rng=rng,
        rate_hz=200.0,
        rotor_noise_rad_s=0.0,
        gyro_noise_rad_s=0.0,
    )
    logs = [late(log, {q: PLANTED_S[q][i] for q in PLANTED_S}, rng) for i, log in enumerate(exact)]
    return sysid.identify(logs, truth, sysid.Options(gusts="white", node_rate_hz=100.0))


def test_delays_of_rotor_speed_and_gyro_are_recovered_flight_by_flight(fitted):
    planted = {("gyro", i): d for i, d in enumerate(PLANTED_S[GYRO])}
    planted |= {("rotor speed", i): d for i, d in enumerate(PLANTED_S[ROTORS])}
    assert len(fitted.clocks) == len(planted)
    for clock in fitted.clocks:
        true_s = planted[clock.stream, int(clock.flight.split()[-1]) - 1]
        assert abs(clock.delay_s - true_s) < max(3e-4, 3.0 * clock.std_robust), clock
        assert clock.std_robust < (2e-3 if clock.flight == "flight 1" else 5e-4)  # the vertical one hardly turns


def test_clocks_that_are_off_are_spoken_of_and_written_down(fitted):
    told = [finding for finding in fitted.findings if "against the pose" in finding]
    assert any("flight 2: rotor speed is" in finding and "early" in finding for finding in told)
    assert not any("flight 1: gyro" in finding for finding in told)
    assert fitted.as_dict()["clocks"][0].keys() == {"stream", "against", "flight", "delay_s", "std_robust"}


def test_clocks_that_are_off_spoil_no_inertia(fitted, truth):
    for axis in ("xx", "yy", "zz"):
        name = f"inertia_{axis}_kg_m2"
        assert fitted.estimate(name).value == pytest.approx(truth.value(name), rel=0.005)


SPEEDS = tuple(COLUMNS[ROTORS])
EARLY = 2
"""Samples by which commands are written down too early: 10 ms."""


def commanded_early(log: FlightLog) -> FlightLog:
    """A log of commands alone, stamped too early."""
    kept = {name: values[:-EARLY] for name, values in log.columns.items() if name not in SPEEDS}
    shifted = {name: log.columns[name][EARLY:] for name in COLUMNS["rotor_speed_command_rad_s"]}
    return FlightLog({**kept, **shifted}, log.metadata)


@pytest.fixture(scope="module")
def early_logs(flying) -> list[FlightLog]:
    rng = np.random.default_rng(4)
    flown = flying.fly(flying.Truth(), flying.paper_flights(rng), 3, duration_s=8.0, rng=rng, gyro_noise_rad_s=0.01)
    return [commanded_early(log) for log in flown]


BY_COMMAND = sysid.Options(gusts="white", node_rate_hz=100.0)


@pytest.fixture(scope="module")
def sent_early(early_logs, truth) -> sysid.Identification:
    return sysid.identify(early_logs, truth, replace(BY_COMMAND, estimate_command_delay=True))


@pytest.fixture(scope="module")
def taken_on_time(early_logs, truth) -> sysid.Identification:
    return sysid.identify(early_logs, truth, BY_COMMAND)


def test_unless_asked_for_no_delay_of_commands_is_taken_out_of_the_lag_and_the_fit_says_so(taken_on_time, sent_early):
    assert not any(clock.stream == "rotor speed command" for clock in taken_on_time.clocks)
    assert taken_on_time.estimate("motor_lag.rise_s").value == pytest.approx(0.03 + EARLY / 200.0, rel=0.05)
    said = "Commands were taken to be on time"
    assert any(said in finding for finding in taken_on_time.findings)
    assert not any(said in finding for finding in sent_early.findings)


def test_the_errors_of_a_fit_that_takes_early_commands_to_be_on_time_hold_the_truth(taken_on_time, sent_early, truth):
    names = ("motor_lag.rise_s", "motor_lag.fall_s", *(f"inertia_{axis}_kg_m2" for axis in ("xx", "yy", "zz")))
    for name in names:
        taken, told = taken_on_time.estimate(name), sent_early.estimate(name)
        assert abs(taken.value - truth.value(name)) < taken.interval90, taken
        assert told.interval90 < 0.5 * taken.interval90, "a clock of their own makes the lag exact"
    for name in names[2:]:  # what hardly rests on the clock is hardly less sure for it
        assert taken_on_time.estimate(name).interval90 < 0.1 * truth.value(name)


def test_a_fit_says_that_commands_seem_early_where_it_takes_them_to_be_on_time(taken_on_time, sent_early):
    said = [finding for finding in taken_on_time.findings if "fit better with commands" in finding]
    assert len(said) == 1
    assert said[0].count("ms early") == 3
    assert not any("fit better with commands" in finding for finding in sent_early.findings)


def test_a_curve_must_explain_more_than_a_delay_of_commands_that_is_not_estimated(taken_on_time):
    evidence = examine(taken_on_time).evidence
    assert {delay_name(motor.QUANTITY, i) for i in range(3)} <= {evidence.names[i] for i in evidence.base}


def test_where_rotor_speed_is_logged_nothing_is_said_of_commands(fitted):
    assert not any("Commands were taken" in f or "fit better with commands" in f for f in fitted.findings)


def test_commands_that_are_early_are_told_from_the_lag_of_motors_and_from_a_late_pose(sent_early):
    found = [clock for clock in sent_early.clocks if clock.stream == "rotor speed command"]
    assert len(found) == 3
    for one in found:
        assert abs(one.delay_s + EARLY / 200.0) < max(5e-4, 3.0 * one.std_robust), one
    assert min(one.std_robust for one in found) < 5e-4
    assert sent_early.estimate("motor_lag.rise_s").value == pytest.approx(0.03, rel=0.05)
    assert not pose_is_late(sent_early.clocks)


def test_what_a_later_command_does_follows_finite_differences(sent_early):
    flight, lagging = sent_early.flights[2], sent_early.vehicle
    name, step_s = delay_name(motor.QUANTITY, flight.log_index), 1e-3
    now, before, after = (motor.driven(rotor_speed.aligned(flight, {name: d}), lagging) for d in (0.0, -step_s, step_s))
    by_speed, by_acceleration = rotor_speed.by_delay(now, {})
    for found, quantity in ((by_speed, "rotor_speed_rad_s"), (by_acceleration, "rotor_acceleration_rad_s2")):
        slope = (getattr(after, quantity) - getattr(before, quantity)) / (2.0 * step_s)
        assert np.abs(found - slope)[2:-2].std() < 0.15 * slope.std()


def test_without_a_lag_in_the_model_commands_are_taken_to_be_on_time(sent_early, truth):
    unknowns, _ = nuisances(sent_early.flights, "pose", truth.without_effect("motor_lag"))
    assert not any(name.startswith("command_delay_s") for name in unknowns.delay)


def test_a_command_is_held_beyond_the_last_sample():
    signal = Signal.held(np.array([0.0, 1.0, 2.0]), np.array([[1.0], [2.0], [5.0]]))
    assert signal.value(np.array([-1.0, 0.5, 1.0, 2.0, 3.0]))[:, 0].tolist() == [1.0, 1.0, 2.0, 5.0, 5.0]
    assert signal.means(np.array([0.5, 1.5, 2.5, 3.0]))[0][:, 0] == pytest.approx([1.5, 3.5, 5.0])


def clock(stream: str, delay_ms: float, std_ms: float = 0.1) -> Clock:
    return Clock(stream, "pose", "flight 1", 1e-3 * delay_ms, 1e-3 * std_ms)


def test_the_pose_is_late_only_where_all_other_streams_are_early_alike():
    assert pose_is_late([clock("rotor speed", -12.0), clock("gyro", -11.8)])
    assert pose_is_late([clock("rotor speed", -12.0), clock("rotor speed", -8.0, 3.0)])
    assert not pose_is_late([clock("rotor speed", -12.0), clock("gyro", 0.0)])
    assert not pose_is_late([clock("rotor speed", -12.0), clock("rotor speed", -5.0)])
    assert not pose_is_late([clock("rotor speed", 5.0), clock("gyro", 5.0)])
    assert not pose_is_late([clock("rotor speed", -2.0, 1.0)])
    assert not pose_is_late([clock("rotor speed command", -12.0)])
    assert not pose_is_late([clock("rotor speed command", -12.0), clock("gyro", 0.0)])
    assert pose_is_late([clock("rotor speed command", -20.0), clock("gyro", -12.0)])
    assert not pose_is_late([])


def test_a_stream_on_time_with_the_pose_speaks_against_a_late_pose_however_short_the_delay():
    assert not pose_is_late([clock("rotor speed", -1.1), clock("gyro", 0.0)])
    assert not pose_is_late([clock("rotor speed", -1.1), clock("gyro", -0.2, 0.2)])
    assert not pose_is_late([clock("rotor speed", -1.1, 0.02), *(clock("gyro", -0.1, 0.5) for _ in range(4))])
    assert not pose_is_late([clock("rotor speed", -1.1), *(clock("gyro", -1.1) for _ in range(3)), clock("gyro", 0.0)])
    assert pose_is_late([clock("rotor speed", -1.1), clock("gyro", -1.0)])
    assert pose_is_late([clock("rotor speed", -1.8), clock("gyro", -1.2)])


@pytest.mark.parametrize(
    "others",
    [
        [("gyro", 0.0, 20.0)],
        [("gyro", -5.0, 3.0)],
        [("accelerometer", -3.0, 10.0), ("gyro", -12.0, 15.0)],
    ],
)
def test_a_stream_that_shows_nothing_does_not_speak_against_a_late_pose(others):
    assert pose_is_late([clock("rotor speed", -12.0, 0.1), *(clock(*other) for other in others)])


def test_a_gyro_that_is_early_in_every_flight_leaves_open_whether_the_pose_is_late():
    assert gyro_is_early([clock("gyro", -3.6), clock("rotor speed", 3.7), clock("gyro", -3.5)])
    assert not gyro_is_early([clock("gyro", -3.6), clock("rotor speed", -3.7)])  # the pose is late, and all agree
    assert not gyro_is_early([clock("gyro", 0.0), clock("rotor speed", -5.0)])
    assert not gyro_is_early([clock("gyro", 5.0), clock("rotor speed", 0.0)])
    assert not gyro_is_early([clock("gyro", -3.6), clock("gyro", 0.0), clock("rotor speed", 3.7)])
    assert not gyro_is_early([clock("rotor speed", 5.0)])
    assert not gyro_is_early([])


def test_the_fix_of_the_log_is_named_only_for_streams_that_it_shifts():
    assert all("goshawk log fix" in clock(stream, 5.0).sentence for stream in ("gyro", "rotor speed"))
    assert "goshawk log fix" not in clock("accelerometer", 5.0).sentence
    assert "goshawk log fix" not in Clock("rotor speed", "gyro", "flight 1", 5e-3, 1e-4).sentence


def test_a_signal_is_held_beyond_its_samples_and_its_means_follow():
    time_s = np.linspace(0.0, 1.0, 21)
    signal = Signal.through(time_s, np.column_stack([time_s**2]))
    mean, slope = signal.means(np.array([-0.2, -0.1, 0.4, 0.6, 1.1, 1.2]))
    inside = [0.4**3 / 1.5, (0.6**3 - 0.4**3) / 0.6, (1.0 - 0.6**3) / 1.5 + 0.2]
    assert mean[:, 0] == pytest.approx([0.0, *inside, 1.0], abs=1e-6)
    assert slope[:, 0] == pytest.approx([0.0, 0.32, 1.0, 1.28, 0.0])
