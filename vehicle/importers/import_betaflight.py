"""Rotors of a Betaflight `diff all` or `dump`: order and spins of QUADX, and turn rates; no lengths and no mass."""

from pathlib import Path

import numpy as np

from flight import FormatError, InputError, errors
from vehicle import layouts
from vehicle.draft import Known

LARGEST_BYTES = 4_000_000
_AXES = ("roll", "pitch", "yaw")
MOST_DEG_S = 1998.0
"""The firmware's own `*_rate_limit`, which none exceeds."""
_PLACES = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))
"""Motors 1 to 4: rear right, front right, rear left, front left."""
_SPIN = (-1.0, 1.0, 1.0, -1.0)
"""Motor 1 turns clockwise seen from above unless `yaw_motors_reversed` is on."""


_MORE = {
    "quadp": "+", "hex6": "hex+", "hex6x": "hex", "octoflatp": "octo+", "octoflatx": "octo", "octox8": "x8", "y6": "y6",
}  # fmt: skip
"""Other mixers, and the name of the layout."""


def is_betaflight(text: str) -> bool:
    return "# Betaflight /" in text[:4096] or "# INAV/" in text[:4096]


def read(path: Path) -> Known:
    """Order and spins of the motors; places on arms of 1 m, to be scaled by `--arm`.

    Raises:
        InputError: another mixer than QUADX, HEX6X and others of `layouts`.
        FormatError: it is no such text.
    """
    path = Path(path)
    text = text_of(path)
    if not is_betaflight(text):
        raise FormatError(f"{path} is no output of `diff all`: its head names no Betaflight")
    words = [line.split() for line in text.lower().splitlines()]
    mixer = next((line[1] for line in words if len(line) == 2 and line[0] == "mixer"), "quadx")
    settings = {line[1]: line[3] for line in words if len(line) >= 4 and line[0] == "set" and line[2] == "="}
    if mixer in _MORE:
        return _of_more(path, mixer, words, settings.get("yaw_motors_reversed") == "on")
    if mixer not in ("quadx", "quadx_1234"):
        known = ", ".join(name.upper() for name in ("quadx", *_MORE))
        raise InputError(f"{path} has mixer {mixer.upper()}; {known} can be modelled: give --arm and --frame")
    spin = np.array(_SPIN) * (-1.0 if settings.get("yaw_motors_reversed") == "on" else 1.0)
    places = np.array(_PLACES) / np.sqrt(2.0)
    # 1234: front left, front right, rear right, rear left
    order = [3, 1, 0, 2] if mixer == "quadx_1234" else [0, 1, 2, 3]
    hubs = np.column_stack([places, np.zeros(4)])[order]
    turned = "reversed" if settings.get("yaw_motors_reversed") == "on" else "not reversed"
    note = f"rotors 0 to 3 are motors 1 to 4 of {path.name}, mixer {mixer.upper()}, yaw_motors_reversed {turned}: check"
    full, untold = full_stick(words)
    notes = (note, f"{path.name} tells no turn rate at full stick for {', '.join(untold)}") if untold else (note,)
    return Known(hub_body_m=hubs, spin=spin[order], arm_known=False, full_stick_rad_s=full, notes=notes)


def _of_more(path: Path, mixer: str, words: list[list[str]], reversed_: bool) -> Known:
    hubs, spin = layouts.find(_MORE[mixer], "betaflight").geometry(1.0)
    turned = "reversed" if reversed_ else "not reversed"
    note = (
        f"rotors 0 to {len(spin) - 1} are motors 1 to {len(spin)} of {path.name}, mixer {mixer.upper()}, "
        f"yaw_motors_reversed {turned}: check"
    )
    full, untold = full_stick(words)
    notes = (note, f"{path.name} tells no turn rate at full stick for {', '.join(untold)}") if untold else (note,)
    turns = -spin if reversed_ else spin
    return Known(hub_body_m=hubs, spin=turns, arm_known=False, full_stick_rad_s=full, notes=notes)


def full_stick(words: list[list[str]]) -> tuple[tuple[float, float, float] | None, list[str]]:
    """Bounds on roll, pitch and yaw rate at full stick of the profile in use, rad/s, and the axes that it tells not.

    The lesser of the ACTUAL rate and `*_rate_limit`. A `diff` is silent about what is the firmware's default: such an
    axis has the firmware's own bound. None: none is told.
    """
    profiles: dict[str, dict[str, str]] = {}
    now = in_use = ""
    for line in words:
        if len(line) == 2 and line[0] == "rateprofile":
            now = in_use = line[1]  # the last such line restores the one in use
        if len(line) >= 4 and line[0] == "set" and line[2] == "=":
            profiles.setdefault(now, {})[line[1]] = line[3]
    rates = profiles.get(in_use, {})
    actual = rates.get("rates_type", "actual") == "actual"
    told = {axis: _told_deg_s(rates, axis, actual=actual) for axis in _AXES}
    untold = [axis for axis in _AXES if not told[axis]]
    if len(untold) == len(_AXES):
        return None, untold
    roll, pitch, yaw = (float(np.deg2rad(min([MOST_DEG_S, *told[axis]]))) for axis in _AXES)
    return (roll, pitch, yaw), untold


def _told_deg_s(rates: dict[str, str], axis: str, *, actual: bool) -> list[float]:
    """What bounds an axis, of its full stick (in tens) and its limit."""
    names = {f"{axis}_rate_limit": 1.0} | ({f"{axis}_srate": 10.0} if actual else {})
    numbers = [unit * int(rates[name]) for name, unit in names.items() if rates.get(name, "").isdigit()]
    return [number for number in numbers if number > 0.0]


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
