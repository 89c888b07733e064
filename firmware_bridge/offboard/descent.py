"""Down without the planner: level, no yaw, a bounded descent, by whatever still tells how the vehicle moves.

Poses, if they still come, tell velocity, and the vehicle brakes; else the firmware tells its tilt and, with a
barometer, its climb; with neither, the rotors hold a little less than hover, which sinks at a bounded speed, for as
long as the last known height takes.

It is down when the rotors are unloaded and nothing falls, by a sensor that has also told of the way down: one that
stands still would say so in the air. Where the sensors shake, it is down when the way has long been over.
"""

import numpy as np

from firmware_bridge.offboard.firmware import FirmwareState
from firmware_bridge.offboard.ladder import POSE_STALE_S
from firmware_bridge.offboard.prediction import Motion
from flight import FloatArray, rotations

SINK_M_S = 0.6
"""What is asked for."""
BLIND_SHARE = 0.96
"""Of the hover's force where nothing tells the climb: inflow bounds the sink to some 1.4 m/s, and a hover's force that
is known to 3 % does not climb."""
INVERTED_SHARE = 0.1
"""Of the hover's force upside down: it only keeps the firmware's rate loop at work, which idles without throttle."""
_TO_LEVEL_1_S = 6.0
_LARGEST_RATE_RAD_S = 3.0
_BRAKE_1_S, _BRAKE_M_S2 = 1.2, 3.0
_CLIMB_1_S, _CLIMB_INTEGRAL_1_S2 = 2.5, 2.0
_LEAST_FORCE, _MOST_FORCE = 0.3, 1.3
"""Of the hover's."""
_ANSWER_S = 0.3
"""Older answers of the firmware are none."""
_UNLOADED, _STILL_M_S, _LANDED_S = 0.6, 0.2, 0.4
_BLIND_M_S, _BLIND_EXTRA_S, _UNLOAD_S = 0.5, 3.0, 1.0
_BOUND_M_S, _BOUND_EXTRA_S = 0.3, 10.0
_STANDS_STILL_S = 1.0
"""A barometer that says the same for longer, before it has told of the way down, tells nothing."""
_WAY_SHARE, _WAY_M = 0.7, 0.5
"""Of the height that must have been come down: this share, or all but this."""


class Descent:
    """One descent; `force_and_rate` each tick, then `landed`."""

    def __init__(self, begin_s: float, hover_n: float, height_m: float, gravity_m_s2: float) -> None:
        """
        Args:
            hover_n: the force that hovered it.
            height_m: above the ground, as last known.
        """
        self._hover_n, self._gravity_m_s2 = hover_n, gravity_m_s2
        height_m = max(height_m, 0.0)
        self._blind_until_s = begin_s + height_m / _BLIND_M_S + _BLIND_EXTRA_S
        self._bound_s = begin_s + height_m / _BOUND_M_S + _BOUND_EXTRA_S
        self._way_m = min(_WAY_SHARE * height_m, height_m - _WAY_M) if height_m > _WAY_M else -np.inf
        self._from_m: dict[str, float] = {}
        self._last_s, self._integral_m_s2, self._unloaded_s, self._still_s = begin_s, 0.0, 0.0, 0.0
        self.landed = False

    def force_and_rate(self, now_s: float, firmware: FirmwareState, motion: Motion | None) -> tuple[float, FloatArray]:
        """Collective force and body rates (3,).

        Args:
            motion: by poses; None or old: not known.
        """
        step_s, self._last_s = now_s - self._last_s, now_s
        if motion is not None and not now_s - motion.time_s <= POSE_STALE_S:
            motion = None
        up_body = _up_body(now_s, firmware, motion)
        rate = np.zeros(3) if up_body is None else _levelling(up_body, motion)
        sense = self._sense(now_s, firmware, motion)
        share = self._blind(now_s) if sense is None else self._share(now_s, *sense, step_s)
        if up_body is None:
            return share * self._hover_n, rate
        if up_body[2] < 0.0:
            return min(share, INVERTED_SHARE) * self._hover_n, rate
        return share * self._hover_n / max(float(up_body[2]), 0.5), rate

    def _sense(self, now_s: float, firmware: FirmwareState, motion: Motion | None) -> tuple[float, bool] | None:
        """Climb, and whether what tells it has told of the way down too; None: nothing tells it."""
        if motion is not None:
            return float(motion.velocity_world_m_s[2]), self._came_down("poses", float(motion.position_world_m[2]))
        if not (firmware.has_barometer and now_s - firmware.altitude_s < _ANSWER_S):
            return None
        came_down = self._came_down("barometer", firmware.altitude_m)
        alive = now_s - firmware.altitude_changed_s < _STANDS_STILL_S
        return (firmware.climb_m_s, came_down) if alive or (came_down and self._way_m > 0.0) else None

    def _came_down(self, source: str, altitude_m: float) -> bool:
        return self._from_m.setdefault(source, altitude_m) - altitude_m >= self._way_m

    def _share(self, now_s: float, climb_m_s: float, came_down: bool, step_s: float) -> float:
        """Of the hover's force, by the climb."""
        short_m_s = -SINK_M_S - climb_m_s
        self._integral_m_s2 = float(np.clip(self._integral_m_s2 + _CLIMB_INTEGRAL_1_S2 * short_m_s * step_s, -6.0, 4.0))
        share = 1.0 + (_CLIMB_1_S * short_m_s + self._integral_m_s2) / self._gravity_m_s2
        self._unloaded_s = self._unloaded_s + step_s if share < _UNLOADED else 0.0
        still = share < _UNLOADED and abs(climb_m_s) < _STILL_M_S
        self._still_s = self._still_s + step_s if still else 0.0
        self.landed |= came_down and self._still_s > _LANDED_S
        self.landed |= now_s > self._bound_s and self._unloaded_s > _LANDED_S
        return float(np.clip(share, _LEAST_FORCE, _MOST_FORCE))

    def _blind(self, now_s: float) -> float:
        left_s = self._blind_until_s + _UNLOAD_S - now_s
        self.landed |= left_s <= 0.0
        return BLIND_SHARE * min(max(left_s / _UNLOAD_S, 0.0), 1.0)


def _up_body(now_s: float, firmware: FirmwareState, motion: Motion | None) -> FloatArray | None:
    """World's up in body axes: the firmware's own attitude, which flies it, before that of the poses."""
    told = firmware.up_body(now_s)
    return told if told is not None or motion is None else rotations.matrix(motion.q_world_body)[2]


def _levelling(up_body: FloatArray, motion: Motion | None) -> FloatArray:
    """Turns body z to the axis wanted: up, and against the velocity where that is known."""
    wanted = np.array([0.0, 0.0, 1.0])
    if motion is not None:
        yaw = rotations.yaw(motion.q_world_body)
        velocity = rotations.rotate(rotations.from_yaw(-float(yaw)), motion.velocity_world_m_s)
        brake = -_BRAKE_1_S * velocity[:2]
        size = float(np.linalg.norm(brake))
        wanted[:2] = brake * min(1.0, _BRAKE_M_S2 / max(size, 1e-9)) / 9.81
    # body z in level axes is up_body mirrored in x and y
    turn = np.array([-up_body[1] - wanted[1], up_body[0] + wanted[0], 0.0])
    return np.clip(_TO_LEVEL_1_S * turn, -_LARGEST_RATE_RAD_S, _LARGEST_RATE_RAD_S)
