"""Views that would show the unknown space of a map which touches its free space, from places that can be reached.

1. The targets: unknown space that is worth another look (`frontier`).
2. The candidates: places with enough clearance in one piece of free space with the recorded path, and headings there.
3. Greedy cover of the targets (Wolsey, 1982): at each step the view that adds most. A target is shown once as many
   images as free space asks for would see it, from at least two places.
4. The tour: the views in an order that makes a short way (nearest neighbour, then 2-opt; straight lines).

What a view shows is an estimate. More than in truth: a ray counts as clear until it meets an occupied voxel, so unknown
space is taken to be transparent. Less: of an image only the largest cone about the optical axis counts. Rays begin at
the body, not at the cameras. Views that show most of the frontier are after Connolly (1985).
"""

import dataclasses
import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, Field, Grid
from esdf.visibility import line_of_sight
from flight import FloatArray, InputError, Progress, rotations, silent
from mapping.camera.rig import Camera, Rig
from mapping.exploration import frontier

HEADINGS = 16
"""Compared at each place."""
_SPACING_M = 0.4
"""Between candidate places: at 2 m, a parallax of 11 degrees."""
_MOST_PLACES = 800
"""Larger maps get a wider spacing."""
_JOIN_M = 1.0
"""How far from the recorded path free space with enough clearance may begin."""
LARGEST_M = 1000.0
"""A longer distance is a wrong unit."""


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """What is worth another look, and from where."""

    clearance_m: float = 0.35
    """Distance to keep from everything that is not free: the vehicle's radius and its margin."""
    farthest_m: float = 4.0
    """Range beyond which an image is not expected to show whether space is free."""
    depth_m: float = 0.5
    """How far behind the frontier unknown space counts."""
    least_m3: float = 0.05
    """Smallest unknown volume that is worth a view; smaller ones are left as they are."""
    looks: int = 3
    """Images that must see through a voxel before it is free."""
    most_views: int = 16
    """Length of the tour."""
    within_m: float = 2.0
    """Of a given path: unknown space farther from it does not count."""
    heights_world_m: tuple[float, float] = (-np.inf, np.inf)
    """Lowest and highest place to look from, say those of a person's hands."""

    def __post_init__(self) -> None:
        for name in ("clearance_m", "farthest_m", "depth_m", "within_m"):
            if not 0.0 < getattr(self, name) <= LARGEST_M:
                raise InputError(f"{name} is {getattr(self, name):g}; it must be above 0 and at most {LARGEST_M:g} m")
        if not 0.0 < self.least_m3 < np.inf:
            raise InputError(f"least_m3 is {self.least_m3:g}; it must be positive and finite")
        if not 1 <= self.looks <= self.most_views:
            raise InputError(
                f"most_views is {self.most_views}; it must be at least {self.looks}, the images that each place needs"
            )


@dataclass(frozen=True, slots=True)
class View:
    """A place to look from; the vehicle is level there."""

    position_world_m: tuple[float, float, float]
    """Of the body."""
    heading_rad: float
    """From x towards y, of the body's x axis."""
    clearance_m: float
    """At least so far from everything that is not free."""
    shows_m3: float
    """Unknown space in view that the whole tour shows; views share it."""

    @property
    def heading_deg(self) -> float:
        return round(float(np.degrees(self.heading_rad)), 1)


@dataclass(frozen=True, slots=True, eq=False)
class Again:
    """Where to look again in a map, and what that would show."""

    views: tuple[View, ...]
    """In the order of the tour; none where nothing is worth it."""
    targets_world_m: FloatArray
    """(n, 3) middles of the cells of unknown space that were asked for."""
    volumes_m3: FloatArray
    """(n,) unknown space in each."""
    shown: NDArray[np.bool_]
    """(n,) whether the tour shows it."""
    in_vain_m3: float
    """Frontier that `frontier.IN_VAIN` images or more looked at, not all from one place, and that stayed unknown."""

    @property
    def unknown_m3(self) -> float:
        """Unknown space that was asked for."""
        return float(self.volumes_m3.sum())

    @property
    def shown_m3(self) -> float:
        """What the tour would show of it."""
        return float(self.volumes_m3[self.shown].sum())

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "views": [dataclasses.asdict(view) | {"heading_deg": view.heading_deg} for view in self.views],
            "unknown_m3": self.unknown_m3,
            "shown_m3": self.shown_m3,
            "in_vain_m3": self.in_vain_m3,
        }


