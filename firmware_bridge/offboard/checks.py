"""What of the firmware's settings must hold before anything is armed, and the CLI line that mends it."""

from collections.abc import Iterator

from firmware_bridge.arming import ArmingCheck
from firmware_bridge.offboard.firmware import ARM_BOX, OVERRIDE_BOX
from firmware_bridge.offboard.settings import Mode, Settings

AXES = ("roll", "pitch", "yaw")
STICKS_MASK = 0b1111
LONGEST_FAILSAFE_S = 1.5
LOWEST_SERIAL_HZ = 500
SMALLEST_ARMING_DEG = 15
_AS_IT_MUST_BE = {
    "rates_type": "ACTUAL",
    "roll_expo": "0",
    "pitch_expo": "0",
    "yaw_expo": "0",
    "thr_expo": "0",
    "throttle_limit_type": "OFF",
    "thrust_linear": "0",
    "rc_smoothing": "OFF",
    "deadband": "0",
    "yaw_deadband": "0",
}
"""So that a pulse means a rate, and a throttle a thrust, in one way only and at once."""


def by_msp_alone(settings: Settings) -> bool:
    """Whether MSP is the only receiver; else it overrides another one's channels."""
    serial = "RX_SERIAL" in settings.features and settings.values.get("serialrx_provider") == "MSP"
    return serial or "RX_MSP" in settings.features


def arm_mode(settings: Settings) -> Mode | None:
    """The switch that arms."""
    return next((mode for mode in settings.modes if mode.mode == ARM_BOX), None)


def checks(settings: Settings) -> tuple[ArmingCheck, ...]:
    """Every condition with what was read."""
    found = [_equal(settings, name, value) for name, value in _AS_IT_MUST_BE.items()]
    found += [_linear(settings, axis) for axis in AXES]
    found += [_order(settings), _serial_rate(settings), _arming_angle(settings), _no_3d(settings)]
    found += list(_receiver(settings))
    return (*found, *_failsafe(settings))


def _equal(settings: Settings, name: str, wanted: str) -> ArmingCheck:
    value = settings.values.get(name, "")
    # a setting that this firmware does not have cannot be wrong
    return ArmingCheck(
        name, value in ("", wanted), f"{value or 'not known here'}, expected {wanted}", f"set {name} = {wanted}"
    )


def _linear(settings: Settings, axis: str) -> ArmingCheck:
    """ACTUAL rates are in proportion where the centre's slope is that of the end, below the limit."""
    centre, end = settings.number(f"{axis}_rc_rate", 0.0), settings.number(f"{axis}_srate", -1.0)
    limit_deg_s = settings.number(f"{axis}_rate_limit", 1998.0)
    return ArmingCheck(
        f"{axis} rate",
        centre == end > 0.0 and 10.0 * end <= limit_deg_s,
        f"{10.0 * centre:.0f} deg/s at the centre, {10.0 * end:.0f} at the end, limit {limit_deg_s:.0f}; expected "
        "equal and within the limit",
        f"set {axis}_rc_rate = {max(end, 1.0):.0f}",
    )


def _order(settings: Settings) -> ArmingCheck:
    order = settings.channel_order
    return ArmingCheck("channel order", order.startswith("AETR"), f"{order}, expected AETR", "map AETR1234")


def _serial_rate(settings: Settings) -> ArmingCheck:
    rate_hz = settings.number("serial_update_rate_hz", LOWEST_SERIAL_HZ)
    return ArmingCheck(
        "serial_update_rate_hz",
        rate_hz >= LOWEST_SERIAL_HZ,
        f"{rate_hz:.0f} Hz, at least {LOWEST_SERIAL_HZ}",
        "set serial_update_rate_hz = 1000",
    )


def _arming_angle(settings: Settings) -> ArmingCheck:
    angle_deg = settings.number("small_angle", 25.0)
    return ArmingCheck(
        "small_angle",
        angle_deg >= SMALLEST_ARMING_DEG,
        f"arms below {angle_deg:.0f} deg, at least {SMALLEST_ARMING_DEG}",
        "set small_angle = 25",
    )


def _no_3d(settings: Settings) -> ArmingCheck:
    return ArmingCheck("3D", "3D" not in settings.features, "rotors that reverse are not flown", "feature -3D")


def _receiver(settings: Settings) -> Iterator[ArmingCheck]:
    arms = arm_mode(settings)
    yield ArmingCheck(
        "arm switch", arms is not None, "no channel arms" if arms is None else f"channel {arms.channel + 1}",
        "aux 0 0 0 1700 2100 0 0",
    )  # fmt: skip
    if by_msp_alone(settings):
        return
    mask = int(settings.number("msp_override_channels_mask", 0.0))
    yield ArmingCheck(
        "msp_override_channels_mask",
        mask & STICKS_MASK == STICKS_MASK,
        f"{mask}, expected all four sticks: {STICKS_MASK}",
        f"set msp_override_channels_mask = {STICKS_MASK}",
    )
    for mode in settings.modes:
        free = not mask >> mode.channel & 1
        yield ArmingCheck(
            f"switch of mode {mode.mode}",
            free,
            f"channel {mode.channel + 1} is {'left to' if free else 'taken from'} the pilot",
            f"set msp_override_channels_mask = {STICKS_MASK}",
        )
    yield ArmingCheck(
        "override switch",
        any(mode.mode == OVERRIDE_BOX for mode in settings.modes),
        "no switch gives the sticks to MSP and takes them back",
        f"aux 1 {OVERRIDE_BOX} 1 1700 2100 0 0",
    )


def _failsafe(settings: Settings) -> Iterator[ArmingCheck]:
    delay_s = 0.1 * settings.number("failsafe_delay", 10.0)
    yield ArmingCheck(
        "failsafe_delay", delay_s <= LONGEST_FAILSAFE_S, f"{delay_s:.1f} s, at most {LONGEST_FAILSAFE_S}",
        "set failsafe_delay = 10",
    )  # fmt: skip
    # ON would let our pulses stand in for a receiver that is lost: the pilot's failsafe would never come
    if not by_msp_alone(settings):
        yield _equal(settings, "msp_override_failsafe", "OFF")
