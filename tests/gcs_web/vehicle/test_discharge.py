"""How long a battery lasts, from voltages that fall along a line."""

import numpy as np
import pytest

from gcs_web.vehicle.discharge import Discharge


def after(seconds: int, slope_v_s: float, *, noise_v: float = 0.0) -> Discharge:
    rng, heard = np.random.default_rng(4), Discharge()
    for time_s in range(seconds + 1):
        heard.take(float(time_s), 16.0 + slope_v_s * time_s + noise_v * rng.standard_normal())
    return heard


@pytest.mark.parametrize("slope_v_s", [-0.01, -0.004])
def test_what_is_left_is_what_the_line_says_from_now_on(slope_v_s):
    now_v = 16.0 + 40 * slope_v_s
    assert after(40, slope_v_s).left_s(14.0) == pytest.approx((14.0 - now_v) / slope_v_s, rel=1e-6)
    assert after(40, slope_v_s, noise_v=0.005).left_s(14.0) == pytest.approx((14.0 - now_v) / slope_v_s, rel=0.1)


def test_nothing_is_said_too_early_without_a_limit_or_of_a_battery_that_does_not_fall():
    assert after(10, -0.01).left_s(14.0) is None
    assert after(40, -0.01).left_s(0.0) is None
    assert after(40, 0.0).left_s(14.0) is None
    assert after(40, 0.01).left_s(14.0) is None


def test_a_flight_begins_anew_and_an_empty_battery_has_nothing_left():
    heard = after(40, -0.1)
    assert heard.left_s(14.0) == 0.0
    heard.take(41.0, 0.0)
    heard.take(42.0, 16.8)
    assert heard.left_s(14.0) is None