def look_again(
    field: Field,
    rig: Rig,
    T_world_body: FloatArray,
    options: ViewOptions | None = None,
    *,
    near_world_m: FloatArray | None = None,
    progress: Progress = silent,
) -> Again:
    """Views that would show the unknown space of a map that touches its free space.

    Args:
        field: the map's, the pilot's edits applied; occupied voxels of an edit hide what is behind them.
        rig: that will look.
        T_world_body: (n, 4, 4) of the map's images; n is at least 1.
        near_world_m: (m, 3) path of a flight to come; only unknown space near it counts. All of the map without.

    Raises:
        InputError: there are no images, none of them was taken within reach of space with the clearance, or all of the
            path's points are outside the map.
    """
    options = options or ViewOptions()
    if not len(T_world_body):
        raise InputError("the map has no poses of images: what was seen, and from where, is not known")
    places = _places(field, T_world_body[:, :3, 3], options)
    asked = frontier.targets(
        field,
        rig,
        T_world_body,
        farthest_m=options.farthest_m,
        depth_m=options.depth_m,
        least_m3=options.least_m3,
        near_world_m=near_world_m,
        within_m=options.within_m,
        progress=progress,
    )
    progress("views", 0.0)
    seen = _sight(asked.state, field.grid, places, asked.middle_world_m, rig, options.farthest_m)
    chosen, looks = _cover(seen, asked.volume_m3, options, progress)
    shown = looks >= options.looks
    views = [_view(field, seen, place, heading, asked.volume_m3 * shown) for place, heading in chosen]
    views = [view for view in views if view.shows_m3 > 0.0]
    return Again(_tour(views, T_world_body[0, :3, 3]), asked.middle_world_m, asked.volume_m3, shown, asked.in_vain_m3)


def _places(field: Field, path_world_m: FloatArray, options: ViewOptions) -> FloatArray:
    """(p, 3) candidate places: enough clearance, in one piece with most of the recorded path."""
    from scipy import ndimage
    from scipy.spatial import KDTree

    grid = field.grid
    slack_m = grid.half_diagonal_m
    # at a voxel's centre, as `SampledField.proven_distance` has it between centres
    allowed = (field.state == FREE) & (np.nan_to_num(field.values_m, nan=-1.0) > np.hypot(options.clearance_m, slack_m))
    pieces = np.zeros(grid.shape, np.int32)
    ndimage.label(allowed, output=pieces)
    cells = np.argwhere(allowed)
    refused = (
        f"no image was taken within {_JOIN_M:g} m of free space with a clearance of {options.clearance_m:.2f} m; "
        "give a smaller clearance"
    )
    if not len(cells):
        raise InputError(refused)
    gap_m, nearest = (np.asarray(each) for each in KDTree(grid.centre(cells)).query(path_world_m))
    reached = pieces[tuple(cells[nearest[gap_m <= _JOIN_M]].T)]
    if not len(reached):
        raise InputError(refused)
    cells = cells[pieces[tuple(cells.T)] == np.bincount(reached).argmax()]
    low_m, high_m = options.heights_world_m
    height_m = grid.centre(cells)[:, 2]
    cells = cells[(height_m >= low_m) & (height_m <= high_m)]
    volume_m3 = len(cells) * float(np.prod(grid.voxel_m))
    spacing_m = max(_SPACING_M, float(np.cbrt(volume_m3 / _MOST_PLACES)))
    blocks = np.floor(grid.centre(cells) / spacing_m).astype(np.int64)
    return grid.centre(cells)[_roomiest_of(blocks, field.values_m[tuple(cells.T)])]


def _roomiest_of(blocks: NDArray[np.int64], room_m: NDArray[np.float32]) -> NDArray[np.int64]:
    """Row of the largest room of each block (n, 3)."""
    order = np.lexsort((-room_m, *blocks.T))
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(blocks[order], axis=0) != 0).any(axis=1)
    return order[first]


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    """Which cells each place sees, and how many cameras see one at each heading."""

    places_world_m: FloatArray
    """(p, 3)."""
    first: NDArray[np.int64]
    """(p + 1,) where each place begins in the two below."""
    cell: NDArray[np.int64]
    """(k,) cells in sight."""
    cameras: NDArray[np.uint8]
    """(k, HEADINGS) cameras that have it in view."""

    def of(self, place: int) -> slice:
        return slice(self.first[place], self.first[place + 1])


def _half_view_rad(camera: Camera) -> float:
    """Half angle of the largest cone about the optical axis that is in the image."""
    edges = np.array(camera.principal_point_px)
    nearest = np.array([[0.0, edges[1]], [camera.width, edges[1]], [edges[0], 0.0], [edges[0], camera.height]])
    rays = camera.unproject(nearest)
    angles = np.where(np.isfinite(rays[:, 2]), np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2]), np.inf)
    return min(float(angles.min()), camera.half_field_rad)


