"""A slice shows the field at its place: an obstacle where it stands, and unknown space as unknown."""

import numpy as np
import pytest

import esdf
from esdf import solids
from flight import rotations
from gcs_web.map import slices
from gcs_web.protocol.map import Slice
from mapping.dense.confidence import MeasuredSurface, SurfaceConfidence

POST = solids.Sphere((1.0, 2.0, 0.5), 0.3)
GRID = esdf.Grid((-1.0, 0.0, 0.0), 0.1, (40, 30, 10))


def drawn(wanted: Slice, field: esdf.Field) -> tuple[slices.Picture, np.ndarray]:
    """The picture, and where each of its pixels is in the world by its own pose (h, w, 3)."""
    picture = slices.draw(None, field, wanted, 0.2)  # type: ignore[arg-type]
    h, w = picture.rgba.shape[:2]
    x = ((np.arange(w) + 0.5) / w - 0.5) * picture.size_m[0]
    y = ((np.arange(h) + 0.5) / h - 0.5) * picture.size_m[1]
    local = np.stack([*np.meshgrid(x, y), np.zeros((h, w))], axis=-1)
    return picture, local @ rotations.matrix(picture.q_world_image).T + picture.centre_world_m


@pytest.mark.parametrize(("axis", "at_m"), [("x", 1.0), ("y", 2.0), ("z", 0.5)])
def test_the_limit_is_drawn_where_the_distance_has_it(axis, at_m):
    field = esdf.build(esdf.rasterize(POST, GRID), GRID, cap_m=2.0)
    picture, places = drawn(Slice(axis, at_m), field)
    np.testing.assert_allclose(places[..., "xyz".index(axis)], at_m, atol=1e-9)
    edge = (picture.rgba == 255).all(axis=-1)
    assert edge.any()
    np.testing.assert_allclose(field.distance(places[edge]), 0.2, atol=0.06)
    room = field.distance(places.reshape(-1, 3)).reshape(edge.shape) > 0.2
    assert (picture.rgba[room & ~edge, 3] > picture.rgba[~room & ~edge, 3].max()).all()


@pytest.mark.parametrize(("heading_deg", "tilt_deg"), [(30.0, 0.0), (-120.0, 40.0), (10.0, -90.0)])
def test_an_oblique_slice_is_a_plane_with_its_normal_and_shows_the_field_there(heading_deg, tilt_deg):
    field = esdf.build(esdf.rasterize(POST, GRID), GRID, cap_m=2.0)
    wanted = Slice("oblique", 0.0, heading_deg=heading_deg, tilt_deg=tilt_deg)
    normal = slices.normal(wanted)
    wanted = Slice("oblique", float(normal @ [1.0, 2.0, 0.5]), heading_deg=heading_deg, tilt_deg=tilt_deg)
    picture, places = drawn(wanted, field)
    np.testing.assert_allclose(places @ normal, wanted.at_m, atol=1e-9)
    edge = (picture.rgba == 255).all(axis=-1)
    assert edge.any()
    np.testing.assert_allclose(field.distance(places[edge]), 0.2, atol=0.06)
    inside = GRID.contains(places.reshape(-1, 3)).reshape(edge.shape)
    assert inside.any()
    assert (picture.rgba[~inside, 3] == 0).all()  # nothing is shown beside the map


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_an_oblique_slice_along_an_axis_has_the_points_of_that_slice(axis):
    field = esdf.build(esdf.rasterize(POST, GRID), GRID, cap_m=2.0)
    angles = {"x": (0.0, 0.0), "y": (90.0, 0.0), "z": (0.0, 90.0)}[axis]
    (_, plain), (_, oblique) = (
        drawn(wanted, field) for wanted in (Slice(axis, 0.45), Slice("oblique", 0.45, "distance", *angles))
    )
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(plain, axis=(0, 1)), end(oblique, axis=(0, 1)), atol=0.06)


def test_unknown_space_is_hatched_and_free_space_clear():
    state = esdf.rasterize(POST, GRID)
    state[30:] = esdf.UNKNOWN
    picture, places = drawn(Slice("z", 0.1, "unknown"), esdf.build(state, GRID, cap_m=2.0))
    edge = (picture.rgba == 255).all(axis=-1)
    unknown = places[..., 0] > 2.0
    assert (picture.rgba[unknown & ~edge, 3] > 0).all()
    assert (picture.rgba[~unknown & ~edge, 3] == 0).all()


def test_an_inferred_wall_is_drawn_in_its_own_colour_only_where_the_field_is_unknown():
    state = esdf.rasterize(POST, GRID)
    state[30:] = esdf.UNKNOWN
    wall = np.zeros(GRID.shape, bool)
    wall[25:35] = True
    wanted, field = Slice("z", 0.1, "unknown"), esdf.build(state, GRID, cap_m=2.0)
    picture = slices.draw(None, field, wanted, 0.2, inferred=wall)  # type: ignore[arg-type]
    without, places = drawn(wanted, field)
    differs = (picture.rgba != without.rgba).any(axis=-1)
    edge = (without.rgba == 255).all(axis=-1)
    x = places[..., 0]
    assert (differs == (x > 2.0) & (x < 2.5))[~edge].all()
    assert len(np.unique(picture.rgba[differs], axis=0)) == 1


def test_obstacles_have_the_colour_of_the_measured_surface_nearest_to_them():
    """Vertices on the surface of the post, those at its smaller x well known; a box that nothing measured beside it."""
    state = esdf.rasterize(solids.Scene([POST, solids.Box((2.2, 0.5, 0.0), (2.6, 0.9, 1.0))]), GRID)
    state[38:] = esdf.UNKNOWN
    field = esdf.build(state, GRID)
    around = np.random.default_rng(0).normal(size=(4000, 3))
    vertices = np.array(POST.centre_world_m) + POST.radius_m * around / np.linalg.norm(around, axis=1, keepdims=True)
    deviation_m = np.where(vertices[:, 0] < 1.0, 0.005, 0.08).astype(np.float32)
    deviation_m[vertices[:, 1] > 2.1] = np.nan
    surface = MeasuredSurface(vertices, SurfaceConfidence(deviation_m, np.ones(4000, np.uint8)))
    wanted = Slice("z", 0.5, "surface_std")
    picture = slices.draw(None, field, wanted, 0.2, surface=surface)  # type: ignore[arg-type]
    _, places = drawn(wanted, field)
    alpha, (x, y) = picture.rgba[..., 3], np.moveaxis(places[..., :2], -1, 0)
    solid = (field.distance(places.reshape(-1, 3)).reshape(x.shape) < 0.0) & (x < 2.75)
    assert (alpha[~solid] == 0).all()  # free or unknown
    near_m = np.linalg.norm(places - POST.centre_world_m, axis=-1)
    rim = solid & (near_m > 0.15) & (near_m < 0.35)
    seen = picture.rgba[rim & (y < 1.95)]
    assert len(np.unique(seen[:, :3], axis=0)) == 2
    left, right = (picture.rgba[rim & (y < 1.95) & side, :3] for side in (x < 0.95, x > 1.05))
    assert (left.sum(axis=1).max() < right.sum(axis=1).min()).all()
    pale = np.concatenate([alpha[rim & (y > 2.2)], alpha[solid & (x > 2.0)]])
    assert 0 < pale.max() < alpha[rim & (y < 1.95)].min()
    without = slices.draw(None, field, wanted, 0.2)  # type: ignore[arg-type]
    assert (without.rgba[solid, 3] == pale.max()).all()
