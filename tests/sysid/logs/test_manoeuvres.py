"""A log without a pose tells which of three manoeuvres it holds, and whether each suffices for a fit."""

import sys
from pathlib import Path

import numpy as np
import pytest

import sysid
from flight import FlightLog
from sysid.logs import manoeuvres

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
EFFORTS = {"all": (1.0, 1.0, 1.0), "rolls only": (0.02, 1.0, 0.02)}


@pytest.fixture(scope="module")
def logs():
    """Of one twin, flown with and without a manoeuvre."""
    sys.path.insert(0, str(BENCHMARKS))
    import without_pose_flights as flights

    sys.path.remove(str(BENCHMARKS))
    values = flights.drawn(1, np.random.default_rng(6))
    return {
        name: flights.flown(
            flights.body(), values, np.random.default_rng(6), duration_s=9.0, gust_m_s=0.1, effort=effort
        )[0]
        for name, effort in EFFORTS.items()
    }


def _errors(log: FlightLog) -> list[float]:
    return [one.error for one in manoeuvres.found(log)]


def _hovering(log: FlightLog) -> FlightLog:
    rng, n = np.random.default_rng(0), len(log)
    still = {f"rate_body_{axis}_rad_s": 2e-3 * rng.standard_normal(n) for axis in "xyz"}
    still |= {f"specific_force_body_{axis}_m_s2": 0.05 * rng.standard_normal(n) for axis in "xyz"}
    still["specific_force_body_z_m_s2"] += 9.81
    commands = {f"motor_command_{i}_ratio": 0.48 + 0.012 * rng.standard_normal(n) for i in range(4)}
    return FlightLog({**log.columns, **still, **commands}, log.metadata)


def test_a_flight_with_all_three_is_enough_for_each(logs):
    found = manoeuvres.found(logs["all"])
    assert [one.name for one in found] == ["throttle steps", "rolls and pitches", "yaws"]
    assert all(one.enough for one in found), [one.error for one in found]


def test_six_motors_of_which_two_are_told_the_same_as_others_show_what_four_do(logs):
    log = logs["all"]
    more = {f"motor_command_{i}_ratio": log.columns[f"motor_command_{i - 4}_ratio"] for i in (4, 5)}
    six = FlightLog({**log.columns, **more}, log.metadata)
    assert _errors(six)[1:] == pytest.approx(_errors(log)[1:], rel=0.1)
    assert _errors(six)[0] < 1.5 * _errors(log)[0]  # in the sum of all, these two count twice


def test_manoeuvres_that_were_left_out_are_those_that_lack(logs):
    throttle, rolls, yaws = manoeuvres.found(logs["rolls only"])
    usual = _errors(logs["all"])
    assert throttle.error > 2.0 * usual[0]
    assert rolls.error < 2.0 * usual[1]
    assert yaws.error > 4.0 * usual[2]
    assert not yaws.enough


def test_half_the_flight_has_about_root_two_of_the_error(logs):
    log = logs["all"]
    rolls = log.slice(2.8, 6.2), log.slice(2.8, 4.5)
    whole, half = (_errors(one)[1] for one in rolls)
    assert 1.0 < half / whole < 2.5


@pytest.mark.parametrize("turn", [(1, 0, 3, 2), (3, 2, 1, 0)])
def test_the_order_of_the_rotors_does_not_matter(logs, turn):
    log = logs["all"]
    turned = {f"motor_command_{i}_ratio": log.columns[f"motor_command_{j}_ratio"] for i, j in enumerate(turn)}
    assert _errors(FlightLog({**log.columns, **turned}, {})) == pytest.approx(_errors(log), rel=1e-6)


def test_a_hover_holds_none_of_them_and_says_what_to_fly(logs):
    for one in manoeuvres.found(_hovering(logs["all"])):
        assert "not in this log" in one.sentence
        assert one.fly in one.sentence


def test_motors_that_never_vary_show_nothing(logs):
    still = {f"motor_command_{i}_ratio": np.full(len(logs["all"]), 0.5) for i in range(4)}
    assert _errors(FlightLog({**logs["all"].columns, **still}, {})) == [np.inf] * 3


def test_check_notes_them_and_a_slow_log_what_to_log(logs):
    log = logs["rolls only"]
    notes = sysid.check_log(log).notes
    assert [note for note in notes if note.startswith("throttle steps: ")]
    every = {name: values[::10] for name, values in log.columns.items()}
    slow = sysid.check_log(FlightLog(every, {})).notes
    assert any("at 50 Hz without a pose" in note and "90 Hz or more" in note for note in slow)
    assert not any(note.startswith("throttle steps") for note in slow)


def test_a_log_with_a_pose_needs_none_of_them(logs):
    log = logs["all"]
    zero = np.zeros(len(log))
    pose = {f"position_world_{axis}_m": zero for axis in "xyz"} | {f"q_world_body_{axis}": zero for axis in "xyz"}
    assert manoeuvres.found(FlightLog({**log.columns, **pose, "q_world_body_w": zero + 1.0}, {})) == ()
