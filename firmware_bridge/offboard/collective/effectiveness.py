"""How much of the force that is asked for comes: weak rotors, a thrust map that is off."""

import numpy as np

LEAST, MOST = 0.6, 1.4
"""Share that is believed; beyond, the vehicle file is of another vehicle."""
_LEARNT_S = 0.5
SLOW_M_S = 1.1
"""No faster: drag is small, and a take-off or the way to the start is such a flight."""
_LOADED = 0.5
"""Of the weight: a smaller force shows little of its scale."""


class Effectiveness:
    """The share, learnt in slow flight: an error of the thrust's scale goes with the force, and bends take more of it.

    On the way, where every lag shows as a force, it stays; what changes there, as a battery does, is the observer's.
    """

    def __init__(self, gravity_m_s2: float) -> None:
        self._least_m_s2 = _LOADED * gravity_m_s2
        self.share = 1.0

    def learn(self, step_s: float, speed_m_s: float, predicted_m_s2: float, excess_m_s2: float) -> bool:
        """Whether it was a moment to learn from.

        Args:
            speed_m_s: of the set-point.
            predicted_m_s2: acceleration by the rotors along body z, this share in it.
            excess_m_s2: along body z, that neither rotors nor gravity explain.
        """
        if speed_m_s > SLOW_M_S or predicted_m_s2 < self._least_m_s2:
            return False
        target = self.share * (1.0 + excess_m_s2 / predicted_m_s2)
        passed = 1.0 - float(np.exp(-step_s / _LEARNT_S))
        self.share = float(np.clip(self.share + passed * (target - self.share), LEAST, MOST))
        return True
