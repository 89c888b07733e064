"""Lenses: from a direction to a place on the sensor of focal length 1, and back.

A base radius of the angle from the axis (perspective, the angle itself, or EUCM), then what all of COLMAP's lens models
have in common: a radial polynomial, tangential terms (Brown) and a thin prism. The kernels read the same numbers
(`Lens.row`).

EUCM: Khomutenko et al., "An enhanced unified camera model", 2016. Fisheye: Kannala and Brandt, 2006. The prism after
the tangential terms (RAD_TAN_THIN_PRISM_FISHEYE) is the lens of Project Aria, FISHEYE624.
"""

import enum
import functools
from dataclasses import dataclass

import numpy as np

from flight import FloatArray

PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "THIN_PRISM_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        *("fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3"),
    ),
    "EUCM": ("fx", "fy", "cx", "cy", "alpha", "beta"),
}
"""COLMAP's model names and the order of their parameters."""

_TABLE_SIZE = 2048
_LEAST_SLOPE = 1e-3
_STEP = 1e-6
_NEWTON_STEPS = 10
_PERSPECTIVE_LIMIT_RAD = float(np.radians(89.0))


class Base(enum.IntEnum):
    """Radius on the sensor as a function of the angle from the axis, before any distortion."""

    PERSPECTIVE = 0
    """tan(angle)."""
    ANGLE = 1
    """The angle."""
    EUCM = 2
    """sin / (alpha sqrt(beta sin^2 + cos^2) + (1 - alpha) cos)."""


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens of focal length 1. Hashable: tables of it are kept."""

    base: Base
    """Radius before distortion."""
    radial: tuple[float, ...] = (0.0,) * 6
    """k of 1 + k1 r^2 + k2 r^4 + ..., r the base radius."""
    tangential: tuple[float, float] = (0.0, 0.0)
    """p1, p2 in OpenCV's order: x moves by 2 p1 x y + p2 (r^2 + 2 x^2)."""
    prism: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """x moves by s1 r^2 + s2 r^4, y by s3 r^2 + s4 r^4."""
    alpha: float = 0.0
    """Of EUCM."""
    beta: float = 1.0
    """Of EUCM."""
    in_turn: bool = False
    """Whether tangential terms and prism act on the radially distorted place, not beside the radial distortion."""

    @property
    def is_radial(self) -> bool:
        """Whether the radius alone is distorted."""
        return not any((*self.tangential, *self.prism))

    @property
    def limit_rad(self) -> float:
        """Largest angle from the axis at which the radius still grows: beyond, two directions share one pixel."""
        return _table(self).limit_rad

    @property
    def row(self) -> list[float]:
        """The numbers as the kernels read them."""
        return [
            float(self.base),
            *self.radial,
            *self.tangential,
            *self.prism,
            self.alpha,
            self.beta,
            float(self.in_turn),
        ]

    def radius(self, theta_rad: FloatArray) -> FloatArray:
        """Distorted radius at an angle from the axis, tangential terms and prism left out."""
        base = self._base(theta_rad)
        return base * self._polynomial(base * base)

    def place(self, rays: FloatArray) -> FloatArray:
        """(..., 3) directions of any length to (..., 2) places on the sensor; NaN straight behind or for no ray."""
        x, y, z = np.moveaxis(rays, -1, 0)
        rho = np.hypot(x, y)
        theta = np.arctan2(rho, z)
        with np.errstate(invalid="ignore", divide="ignore"):
            stretch = np.where(rho > 0.0, self._base(theta) / rho, np.where(z > 0.0, 0.0, np.nan))
        return self._distorted(stretch[..., None] * rays[..., :2])

    def ray(self, place: FloatArray) -> FloatArray:
        """(..., 2) places on the sensor to (..., 3) unit rays; NaN where no direction below the limit leads there."""
        radius = np.hypot(place[..., 0], place[..., 1])
        theta = self._angle(radius)
        with np.errstate(invalid="ignore", divide="ignore"):
            ideal = np.where(radius > 0.0, self._base(theta) / radius, 0.0)[..., None] * place
        if not self.is_radial:
            ideal = self._undistorted(place, np.nan_to_num(ideal))
            theta = self._base_angle(np.hypot(ideal[..., 0], ideal[..., 1]))
        base = np.hypot(ideal[..., 0], ideal[..., 1])
        with np.errstate(invalid="ignore", divide="ignore"):
            sine = np.where(base > 0.0, np.sin(theta) / base, 0.0)
        return np.concatenate([sine[..., None] * ideal, np.cos(theta)[..., None]], axis=-1)

    def _base(self, theta_rad: FloatArray) -> FloatArray:
        match self.base:
            case Base.PERSPECTIVE:
                return np.asarray(np.tan(theta_rad))
            case Base.ANGLE:
                return np.asarray(theta_rad)
            case Base.EUCM:
                sine, cosine = np.sin(theta_rad), np.cos(theta_rad)
                below = self.alpha * np.sqrt(self.beta * sine**2 + cosine**2) + (1.0 - self.alpha) * cosine
                return np.asarray(sine / np.maximum(below, 1e-9))

    def _base_angle(self, base: FloatArray) -> FloatArray:
        """The inverse of the base radius of the lenses with tangential terms or a prism."""
        angle = np.arctan(base) if self.base is Base.PERSPECTIVE else base
        return np.where(angle <= self.limit_rad, angle, np.nan)

    def _polynomial(self, square: FloatArray) -> FloatArray:
        value = np.zeros_like(square)
        for k in reversed(self.radial):
            value = square * (k + value)
        return 1.0 + value

    def _distorted(self, ideal: FloatArray) -> FloatArray:
        straight = ideal * self._polynomial((ideal * ideal).sum(axis=-1))[..., None]
        if self.is_radial:
            return straight
        x, y = np.moveaxis(straight if self.in_turn else ideal, -1, 0)
        (p1, p2), (s1, s2, s3, s4) = self.tangential, self.prism
        square = x * x + y * y
        aside_x = 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x) + square * (s1 + square * s2)
        aside_y = 2.0 * p2 * x * y + p1 * (square + 2.0 * y * y) + square * (s3 + square * s4)
        return straight + np.stack([aside_x, aside_y], axis=-1)

    def _undistorted(self, place: FloatArray, ideal: FloatArray) -> FloatArray:
        """Newton's method in the plane, from a start that is good to the tangential terms and the prism."""
        for _ in range(_NEWTON_STEPS):
            along_x, along_y = (
                (self._distorted(ideal + step) - self._distorted(ideal - step)) / (2.0 * _STEP)
                for step in _STEP * np.eye(2)
            )
            off = place - self._distorted(ideal)
            with np.errstate(all="ignore"):
                determinant = along_x[..., 0] * along_y[..., 1] - along_x[..., 1] * along_y[..., 0]
                x = (along_y[..., 1] * off[..., 0] - along_y[..., 0] * off[..., 1]) / determinant
                y = (along_x[..., 0] * off[..., 1] - along_x[..., 1] * off[..., 0]) / determinant
                ideal = ideal + np.stack([x, y], axis=-1)
        with np.errstate(all="ignore"):
            met = np.abs(self._distorted(ideal) - place).max(axis=-1, keepdims=True) < 1e-9
        return np.where(met, ideal, np.nan)

    def _angle(self, radius: FloatArray) -> FloatArray:
        """The angle at which `radius` is reached; NaN beyond the largest."""
        table = _table(self)
        theta = np.interp(radius, table.radii, table.angles_rad, right=np.nan)
        for _ in range(3):  # the table is good to 1e-6 rad, each Newton step squares that
            slope = (self.radius(theta + _STEP) - self.radius(theta - _STEP)) / (2.0 * _STEP)
            theta = theta - (self.radius(theta) - radius) / np.maximum(slope, _LEAST_SLOPE)
        return np.asarray(theta, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Angles up to the limit of a lens, and the radii there."""

    limit_rad: float
    angles_rad: FloatArray
    radii: FloatArray


@functools.lru_cache(maxsize=64)
def _table(lens: Lens) -> _Table:
    limit_rad = _PERSPECTIVE_LIMIT_RAD if lens.base is Base.PERSPECTIVE else np.pi
    angles = np.linspace(0.0, limit_rad, 4 * _TABLE_SIZE)
    falling = np.flatnonzero(np.diff(lens.radius(angles)) <= _LEAST_SLOPE * angles[1])
    limit_rad = float(angles[max(falling[0], 1)]) if falling.size else limit_rad
    angles = np.linspace(0.0, limit_rad, _TABLE_SIZE)
    return _Table(limit_rad, angles, lens.radius(angles))


def of_model(model: str, named: dict[str, float]) -> Lens:
    """The lens of one of COLMAP's models, from its parameters by name."""
    k = [value for name, value in named.items() if name.startswith("k")]
    radial = tuple((k + [0.0] * 6)[:6])
    match model:
        case "OPENCV":
            return Lens(Base.PERSPECTIVE, radial, (named["p1"], named["p2"]))
        case "THIN_PRISM_FISHEYE":
            prism = (named["sx1"], 0.0, named["sy1"], 0.0)
            return Lens(Base.ANGLE, radial, (named["p1"], named["p2"]), prism)
        case "RAD_TAN_THIN_PRISM_FISHEYE":
            prism = (named["s0"], named["s1"], named["s2"], named["s3"])
            return Lens(Base.ANGLE, radial, (named["p1"], named["p0"]), prism, in_turn=True)
        case "EUCM":
            return Lens(Base.EUCM, alpha=named["alpha"], beta=named["beta"])
        case _:
            return Lens(Base.ANGLE if model.endswith("FISHEYE") else Base.PERSPECTIVE, radial)
