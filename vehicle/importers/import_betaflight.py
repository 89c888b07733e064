"""Rotors of a Betaflight `diff all` or `dump`: order and spins of QUADX, and turn rates; no lengths and no mass."""

from pathlib import Path

import numpy as np

from flight import FormatError, InputError, errors
from vehicle.draft import Known

LARGEST_BYTES = 4_000_000
_PLACES = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
"""Motors 1 to 4: rear right, front right, rear left, front left."""
_SPIN = (-1.0, 1.0, 1.0, -1.0)
"""Motor 1 turns clockwise seen from above unless `yaw_motors_reversed` is on."""


def is_betaflight(text: str) -> bool:
    return "# Betaflight /" in text[:4096] or "# INAV/" in text[:4096]


def read(path: Path) -> Known:
    """Order and spins of motors 1 to 4; places on arms of 1 m, to be scaled by `--arm`.

    Raises:
        InputError: another mixer than QUADX.
        FormatError: it is no such text.
    """
    path = Path(path)
    text = text_of(path)
    if not is_betaflight(text):
        raise FormatError(f"{path} is no output of `diff all`: its head names no Betaflight")
    words = [line.split() for line in text.lower().splitlines()]
    mixer = next((line[1] for line in words if len(line) == 2 and line[0] == "mixer"), "quadx")
    if mixer not in ("quadx", "quadx_1234"):
        raise InputError(f"{path} has mixer {mixer.upper()}; only QUADX can be modelled: give --arm and --frame")
    settings = {line[1]: line[3] for line in words if len(line) >= 4 and line[0] == "set" and line[2] == "="}
    spin = np.array(_SPIN) * (-1.0 if settings.get("yaw_motors_reversed") == "on" else 1.0)
    places = np.array(_PLACES) / np.sqrt(2.0)
    # 1234: front left, front right, rear right, rear left
    order = [3, 1, 0, 2] if mixer == "quadx_1234" else [0, 1, 2, 3]
    hubs = np.column_stack([places, np.zeros(4)])[order]
    turned = "reversed" if settings.get("yaw_motors_reversed") == "on" else "not reversed"
    note = f"rotors 0 to 3 are motors 1 to 4 of {path.name}, mixer {mixer.upper()}, yaw_motors_reversed {turned}: check"
    full = full_stick(words)
    return Known(hub_body_m=hubs, spin=spin[order], arm_known=False, full_stick_rad_s=full, notes=(note,))


def full_stick(words: list[list[str]]) -> tuple[float, float, float] | None:
    """Roll, pitch and yaw rate at full stick by the ACTUAL rates of the profile in use; None: not told.

    A `diff` is silent about what is the firmware's default.
    """
    profiles: dict[str, dict[str, str]] = {}
    now = in_use = ""
    for line in words:
        if len(line) == 2 and line[0] == "rateprofile":
            now = in_use = line[1]  # the last such line restores the one in use
        if len(line) >= 4 and line[0] == "set" and line[2] == "=":
            profiles.setdefault(now, {})[line[1]] = line[3]
    rates = profiles.get(in_use, {})
    told = [rates.get(f"{axis}_srate", "") for axis in ("roll", "pitch", "yaw")]
    if rates.get("rates_type", "actual") != "actual" or not all(text.isdigit() and int(text) > 0 for text in told):
        return None
    roll, pitch, yaw = (float(np.deg2rad(10.0 * int(text))) for text in told)
    return roll, pitch, yaw


def text_of(path: Path) -> str:
    """
    Raises:
        InputError: there is no such file.
        FormatError: it is large, or no text.
    """
    if not path.is_file():
        raise errors.missing(path)
    if path.stat().st_size > LARGEST_BYTES:
        raise FormatError(f"{path} has {path.stat().st_size} bytes; a file of settings has less than {LARGEST_BYTES}")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not text; save it as UTF-8") from None
