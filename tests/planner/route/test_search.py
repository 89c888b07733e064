import itertools

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

import esdf
from esdf import solids
from flight import Waypoints
from planner import PlanInfeasibleError, PlanOptions, _planner
from planner.request import space
from planner.route import routes, search

BOX = np.array([[-3.0, -2.0, 1.0], [3.0, 2.5, 1.5]])


def path_cost(distance: np.ndarray, cells: np.ndarray, required: float, comfort: float, price: float) -> float:
    corners = np.stack(np.unravel_index(cells, distance.shape), axis=1)
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    lack = np.clip((comfort - distance.ravel()[cells[1:]]) / (comfort - required), 0.0, None)
    return float((lengths * (1.0 + price * lack**2)).sum())


def dijkstra_cost(distance: np.ndarray, start: int, goal: int, required: float, comfort: float, price: float) -> float:
    """The NumPy reference: every edge of the grid in a sparse graph."""
    shape = np.array(distance.shape)
    cells = np.stack(np.unravel_index(np.arange(distance.size), distance.shape), axis=1)
    rows, columns, weights = [], [], []
    for step in np.ndindex(3, 3, 3):
        move = np.array(step) - 1
        if not move.any():
            continue
        target = cells + move
        ok = ((target >= 0) & (target < shape)).all(axis=1)
        to = np.ravel_multi_index(tuple(target[ok].T), distance.shape)
        d = distance.ravel()[to]
        free = d >= required
        lack = np.clip((comfort - d[free]) / (comfort - required), 0.0, None)
        rows.append(np.flatnonzero(ok)[free])
        columns.append(to[free])
        weights.append(np.linalg.norm(move) * (1.0 + price * lack**2))
    graph = sparse.csr_matrix(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=(distance.size,) * 2
    )
    return float(dijkstra(graph, indices=start)[goal])


@pytest.mark.parametrize("greed", [1.0, 1.5])
@pytest.mark.parametrize("seed", range(8))
def test_the_kernel_finds_a_cheapest_way_or_one_dearer_by_no_more_than_asked(seed, greed):
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.0, 1.0, (14, 12, 7)).astype(np.float32)
    distance[0, 0, 0] = distance[-1, -1, -1] = 1.0
    goal = distance.size - 1
    for required in (0.3, 0.55):
        found = _planner.search(distance, 0, goal, required, 0.9, 3.0, greed)
        best = dijkstra_cost(distance, 0, goal, required, 0.9, 3.0)
        if np.isinf(best):
            assert len(found) == 0
        else:
            assert found[0] == 0
            assert found[-1] == goal
            assert (distance.ravel()[found[1:]] >= np.float32(required)).all()
            cost = path_cost(distance, found, required, 0.9, 3.0)
            assert best * (1.0 - 1e-3) <= cost <= best * (greed + 1e-3)


def test_a_dear_cell_across_a_corner_is_come_to_by_the_cell_beside_it():
    distance = np.array([[1.0, 1.0], [1.0, 0.3]], dtype=np.float32)[:, :, None]
    assert len(_planner.search(distance, 0, 3, 0.3, 1.0, 3.0, 1.0)) == 3  # 1 + 4, and 4 times the diagonal is 5.7


@pytest.mark.parametrize("voxel_m", [0.1, 0.3])
def test_a_lattice_of_a_sampled_field_holds_what_the_field_proves(two_rooms, voxel_m):
    shape = tuple(int(np.ceil(edge / voxel_m)) for edge in (10.6, 8.6, 3.6))
    grid = esdf.Grid((-5.3, -4.3, -0.3), (voxel_m,) * 3, shape)
    field = esdf.build(esdf.rasterize(two_rooms, grid), grid)
    points = np.random.default_rng(0).uniform([-4.5, -3.5, 0.3], [4.5, 3.5, 2.5], (500, 3))
    held = space.certain(field, field.distance(points))
    assert np.allclose(held, field.proven_distance(points), atol=1e-5)
    assert np.isneginf(space.certain(field, np.array([np.nan])))[0]


def test_walled_in_there_is_no_way():
    distance = np.ones((9, 9, 9), dtype=np.float32)
    distance[4] = 0.0
    assert len(_planner.search(distance, 0, distance.size - 1, 0.3, 0.5, 1.0, 1.0)) == 0


def test_unknown_cells_are_not_entered():
    distance = np.ones((9, 9, 9), dtype=np.float32)
    distance[4] = np.nan
    assert len(_planner.search(distance, 0, distance.size - 1, 0.3, 0.5, 1.0, 1.0)) == 0


