"""A bent rotor is told by its line; a vibration of another kind, or of all rotors alike, is not called one.

The vibration is made here, by the formula of an unbalanced rotor; nothing of it is shared with the code under test.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

from flight import FlightLog
from sysid.diagnosis import from_imu
from sysid.diagnosis.evidence import rotor_line
from sysid.diagnosis.evidence.rotor_line import Line, _Piece

BENCHMARKS = Path(__file__).parents[4] / "benchmarks"
DURATION_S = 8.0


@pytest.fixture(scope="module", autouse=True)
def benchmarks():
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


def recorded(seed, strength_m_s2, rate_hz=1000.0, told=1.0):
    """Accelerometer of four rotors about 180 turns a second, each with a line of its own in the rotors' plane.

    Args:
        strength_m_s2: (4,) amplitudes at the usual speed; they grow with its square.
        told: what the log says of the rotors' speed over the truth.
    """
    rng, fine_s = np.random.default_rng(seed), 1.0 / 4000.0
    time_s = np.arange(0.0, DURATION_S, fine_s)
    sticks = rng.uniform(-0.12, 0.12, (int(DURATION_S / 0.35) + 2, 4))
    asked = 1130.0 * (1.0 + sticks[(time_s / 0.35).astype(int)])
    blend = np.exp(-np.arange(0.0, 0.2, fine_s) / 0.04)
    speed = np.stack([np.convolve(a, blend / blend.sum())[: len(a)] for a in asked.T], axis=1)
    speed[: len(blend)] = speed[len(blend)]
    phase = 2.0 * np.pi * rng.random(4) + np.cumsum(speed, axis=0) * fine_s
    force = strength_m_s2 * (speed / 1130.0) ** 2
    plane = [(force * np.cos(phase)).sum(axis=1), (force * np.sin(phase)).sum(axis=1), 0.1 * force.sum(axis=1)]
    every = round(1.0 / (rate_hz * fine_s))
    felt = np.stack(plane, axis=1)[::every] + np.array([0.0, 0.0, 9.8])
    felt += 0.5 * rng.standard_normal(felt.shape) + 0.8 * np.sin(1050.0 * time_s[::every, None] + np.arange(3))
    felt += np.cumsum(rng.standard_normal(felt.shape), axis=0) * 0.02  # what the vehicle does
    known = told * (speed[::every] + 3.0 * rng.standard_normal((len(felt), 4)))
    return _Piece(time_s[::every], felt, known)


def named(piece, scale=1.0) -> Line | None:
    return rotor_line.strongest(*rotor_line.power([piece], scale))


@pytest.mark.parametrize("bent", [0, 3])
def test_a_bent_rotor_is_named_and_its_line_is_as_strong_as_it_is(bent):
    strength = np.full(4, 0.4)
    strength[bent] = 2.5
    line = named(recorded(bent, strength))
    assert line is not None
    assert line.rotor == bent
    assert line.rms_m_s2 == pytest.approx(2.5, rel=0.1)  # two axes, each of that amplitude
    assert line.next_m_s2 < 0.8


def test_vibration_that_is_no_rotors_own_names_none():
    """Rotors out of balance alike, a little, or not at all, beside a frame that shakes at 1050 rad/s."""
    rng = np.random.default_rng(5)
    for seed in range(15):
        strength = rng.choice([0.0, 0.3, 2.0]) * rng.uniform(0.7, 1.4, 4)
        assert named(recorded(100 + seed, strength)) is None


def test_rotors_that_never_differ_are_not_told_apart():
    piece = recorded(7, np.array([2.5, 0.4, 0.4, 0.4]))
    alike = _Piece(piece.time_s, piece.force_m_s2, np.repeat(piece.speed_rad_s[:, :1], 4, axis=1))
    assert named(alike) is None


@pytest.mark.parametrize("told", [0.8, 1.25])
def test_full_throttles_speed_is_found_by_the_line_where_nobody_measured_it(told):
    piece = recorded(9, np.array([0.3, 2.5, 0.3, 0.3]), told=told)
    scale = rotor_line._scale([piece], 1000.0)
    assert scale == pytest.approx(1.0 / told, rel=0.015)
    line = named(piece, scale)
    assert line is not None
    assert line.rotor == 1


@pytest.mark.slow
def test_a_diagnosis_names_the_bent_rotor_of_a_log_with_commands_alone():
    """Full throttle's speed, which the fit takes for 3,000 rad/s, is 2,400."""
    import without_pose_flights as flights

    rng = np.random.default_rng(8)
    (log,) = flights.flown(
        flights.body(), flights.drawn(1, rng), rng, duration_s=14.0, recorder=flights.Recorder(1000.0)
    )
    step_s, command = 1e-3, log.columns["motor_command_2_ratio"]
    speed = np.empty(len(command))
    speed[0] = 2400.0 * command[0]
    for k in range(1, len(command)):
        speed[k] = speed[k - 1] + (2400.0 * command[k - 1] - speed[k - 1]) * (1.0 - np.exp(-step_s / 0.04))
    strength, phase = 2.5 * (speed / 1130.0) ** 2, np.cumsum(speed) * step_s
    shaken = {"x": strength * np.cos(phase), "y": strength * np.sin(phase)}
    names = {axis: f"specific_force_body_{axis}_m_s2" for axis in shaken}
    columns = {**log.columns, **{names[axis]: log.columns[names[axis]] + wave for axis, wave in shaken.items()}}
    found = from_imu.diagnose([FlightLog(columns, log.metadata)], flights.start())
    assert found.bent is not None
    assert found.bent.rotor == found.as_dict()["bent_rotor"]["rotor"] == 2
    assert "rotor 2 shakes" in found.verdict
    sound = from_imu.diagnose([log], flights.start())
    assert sound.bent is None
    assert "eRPM" in dict(sound.invisible)["bent_rotor"]


def test_the_sentence_names_rotor_and_strength():
    assert "rotor 2 shakes the accelerometer with 2.5 m/s2" in Line(2, 2.5, 0.4).sentence
