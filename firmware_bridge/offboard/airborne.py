"""What the guard learns of a flight for the case that it must end it: that it flies, how high, and with what force."""

from collections import deque
from statistics import median

from firmware_bridge.offboard.firmware import FirmwareState
from firmware_bridge.offboard.poses import Pose

_ROSE_M = 0.1
_CARRIES = 0.5
"""Of the weight."""
_LEAPS_M_S = 0.5
"""Speed that the commanded force would have given: it flies, whatever its poses say."""
_HOVER_S = 2.0
"""Over which the force that hovers is averaged."""
_LEAST_HOVER, _MOST_HOVER = 0.7, 1.4
"""Of the weight: a force beyond is no hover's."""
_STEADY_M_S2 = 0.5
_POSES, _FRESH_S, _LYING_M = 200, 0.5, 1.0


class Airborne:
    """One flight."""

    def __init__(self, mass_kg: float, gravity_m_s2: float) -> None:
        self._mass_kg, self._gravity_m_s2 = mass_kg, gravity_m_s2
        self.hover_n = mass_kg * gravity_m_s2
        """Vertical force that held it, in what the planner commands: an error of the thrust map is in it."""
        self.lifted = False
        """Whether it has left the ground."""
        self._stood_m: deque[float] = deque(maxlen=_POSES)
        self._ground_m: float | None = None
        self._pose: Pose | None = None
        self._leap_m_s = 0.0

    def pose(self, pose: Pose, *, armed: bool) -> None:
        """The ground is where it stood before it was armed, in the middle of what the poses said."""
        self._pose = pose
        if not armed or self._ground_m is None:
            self._stood_m.append(float(pose.position_world_m[2]))
            self._ground_m = median(self._stood_m)

    def commanded(self, step_s: float, force_n: float, *, armed: bool) -> None:
        """A force that the vehicle flies by."""
        excess_m_s2 = force_n / self._mass_kg - self._gravity_m_s2
        self._leap_m_s = max(0.0, self._leap_m_s + step_s * excess_m_s2) if armed else 0.0
        carries = force_n > _CARRIES * self._mass_kg * self._gravity_m_s2
        self.lifted |= armed and ((carries and self._rose_m() > _ROSE_M) or self._leap_m_s > _LEAPS_M_S)

    def piloted(self, now_s: float) -> None:
        """The pilot flies it: it is in the air unless poses of now see it on the ground."""
        seen = self._pose is not None and now_s - self._pose.time_s < _FRESH_S
        self.lifted |= not (seen and self._rose_m() < _ROSE_M)

    def hovers(self, period_s: float, force_n: float, up_z: float, climbing_m_s2: float) -> None:
        """Learn from a moment in which it neither rises nor falls faster.

        Args:
            up_z: of the body's z axis, along world z.
            climbing_m_s2: vertical acceleration.
        """
        vertical_n, weight_n = force_n * up_z, self._mass_kg * self._gravity_m_s2
        if abs(climbing_m_s2) < _STEADY_M_S2 and _LEAST_HOVER < vertical_n / weight_n < _MOST_HOVER:
            self.hover_n += period_s / _HOVER_S * (vertical_n - self.hover_n)

    def height_m(self, now_s: float, firmware: FirmwareState, *, lying: bool) -> float:
        """Above the ground, the highest that anything still says.

        Args:
            lying: the poses have been found to lie: they may have for a while.
        """
        by_pose_m = self._rose_m() + (_LYING_M if lying else 0.0)
        told = firmware.has_barometer and now_s - firmware.altitude_changed_s < 1.0
        return max(by_pose_m, firmware.altitude_m if told else 0.0, 0.0)

    def _rose_m(self) -> float:
        if self._pose is None or self._ground_m is None:
            return 0.0
        return float(self._pose.position_world_m[2]) - self._ground_m
