"""Simulated position and attitude loops of an autopilot: the cascade that PX4 documents, with its default gains.

Position error to velocity, velocity error with an integral to acceleration, each beside what is fed forward; the
thrust's direction to an attitude, its error to body rates. Not PX4's code.
"""

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from flight import rotations
from vehicle import Vehicle, simulate

STEP_S = 2e-3
FLIP = np.array([1.0, -1.0, -1.0])
P_1_S = np.array([0.95, 0.95, 1.0])
"""MPC_XY_P, MPC_Z_P."""
VELOCITY_P_1_S, VELOCITY_I_1_S2 = np.array([1.8, 1.8, 4.0]), np.array([0.4, 0.4, 2.0])
"""MPC_XY_VEL_P_ACC, MPC_XY_VEL_I_ACC, MPC_Z_VEL_P_ACC, MPC_Z_VEL_I_ACC."""
ATTITUDE_P_1_S = np.array([6.5, 6.5, 2.8 * 0.4])
"""MC_ROLL_P, MC_PITCH_P, MC_YAW_P times MC_YAW_WEIGHT."""


class SimulatedPositionLoops:
    """One vehicle."""

    def __init__(self, model: Vehicle) -> None:
        self._mass_kg, self._gravity_m_s2 = model.mass_kg, model.gravity_m_s2
        self._integral = np.zeros(3)

    def reset(self) -> None:
        self._integral[:] = 0.0

    def rates_and_force(
        self, estimate: simulate.State, target: mavlink.MAVLink_set_position_target_local_ned_message
    ) -> tuple[np.ndarray, float]:
        """Body rates, z up, and force along body z.

        Args:
            estimate: its own, in its local frame, z up.
        """
        place, velocity, fed = (
            FLIP * np.array(v)
            for v in (
                (target.x, target.y, target.z), (target.vx, target.vy, target.vz), (target.afx, target.afy, target.afz)
            )
        )  # fmt: skip
        wanted_m_s = velocity + P_1_S * (place - estimate.position_world_m)
        short_m_s = wanted_m_s - estimate.velocity_world_m_s
        self._integral += VELOCITY_I_1_S2 * short_m_s * STEP_S
        asked = fed + VELOCITY_P_1_S * short_m_s + self._integral + np.array([0.0, 0.0, self._gravity_m_s2])
        up = asked / np.linalg.norm(asked)
        q = estimate.q_world_body
        error = rotations.log(rotations.multiply(rotations.conjugate(q), _attitude(up, -float(target.yaw))))
        R = rotations.matrix(q)
        yawing = R.T @ np.array([0.0, 0.0, -float(target.yaw_rate)])
        return ATTITUDE_P_1_S * error + yawing, self._mass_kg * max(float(asked @ R[:, 2]), 0.0)


def _attitude(up: np.ndarray, yaw_rad: float) -> np.ndarray:
    """Whose body z is `up`, and whose nose is in the upright plane of the heading."""
    heading = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    left = np.cross(up, heading)
    left /= np.linalg.norm(left)
    return rotations.from_matrix(np.column_stack([np.cross(left, up), left, up]))
