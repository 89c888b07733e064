"""What of the firmware's settings must hold before anything is armed, and the CLI line that mends it."""

import re
from collections.abc import Iterator

from firmware_bridge.arming import ArmingCheck
from firmware_bridge.offboard.firmware import ARM_BOX, OVERRIDE_BOX
from firmware_bridge.offboard.settings import Mode, Settings

AXES = ("roll", "pitch", "yaw")
STICKS_MASK = 0b1111
LONGEST_FAILSAFE_S, LONGEST_ALONE_S = 1.5, 0.3
"""Of `failsafe_delay`. The firmware holds the last sticks for 0.3 s and then cuts the throttle until the delay is over:
longer, a vehicle without a pilot falls before it begins to land."""
LOWEST_SERIAL_HZ = 500
SMALLEST_ARMING_DEG = 15
HOVER_THROTTLE = 0.15, 0.8
"""By the vehicle file: a hover beyond leaves no room, or is of another vehicle than one that flies."""
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
    "yaw_control_reversed": "OFF",
    "mid_rc": "1500",
    "motor_output_limit": "100",
    "throttle_boost": "0",
    "vbat_sag_compensation": "0",
    "fpv_mix_degrees": "0",
    "dyn_idle_min_rpm": "0",
}
"""So that a pulse means a rate, and a throttle a thrust, in one way only and at once."""


_SENT_CHANNELS, _REST_US = 8, 1000
"""By MSP alone; every switch but that which arms rests there."""
_HARMLESS = {4, 8, 13, 15, 19, 20, *range(23, 27), 28, *range(31, 35), 36, 37, *range(39, 45), 48, *range(51, 55)}
"""Modes that may be on: they change neither what sticks mean nor whether rotors turn."""
_RANGE_US = (1000, 2000)
_LOWEST_FAILSAFE_US = 1100
_HOLDS = re.compile(r"(4\.\d+|2025\.12)\.\d+")
"""Versions whose override goes on with the last pulses when none come any more (betaflight.com, pull request 752)."""
_SIMULATED = "SITL"
_MIXERS = {
    4: ("QUADX", "QUADP", "QUADX_1234", "Y4", "VTAIL4", "ATAIL4"), 6: ("HEX6X", "HEX6", "HEX6H", "Y6"),
    8: ("OCTOX8", "OCTOFLATX", "OCTOFLATP"),
}  # fmt: skip
"""By how many rotors they drive; the first is the usual one."""


def hover(throttle: float) -> ArmingCheck:
    """Whether the vehicle file's hover is one to fly by."""
    least, most = HOVER_THROTTLE
    return ArmingCheck(
        "hover throttle", least <= throttle <= most,
        f"{throttle:.2f} of full by the vehicle file, expected {least} to {most}",
        "mend its mass, thrust or rotor_speed_max_rad_s",
    )  # fmt: skip


def by_msp_alone(settings: Settings) -> bool:
    """Whether MSP is the only receiver; else it overrides another one's channels."""
    serial = "RX_SERIAL" in settings.features and settings.values.get("serialrx_provider") == "MSP"
    return serial or "RX_MSP" in settings.features


def arm_mode(settings: Settings) -> Mode | None:
    """The switch that arms."""
    return next((mode for mode in settings.modes if mode.mode == ARM_BOX), None)


def checks(settings: Settings, *, failsafe_us: tuple[float, float] | None = None) -> tuple[ArmingCheck, ...]:
    """Every condition with what was read.

    Args:
        failsafe_us: of `failsafe_throttle`, between which this vehicle sinks slowly; None: only that rotors turn.
    """
    found = [_equal(settings, name, value) for name, value in _AS_IT_MUST_BE.items()]
    found += [_linear(settings, axis) for axis in AXES]
    found += [_order(settings), _ranges(settings), _serial_rate(settings), _arming_angle(settings), _no_3d(settings)]
    found += list(_receiver(settings))
    return (*found, *_failsafe(settings, failsafe_us))


def simulator(settings: Settings) -> ArmingCheck:
    """Until the bridge has flown hardware: a port of this machine may lead to a real vehicle too."""
    return ArmingCheck(
        "firmware", _SIMULATED in settings.firmware, f"{settings.firmware or 'unknown'}, expected Betaflight's SITL",
        "the Betaflight bridge has flown only the SITL; it arms no real vehicle",
    )  # fmt: skip


def as_many_rotors(settings: Settings, rotors: int) -> ArmingCheck:
    """Whether the firmware's mixer drives as many as the vehicle file has."""
    mixer, known = settings.mixer or _MIXERS[4][0], _MIXERS.get(rotors, ())
    return ArmingCheck(
        "mixer", mixer in known, f"{mixer}, the vehicle file has {rotors} rotors",
        f"give the file of this vehicle{f', or mixer {known[0]}' if known else ''}",
    )  # fmt: skip


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
    within = 10.0 * end <= limit_deg_s
    return ArmingCheck(
        f"{axis} rate",
        centre == end > 0.0 and within,
        f"{10.0 * centre:.0f} deg/s at the centre, {10.0 * end:.0f} at the end, limit {limit_deg_s:.0f}; expected "
        "equal and within the limit",
        f"set {axis}_rc_rate = {max(end, 1.0):.0f}" if within else f"set {axis}_rate_limit = {10.0 * end:.0f}",
    )


