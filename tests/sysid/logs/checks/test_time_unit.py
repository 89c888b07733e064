"""Times in another unit are named as that, not as frames that differ."""

import numpy as np
import pytest

from flight import FlightLog
from sysid.logs.check import check_log
from tests.sysid import flying


@pytest.fixture(scope="module")
def flown() -> list[FlightLog]:
    rng = np.random.default_rng(5)
    return flying.fly(flying.Truth(), flying.paper_flights(rng), 3, duration_s=15.0, rng=rng, gyro_noise_rad_s=0.02)


@pytest.mark.parametrize("factor", [0.01, 0.1, 10.0])
def test_a_time_off_by_a_power_of_ten_is_put_right(flown, factor):
    for log in flown:
        wrong = FlightLog({**log.columns, "time_s": log.time_s * factor}, {})
        (found,) = [f for f in check_log(wrong).findings if f.what == "time unit"]
        assert found.repair is not None
        assert found.repair.factor == pytest.approx(1.0 / factor)
        assert not [f for f in check_log(wrong).findings if f.what == "frame"]


def test_a_good_time_and_a_gyro_in_degrees_are_left(flown):
    for log in flown:
        assert not [f for f in check_log(log).findings if f.what == "time unit"]
        gyro = {name: np.rad2deg(values) for name, values in log.columns.items() if name.startswith("rate_body")}
        found = check_log(FlightLog({**log.columns, **gyro}, {})).findings
        assert not [f for f in found if f.what == "time unit"]
        assert [f for f in found if f.what == "unit"]


def test_a_gyro_of_ten_samples_a_second_is_not_called_late(flown):
    for log in flown:
        slow = FlightLog({name: values[::20] for name, values in log.columns.items()}, {})
        assert not [f.sentence for f in check_log(slow).findings if f.what == "clock"]
