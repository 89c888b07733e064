"""Down without the planner: level, no yaw, a bounded descent, by whatever still tells how the vehicle moves.

Poses, if they still come, tell velocity, and the vehicle brakes; else the firmware tells its tilt and, with a
barometer, its climb; with neither, the rotors hold a little less than hover, which sinks at a bounded speed, for as
long as the last known height takes.
"""

import math

import numpy as np

from firmware_bridge.offboard.firmware import FirmwareState
from firmware_bridge.offboard.ladder import POSE_STALE_S
from firmware_bridge.offboard.prediction import Motion
from flight import FloatArray, rotations

SINK_M_S = 0.6
"""What is asked for."""
BLIND_SHARE = 0.97
"""Of the hover's force where nothing tells the climb: inflow bounds the sink to some 1 m/s."""
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


class Descent:
    """One descent; `force_and_rate` each tick, then `landed`."""

    def __init__(self, begin_s: float, hover_n: float, height_m: float, gravity_m_s2: float) -> None:
        """
        Args:
            hover_n: the force that hovered it.
            height_m: above the ground, as last known.
        """
        self._hover_n, self._gravity_m_s2 = hover_n, gravity_m_s2
        self._blind_until_s = begin_s + max(height_m, 0.0) / _BLIND_M_S + _BLIND_EXTRA_S
        self._last_s, self._integral_m_s2, self._unloaded_s = begin_s, 0.0, 0.0
        self.landed = False

    def force_and_rate(self, now_s: float, firmware: FirmwareState, motion: Motion | None) -> tuple[float, FloatArray]:
        """Collective force and body rates (3,).

        Args:
            motion: by poses; None or old: not known.
        """
        step_s, self._last_s = now_s - self._last_s, now_s
        if motion is not None and now_s - motion.time_s > POSE_STALE_S:
            motion = None
        up_body = _up_body(now_s, firmware, motion)
        rate = np.zeros(3) if up_body is None else _levelling(up_body, motion)
        climb_m_s = _climb(now_s, firmware, motion)
        share = self._blind(now_s) if climb_m_s is None else self._share(climb_m_s, step_s)
        upright = 1.0 if up_body is None else max(float(up_body[2]), 0.5)
        return share * self._hover_n / upright, rate

    def _share(self, climb_m_s: float, step_s: float) -> float:
        """Of the hover's force, by the climb."""
        short_m_s = -SINK_M_S - climb_m_s
        self._integral_m_s2 = float(np.clip(self._integral_m_s2 + _CLIMB_INTEGRAL_1_S2 * short_m_s * step_s, -6.0, 4.0))
        share = 1.0 + (_CLIMB_1_S * short_m_s + self._integral_m_s2) / self._gravity_m_s2
        still = share < _UNLOADED and abs(climb_m_s) < _STILL_M_S
        self._unloaded_s = self._unloaded_s + step_s if still else 0.0
        self.landed |= self._unloaded_s > _LANDED_S
        return float(np.clip(share, _LEAST_FORCE, _MOST_FORCE))

    def _blind(self, now_s: float) -> float:
        left_s = self._blind_until_s + _UNLOAD_S - now_s
        self.landed |= left_s <= 0.0
        return BLIND_SHARE * min(max(left_s / _UNLOAD_S, 0.0), 1.0)


def _up_body(now_s: float, firmware: FirmwareState, motion: Motion | None) -> FloatArray | None:
    """World's up in body axes: the firmware's own attitude, which flies it, before that of the poses."""
    if now_s - firmware.attitude_s < _ANSWER_S:
        roll, pitch = firmware.roll_pitch_rad
        return np.array([-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)])
    return None if motion is None else rotations.matrix(motion.q_world_body)[2]


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


def _climb(now_s: float, firmware: FirmwareState, motion: Motion | None) -> float | None:
    if motion is not None:
        return float(motion.velocity_world_m_s[2])
    known = firmware.has_barometer and now_s - firmware.altitude_s < _ANSWER_S
    return firmware.climb_m_s if known else None
