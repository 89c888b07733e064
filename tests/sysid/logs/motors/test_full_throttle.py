"""Motor commands as rotor speeds: in proportion to the output, idle included."""

import numpy as np
import pytest

from flight import FlightLog
from sysid.logs.motors import full_throttle
from sysid.logs.readers import read_blackbox


def test_a_command_of_nothing_idles():
    share = np.array([0.0, 0.25, 1.0])
    log = FlightLog({"time_s": np.arange(3.0), **{f"motor_command_{i}_ratio": share for i in range(4)}}, {})
    idling = FlightLog(log.columns, {full_throttle.IDLE: 0.1})
    speeds = full_throttle.by_limit(idling, 2000.0).columns
    np.testing.assert_allclose(speeds["rotor_speed_command_2_rad_s"], [200.0, 650.0, 2000.0])
    plain = full_throttle.with_command_speeds(log, 2000.0).columns
    np.testing.assert_allclose(plain["rotor_speed_command_2_rad_s"], 2000.0 * share)


@pytest.mark.parametrize(
    ("low", "high", "idle"),
    [(1055.0, 2000.0, 0.055), (1000.0, 2000.0, 0.0), (158.0, 2047.0, 110.0 / 1999.0), (2000.0, 2000.0, 0.0)],
)
def test_the_header_tells_the_idle_output_of_pulses_and_of_dshot(low, high, idle):
    assert read_blackbox._idle(low, high) == pytest.approx(idle)