def _sight(
    state: NDArray[np.uint8],
    grid: Grid,
    places_world_m: FloatArray,
    cells_world_m: FloatArray,
    rig: Rig,
    farthest_m: float,
) -> _Sight:
    from scipy.spatial import KDTree

    headings = 2.0 * np.pi * np.arange(HEADINGS) / HEADINGS
    R_world_body = rotations.matrix(rotations.from_yaw(headings))
    axes = np.stack([R_world_body @ camera.T_body_camera[:3, 2] for camera in rig])  # (cameras, HEADINGS, 3)
    cosine = np.cos([_half_view_rad(camera) for camera in rig])
    numbers, counts = [], []
    near = KDTree(cells_world_m).query_ball_point(places_world_m, farthest_m) if len(cells_world_m) else []
    for place, asked in zip(places_world_m, near, strict=len(cells_world_m) > 0):
        asked = np.sort(np.array(asked, np.int64))
        offset = cells_world_m[asked] - place
        ray = offset / np.linalg.norm(offset, axis=1)[:, None]
        in_view = np.einsum("chi,ki->kch", axes, ray) >= cosine[:, None]
        clear = line_of_sight(state, grid, place, cells_world_m[asked])
        numbers.append(asked[clear])
        counts.append(in_view[clear].sum(axis=1).astype(np.uint8))
    if not numbers:
        return _Sight(
            places_world_m[:0], np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros((0, HEADINGS), np.uint8)
        )
    first = np.concatenate([[0], np.cumsum([len(each) for each in numbers])])
    return _Sight(places_world_m, first, np.concatenate(numbers), np.concatenate(counts))


def _cover(
    seen: _Sight, volume_m3: FloatArray, options: ViewOptions, progress: Progress
) -> tuple[list[tuple[int, int]], NDArray[np.int64]]:
    """Places and headings (of their lists), and how many images of each cell these give.

    A place is worth no more than all but one of the images that a cell needs: the others must come from elsewhere, or
    there is no parallax. What a place adds never grows, so that most need not be asked again
    (Minoux, 1978).
    """
    looks = np.zeros(len(volume_m3), np.int64)
    at_once = max(options.looks - 1, 1)

    def adds_m3(place: int) -> FloatArray:
        rows = seen.of(place)
        cell = seen.cell[rows]
        missing = np.clip(options.looks - looks[cell], 0, at_once)
        return volume_m3[cell] @ np.minimum(seen.cameras[rows], missing[:, None])

    waiting = [(-float(adds_m3(place).max(initial=0.0)), place) for place in range(len(seen.places_world_m))]
    heapq.heapify(waiting)
    chosen: list[tuple[int, int]] = []
    while waiting and len(chosen) < options.most_views and -waiting[0][0] >= options.least_m3:
        _, place = heapq.heappop(waiting)
        if any(math.dist(*seen.places_world_m[[place, other]]) < frontier.APART_M for other, _ in chosen):
            continue
        adds = adds_m3(place)
        heading = int(adds.argmax())
        if waiting and adds[heading] < -waiting[0][0]:
            heapq.heappush(waiting, (-float(adds[heading]), place))
        elif adds[heading] >= options.least_m3:
            rows = seen.of(place)
            looks[seen.cell[rows]] += np.minimum(seen.cameras[rows, heading], at_once)
            chosen.append((place, heading))
            progress("views", len(chosen) / options.most_views)
    return chosen, looks


def _view(field: Field, seen: _Sight, place: int, heading: int, shown_m3: FloatArray) -> View:
    rows = seen.of(place)
    in_view = seen.cell[rows][seen.cameras[rows, heading] > 0]
    position = seen.places_world_m[place]
    x, y, z = np.round(position, 4).tolist()
    angle = 2.0 * np.pi * heading / HEADINGS
    return View(
        (x, y, z),
        float(np.arctan2(np.sin(angle), np.cos(angle))),
        float(field.proven_distance(position[None])[0]),
        float(shown_m3[in_view].sum()),
    )


def _tour(views: Sequence[View], start_world_m: FloatArray) -> tuple[View, ...]:
    """The views in an order that makes a short way from the start: nearest neighbour, then 2-opt."""
    points = np.array([start_world_m, *(view.position_world_m for view in views)])
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    order, left = [0], set(range(1, len(points)))
    while left:
        order.append(min(left, key=lambda k: apart[order[-1], k]))
        left.remove(order[-1])
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order) - 1):
            for j in range(i + 1, len(order)):
                before, a, b = order[i - 1], order[i], order[j]
                saved_m = apart[before, a] - apart[before, b]
                if j + 1 < len(order):
                    saved_m += apart[b, order[j + 1]] - apart[a, order[j + 1]]
                if saved_m > 1e-9:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return tuple(views[k - 1] for k in order[1:])
