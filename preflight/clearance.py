"""How far a batch of flights stayed from everything in the map: one query for all positions."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge.controller import State
from flight import FloatArray, Trajectory
from preflight.core import NONE, Flown

DESCENDING = (State.LANDING, State.EMERGENCY)
"""States in which the vehicle may touch what is below it, and nothing else."""
_ON_M = 5e-3
"""A point so near is on a surface."""
_MOST_STEPS = 200
_RISE_M = 0.1
_SLOPE_M = 0.05
"""Half the way over which the slope of the distance is taken: about a voxel."""
_BELOW = 0.7
"""Slope of the distance upwards from which on the nearest surface counts as below: within 45 degrees of straight."""


class DistanceField(Protocol):
    """Signed distance to the nearest obstacle; NaN outside of what is known."""

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray: ...


@dataclass(frozen=True, slots=True)
class Nearest:
    """Where each of m flights came closest."""

    clearance_m: FloatArray
    """(m,) between the vehicle's sphere and the nearest surface; negative: touched. Infinite if nothing was flown."""
    point_world_m: FloatArray
    """(m, 3)."""
    path_s: FloatArray
    """(m,) time on the trajectory, of the sample before if it was off it then; NaN if it never was."""
    left_map: np.ndarray
    """(m,) whether it was where the map does not reach."""


def below_and_above(field: DistanceField, points_world_m: FloatArray) -> tuple[float, float]:
    """Heights of the nearest floor and ceiling of points (n, 3): the highest below any, the lowest above any.

    Infinite where the map ends before there is one. Each is looked for by steps of the distance (sphere tracing).
    """
    found = []
    for way in (-1.0, 1.0):
        at = points_world_m.copy()
        for _ in range(_MOST_STEPS):
            distance = field.distance(at)
            moving = (distance > _ON_M) & (distance < np.inf)
            if not moving.any():
                break
            at[moving, 2] += way * distance[moving]
        there = distance <= _ON_M
        found.append(way * float(np.min(way * at[there, 2], initial=np.inf)))
    return found[0], found[1]


@dataclass(frozen=True, slots=True)
class Along:
    """How near m flights were to everything, sample by sample."""

    clearance_m: FloatArray
    """(m, n) between the vehicle's sphere and the nearest surface; infinite where it was not flown, or stands."""
    left_map: np.ndarray
    """(m,) whether it was where the map does not reach."""


def along(
    flown: Flown,
    field: DistanceField,
    radius_m: float,
    scale: FloatArray,
    error_m: FloatArray,
    shift: FloatArray | float = 1.0,
) -> Along:
    """Ask the map for the distance of every position.

    Args:
        scale, error_m, shift: (m,) as `draws.Drawn.map_scale`, `map_error_m` and `map_shift`.
    """
    asked = flown.state != NONE
    flight, sample = np.nonzero(asked)
    points = flown.position_world_m[asked].astype(np.float64) / np.broadcast_to(shift, len(flown))[flight, None]
    reasonable = np.isfinite(points).all(axis=1)
    distance = np.full(len(points), np.nan)
    distance[reasonable] = field.distance(points[reasonable])
    descending = np.flatnonzero(np.isfinite(distance) & np.isin(flown.state[asked], DESCENDING))
    above = field.distance(points[descending] + [0.0, 0.0, _RISE_M])
    below = descending[above - distance[descending] > _BELOW * _RISE_M]
    landed = np.full(len(flown), asked.shape[1])
    standing = below[distance[below] < radius_m]
    np.minimum.at(landed, flight[standing], sample[standing])
    distance[below] = np.inf
    distance[sample >= landed[flight]] = np.inf  # it stands, or lies: what follows is no flight
    known = ~np.isnan(distance)
    beyond = np.zeros(len(flown), bool)
    beyond[flight[~known]] = True
    clearance = np.full(asked.shape, np.inf)
    clearance[flight[known], sample[known]] = scale[flight[known]] * distance[known] + error_m[flight[known]] - radius_m
    return Along(clearance, beyond)


def nearest(
    flown: Flown,
    field: DistanceField,
    radius_m: float,
    scale: FloatArray,
    error_m: FloatArray,
    shift: FloatArray | float = 1.0,
) -> Nearest:
    """Where each flight came closest; arguments as `along`."""
    found = along(flown, field, radius_m, scale, error_m, shift)
    rows, at = np.arange(len(flown)), found.clearance_m.argmin(axis=1)
    path_s = held(flown.path_s)
    points = flown.position_world_m[rows, at].astype(np.float64)
    return Nearest(found.clearance_m[rows, at], points, path_s[rows, at], found.left_map)


def surface(field: DistanceField, points_world_m: FloatArray) -> FloatArray:
    """(n, 3) the nearest point of the map's surfaces to each of the points (n, 3).

    By a step of the distance along its slope; NaN where the map is unknown, or the distance has no slope.
    """
    steps = _SLOPE_M * np.concatenate([np.eye(3), -np.eye(3)])
    around = np.asarray(field.distance((points_world_m[:, None] + steps).reshape(-1, 3))).reshape(-1, 6)
    slope = around[:, :3] - around[:, 3:]
    with np.errstate(invalid="ignore", divide="ignore"):
        away = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    return points_world_m - np.asarray(field.distance(points_world_m))[:, None] * away


def held(path_s: np.ndarray) -> FloatArray:
    """Time on the trajectory with gaps filled by what was before."""
    at = np.where(np.isfinite(path_s), np.arange(path_s.shape[1]), 0)
    np.maximum.accumulate(at, axis=1, out=at)
    return np.take_along_axis(path_s, at, axis=1).astype(np.float64)


def errors_along(flown: Flown, trajectory: Trajectory, bins: int) -> np.ndarray:
    """(m, bins) largest tracking error within equal shares of the trajectory's time; NaN where it was not flown."""
    found = np.full((len(flown), bins), np.nan, np.float32)
    on = np.isfinite(flown.path_s)
    share = np.clip((flown.path_s[on] * (bins / trajectory.duration_s)).astype(int), 0, bins - 1)
    flight = np.nonzero(on)[0]
    flat = np.full(found.size, -np.inf, np.float32)
    np.maximum.at(flat, flight * bins + share, flown.error_m[on])
    return np.where(np.isfinite(flat), flat, np.nan).reshape(found.shape).astype(np.float32)
