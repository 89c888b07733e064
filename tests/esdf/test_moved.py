"""Solids, edits and fields in another frame: distances stay, and no space becomes free that was not."""

import numpy as np
import pytest

import esdf
from esdf import Edit, solids
from esdf.moved import moved_edits, moved_field, moved_solid
from esdf.solids import Box, Capsule, Cylinder, OrientedBox, Prism, Room, Scene, Sphere, Stroke
from flight import InputError, frames, rotations

SHIFT = frames.transform([1.0, 0.0, 0.0, 0.0], [0.4, -1.3, 0.7])
YAW = frames.transform(rotations.from_yaw(0.6), [0.4, -1.3, 0.7])
TILT = frames.transform(rotations.exp([0.2, -0.3, 0.6]), [0.4, -1.3, 0.7])
LEANING = (
    Box((0.0, 0.0, 0.0), (1.0, 2.0, 0.5)),
    Room((-1.0, -1.0, 0.0), (2.0, 1.5, 2.0)),
    OrientedBox((0.1, 0.2, 0.3), (0.5, 0.4, 0.3), (0.9, 0.1, 0.2, -0.3)),
    Sphere((0.3, 0.2, 0.1), 0.4),
    Capsule((0.0, 0.0, 0.0), (1.0, 0.3, 0.8), 0.1),
    Stroke(((0.0, 0.0, 0.0), (1.0, 0.0, 0.5), (1.0, 1.0, 0.5)), 0.2),
)
UPRIGHT = (Cylinder((0.5, 0.5, 0.5), 0.3, 1.0), Prism(((0.0, 0.0), (1.0, 0.0), (0.3, 1.2)), 0.0, 1.0))


@pytest.mark.parametrize(
    ("solid", "T"),
    [(solid, T) for solid in LEANING for T in (SHIFT, YAW, TILT)] + [(s, T) for s in UPRIGHT for T in (SHIFT, YAW)],
    ids=lambda value: type(value).__name__,
)
def test_a_moved_solid_holds_the_moved_points(solid: solids.Solid, T: np.ndarray) -> None:
    points = np.random.default_rng(0).uniform(-2.0, 3.0, (500, 3))
    before, after = solid.distance(points), Scene(moved_solid(solid, T)).distance(frames.apply(T, points))
    outside = before > 0.0  # walls that overlap in a corner know only a bound inside
    np.testing.assert_allclose(after[outside], before[outside], atol=1e-9)
    np.testing.assert_array_equal(after < 0.0, before < 0.0)


@pytest.mark.parametrize("solid", UPRIGHT, ids=lambda solid: type(solid).__name__)
def test_an_upright_solid_that_would_lean_is_refused_by_name(solid: solids.Solid) -> None:
    grid = esdf.Grid.covering([-2.0] * 3, [3.0] * 3, 0.1)
    with pytest.raises(InputError, match=r"edit 1 \(no-fly mast\): an upright .* cannot lean; remove it"):
        moved_edits([Edit("no-fly", solid, "mast")], TILT, grid)


def test_a_solid_that_is_only_shifted_keeps_its_shape() -> None:
    for solid in (*LEANING, *UPRIGHT):
        assert [type(part) for part in moved_solid(solid, SHIFT)] == [type(solid)]


def test_edits_beyond_the_new_grid_are_left_out() -> None:
    grid = esdf.Grid.covering([0.0] * 3, [1.0] * 3, 0.1)
    near, far = Edit("add", Sphere((0.5, 0.5, 0.5), 0.2)), Edit("add", Sphere((9.0, 0.5, 0.5), 0.2))
    assert moved_edits([near, far], np.eye(4), grid) == (near,)


def test_a_keep_in_room_that_is_turned_still_keeps_in() -> None:
    """Its walls have names of their own, as two no-fly zones of one name are refused."""
    grid = esdf.Grid.covering([-3.0] * 3, [3.0] * 3, 0.1)
    edits = moved_edits([Edit("no-fly", Room((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)), "keep in")], YAW, grid)
    assert {edit.name for edit in edits} <= {f"keep in {k}" for k in range(1, 7)}
    assert len({edit.name for edit in edits}) == len(edits)


def field(seed: int) -> esdf.Field:
    rng = np.random.default_rng(seed)
    grid = esdf.Grid((-0.3, 0.2, 0.1), (0.1, 0.1, 0.1), (14, 11, 9))
    state = rng.choice(np.array([0, 1, 2], np.uint8), grid.shape, p=[0.1, 0.8, 0.1])
    return esdf.build(state, grid, cap_m=1.0)


def test_a_shifted_field_has_the_same_voxels() -> None:
    old = field(0)
    new = moved_field(old, SHIFT)
    np.testing.assert_array_equal(new.state, old.state)
    np.testing.assert_allclose(new.grid.low_world_m, old.grid.low_world_m + SHIFT[:3, 3])
    assert new.hash != old.hash
    points = old.grid.centre(np.argwhere(old.state == esdf.FREE))
    np.testing.assert_allclose(new.distance(frames.apply(SHIFT, points)), old.distance(points), atol=1e-6)


@pytest.mark.parametrize("T", [YAW, TILT], ids=["yaw", "tilt"])
@pytest.mark.parametrize("seed", range(3))
def test_a_turned_field_is_never_more_permissive(seed: int, T: np.ndarray) -> None:
    """Wherever the new one is free the old one was; wherever the old one was occupied the new one is."""
    old = field(seed)
    new = moved_field(old, T)
    points = np.random.default_rng(seed).uniform(old.grid.low_world_m + 1e-6, old.grid.high_world_m - 1e-6, (4000, 3))
    was = old.state[tuple(old.grid.index(points).T)]
    now = new.state[tuple(new.grid.index(frames.apply(T, points)).T)]
    assert (was[now == esdf.FREE] == esdf.FREE).all()
    assert (now[was == esdf.OCCUPIED] == esdf.OCCUPIED).all()


def test_free_space_survives_a_turn_but_for_a_voxel_at_its_rim() -> None:
    grid = esdf.Grid.covering([0.0] * 3, [3.0] * 3, 0.1)
    open_space = esdf.build(np.full(grid.shape, esdf.FREE, np.uint8), grid)
    new = moved_field(open_space, YAW)
    middle = frames.apply(YAW, np.random.default_rng(0).uniform(0.3, 2.7, (500, 3)))
    assert (new.state[tuple(new.grid.index(middle).T)] == esdf.FREE).all()


def test_a_field_on_another_ones_lattice_can_be_merged_with_it() -> None:
    first, second = field(1), field(2)
    turned = moved_field(second, YAW, lattice=first.grid)
    steps = (turned.grid.low_world_m - first.grid.low_world_m) / np.array(first.grid.voxel_m)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert turned.grid.voxel_m == first.grid.voxel_m
