"""How much of the force that is asked for comes: weak rotors, a thrust map that is off."""

from dataclasses import dataclass

import numpy as np

LEAST, MOST = 0.75, 1.4
"""Share that is believed; beyond, the vehicle file is of another vehicle. The guard hovers by its inverse."""
_LEARNT_S = 0.5
SLOW_M_S, GENTLE_M_S2, UPRIGHT = 1.2, 1.0, 0.95
"""No faster than a take-off: drag is small. No bend, and no wind that is leant against: they are no thrust."""
_LOADED = 0.5
"""Of the weight: a smaller force shows little of its scale."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What the vehicle does."""

    speed_m_s: float
    """As estimated."""
    bend_m_s2: float
    """Horizontal acceleration of the set-point: a take-off shows the thrust."""
    up_z: float
    """Of the body's z axis, along world z."""
    predicted_m_s2: float
    """By the rotors along body z, the share in it."""
    excess_m_s2: float
    """Along body z, that would explain the vertical acceleration that neither rotors nor gravity do."""


class Effectiveness:
    """The share, learnt in slow flight: an error of the thrust's scale goes with the force, and bends take more of it.

    On the way, where every lag shows as a force, it stays; what changes there, as a battery does, is the observer's.
    """

    def __init__(self, gravity_m_s2: float) -> None:
        self._least_m_s2 = _LOADED * gravity_m_s2
        self.share = 1.0

    @property
    def at_bound(self) -> bool:
        return not LEAST < self.share < MOST

    def learn(self, step_s: float, now: Moment) -> bool:
        """Whether it was a moment to learn from: the share takes up its excess, unless it is at a bound."""
        slow = now.speed_m_s < SLOW_M_S and now.bend_m_s2 < GENTLE_M_S2
        if not slow or now.up_z < UPRIGHT or now.predicted_m_s2 < self._least_m_s2:
            return False
        target = self.share * (1.0 + now.excess_m_s2 / now.predicted_m_s2)
        passed = 1.0 - float(np.exp(-step_s / _LEARNT_S))
        self.share = float(np.clip(self.share + passed * (target - self.share), LEAST, MOST))
        return not self.at_bound
