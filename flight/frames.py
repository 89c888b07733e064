"""Rigid transforms `T_a_b` (4x4, p_a = T_a_b @ p_b) and the one conversion to and from MAVLink's frames.

Ours: world z up, body x forward, y left, z up. MAVLink: NED world, FRD body. Both conversions are the same half turn:
world east-north-up is not assumed, our world x is MAVLink's local north, our y its west.
"""

import numpy as np
from numpy.typing import ArrayLike

from flight import rotations
from flight.rotations import FloatArray

GRAVITY_M_S2 = 9.80665
"""Standard gravity, towards -z of the world; a vehicle file may keep that of the place where it flies."""
_HALF_TURN_ABOUT_X = np.array([1.0, -1.0, -1.0])


def transform(q: ArrayLike, translation_m: ArrayLike) -> FloatArray:
    """(..., 4) quaternion and (..., 3) translation to (..., 4, 4)."""
    q = np.asarray(q, dtype=np.float64)
    result = np.zeros((*q.shape[:-1], 4, 4))
    result[..., :3, :3] = rotations.matrix(q)
    result[..., :3, 3] = translation_m
    result[..., 3, 3] = 1.0
    return result


def invert(T: ArrayLike) -> FloatArray:
    """Inverse of a rigid transform, `invert(T_a_b)` is `T_b_a`."""
    given = np.asarray(T, dtype=np.float64)
    result = np.zeros_like(given)
    R_transposed = np.swapaxes(given[..., :3, :3], -1, -2)
    result[..., :3, :3] = R_transposed
    result[..., :3, 3] = -(R_transposed @ given[..., :3, 3:])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def apply(T_a_b: ArrayLike, points_b: ArrayLike) -> FloatArray:
    """Points (..., 3) from frame b to frame a."""
    T = np.asarray(T_a_b, dtype=np.float64)
    p = np.asarray(points_b, dtype=np.float64)
    return (T[..., :3, :3] @ p[..., None])[..., 0] + T[..., :3, 3]


def flip_vector(v: ArrayLike) -> FloatArray:
    """World (z up) to MAVLink local NED, or body to FRD, and back: it is its own inverse. (..., 3)."""
    return np.asarray(v, dtype=np.float64) * _HALF_TURN_ABOUT_X


def flip_attitude(q: ArrayLike) -> FloatArray:
    """`q_world_body` to MAVLink's NED-from-FRD quaternion, and back: it is its own inverse. (..., 4)."""
    return np.asarray(q, dtype=np.float64) * np.array([1.0, 1.0, -1.0, -1.0])
