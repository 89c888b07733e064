"""A bent rotor is told by its line; a vibration of another kind, or of all rotors alike, is not called one.

The vibration is made here, by the formula of an unbalanced rotor; nothing of it is shared with the code under test.
"""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid.diagnosis.evidence import rotor_line
from sysid.diagnosis.evidence.rotor_line import Line, _Piece

DURATION_S = 8.0


def recorded(seed, strength_m_s2, rate_hz=1000.0):
    """Accelerometer of four rotors about 180 turns a second, each with a line of its own in the rotors' plane.

    Args:
        strength_m_s2: (4,) amplitudes at the usual speed; they grow with its square.
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
    known = speed[::every] + 3.0 * rng.standard_normal((len(felt), 4))
    return _Piece(time_s[::every], felt, known)


def named(piece) -> Line | None:
    return rotor_line.strongest(*rotor_line.power([piece]))


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


def told(monkeypatch, piece, **flight) -> tuple[Line | None, str]:
    monkeypatch.setattr(rotor_line, "_pieces", lambda logs, fit: [piece])
    fit = SimpleNamespace(flights=[SimpleNamespace(**{"driven_by_command": False} | flight)])
    return rotor_line.find([], cast("Any", fit))


def test_what_flights_cannot_show_is_said_and_none_is_silent_only_where_every_line_is_weak(monkeypatch):
    strong, weak = recorded(1, np.array([0.4, 2.5, 0.4, 0.4])), recorded(2, np.full(4, 0.1))
    found, unseen = told(monkeypatch, strong)
    assert found is not None
    assert found.rotor == 1
    assert not unseen
    assert told(monkeypatch, weak) == (None, "")
    alike = _Piece(strong.time_s, strong.force_m_s2, np.repeat(strong.speed_rad_s[:, :1], 4, axis=1))
    assert "fly rolls and yaws" in told(monkeypatch, alike)[1]
    assert "eRPM" in told(monkeypatch, strong, driven_by_command=True)[1]
    slow = _Piece(strong.time_s[::4], strong.force_m_s2[::4], strong.speed_rad_s[::4])
    assert "draw no line in samples of 250 Hz: log the accelerometer at 40" in told(monkeypatch, slow)[1]
    short = _Piece(strong.time_s[:900], strong.force_m_s2[:900], strong.speed_rad_s[:900])
    assert "less than 2 s" in told(monkeypatch, short)[1]


def test_the_sentence_names_rotor_and_strength():
    assert "rotor 2 shakes the accelerometer with 2.5 m/s2" in Line(2, 2.5, 0.4).sentence
