"""The flown envelope: what flights reached, and that nothing is said of what lies beyond."""

import numpy as np
import pytest

from sysid.diagnosis.envelope import flown
from sysid.estimator.trajectory.states import States


def states(velocity: np.ndarray, rate: np.ndarray) -> States:
    return States(np.zeros_like(velocity), velocity, np.tile([1.0, 0.0, 0.0, 0.0], (len(rate), 1)), rate)


def test_the_envelope_is_that_of_all_flights_together():
    """One climbs and sinks, one flies level in a circle and turns."""
    t = np.linspace(0.0, 4.0 * np.pi, 4000)
    none = np.zeros_like(t)
    vertical = states(np.stack([none, none, 1.0 + 3.0 * np.sin(t)], axis=1), np.zeros((len(t), 3)))
    level = states(np.stack([6.0 * np.cos(t), 6.0 * np.sin(t), none], axis=1), np.tile([0.0, 0.6, 0.8], (len(t), 1)))
    found = flown([vertical, level])
    assert found.level_speed_m_s == pytest.approx(6.0)
    assert found.climb_m_s == pytest.approx(4.0, abs=0.01)
    assert found.sink_m_s == pytest.approx(2.0, abs=0.01)
    assert found.rate_rad_s == pytest.approx(1.0)
    assert "sink to 2.0 m/s" in found.sentence
    assert "beyond it" in found.sentence


def test_flights_that_only_climb_have_no_sink():
    climbing = states(np.tile([0.0, 0.0, 1.0], (100, 1)), np.zeros((100, 3)))
    assert flown([climbing]).sink_m_s == 0.0
