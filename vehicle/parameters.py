"""A parameter with its standard deviation and source; and the limits of the vehicle."""

from dataclasses import asdict, dataclass
from math import inf, isfinite

import numpy as np

from flight import FloatArray, InputError


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value, its standard deviation, its unit and where it came from."""

    value: float
    """In SI units."""
    std: float = 0.0
    """Standard deviation in the same unit; 0 for a number taken as exact."""
    unit: str = "1"
    """SI unit as text, `1` for none."""
    source: str = ""
    """Where the value came from: a paper, a data sheet, a scale, an identification."""

    def __post_init__(self) -> None:
        if not isfinite(self.value):
            raise InputError(f"a parameter's value is {self.value}; it must be finite")
        if not self.std >= 0.0:
            raise InputError(f"a parameter's standard deviation is {self.std}; it must be zero or more")


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that a plan must keep."""

    speed_m_s: float = 8.0
    """Largest speed along the path."""
    acceleration_m_s2: float = 8.0
    """Largest acceleration, gravity not included."""
    tilt_rad: float = 0.9
    """Largest angle between body z and world z."""
    rate_rad_s: float = 6.0
    """Largest roll or pitch rate."""
    yaw_rate_rad_s: float = 2.0
    """Largest yaw rate."""
    rotor_speed_min_rad_s: float = 200.0
    """Slowest speed a rotor may turn at in flight."""
    rotor_speed_max_rad_s: float = 2000.0
    """Fastest speed a rotor reaches."""
    jerk_m_s3: float | None = None
    """Largest jerk (the third derivative of position); None: no limit."""

    @property
    def largest_jerk_m_s3(self) -> float:
        """The limit of jerk, infinite without one."""
        return inf if self.jerk_m_s3 is None else self.jerk_m_s3

    def rotor_margin(self, rotor_speed_rad_s: FloatArray) -> FloatArray:
        """Share of the thrust range between slowest and fastest that the busiest rotor has left, (n,) of (n, rotors).

        Thrust goes with the square of the speed; negative outside the limits.
        """
        low, high = self.rotor_speed_min_rad_s**2, self.rotor_speed_max_rad_s**2
        slowest, fastest = rotor_speed_rad_s.min(axis=1) ** 2, rotor_speed_rad_s.max(axis=1) ** 2
        return np.minimum(high - fastest, slowest - low) / (high - low)

    def as_dict(self) -> dict[str, float]:
        """By name, without a limit that there is not: files of before, and their hashes, stay what they were."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    def stricter(self, other: "Limits") -> "Limits":
        """Of each limit the stricter one."""
        ours, theirs = self.as_dict(), other.as_dict()
        least = {"rotor_speed_min_rad_s": max}
        both = {name: least.get(name, min)(ours[name], theirs[name]) for name in ours.keys() & theirs.keys()}
        return Limits(**(ours | theirs | both))

    def __post_init__(self) -> None:
        for name, value in self.as_dict().items():
            lowest_allowed = name == "rotor_speed_min_rad_s"
            if not (isfinite(value) and (value > 0.0 or (lowest_allowed and value >= 0.0))):
                raise InputError(f"limit {name} is {value}; it must be a positive, finite number")
        if self.rotor_speed_min_rad_s >= self.rotor_speed_max_rad_s:
            raise InputError(
                f"rotor_speed_min_rad_s {self.rotor_speed_min_rad_s:g} is not below "
                f"rotor_speed_max_rad_s {self.rotor_speed_max_rad_s:g}"
            )
