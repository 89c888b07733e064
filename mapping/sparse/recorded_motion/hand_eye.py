"""Where a camera sits on the thing whose motion was recorded: hand-eye calibration, A X = X B.

Between two instants the tracked thing moves by A and the camera by B, each in its own axes; X is the pose of the camera
on the tracked thing. Turns and shifts taken as vectors give a first rotation (Park and Martin, "Robot sensor
calibration", 1994), robust least squares then all of X and the scale of the recorded shifts, with their covariance.
Turns about less than two axes leave a part of X undetermined; the covariance says what that does to a motion that is
predicted with X.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, frames, rotations
from mapping.sparse.recorded_motion import motion

_ROUNDS = 3
"""Each estimates X with the noise that the round before has left."""
_LEAST_NOISE = 0.1
"""Of the noise that `motion` takes for usual: the motions of the images are not known better."""
_PRIOR_STD = np.array([np.pi, np.pi, np.pi, 1.0, 1.0, 1.0])
"""Of X (rad, m), known beforehand: the camera is on the tracked vehicle."""
_SCALE_STD, _FIXED_STD, _LEAST_SIGNAL = 0.5, 1e-3, 5.0
"""The same of the scale, and where recorded shifts are not so many times their noise: noise makes a scale small."""


@dataclass(frozen=True, slots=True, eq=False)
class HandEye:
    """Where the camera sits on the tracked thing, and how well recorded motion then predicts the camera's."""

    T_tracked_camera: FloatArray
    """(4, 4)."""
    scale: float
    """Metres of the camera's motion per recorded metre."""
    covariance: FloatArray
    """(7, 7) of turn (rad) and shift (m) of the camera, in its own frame, and of the scale."""
    turn_noise_rad: float
    """Standard deviation, along each axis, of a predicted motion's turn ..."""
    shift_noise_m: float
    """... and of its shift."""
    unexplained: float
    """Median difference of predicted and measured motions over the median motion."""

    def predicted(self, tracked_b_a: FloatArray) -> FloatArray:
        """Motions of the tracked thing (n, 4, 4) as motions T_b_a of the camera (n, 4, 4)."""
        return _predicted(self.T_tracked_camera, self.scale, tracked_b_a)

    def covariances(self, tracked_b_a: FloatArray) -> FloatArray:
        """(n, 6, 6) of turn and shift of each predicted motion, in the camera frame at a: noise, and what X adds."""
        step = 1e-6
        motions = self.predicted(tracked_b_a)
        moved = [
            _predicted(self.T_tracked_camera @ _pose(each[:6]), self.scale + each[6], tracked_b_a)
            for each in step * np.eye(7)
        ]
        jacobian = np.stack([difference(motions, each) for each in moved], axis=-1) / step
        noise = np.diag(np.repeat([self.turn_noise_rad, self.shift_noise_m], 3) ** 2)
        return noise + jacobian @ self.covariance @ jacobian.swapaxes(1, 2)


def calibrate(camera_b_a: FloatArray, tracked_b_a: FloatArray) -> HandEye:
    """X and scale from motions of the camera and of the tracked thing, some of which may be wrong.

    Args:
        camera_b_a, tracked_b_a: (n, 4, 4) metres: the pose at instant a in the frame at instant b, of each pair.
    """
    usual = np.array([motion.TURN_NOISE_RAD, motion.SHIFT_NOISE_M])
    noise, scale = usual, 1.0
    T_tracked_camera = frames.transform(_first_rotation(camera_b_a, tracked_b_a), np.zeros(3))
    shift_m = float(np.median(np.linalg.norm(tracked_b_a[:, :3, 3], axis=1)))
    for _ in range(_ROUNDS):
        prior_std = np.append(_PRIOR_STD, _SCALE_STD if shift_m > _LEAST_SIGNAL * noise[1] else _FIXED_STD)
        T_tracked_camera, scale, covariance = _fitted(
            camera_b_a, tracked_b_a, T_tracked_camera, scale, noise, prior_std
        )
        off = difference(camera_b_a, _predicted(T_tracked_camera, scale, tracked_b_a))
        noise = np.maximum(1.4826 * np.median(np.abs(off).reshape(-1, 2, 3), axis=(0, 2)), _LEAST_NOISE * usual)
    motions = difference(np.broadcast_to(np.eye(4), camera_b_a.shape), camera_b_a)
    unexplained = _median_size(off / np.repeat(usual, 3)) / max(_median_size(motions / np.repeat(usual, 3)), 1e-30)
    return HandEye(T_tracked_camera, scale, covariance, float(noise[0]), float(noise[1]), unexplained)