def test_the_way_through_a_doorway_is_free_and_hardly_longer_than_it_must_be(two_rooms):
    start, goal = np.array([-3.0, -2.0, 1.0]), np.array([3.0, -2.0, 1.0])
    grid = search.lattice(two_rooms, BOX, 0.2)
    way = search.route(two_rooms, grid, start, goal, 0.3, 0.8)
    assert way is not None
    assert np.array_equal(way[[0, -1]], [start, goal])
    assert all(line.free for line in space.check_lines(two_rooms, way[:-1], way[1:], 0.3))
    # The taut string touches the door post at 0.3 m; round it, it is no shorter than to the post's clearance circle.
    shortest = 2.0 * np.hypot(3.0, 3.5 + 0.2)
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).sum() < 1.1 * shortest


@pytest.mark.parametrize("width", [0.64, 0.68, 0.75])
def test_a_doorway_that_is_only_just_wide_enough_is_found(width):
    y = 0.137
    scene = solids.Scene(
        [
            solids.Room((-3.0, -3.0, 0.0), (3.0, 3.0, 2.5)),
            solids.Box((-0.05, -3.0, 0.0), (0.05, y - width / 2, 2.5)),
            solids.Box((-0.05, y + width / 2, 0.0), (0.05, 3.0, 2.5)),
        ]
    )
    start, goal = np.array([-2.0, -2.0, 1.0]), np.array([2.0, -2.0, 1.0])
    grid = search.lattice(scene, np.stack([start, goal, (-2.0, 1.0, 1.0)]), 0.3)
    way = search.route(scene, grid, start, goal, 0.3, 0.8)
    assert way is not None
    assert all(line.free for line in space.check_lines(scene, way[:-1], way[1:], 0.3))


def test_a_doorway_that_is_too_narrow_is_not(two_rooms):
    start, goal = np.array([-3.0, -2.0, 1.0]), np.array([3.0, -2.0, 1.0])
    grid = search.lattice(two_rooms, BOX, 0.2)
    assert search.route(two_rooms, grid, start, goal, 0.52, 0.8) is None


def test_more_clearance_never_makes_a_shorter_way(pillar):
    start, goal = np.array([-4.0, 0.1, 1.5]), np.array([4.0, 0.0, 1.5])
    grid = search.lattice(pillar, np.stack([start, goal]), 2.0)
    lengths = []
    for required in (0.1, 0.3, 0.5, 0.8, 1.2):
        way = search.route(pillar, grid, start, goal, required, required + 0.5)
        assert way is not None
        lengths.append(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    assert all(b >= a - 0.05 for a, b in itertools.pairwise(lengths))  # 5 cm: half a cell
    assert lengths[-1] > lengths[0] + 0.1


@pytest.mark.parametrize("width_m", [0.3, 0.5])
def test_without_a_way_the_narrowest_gap_is_told_with_place_and_width(width_m):
    """A wall with two doors: the wider one, too narrow all the same, is where most room is."""
    half = 0.5 * width_m
    scene = solids.Scene(
        [
            solids.Room((-3.0, -3.0, 0.0), (3.0, 3.0, 2.5)),
            solids.Box((-0.1, -3.0, 0.0), (0.1, -2.1, 2.5)),
            solids.Box((-0.1, -2.0, 0.0), (0.1, 1.5 - half, 2.5)),
            solids.Box((-0.1, 1.5 + half, 0.0), (0.1, 3.0, 2.5)),
        ]
    )
    ask = Waypoints(np.array([[-2.0, 0.0, 1.0], [2.0, 0.0, 1.0]]), np.full(2, np.nan))
    with pytest.raises(PlanInfeasibleError, match="the widest way narrows to") as caught:
        routes.find(ask, scene, PlanOptions(radius_m=0.15))
    gap = caught.value.gap
    assert gap is not None
    assert gap.width_m == pytest.approx(width_m, abs=0.25)
    assert np.linalg.norm(np.array(gap.point_world_m[:2]) - [0.0, 1.5]) < 0.3
    routes.find(ask, scene, PlanOptions(radius_m=0.5 * width_m - 0.06, margin_m=0.0))


def test_a_closed_room_has_a_gap_of_no_width():
    scene = solids.Scene([solids.Room((-3, -3, 0), (3, 3, 2.5)), solids.Box((-0.1, -3.0, 0.0), (0.1, 3.0, 2.5))])
    ask = Waypoints(np.array([[-2.0, 0.0, 1.0], [2.0, 0.0, 1.0]]), np.full(2, np.nan))
    with pytest.raises(PlanInfeasibleError, match=r"narrows to 0.00 m at .* 0.60 m are needed"):
        routes.find(ask, scene, PlanOptions(radius_m=0.15))
