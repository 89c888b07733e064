"""Conditions of a preflight as flights show them: gaps and noise of the pose, noise of the gyro, wind and gusts."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import preflight
from firmware_bridge.airborne import in_the_air
from firmware_bridge.sitl_vehicle import Sensors
from flight import FlightLog, InputError
from goshawk import flown_with
from goshawk.terminal import console
from sysid.estimator.validation.steady import Steady
from sysid.logs import conditions
from sysid.logs.conditions import Conditions
from sysid.logs.reading import DRAFTED, read_log
from vehicle import Vehicle

_NO_FLIGHT = preflight.Uncertainty()
UNTOLD = {"wind_m_s": "no wind, give --wind", "gust_std_m_s": "no gusts"}
"""In words, that an observer does not tell one of `AIR`; without a wind there are no gusts either."""
ANOTHER, NO_MODEL = "; flown with another model", ", and the model is the one flown"
"""Why it does not; and what is taken for granted of a log that does not name its model."""
_TOLD_M_S = 0.5
"""Standard error of a wind up to which a flight tells it, or up to the wind itself: it is flown with that error."""
_NAMED = 3
"""Flights that are named in a sentence."""
_DEG = math.degrees(1.0)
AIR = ("wind_m_s", "gust_std_m_s")
"""Fields of `Uncertainty` that an observer tells."""
NOISE = ("position_std_m", "attitude_std_rad", "rate_std_rad_s")
"""Fields of `Sensors` and of `Conditions`."""


@dataclass(frozen=True, slots=True)
class Like:
    """What the flights tell, or what is assumed where there are none."""

    drop_outs_per_s: float = _NO_FLIGHT.drop_outs_per_s
    drop_out_s: float = _NO_FLIGHT.drop_out_s
    wind_m_s: float = _NO_FLIGHT.wind_m_s
    wind_spread_ratio: float = _NO_FLIGHT.wind_spread_ratio
    gust_std_m_s: float = _NO_FLIGHT.gust_std_m_s
    sensors: Sensors = field(default_factory=Sensors.typical)
    sources: Mapping[str, str] = field(default_factory=dict)
    """Name of an uncertainty to the flights it is from."""
    said: tuple[str, ...] = ()

    @property
    def blowing(self) -> preflight.Uncertainty:
        """All as usual, in the flights' wind, from anywhere."""
        return replace(_NO_FLIGHT, wind_m_s=self.wind_m_s, wind_spread_ratio=self.wind_spread_ratio)

    @staticmethod
    def of(
        paths: Sequence[Path],
        drop_outs_per_s: float | None = None,
        drop_out_s: float | None = None,
        *,
        models: Mapping[Path, Vehicle] | None = None,
        air: Collection[str] = AIR,
    ) -> "Like":
        """What flights tell, the gaps only where they are not given.

        Args:
            models: by their files, with one of which the flights were flown; None: they tell no wind.
            air: what of `AIR` is asked for.

        Raises:
            InputError: a flight is missing, was never in the air, or all of them tell nothing.
            FormatError: one cannot be read.
        """
        if not paths:
            return Like()
        logs = [_read(path) for path in paths]
        found, blown = conditions.of_logs(logs), _Blown.of(logs, models or {}, air)
        names = _names(paths)
        if found.gaps is None and not _noise(found) and not blown.told:
            raise InputError(
                f"{names}: neither a pose nor a gyro of some seconds to take conditions from; leave out --like"
            )
        of_all = names if len(paths) == 1 else f"{len(paths)} flights"
        told = _told(found, drop_outs_per_s is None, drop_out_s is None)
        said = (_sentence(found, of_all, told, blown, air), *blown.sentences(of_all))
        return replace(
            Like(sources=dict.fromkeys([*told, *blown.told], names), said=said),
            drop_outs_per_s=found.gaps_per_s if "drop_outs_per_s" in told else _NO_FLIGHT.drop_outs_per_s,
            drop_out_s=found.gap_s if "drop_out_s" in told else _NO_FLIGHT.drop_out_s,
            sensors=replace(Sensors.typical(), **_noise(found)),
            **blown.told,
        )