def _fitted(
    camera_b_a: FloatArray,
    tracked_b_a: FloatArray,
    T_tracked_camera: FloatArray,
    scale: float,
    noise: FloatArray,
    prior_std: FloatArray,
) -> tuple[FloatArray, float, FloatArray]:
    """X, the scale and their covariance, by robust least squares from a first X and scale.

    Args:
        noise: (2,) of the motions (rad, m); prior_std: (7,) of X and scale.
    """
    from scipy.optimize import least_squares

    def residuals(step: FloatArray) -> FloatArray:
        moved, scaled = T_tracked_camera @ _pose(step[:6]), scale + step[6]
        off = difference(camera_b_a, _predicted(moved, scaled, tracked_b_a)) / np.repeat(noise, 3)
        return np.concatenate([off.ravel(), np.hstack([step[:3], moved[:3, 3], scaled - 1.0]) / prior_std])

    found = least_squares(residuals, np.zeros(7), loss="soft_l1")
    measured = found.jac[: -len(prior_std)]
    covariance = _covariance(measured.T @ measured, len(camera_b_a), prior_std, noise[0] / noise[1])
    return T_tracked_camera @ _pose(found.x[:6]), scale + float(found.x[6]), covariance


def _covariance(information: FloatArray, count: int, prior_std: FloatArray, turn_over_shift: float) -> FloatArray:
    """(7, 7) of X and scale, of what `count` motions say of them and of what is known beforehand.

    Noise makes every motion turn and shift a little along all axes, which looks like information (7, 7) on X and scale.
    A motion of a small turn w and shift t changes by [w]x and [t]x when X turns, by [w]x when X shifts, and by t with
    the scale. With standard deviations s (turn) and d (shift) along each axis, the mean of [w]x^T [w]x is 2 s^2 I, and
    that of t^T t is 3 d^2. Over the variance of the noise this makes 2 + 2 for the turn, 2 s^2 / d^2 for the shift, and
    3 for the scale.
    """
    by_noise = count * np.array([4.0, 4.0, 4.0, *3 * [2.0 * turn_over_shift**2], 3.0])
    strength, axes = np.linalg.eigh(information - np.diag(by_noise))
    known = (axes * strength.clip(0.0)) @ axes.T + np.diag(prior_std**-2.0)
    return np.asarray(np.linalg.inv(known), dtype=np.float64)


def difference(T_b_a: FloatArray, other_b_a: FloatArray) -> FloatArray:
    """(n, 6) turn (rad) and shift (m), in the frame at a, by which other motions differ."""
    off = frames.invert(T_b_a) @ other_b_a
    return np.concatenate([rotations.log(rotations.from_matrix(off[:, :3, :3])), off[:, :3, 3]], axis=1)


def _predicted(T_tracked_camera: FloatArray, scale: float, tracked_b_a: FloatArray) -> FloatArray:
    metric = tracked_b_a.copy()
    metric[:, :3, 3] *= scale
    return frames.invert(T_tracked_camera) @ metric @ T_tracked_camera


def _pose(step: FloatArray) -> FloatArray:
    """(4, 4) of a turn and a shift (6,)."""
    return frames.transform(rotations.exp(step[:3]), step[3:])


def _first_rotation(camera_b_a: FloatArray, tracked_b_a: FloatArray) -> FloatArray:
    """q_tracked_camera that fits turns and shifts best, if the camera sat where the tracked thing is."""
    identity = np.broadcast_to(np.eye(4), camera_b_a.shape)
    of_camera, of_tracked = (
        difference(identity, T).reshape(-1, 2, 3) / np.array([[motion.TURN_NOISE_RAD], [motion.SHIFT_NOISE_M]])
        for T in (camera_b_a, tracked_b_a)
    )
    return rotations.from_matrix(motion.nearest_rotation(np.einsum("nki,nkj->ij", of_tracked, of_camera)))


def _median_size(vectors: FloatArray) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))