def _order(settings: Settings) -> ArmingCheck:
    order = settings.channel_order
    return ArmingCheck("channel order", order.startswith("AETR"), f"{order}, expected AETR", "map AETR1234")


def _ranges(settings: Settings) -> ArmingCheck:
    wrong = [f"{begin}-{end}" for begin, end in settings.ranges_us if (begin, end) != _RANGE_US]
    said = f"{', '.join(wrong) or 'all sticks as they are'}, expected {_RANGE_US[0]}-{_RANGE_US[1]}"
    return ArmingCheck("rxrange", not wrong, said, "rxrange reset")


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
    arms = [mode for mode in settings.modes if mode.mode == ARM_BOX]
    where = ", ".join(f"channel {mode.channel + 1} from {mode.from_us} to {mode.to_us}" for mode in arms)
    yield ArmingCheck(
        "arm switch", len(arms) == 1, f"{where or 'no channel arms'}; expected one", "aux 0 0 0 1700 2100 0 0"
    )
    if by_msp_alone(settings):
        yield from _rest(settings)
        return
    said = "no signal" if settings.receiver_lost else "no fault told"
    yield ArmingCheck("remote control", not settings.receiver_lost, said, "turn the transmitter on, then look again")
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
    yield _returns(settings)


def _rest(settings: Settings) -> Iterator[ArmingCheck]:
    """By MSP alone nobody moves a switch: what the pulses that we send turn on is on throughout the flight."""
    arms = arm_mode(settings)
    for mode in settings.modes:
        sent_us = {_REST_US}
        if mode.mode != ARM_BOX and arms is not None and mode.channel == arms.channel:
            sent_us.add((arms.from_us + arms.to_us) // 2)
        on = sorted(us for us in sent_us if mode.from_us <= us < mode.to_us)
        unsent = mode.channel >= _SENT_CHANNELS
        if mode.mode in _HARMLESS:
            continue
        said = f"on at {on[0]} us, which is sent" if on else "not sent" if unsent else "off"
        yield ArmingCheck(
            f"mode {mode.mode} on channel {mode.channel + 1}", not on and not unsent,
            f"{said}; by MSP alone a mode must rest off, on channels 5 to {_SENT_CHANNELS}",
            "aux 0 0 0 1700 2100 0 0" if mode.mode == ARM_BOX else f"clear the line `aux` of mode {mode.mode}",
        )  # fmt: skip


def _returns(settings: Settings) -> ArmingCheck:
    """Whether the pilot has the sticks again when pulses end."""
    version = _HOLDS.search(settings.firmware)
    simulated = _SIMULATED in settings.firmware
    said = f"{version[0]} holds the last sticks" if version else settings.firmware or "unknown"
    return ArmingCheck(
        "override without a sender", simulated or bool(settings.firmware and not version),
        f"{said}{' (a simulation)' if simulated else ''}; expected to return to the receiver",
        "update the firmware, or fly by MSP alone: set serialrx_provider = MSP",
    )  # fmt: skip


def _failsafe(settings: Settings, failsafe_us: tuple[float, float] | None) -> Iterator[ArmingCheck]:
    delay_s = 0.1 * settings.number("failsafe_delay", 15.0)
    longest_s = LONGEST_ALONE_S if by_msp_alone(settings) else LONGEST_FAILSAFE_S
    yield ArmingCheck(
        "failsafe_delay", delay_s < longest_s + 0.01, f"{delay_s:.1f} s, at most {longest_s}",
        f"set failsafe_delay = {10.0 * longest_s:.0f}",
    )  # fmt: skip
    # ON would let our pulses stand in for a receiver that is lost: the pilot's failsafe would never come
    if not by_msp_alone(settings):
        yield _equal(settings, "msp_override_failsafe", "OFF")
        return
    # by MSP alone it is all that is left when the sender dies, and its defaults are to fall
    procedure, throttle_us = (
        settings.values.get("failsafe_procedure", "unknown"),
        settings.number("failsafe_throttle", 0.0),
    )
    yield ArmingCheck(
        "failsafe_procedure", procedure == "AUTO-LAND", f"{procedure}, expected AUTO-LAND",
        "set failsafe_procedure = AUTO-LAND",
    )  # fmt: skip
    least_us, most_us = failsafe_us or (_LOWEST_FAILSAFE_US, 2000.0)
    yield ArmingCheck(
        "failsafe_throttle", least_us <= throttle_us <= most_us,
        f"{throttle_us:.0f}, expected {least_us:.0f} to {most_us:.0f}, at which this vehicle sinks slowly",
        f"set failsafe_throttle = {0.5 * (least_us + most_us) if failsafe_us else 1250:.0f}",
    )  # fmt: skip
