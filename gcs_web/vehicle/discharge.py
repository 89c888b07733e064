"""How long a battery lasts: a straight line through its voltage of the last minute."""

import numpy as np

_KEPT_S, _STEP_S = 60.0, 0.5
_LEAST_S = 15.0
"""Of a flight, before anything is said."""
_LONGEST_S = 3600.0
"""More is not worth a number: the line is too flat to say when."""


class Discharge:
    """Takes the voltage of a vehicle in the air as it is heard."""

    def __init__(self) -> None:
        self._heard: list[tuple[float, float]] = []

    def take(self, time_s: float, voltage_v: float) -> None:
        """A voltage of 0 (not measured, or not in the air) begins anew."""
        if voltage_v <= 0.0 or (self._heard and time_s < self._heard[-1][0]):
            self._heard = []
        elif not self._heard or time_s - self._heard[-1][0] >= _STEP_S:
            kept = [each for each in self._heard if time_s - each[0] <= _KEPT_S]
            self._heard = [*kept, (time_s, voltage_v)]  # another list: `left_s` is asked for from other threads

    def left_s(self, least_v: float) -> float | None:
        """Until `least_v` is reached, s; None where that cannot be said yet, or 0 V is asked."""
        heard = self._heard
        if least_v <= 0.0 or len(heard) < 2 or heard[-1][0] - heard[0][0] < _LEAST_S:
            return None
        time_s, voltage_v = np.array(heard).T
        slope_v_s, now_v = np.polyfit(time_s - time_s[-1], voltage_v, 1)
        if slope_v_s >= 0.0:
            return None
        left_s = max(0.0, float((least_v - now_v) / slope_v_s))
        return left_s if left_s < _LONGEST_S else None
