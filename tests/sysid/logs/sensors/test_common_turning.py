"""Two recorders' clocks from how both saw the vehicle turn."""

import numpy as np
import pytest

from flight import InputError, rotations
from sysid.logs.sensors import common_turning

TRUE_S = 4.7318


def turning(seed: int, length_s: float = 20.0, step_s: float = 0.002):
    """Times, attitudes, and body rates of an irregular flight."""
    rng, time_s = np.random.default_rng(seed), np.arange(0.0, length_s, step_s)
    phases, speeds = rng.uniform(0.0, 6.3, (3, 8)), rng.uniform(0.5, 7.0, (3, 8))
    rate = 0.5 * np.sin(speeds[:, :, None] * time_s + phases[:, :, None]).sum(axis=1).T
    q = [np.array([1.0, 0.0, 0.0, 0.0])]
    for step in rotations.exp(0.5 * step_s * (rate[1:] + rate[:-1])):
        q.append(rotations.multiply(q[-1], step))
    return time_s, np.array(q), rate


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("later", [0.0, 3.0, -2.5])
def test_an_offset_is_found_to_two_milliseconds(seed, later):
    """Whichever recorder began first, with noise of a tracking system and of a gyro."""
    rng = np.random.default_rng(seed)
    time_s, q, rate = turning(seed)
    poses, gyro = slice(0 if later >= 0.0 else 1250, None, 5), slice(round(max(later, 0.0) * 500), None)
    seen = rotations.multiply(q[poses], rotations.exp(1e-3 * rng.standard_normal((len(q[poses]), 3))))
    felt = rate[gyro] + 0.02 * rng.standard_normal((len(rate[gyro]), 3))
    found = common_turning.offset_s(time_s[poses], seen, time_s[gyro] - TRUE_S, felt)
    assert found == pytest.approx(TRUE_S, abs=2e-3)


def test_axes_that_are_turned_change_nothing():
    time_s, q, rate = turning(1)
    turned = rotations.rotate(rotations.exp([0.3, -1.0, 2.0]), rate)
    one, other = (common_turning.offset_s(time_s[::5], q[::5], time_s - TRUE_S, r) for r in (rate, turned))
    assert one == pytest.approx(other, abs=1e-6)


def test_another_flight_is_refused():
    time_s, q, _ = turning(1)
    _, _, rate = turning(2)
    with pytest.raises(InputError, match="of the same flight"):
        common_turning.offset_s(time_s[::5], q[::5], time_s, rate)


def test_a_turning_that_repeats_itself_is_refused():
    time_s = np.arange(0.0, 20.0, 0.002)
    rate = np.column_stack([2.0 + np.sin(4.0 * time_s), 0.0 * time_s, 0.0 * time_s])
    angle = 2.0 * time_s + 0.25 * (1.0 - np.cos(4.0 * time_s))
    q = rotations.exp(np.column_stack([angle, 0.0 * angle, 0.0 * angle]))
    with pytest.raises(InputError, match="about as likely"):
        common_turning.offset_s(time_s[::5], q[::5], time_s, rate)


def test_a_flight_that_hardly_turns_is_refused():
    time_s, q, rate = turning(1)
    with pytest.raises(InputError, match="do not tell the clocks apart"):
        common_turning.offset_s(time_s[::5], q[::5], time_s, 0.001 * rate)


def test_clocks_that_drift_apart_are_refused():
    time_s, q, rate = turning(1, length_s=60.0)
    with pytest.raises(InputError, match="different rates"):
        common_turning.offset_s(time_s[::5], q[::5], 1.001 * time_s, rate)


def test_times_that_do_not_increase_are_refused():
    time_s, q, rate = turning(1)
    twice = np.concatenate([time_s[:1], time_s[:-1]])
    with pytest.raises(InputError, match="do not increase"):
        common_turning.offset_s(time_s[::5], q[::5], twice, rate)
