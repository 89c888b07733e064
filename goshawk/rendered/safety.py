"""What a map of the hazardous room says of thin rods, a cable and a plain wall: shown, unknown, or called free.

Nothing here is shared with what makes the map: the distance to every solid is a formula.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import esdf
from esdf import FREE, OCCUPIED, Grid
from esdf.solids import Cylinder
from esdf.visibility import Visibility
from flight import FloatArray
from goshawk.rendered import scene as rendered_room
from goshawk.rendered.scene import RenderedScene

STEP_M = 0.01
OVERSTATED_M = 0.10
BEHIND_M = 0.10
NEAR_M = 0.10
CAP_M = 2.0


@dataclass(frozen=True, slots=True)
class Shares:
    """Of points, by the voxel they lie in."""

    occupied: float
    free: float
    """The rest is unknown."""


@dataclass(frozen=True, slots=True)
class Safety:
    """Scores of a map in the frame of the scene."""

    pole: Shares
    """Of the axis of the 3 cm pole."""
    cable: Shares
    """Of the axis of the 12 mm cable."""
    wall: Shares
    """Of the plain wall's surface."""
    wall_inferred: float
    """Share of it that is inferred from planes instead."""
    inferred_not_near_matter: float
    """Share of all inferred voxels with nothing within 10 cm of their centre."""
    behind_wall: Shares
    """Of the plane 10 cm behind it."""
    free_m3: float
    """Volume marked free."""
    free_share_in_matter: float
    """Share of the free voxels whose centre lies inside matter."""
    overstated: float
    """Share of the free voxels where the map's distance is more than 10 cm too large."""
    overstated_unexplained: float
    """Share of them near something that the images resolve, according to the map's own mask."""


def score(state: NDArray[np.uint8], grid: Grid, seen: Visibility, inferred: NDArray[np.bool_]) -> Safety:
    """Score a map's voxel states, the mask of what could hide in it, and its inferred voxels."""
    scene = rendered_room.hazardous()
    cable, wall = rendered_room.CABLE, rendered_room.PLAIN_WALL
    along_m = np.arange(cable.low_world_m[0] + 0.1, cable.high_world_m[0] - 0.1, STEP_M)
    middle = 0.5 * (np.array(cable.low_world_m) + np.array(cable.high_world_m))
    cable_axis = np.tile(middle, (len(along_m), 1))
    cable_axis[:, 0] = along_m
    y, z = np.meshgrid(
        np.arange(wall.low_world_m[1] + 0.1, wall.high_world_m[1] - 0.1, 5 * STEP_M),
        np.arange(0.5, wall.high_world_m[2] - 0.1, 5 * STEP_M),
    )
    face = np.column_stack([np.full(y.size, wall.low_world_m[0]), y.ravel(), z.ravel()])
    free = grid.centre(np.argwhere(state == FREE))
    true_m = scene.distance(free)
    overstated = esdf.build(state, grid, cap_m=CAP_M).distance(free) - np.minimum(true_m, CAP_M) > OVERSTATED_M
    return Safety(
        pole=shares(state, grid, axis(rendered_room.RODS[0])),
        cable=shares(state, grid, cable_axis),
        wall=shares(state, grid, face),
        wall_inferred=float(inferred[tuple(grid.index(face[grid.contains(face)]).T)].sum() / len(face)),
        inferred_not_near_matter=false_share(scene, grid, inferred),
        behind_wall=shares(state, grid, face + np.array([BEHIND_M, 0.0, 0.0])),
        free_m3=len(free) * float(np.prod(grid.voxel_m)),
        free_share_in_matter=float((true_m < 0.0).mean()),
        overstated=float(overstated.mean()),
        overstated_unexplained=float((~_could_hide(scene, seen, free[overstated])).sum() / max(len(free), 1)),
    )


def axis(rod: Cylinder) -> FloatArray:
    """(n, 3) points along the axis of an upright rod, without its ends."""
    x, y, z = rod.centre_world_m
    heights_m = np.arange(z - 0.5 * rod.height_m + 0.1, z + 0.5 * rod.height_m - 0.1, STEP_M)
    return np.column_stack([np.full(len(heights_m), x), np.full(len(heights_m), y), heights_m])


def shares(state: NDArray[np.uint8], grid: Grid, points_world_m: FloatArray) -> Shares:
    """What a map says of points (n, 3); those outside of it are unknown."""
    inside = grid.contains(points_world_m)
    found = state[tuple(grid.index(points_world_m[inside]).T)]
    count = max(len(points_world_m), 1)
    return Shares(float((found == OCCUPIED).sum() / count), float((found == FREE).sum() / count))


def false_share(scene: RenderedScene, grid: Grid, inferred: NDArray[np.bool_]) -> float:
    """Share of the inferred voxels (nx, ny, nz) with nothing within 10 cm of their centre."""
    distance_m = np.abs(scene.distance(grid.centre(np.argwhere(inferred))))
    return float((distance_m > NEAR_M).sum() / max(len(distance_m), 1))


def _could_hide(scene: RenderedScene, seen: Visibility, points_world_m: FloatArray) -> NDArray[np.bool_]:
    """Whether the solid nearest to each point (n, 3) is too thin to be resolved, where it is nearest."""
    explained = np.zeros(len(points_world_m), bool)
    if not len(points_world_m):
        return explained
    solids = [solid for solid, _ in scene.painted]
    nearest = np.argmin([solid.distance(points_world_m) for solid in solids], axis=0)
    for number, solid in enumerate(solids):
        mine = nearest == number
        low, high = solid.bounds_world_m
        thickness_m = float(np.min(high - low))
        if mine.any() and np.isfinite(thickness_m):
            points = points_world_m[mine]
            explained[mine] = seen.could_hide(np.clip(points, low, high), thickness_m)
    return explained
