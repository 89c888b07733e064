"""How certain a relocalized pose is: the covariance that the scatter of its own matches implies.

Linear error propagation through the reprojection errors (Hartley and Zisserman, 2004, section 5.2): with J the
derivative of the pixels after the pose, cov = s^2 (J^T J)^-1, s^2 the mean squared error of a coordinate over the
degrees of freedom. The scatter holds the errors of features and of map points, as far as these are independent.
"""

from collections.abc import Sequence

import numpy as np

from flight import FloatArray, frames, rotations
from mapping.camera.rig import Rig

_STEP_M = 1e-4
"""Of the derivatives of the lens, as a share of the range."""

Match = tuple[int, FloatArray, FloatArray]
"""A camera of the rig, its pixels (k, 2), and the map points (k, 3) that they mean."""


def covariance(rig: Rig, matches: Sequence[Match], T_world_body: FloatArray) -> FloatArray:
    """(6, 6) of position (world, m) and a small turn after the attitude (body axes, rad); NaN if too few matches.

    Args:
        matches: those that support the pose.
        T_world_body: (4, 4).
    """
    jacobians, errors = zip(*(_linearised(rig, match, T_world_body) for match in matches), strict=True)
    J, e = np.concatenate(jacobians), np.concatenate(errors)
    if len(e) <= 6:
        return np.full((6, 6), np.nan)
    return np.linalg.inv(J.T @ J) * float(e @ e) / (len(e) - 6)


def _linearised(rig: Rig, match: Match, T_world_body: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivative (2 k, 6) of the projected pixels after the pose, and the errors (2 k,) in pixels."""
    number, pixels, points_world_m = match
    camera = rig.cameras[number]
    R_body_camera = camera.T_body_camera[:3, :3]
    in_body = frames.apply(frames.invert(T_world_body), points_world_m)
    in_camera = frames.apply(frames.invert(camera.T_body_camera), in_body)
    step_m = _STEP_M * np.linalg.norm(in_camera, axis=1)
    by_camera = np.empty((len(pixels), 2, 3))
    for axis in range(3):
        shift = step_m[:, None] * np.eye(3)[axis]
        by_camera[..., axis] = (camera.project(in_camera + shift) - camera.project(in_camera - shift)) / (
            2.0 * step_m[:, None]
        )
    by_body = by_camera @ R_body_camera.T
    J = np.concatenate([-by_body @ T_world_body[:3, :3].T, by_body @ rotations.hat(in_body)], axis=2)
    return J.reshape(-1, 6), (camera.project(in_camera) - pixels).reshape(-1)
