"""Settings that would make a pulse mean something else are refused, with the line that mends them."""

from dataclasses import replace

import pytest

from firmware_bridge.arming import required
from firmware_bridge.offboard.checks import as_many_rotors, by_msp_alone, checks
from firmware_bridge.offboard.settings import Mode, Settings
from flight import LinkError

RATES = {f"{a}_{n}": v for a in ("roll", "pitch", "yaw") for n, v in
         (("rc_rate", "100"), ("srate", "100"), ("expo", "0"), ("rate_limit", "1998"))}  # fmt: skip
GOOD = Settings(
    {**RATES, "rates_type": "ACTUAL", "thr_expo": "0", "throttle_limit_type": "OFF", "thrust_linear": "0",
     "rc_smoothing": "OFF", "deadband": "0", "yaw_deadband": "0", "small_angle": "25", "min_check": "1050",
     "serial_update_rate_hz": "1000", "failsafe_delay": "15", "msp_override_channels_mask": "15",
     "msp_override_failsafe": "OFF", "serialrx_provider": "CRSF", "failsafe_procedure": "AUTO-LAND",
     "failsafe_throttle": "1300"},
    (Mode(0, 4, 1700, 2100), Mode(50, 5, 1700, 2100)), frozenset({"RX_SERIAL"}), "AETR1234",
    "Betaflight / STM32F7X2 (S7X2) 2026.6.1", ((1000, 2000),) * 4,
)  # fmt: skip


ALONE = replace(
    GOOD, values={**GOOD.values, "failsafe_delay": "3"}, modes=GOOD.modes[:1], features=frozenset({"RX_MSP"})
)


def test_good_settings_pass():
    required(checks(GOOD))
    assert not by_msp_alone(GOOD)
    required(checks(ALONE))
    assert by_msp_alone(ALONE)


def test_a_pilot_whose_transmitter_is_off_does_not_arm():
    with pytest.raises(LinkError, match=r"remote control.*no signal.*turn the transmitter on"):
        required(checks(replace(GOOD, receiver_lost=True)))
    required(checks(replace(ALONE, receiver_lost=True)))  # MSP itself is the receiver, silent until the guard speaks


