"""Scale, heading and translation from a level map to recorded positions; and in which axes those fit."""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray

_AXES = {
    "their z points down": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "their z points down and they are left-handed": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "they are left-handed": ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    "their y points up": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "their y points up and they are left-handed": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "their y points down": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "their x points up": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "their x points down": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
}
"""What takes recorded positions to axes with z up."""
BETTER = 0.3
"""Share of a residual that other axes leave when they are the right ones."""
_TRIALS = 400
_MOST_DRIFT = 0.98


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Scale, heading and translation from level map positions to recorded ones."""

    scale: float
    R: FloatArray
    t: FloatArray
    residual_m: float
    inliers: np.ndarray

    def scale_std(self, level: FloatArray, recorded_m: FloatArray) -> float:
        """Relative standard deviation of the scale: the recorded positions' error over the extent of the path.

        Errors that drift count as fewer positions: n (1 - r) / (1 + r), r that of neighbours (Bartlett, 1946).

        Args:
            level, recorded_m: (n, 3) the positions that were fitted, in order of time.
        """
        used, truth_m = self.scale * level[self.inliers], recorded_m[self.inliers]
        extent_m = np.linalg.norm(used - used.mean(axis=0), axis=1)
        noise_m = self.residual_m / 1.5382  # median of the length of a normal vector in space
        off_m = used @ self.R.T + self.t - truth_m
        alike = float((off_m[1:] * off_m[:-1]).sum() / max((off_m**2).sum(), 1e-30))
        drift = np.sqrt((1.0 + (r := float(np.clip(alike, 0.0, _MOST_DRIFT)))) / (1.0 - r))
        return float(drift * noise_m / max(np.sqrt((extent_m**2).sum()), 1e-12))

    @staticmethod
    def robust(level: FloatArray, recorded_m: FloatArray, *, scale: float | None = None) -> "Fit":
        """Least median of squares over pairs, then least squares over the inliers: up to half may be outliers."""
        rng = np.random.default_rng(0)
        everyone = np.ones(len(level))
        best = _similarity(level, recorded_m, everyone, scale)
        best_median = np.median(_residuals(best, level, recorded_m))
        for _ in range(_TRIALS):
            weight = np.zeros(len(level))
            weight[rng.choice(len(level), 2, replace=False)] = 1.0
            trial = _similarity(level, recorded_m, weight, scale)
            median = np.median(_residuals(trial, level, recorded_m))
            if median < best_median:
                best, best_median = trial, median
        inliers = _residuals(best, level, recorded_m) <= max(3.7 * float(best_median), 1e-9)
        s, R, t = _similarity(level, recorded_m, inliers.astype(float), scale)
        return Fit(s, R, t, float(np.median(_residuals((s, R, t), level, recorded_m)[inliers])), inliers)


def _similarity(
    level: FloatArray, recorded_m: FloatArray, weight: FloatArray, scale: float | None
) -> tuple[float, FloatArray, FloatArray]:
    """Weighted least squares, rotation about z only; closed form."""
    w = weight / weight.sum()
    a, b = w @ level, w @ recorded_m
    p, q = level - a, recorded_m - b
    cosine = w @ (p[:, 0] * q[:, 0] + p[:, 1] * q[:, 1])
    sine = w @ (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    R = about_z(float(np.arctan2(sine, cosine)))
    if scale is None:
        scale = max(
            float((np.hypot(cosine, sine) + w @ (p[:, 2] * q[:, 2])) / max(w @ (p * p).sum(axis=1), 1e-30)), 1e-9
        )
    return scale, R, b - scale * (R @ a)


def _residuals(fit: tuple[float, FloatArray, FloatArray], level: FloatArray, recorded_m: FloatArray) -> FloatArray:
    scale, R, t = fit
    return np.linalg.norm(scale * level @ R.T + t - recorded_m, axis=1)


def better_axes(level: FloatArray, recorded_m: FloatArray, residual_m: float) -> str:
    """Which reading of the recorded axes leaves a small part of the residual, in words; empty: none does."""
    left = {words: Fit.robust(level, recorded_m @ np.array(axes).T).residual_m for words, axes in _AXES.items()}
    best = min(left, key=lambda words: left[words])
    return f"{best} ({left[best]:.2g} m)" if left[best] < BETTER * residual_m else ""


def about_z(angle_rad: float) -> FloatArray:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
