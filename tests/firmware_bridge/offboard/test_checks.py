"""Settings that would make a pulse mean something else are refused, with the line that mends them."""

from dataclasses import replace

import pytest

from firmware_bridge.arming import required
from firmware_bridge.offboard.checks import by_msp_alone, checks
from firmware_bridge.offboard.settings import Mode, Settings
from flight import LinkError

RATES = {f"{a}_{n}": v for a in ("roll", "pitch", "yaw") for n, v in
         (("rc_rate", "100"), ("srate", "100"), ("expo", "0"), ("rate_limit", "1998"))}  # fmt: skip
GOOD = Settings(
    {**RATES, "rates_type": "ACTUAL", "thr_expo": "0", "throttle_limit_type": "OFF", "thrust_linear": "0",
     "rc_smoothing": "OFF", "deadband": "0", "yaw_deadband": "0", "small_angle": "25", "min_check": "1050",
     "serial_update_rate_hz": "1000", "failsafe_delay": "15", "msp_override_channels_mask": "15",
     "msp_override_failsafe": "OFF", "serialrx_provider": "CRSF"},
    (Mode(0, 4, 1700, 2100), Mode(50, 5, 1700, 2100)), frozenset({"RX_SERIAL"}), "AETR1234", "Betaflight",
)  # fmt: skip


def test_good_settings_pass():
    required(checks(GOOD))
    assert not by_msp_alone(GOOD)
    assert by_msp_alone(replace(GOOD, features=frozenset({"RX_MSP"})))


@pytest.mark.parametrize(
    ("name", "value", "mended"),
    [
        ("rates_type", "BETAFLIGHT", "set rates_type = ACTUAL"),
        ("roll_expo", "30", "set roll_expo = 0"),
        ("pitch_rc_rate", "7", "set pitch_rc_rate = 100"),
        ("thr_expo", "20", "set thr_expo = 0"),
        ("rc_smoothing", "ON", "set rc_smoothing = OFF"),
        ("thrust_linear", "20", "set thrust_linear = 0"),
        ("serial_update_rate_hz", "100", "set serial_update_rate_hz = 1000"),
        ("small_angle", "5", "set small_angle = 25"),
        ("msp_override_channels_mask", "7", "set msp_override_channels_mask = 15"),
        ("msp_override_channels_mask", "31", "set msp_override_channels_mask = 15"),
        ("msp_override_failsafe", "ON", "set msp_override_failsafe = OFF"),
        ("failsafe_delay", "50", "set failsafe_delay = 10"),
    ],
)
def test_each_wrong_setting_is_refused_with_the_line_that_mends_it(name, value, mended):
    wrong = replace(GOOD, values={**GOOD.values, name: value})
    with pytest.raises(LinkError, match=mended):
        required(checks(wrong))


def test_switches_and_channel_order_are_looked_at():
    for wrong, mended in (
        (replace(GOOD, modes=GOOD.modes[:1]), "aux 1 50 1"),
        (replace(GOOD, modes=GOOD.modes[1:]), "aux 0 0 0"),
        (replace(GOOD, channel_order="TAER1234"), "map AETR1234"),
        (replace(GOOD, features=frozenset({"RX_SERIAL", "3D"})), "feature -3D"),
    ):
        with pytest.raises(LinkError, match=mended):
            required(checks(wrong))