@pytest.mark.parametrize(
    ("name", "value", "mended"),
    [
        ("rates_type", "BETAFLIGHT", "set rates_type = ACTUAL"),
        ("roll_expo", "30", "set roll_expo = 0"),
        ("pitch_rc_rate", "7", "set pitch_rc_rate = 100"),
        ("yaw_rate_limit", "900", "set yaw_rate_limit = 1000"),
        ("thr_expo", "20", "set thr_expo = 0"),
        ("rc_smoothing", "ON", "set rc_smoothing = OFF"),
        ("thrust_linear", "20", "set thrust_linear = 0"),
        ("serial_update_rate_hz", "100", "set serial_update_rate_hz = 1000"),
        ("small_angle", "5", "set small_angle = 25"),
        ("msp_override_channels_mask", "7", "set msp_override_channels_mask = 15"),
        ("msp_override_channels_mask", "31", "set msp_override_channels_mask = 15"),
        ("msp_override_failsafe", "ON", "set msp_override_failsafe = OFF"),
        ("failsafe_delay", "50", "set failsafe_delay = 15"),
        ("yaw_control_reversed", "ON", "set yaw_control_reversed = OFF"),
        ("mid_rc", "1480", "set mid_rc = 1500"),
        ("motor_output_limit", "80", "set motor_output_limit = 100"),
        ("throttle_boost", "5", "set throttle_boost = 0"),
        ("vbat_sag_compensation", "100", "set vbat_sag_compensation = 0"),
        ("fpv_mix_degrees", "20", "set fpv_mix_degrees = 0"),
        ("dyn_idle_min_rpm", "30", "set dyn_idle_min_rpm = 0"),
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
        (replace(GOOD, ranges_us=(*GOOD.ranges_us[:3], (1010, 1990))), "rxrange reset"),
        (replace(GOOD, modes=(*GOOD.modes, Mode(0, 6, 900, 1300))), "expected one"),
    ):
        with pytest.raises(LinkError, match=mended):
            required(checks(wrong))


@pytest.mark.parametrize(
    ("modes", "said"),
    [
        ((Mode(0, 4, 1700, 2100), Mode(1, 5, 900, 1300)), "mode 1 on channel 6: on at 1000 us"),
        ((Mode(0, 4, 1700, 2100), Mode(46, 7, 1000, 1300)), "mode 46 on channel 8: on at 1000 us"),
        ((Mode(0, 4, 1700, 2100), Mode(1, 4, 1700, 2100)), "mode 1 on channel 5: on at 1900 us"),
        ((Mode(0, 4, 900, 1300),), "mode 0 on channel 5: on at 1000 us"),
        ((Mode(0, 8, 1700, 2100),), "mode 0 on channel 9: not sent"),
        ((Mode(0, 4, 1700, 2100), Mode(27, 9, 1700, 2100)), "mode 27 on channel 10: not sent"),
    ],
)
def test_by_msp_alone_nothing_is_on_that_nobody_switches(modes, said):
    with pytest.raises(LinkError, match=said):
        required(checks(replace(ALONE, modes=modes)))


def test_by_msp_alone_air_mode_may_be_on_and_other_switches_at_rest():
    required(checks(replace(ALONE, modes=(Mode(0, 4, 1700, 2100), Mode(28, 5, 900, 2100), Mode(1, 6, 1300, 1700)))))


@pytest.mark.parametrize(
    ("name", "value", "mended"),
    [
        ("failsafe_procedure", "DROP", "set failsafe_procedure = AUTO-LAND"),
        ("failsafe_throttle", "1000", "set failsafe_throttle = 1250"),
        ("failsafe_delay", "15", "set failsafe_delay = 3"),
    ],
)
def test_by_msp_alone_the_firmware_lands_when_the_sender_dies(name, value, mended):
    with pytest.raises(LinkError, match=mended):
        required(checks(replace(ALONE, values={**ALONE.values, name: value})))


def test_its_throttle_is_one_that_sinks():
    required(checks(ALONE, failsafe_us=(1280.0, 1310.0)))
    for wrong in ((1320.0, 1350.0), (1200.0, 1290.0)):
        with pytest.raises(LinkError, match="failsafe_throttle: 1300, expected"):
            required(checks(ALONE, failsafe_us=wrong))


@pytest.mark.parametrize(
    ("firmware", "passes"),
    [
        ("Betaflight / STM32F405 (S405) 4.5.1 Jul 27 2024 / 09:12:00 (77d01ba3b)", False),
        ("Betaflight / STM32F405 (S405) 2025.12.2 Jan 27 2026", False),
        ("Betaflight / STM32F405 (S405) 2026.6.0 Jul 27 2026", True),
        ("Betaflight / SITL (SITL) 4.6.0 Jul 27 2025", True),
        ("", False),
    ],
)
def test_an_override_that_holds_the_last_sticks_of_a_dead_sender_is_refused(firmware, passes):
    failed = [check.name for check in checks(replace(GOOD, firmware=firmware)) if not check.passed]
    assert failed == ([] if passes else ["override without a sender"])


@pytest.mark.parametrize(("mixer", "rotors"), [("QUADX", 4), ("", 4), ("HEX6X", 6), ("OCTOX8", 8)])
def test_the_mixer_must_drive_as_many_rotors_as_the_file_has(mixer, rotors):
    told = replace(GOOD, mixer=mixer)
    required((as_many_rotors(told, rotors),))
    other = 10 - rotors if rotors != 8 else 6
    with pytest.raises(LinkError, match=f"not armed. mixer: {mixer or 'QUADX'}, the vehicle file has {other} rotors"):
        required((as_many_rotors(told, other),))
