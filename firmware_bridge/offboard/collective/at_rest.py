"""What rotors that turn at a speed would give in air at rest: that is what a throttle means."""

import numpy as np
from numpy.typing import NDArray

from firmware_bridge import _controller
from flight import FloatArray

_POINTS = 400
_MOST_M_S2 = 60.0
"""Of the table, per mass: more than the mixer's rotors give is left out."""
_SAME_SPEED = 1.001


class RotorsAtRest:
    """Force over rotor speed, by the thrust law of the controller, whatever that is.

    The mixer solves for the speeds that give a force in the air as it flows; a thrust map tells the throttle for a
    force in air at rest. Between them is the speed.
    """

    def __init__(self, parameters: NDArray[np.float32], mass_kg: float) -> None:
        """
        Args:
            parameters: (p,) all of the controller's, in the order of its table.
        """
        forces_n = np.linspace(0.0, _MOST_M_S2 * mass_kg, _POINTS)
        wrench, still = np.zeros((_POINTS, 4), np.float32), np.zeros((_POINTS, 3), np.float32)
        wrench[:, 0] = forces_n
        speeds = np.asarray(_controller.mixer(parameters, wrench, still, still)[0][:, :4], np.float64).mean(axis=1)
        between = (speeds > speeds.min() * _SAME_SPEED) & (speeds < speeds.max() / _SAME_SPEED)
        self._forces_n, self._speeds_rad_s = forces_n[between], speeds[between]

    def force_n(self, rotor_speed_rad_s: FloatArray, thrust_n: float) -> float:
        """Collective force in air at rest of rotor speeds (4,).

        Args:
            thrust_n: of the mixer; it is the answer where the rotors cannot turn more slowly.
        """
        if float(np.mean(rotor_speed_rad_s)) <= self._speeds_rad_s[0]:
            return thrust_n
        return float(np.interp(rotor_speed_rad_s, self._speeds_rad_s, self._forces_n).mean())

    def lagging_rad_s(self, rotor_speed_rad_s: FloatArray, force_n: float) -> FloatArray:
        """Speeds (4,) as unlike each other as those, which give a force in air at rest."""
        size_rad_s = float(np.sqrt(np.mean(rotor_speed_rad_s**2)))
        wanted_rad_s = float(np.interp(force_n, self._forces_n, self._speeds_rad_s))
        return rotor_speed_rad_s * (wanted_rad_s / size_rad_s) if size_rad_s > 0.0 else np.full(4, wanted_rad_s)


class Lead:
    """The rotors' lag, undone up to a filter's frequency: (lag s + 1) / (filter s + 1) of their speed."""

    def __init__(self, lag_s: float, filter_s: float) -> None:
        self._filter_s, self._gain = filter_s, lag_s / filter_s
        self._slow: float | None = None

    def reset(self) -> None:
        self._slow = None

    def force_n(self, force_n: float, step_s: float) -> float:
        """What to ask for, so that the force comes sooner: its square root goes with the speed."""
        speed = float(np.sqrt(max(force_n, 0.0)))
        if self._slow is None:
            self._slow = speed
        self._slow += (1.0 - float(np.exp(-step_s / self._filter_s))) * (speed - self._slow)
        return max(self._slow + self._gain * (speed - self._slow), 0.0) ** 2
