"""The delay of one stream against another, with what else explains them beside it."""

import numpy as np
import pytest

from flight.rotations import FloatArray
from sysid.logs.checks import clocks

TIME_S = clocks.GRID_S * np.arange(3000)


def circles(delay_s: float, dither: float, misfit: float = 0.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of slow circles with a quick dither: turning, what drives it read later, and body rates and airspeed beside."""

    def rate(time_s: FloatArray) -> FloatArray:
        slow = [np.sin(1.2 * time_s) + 0.3 * np.sin(1.9 * time_s), np.cos(1.2 * time_s) + 0.3 * np.cos(1.9 * time_s)]
        return np.stack(slow, axis=1) + dither * np.stack([np.sin(9.0 * time_s), np.sin(11.0 * time_s)], axis=1)

    def turning(time_s: FloatArray) -> FloatArray:
        return (rate(time_s + 1e-4) - rate(time_s - 1e-4)) / 2e-4

    air = np.stack([np.sin(1.2 * TIME_S + 0.8), np.cos(1.2 * TIME_S + 0.8)], axis=1)
    beside = np.stack([np.column_stack([rate(TIME_S)[:, i], air]) for i in (0, 1)], axis=1)
    return turning(TIME_S) + misfit * rate(TIME_S) ** 3, turning(TIME_S - delay_s), beside


@pytest.mark.parametrize("delay_s", [-0.004, 0.0, 0.003])
@pytest.mark.parametrize("dither", [0.05, 0.01])
def test_a_delay_is_found_beside_what_else_turns_the_body(delay_s, dither):
    found = clocks.clock_offset(*circles(delay_s, dither))
    assert abs(found.delay_s - delay_s) < 1e-5
    assert found.sigma_s < 6e-4


def test_a_delay_is_the_less_known_the_more_of_it_stands_beside():
    sigmas_s = [clocks.clock_offset(*circles(0.0, dither)).sigma_s for dither in (0.05, 0.01, 0.003)]
    assert sigmas_s[1] > 1.5 * sigmas_s[0]
    assert sigmas_s[2] > 1.5 * sigmas_s[1]
    alone = clocks.clock_offset(*circles(0.0, 0.003)[:2])
    assert alone.sigma_s == pytest.approx(clocks.SYSTEMATIC_S, rel=0.01)


def test_a_delay_that_stands_beside_whole_is_not_known():
    found = clocks.clock_offset(*circles(0.0, 0.0, misfit=1e-3))
    assert not np.isfinite(found.sigma_s)