@dataclass(frozen=True, slots=True)
class _Blown:
    """The windiest and the gustiest of the flights, by the force that their observers measured."""

    told: Mapping[str, float]
    """Fields of `Like`."""
    foreign: bool = False
    """Whether one of the flights was flown with none of the models."""
    unnamed: bool = False
    """Whether one does not name its model."""

    @staticmethod
    def of(logs: Sequence[FlightLog], models: Mapping[Path, Vehicle], air: Collection[str]) -> "_Blown":
        found = [one for log in logs if (one := _lasted(log, models)) is not None]
        winds = [(math.hypot(*(k.value for k in w)), max(k.std for k in w)) for one in found if (w := one.wind_m_s)]
        winds = [(size, std) for size, std in winds if std < max(_TOLD_M_S, size)]
        gusts = [one.gust_m_s for one in found if one.gust_m_s is not None]
        told: dict[str, float] = {}
        if winds and "wind_m_s" in air:
            size, std = max(winds)
            told = {"wind_m_s": size, "wind_spread_ratio": max(_NO_FLIGHT.wind_spread_ratio, std / max(size, std))}
        told |= {"gust_std_m_s": max(gusts)} if gusts and "gust_std_m_s" in air else {}
        observed = [log for log in logs if models and log.has("observer_state")]
        return _Blown(
            told,
            foreign=any(flown_with.model_of(log, models) is None for log in observed),
            unnamed=any(not flown_with.named(log) for log in observed),
        )

    def sentences(self, flights: str) -> tuple[str, ...]:
        """What is taken: the force is of the air, a load, or an attitude that is off; no log tells them apart."""
        parts = [f"wind of {size:.1f} m/s, from anywhere"] if (size := self.told.get("wind_m_s")) is not None else []
        parts += [f"gusts of {size:.1f} m/s"] if (size := self.told.get("gust_std_m_s")) is not None else []
        granted = "if the force that its observer saw is the air's" + (NO_MODEL if self.unnamed else "")
        return (f"from {flights}: {', '.join(parts)}, {granted}",) if parts else ()


def _lasted(log: FlightLog, models: Mapping[Path, Vehicle]) -> Steady | None:
    path = flown_with.model_of(log, models) if log.has("observer_state") else None
    return None if path is None else flown_with.lasted(log, models[path])


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


def _sentence(found: Conditions, flights: str, told: Sequence[str], blown: _Blown, air: Collection[str]) -> str:
    """What is taken of pose and gyro from the flights, and that the wind is not if they do not tell it."""
    parts: list[str] = []
    if {"drop_outs_per_s", "drop_out_s"} & set(told):
        like = "" if found.gap_s is None else f" ({found.gaps_per_s:.2g} a second of {found.gap_s:.2g} s)"
        parts.append(f"{found.gaps} gaps of the pose in {found.flown_s:.0f} s{like}")
    missing = [word for name, word in zip(NOISE, ("position", "attitude", "gyro"), strict=True) if name not in told]
    if _noise(found):
        assumed = f" ({' and '.join(missing)} assumed)" if missing else ""
        parts.append(f"noise up to {noise_words(replace(Sensors.typical(), **_noise(found)))}{assumed}")
    untold = [said for name, said in UNTOLD.items() if name in air and name not in blown.told]
    why = ANOTHER if untold and blown.foreign else ""
    return "; ".join([f"from {flights}: {', '.join(parts) or 'neither gaps nor noise'}", *untold[:1]]) + why


def noise_words(sensors: Sensors) -> str:
    """Standard deviations of position, attitude and gyro."""
    position, attitude, rate = (getattr(sensors, name) for name in NOISE)
    return f"{1e3 * position:.2g} mm, {_DEG * attitude:.2g}°, {_DEG * rate:.2g}°/s"
