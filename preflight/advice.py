"""What would be a go: the largest wind, and the least slowing down, both found by flying them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

SLOWER = (1.05, 1.1, 1.2, 1.35, 1.5, 2.0)
"""Durations over the plan's that are tried, the fastest first."""
_WIND_STEP_M_S = 0.5


@dataclass(frozen=True, slots=True)
class Advice:
    """Each tried by as many flights as show the risk."""

    wind_m_s: float | None
    """Largest wind that is a go; None: not even calm air is."""
    slower: float | None
    """Least of `SLOWER` that is a go in the wind that was asked for; 1 if the plan is, None if none is."""

    def as_dict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    def sentence(self) -> str:
        wind = "no wind at all is a go" if self.wind_m_s is None else f"a go in up to {self.wind_m_s:g} m/s of wind"
        if self.slower == 1.0:
            return wind
        slower = f"{SLOWER[-1]:g} times slower is no go either" if self.slower is None else (
            f"{self.slower:g} times slower is a go"
        )  # fmt: skip
        return f"{slower}; {wind}"


def advise(wind_m_s: float, most_m_s: float, go: bool, is_go: Callable[[float, float], bool]) -> Advice:
    """Find both.

    Args:
        wind_m_s: that was asked for, and `go`, what came out.
        most_m_s: in which the vehicle hovers.
        is_go: of a mean wind and a duration over the plan's. Flights have common random numbers, so that it is taken to
            change once only, from a go to none as the wind rises.
    """
    slower = 1.0 if go else next((factor for factor in SLOWER if is_go(wind_m_s, factor)), None)
    return Advice(_largest(wind_m_s, most_m_s, go, lambda wind: is_go(wind, 1.0)), slower)


def _largest(wind_m_s: float, most_m_s: float, go: bool, is_go: Callable[[float], bool]) -> float | None:
    """By halving steps of `_WIND_STEP_M_S`."""
    least, most = (wind_m_s, most_m_s) if go else (0.0, wind_m_s)
    if not go and (wind_m_s <= 0.0 or not is_go(0.0)):
        return None
    steps_below, steps_above = 0, max(int((most - least) / _WIND_STEP_M_S), 0) + (0 if go else 1)
    while steps_above - steps_below > 1:
        middle = (steps_below + steps_above) // 2
        if is_go(least + middle * _WIND_STEP_M_S):
            steps_below = middle
        else:
            steps_above = middle
    return least + steps_below * _WIND_STEP_M_S
