"""Where waypoints go that are snapped: onto a grid, to a height above what is below, away from obstacles."""

import numpy as np

from esdf import Field
from flight import FloatArray, InputError

_DEEPEST_M, _STEP_M = 30.0, 0.01
"""How far below a point a floor is looked for, and how finely."""
_MOST_STEPS, _LONGEST_STEP_M, _REACHED_M = 50, 0.2, 1e-3


def onto_grid(positions_world_m: FloatArray, spacing_m: float) -> FloatArray:
    """Nearest points of a grid through the origin, (n, 3). Raises `InputError` if the spacing is not positive."""
    _require(spacing_m, "the spacing of the grid")
    return spacing_m * np.round(positions_world_m / spacing_m)


def above_ground(positions_world_m: FloatArray, height_m: float, field: Field) -> FloatArray:
    """The same places (n, 3) at a height above the first surface below each.

    Raises:
        InputError: the height is not positive, or nothing is known below a place.
    """
    _require(height_m, "the height")
    placed = positions_world_m.copy()
    for place in placed:
        place[2] = surface_below(place, field) + height_m
    return placed


def surface_below(place_world_m: FloatArray, field: Field, near_m: float = 0.1) -> float:
    """Height (world z) of the first surface below a place: where `near_m` above it the map is that near.

    Raises:
        InputError: nothing is known below it.
    """
    x, y, z = (float(value) for value in place_world_m)
    heights_m = np.arange(z, z - _DEEPEST_M, -_STEP_M)
    near = field.distance(np.stack([np.full_like(heights_m, x), np.full_like(heights_m, y), heights_m], axis=1))
    found = near <= near_m
    if not found.any():
        raise InputError(f"the map knows no floor below ({x:.2f}, {y:.2f}, {z:.2f}) m; give the height")
    return float(heights_m[int(np.argmax(found))]) - near_m


def away_from_obstacles(positions_world_m: FloatArray, clearance_m: float, field: Field) -> FloatArray:
    """Places (n, 3) with a distance to everything mapped: those that are too near go straight away from it.

    Raises:
        InputError: the clearance is not positive, a place is outside the map or in unknown space, or there is not so
            much room round it.
    """
    _require(clearance_m, "the clearance")
    placed = positions_world_m.copy()
    distance_m, uphill = field.distance_and_gradient(placed)
    if np.isnan(distance_m).any():
        x, y, z = positions_world_m[int(np.argmax(np.isnan(distance_m)))]
        raise InputError(f"nothing is known round ({x:.2f}, {y:.2f}, {z:.2f}) m; move that waypoint into the map")
    most_m = distance_m
    for _ in range(_MOST_STEPS):
        near = ~(distance_m >= clearance_m - _REACHED_M)  # also where the last step left the map
        if not near.any():
            return placed
        steepness = np.maximum(np.linalg.norm(uphill[near], axis=1, keepdims=True), 1e-3)
        step_m = np.minimum(clearance_m - distance_m[near], _LONGEST_STEP_M)
        placed[near] += step_m[:, None] * uphill[near] / steepness
        distance_m, uphill = field.distance_and_gradient(placed)
        most_m = np.fmax(most_m, distance_m)
        if np.isnan(distance_m).any():
            break
    worst = int(np.argmin(np.where(distance_m >= clearance_m - _REACHED_M, np.inf, most_m)))
    x, y, z = positions_world_m[worst]
    raise InputError(
        f"there is no {clearance_m:.2f} m of room near ({x:.2f}, {y:.2f}, {z:.2f}) m: {most_m[worst]:.2f} m was found; "
        "give less, or move that waypoint"
    )


def _require(value_m: float, what: str) -> None:
    if not 0.0 < value_m <= 100.0:
        raise InputError(f"{what} would be {value_m:g} m; it must be above 0 and at most 100 m")
