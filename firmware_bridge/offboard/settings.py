"""The firmware's settings, read back from its command line before anything is armed."""

import contextlib
import time
from dataclasses import dataclass, field

from firmware_bridge.offboard.byte_line import ByteLine
from firmware_bridge.offboard.msp import ANSWER, Decoder, Frame, encode
from flight import LinkError

NAMES = (
    *(f"{axis}_{name}" for axis in ("roll", "pitch", "yaw") for name in ("rc_rate", "srate", "expo", "rate_limit")),
    "rates_type", "thr_expo", "throttle_limit_type", "thrust_linear", "rc_smoothing", "deadband", "yaw_deadband",
    "small_angle", "min_check", "serial_update_rate_hz", "failsafe_procedure", "failsafe_delay", "failsafe_throttle",
    "yaw_control_reversed", "mid_rc", "motor_output_limit", "throttle_boost", "vbat_sag_compensation", "motor_idle",
    "fpv_mix_degrees", "dyn_idle_min_rpm", "msp_override_channels_mask", "msp_override_failsafe", "serialrx_provider",
)  # fmt: skip
"""What is looked at."""
FEATURES = {"RX_SERIAL": 3, "3D": 12, "RX_MSP": 14}
"""Bits of the features that matter."""
_FEATURE_CONFIG = 36
_PROMPT, _PAUSE_S = "\n# ", 0.02


@dataclass(frozen=True, slots=True)
class Mode:
    """One line `aux`: a mode, and the switch that turns it on."""

    mode: int
    """The mode's permanent id."""
    channel: int
    """Receiver channel from 0; the first switch is 4."""
    from_us: int
    to_us: int


@dataclass(frozen=True, slots=True)
class Settings:
    """What the firmware has said."""

    values: dict[str, str]
    """By name; one that this firmware does not have is missing."""
    modes: tuple[Mode, ...] = ()
    features: frozenset[str] = field(default_factory=frozenset)
    channel_order: str = ""
    firmware: str = ""
    """Its first line about itself."""
    ranges_us: tuple[tuple[int, int], ...] = ()
    """Of the four sticks, as the receiver is calibrated."""
    mixer: str = ""
    """QUADX, HEX6X and others; empty where the firmware knows no other than for four rotors."""
    receiver_lost: bool = False
    """Whether it said that no receiver gives a signal."""

    def number(self, name: str, otherwise: float) -> float:
        try:
            return float(self.values[name])
        except (KeyError, ValueError):
            return otherwise


def read(line: ByteLine, *, patience_s: float = 10.0) -> Settings:
    """Ask for every setting. The firmware restarts after it, as it does not arm once its command line was open.

    Raises:
        LinkError: it does not answer, or has no command line now, e.g. because it is armed.
    """
    features = _features(line, patience_s)
    opened = _asked(line, "#", patience_s)
    if "Entering CLI" not in opened:
        raise LinkError("the flight controller's command line does not open: is it armed, or the line in use?")
    line.write(b"\n")  # the first command is lost
    version = _asked(line, "version\n", patience_s)
    values = {name: value for name in NAMES if (value := _value(_asked(line, f"get {name}\n", patience_s), name))}
    modes = tuple(_modes(_asked(line, "aux\n", patience_s)))
    ranges_us = tuple(_ranges(_asked(line, "rxrange\n", patience_s)))
    mixer = _asked(line, "mixer\n", patience_s).partition("Mixer: ")[2].split()[:1]
    flags = _asked(line, "status\n", patience_s).partition("Arming disable flags:")[2].split("\n")[0].split()
    order = _asked(line, "map\n", patience_s).partition("map ")[2].split("\r")[0].split("\n")[0].strip()
    line.write(b"exit\n")
    with contextlib.suppress(LinkError):
        _until(line, "leaving CLI", 2.0)
    about = next((text.strip(" #\r") for text in version.splitlines() if "Betaflight" in text), "")
    return Settings(values, modes, features, order, about, ranges_us, "".join(mixer), "RXLOSS" in flags)


def _asked(line: ByteLine, command: str, patience_s: float) -> str:
    """The answer; asked once more halfway, as one lost byte can cost the whole of it.

    Raises:
        LinkError: the answer has no end: what it lacks must not count as not there.
    """
    for before in ("", "\n"):  # ends what came of the first question
        line.write((before + command).encode())
        said, end_s = "", time.monotonic() + 0.5 * patience_s
        while time.monotonic() < end_s:
            said += (more := line.read(_PAUSE_S if said.endswith(_PROMPT) else 0.2).decode("ascii", "replace"))
            # it repeats the command; and a line of an answer may begin as the prompt does
            if said.endswith(_PROMPT) and not more and (command == "#" or command.strip() in said):
                return said
    raise LinkError(f"the flight controller's command line does not answer `{command.strip()}` to the end")


def _until(line: ByteLine, end: str, patience_s: float) -> str:
    said, end_s = "", time.monotonic() + patience_s
    while end not in said[-200:] and time.monotonic() < end_s:
        said += line.read(0.2).decode("ascii", "replace")
    return said


def _value(said: str, name: str) -> str:
    """Of `name = value`; empty where the firmware does not know it: it says so, or lists others with that in the name.

    Raises:
        LinkError: neither.
    """
    others = "INVALID NAME" in said.upper()
    for text in said.splitlines():
        left, is_value, right = text.partition(" = ")
        if left.strip(" #") == name and right.strip():
            return right.strip()
        others |= bool(is_value) and name in left
    if not others:
        raise LinkError(f"the flight controller's answer to `get {name}` is damaged: {said.strip()[:80]!r}")
    return ""


def _ranges(said: str) -> list[tuple[int, int]]:
    """Of `rxrange channel from to`."""
    found = [text.split() for text in said.splitlines()]
    rows = [words for words in found if len(words) == 4 and words[0] == "rxrange" and all(map(str.isdigit, words[1:]))]
    return [(int(words[2]), int(words[3])) for words in rows]


def _modes(said: str) -> list[Mode]:
    """Of `aux index mode channel from to logic linked`; an empty range turns nothing on."""
    found: list[Mode] = []
    for text in said.splitlines():
        words = text.split()
        if len(words) >= 6 and words[0] == "aux" and all(word.isdigit() for word in words[1:6]):
            _, mode, channel, begin_us, end_us = map(int, words[1:6])
            if begin_us < end_us:
                found.append(Mode(mode, 4 + channel, begin_us, end_us))
    return found


def _features(line: ByteLine, patience_s: float) -> frozenset[str]:
    """By MSP, as the command line does not name every one of them."""
    line.write(encode(Frame(_FEATURE_CONFIG, b"")))
    decoder, end_s = Decoder(), time.monotonic() + patience_s
    while time.monotonic() < end_s:
        for frame in decoder.feed(line.read(0.2)):
            if frame.function == _FEATURE_CONFIG and frame.direction == ANSWER and len(frame.payload) >= 4:
                bits = int.from_bytes(frame.payload[:4], "little")
                return frozenset(name for name, bit in FEATURES.items() if bits >> bit & 1)
    raise LinkError("the flight controller does not answer MSP; is it on for this port, and the baud rate right?")
