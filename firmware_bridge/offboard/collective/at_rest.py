"""What rotors that turn at a speed would give in air at rest: that is what a throttle means."""

import numpy as np
from numpy.typing import NDArray

from firmware_bridge import _controller
from flight import FloatArray

_POINTS = 400
_SAME_SPEED = 1.001
_LEAST_LED = 0.5
"""Of the force: a step down stops no rotor, which would take long to turn again and holds no attitude."""
IN_MOTION = 0.5, 2.0
"""Bounds of the force in motion over that in air at rest: beyond, no thrust law holds."""


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
        self._parameters = parameters
        tried_n = mass_kg * np.geomspace(1.0, 1000.0, _POINTS)
        tried_rad_s = self._mixed_rad_s(tried_n)
        most_n = tried_n[int(np.argmax(tried_rad_s > tried_rad_s.max() / _SAME_SPEED))]
        forces_n = np.linspace(0.0, most_n, _POINTS)
        speeds = self._mixed_rad_s(forces_n)
        between = (speeds > speeds.min() * _SAME_SPEED) & (speeds < speeds.max() / _SAME_SPEED)
        self._forces_n, self._speeds_rad_s = forces_n[between], speeds[between]

    def _mixed_rad_s(self, thrust_n: FloatArray, velocity_m_s: FloatArray | None = None) -> FloatArray:
        """(n,) mean speeds for collective forces (n,) without torque, in air that flows by (3,) along the body."""
        wrench, air, still = (np.zeros((len(thrust_n), width), np.float32) for width in (4, 3, 3))
        wrench[:, 0] = thrust_n
        air[:] = 0.0 if velocity_m_s is None else velocity_m_s
        return np.asarray(_controller.mixer(self._parameters, wrench, air, still)[0][:, :4], np.float64).mean(axis=1)

    def in_motion(self, thrust_n: float, velocity_body_m_s: FloatArray) -> float:
        """Force over what the same speeds give in air at rest, within `IN_MOTION`; torques are none of its.

        Another firmware's attitude loop commands the torques: what ours would take must not move the collective.
        """
        speed_rad_s = self._mixed_rad_s(np.array([thrust_n]), velocity_body_m_s)
        at_rest_n = self.force_n(speed_rad_s, thrust_n)
        return float(np.clip(thrust_n / at_rest_n, *IN_MOTION)) if thrust_n > 0.0 and at_rest_n > 0.0 else 1.0

    def force_n(self, rotor_speed_rad_s: FloatArray, thrust_n: float) -> float:
        """Collective force in air at rest of rotor speeds (4,), or of one.

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
        led_n = max(self._slow + self._gain * (speed - self._slow), 0.0) ** 2
        return max(led_n, _LEAST_LED * force_n)
