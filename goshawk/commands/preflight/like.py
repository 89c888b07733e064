"""Conditions of a preflight as flights show them: gaps and noise of the pose, and noise of the gyro."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import preflight
from firmware_bridge.airborne import in_the_air
from firmware_bridge.sitl_vehicle import Sensors
from flight import FlightLog, InputError
from goshawk.terminal import console
from sysid.logs import conditions
from sysid.logs.conditions import Conditions
from sysid.logs.reading import DRAFTED, read_log

_NO_FLIGHT = preflight.Uncertainty()
NO_WIND = "no wind, give --wind"
"""The force that an observer measures is of the air, a load, or an attitude that is off: no log tells them apart."""
_NAMED = 3
"""Flights that are named in a sentence."""
_DEG = math.degrees(1.0)
NOISE = ("position_std_m", "attitude_std_rad", "rate_std_rad_s")
"""Fields of `Sensors` and of `Conditions`."""


@dataclass(frozen=True, slots=True)
class Like:
    """What the flights tell, or what is assumed where there are none."""

    drop_outs_per_s: float = _NO_FLIGHT.drop_outs_per_s
    drop_out_s: float = _NO_FLIGHT.drop_out_s
    sensors: Sensors = field(default_factory=Sensors.typical)
    sources: Mapping[str, str] = field(default_factory=dict)
    """Name of an uncertainty to the flights it is from."""
    said: tuple[str, ...] = ()

    @staticmethod
    def of(paths: Sequence[Path], drop_outs_per_s: float | None = None, drop_out_s: float | None = None) -> "Like":
        """What flights tell, the gaps only where they are not given.

        Raises:
            InputError: a flight is missing, was never in the air, or all of them tell nothing.
            FormatError: one cannot be read.
        """
        if not paths:
            return Like()
        found = conditions.of_logs([_read(path) for path in paths])
        names = _names(paths)
        if found.gaps is None and not _noise(found):
            raise InputError(
                f"{names}: neither a pose nor a gyro of some seconds to take conditions from; leave out --like"
            )
        of_all = names if len(paths) == 1 else f"{len(paths)} flights"
        told = _told(found, drop_outs_per_s is None, drop_out_s is None)
        return replace(
            Like(sources=dict.fromkeys(told, names), said=(_sentence(found, of_all, told),)),
            drop_outs_per_s=found.gaps_per_s if "drop_outs_per_s" in told else _NO_FLIGHT.drop_outs_per_s,
            drop_out_s=found.gap_s if "drop_out_s" in told else _NO_FLIGHT.drop_out_s,
            sensors=replace(Sensors.typical(), **_noise(found)),
        )


def _read(path: Path) -> FlightLog:
    """A log, of our own controller between take-off and landing."""
    log = read_log(path)
    for sentence in log.metadata.get(DRAFTED, ()):
        console.note(f"{path}, drafted {sentence}")
    return in_the_air(log, str(path)) if log.has("mission_state") else log


def _names(paths: Sequence[Path]) -> str:
    more = f" and {len(paths) - _NAMED} more" if len(paths) > _NAMED else ""
    return ", ".join(path.name for path in paths[:_NAMED]) + more


def _noise(found: Conditions) -> dict[str, float]:
    """Fields of `Sensors` that the flights tell."""
    return {name: std for name in NOISE if (std := getattr(found, name)) is not None}


def _told(found: Conditions, per_s: bool, length: bool) -> list[str]:
    """Names of what is taken from the flights: of the gaps what is asked for."""
    rate = ["drop_outs_per_s"] if per_s and found.gaps_per_s is not None else []
    return [*rate, *(["drop_out_s"] if length and found.gap_s is not None else []), *_noise(found)]


def _sentence(found: Conditions, flights: str, told: Sequence[str]) -> str:
    """What is taken from the flights, and that the wind is not."""
    parts: list[str] = []
    if {"drop_outs_per_s", "drop_out_s"} & set(told):
        like = "" if found.gap_s is None else f" ({found.gaps_per_s:.2g} a second of {found.gap_s:.2g} s)"
        parts.append(f"{found.gaps} gaps of the pose in {found.flown_s:.0f} s{like}")
    missing = [word for name, word in zip(NOISE, ("position", "attitude", "gyro"), strict=True) if name not in told]
    if _noise(found):
        assumed = f" ({' and '.join(missing)} assumed)" if missing else ""
        parts.append(f"noise up to {noise_words(replace(Sensors.typical(), **_noise(found)))}{assumed}")
    return f"from {flights}: {', '.join(parts)}; {NO_WIND}"


def noise_words(sensors: Sensors) -> str:
    """Standard deviations of position, attitude and gyro."""
    position, attitude, rate = (getattr(sensors, name) for name in NOISE)
    return f"{1e3 * position:.2g} mm, {_DEG * attitude:.2g}°, {_DEG * rate:.2g}°/s"
