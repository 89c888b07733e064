"""Pictures show the field's values at the right places."""

import numpy as np
import pytest

from esdf import FREE, UNKNOWN, Grid, build, pictures, rasterize, solids
from flight import InputError

SPHERE = solids.Sphere((1.0, 1.2, 0.9), 0.5)


@pytest.fixture(scope="module")
def field():
    grid = Grid((0, 0, 0), 0.05, (40, 48, 36))
    state = rasterize(SPHERE, grid)
    state[:, :6] = UNKNOWN
    return build(state, grid, unknown="nan")


@pytest.mark.parametrize(("axis", "at"), [("x", 1.0), ("y", 1.2), ("z", 0.9)])
def test_a_slice_is_the_field_on_its_plane(field, axis, at):
    picture = pictures.axis_slice(field, axis, at)
    rows, columns = picture.distance_m.shape
    r, c = rows // 3, columns // 2
    point = picture.corner_world_m + c * picture.right_world_m + r * picture.up_world_m
    assert point["xyz".index(axis)] == pytest.approx(at)
    assert picture.distance_m[r, c] == field.distance(point[None])[0]
    assert np.isnan(picture.distance_m).any() == (axis != "y")


def test_an_oblique_slice_through_the_centre_shows_a_circle_of_the_right_size(field):
    picture = pictures.oblique_slice(
        field, SPHERE.centre_world_m, (1, 1, 0.3), (0, 0.2, 1), size_m=(1.4, 1.4), step_m=0.01
    )
    area = (picture.distance_m < 0).sum() * 0.01**2
    assert np.sqrt(area / np.pi) == pytest.approx(0.5, abs=0.06)


def test_slices_outside_of_the_map_and_flat_ones_are_refused(field):
    with pytest.raises(InputError, match="outside of it"):
        pictures.axis_slice(field, "z", 50.0)
    with pytest.raises(InputError, match="parallel"):
        pictures.oblique_slice(field, (1, 1, 1), (1, 0, 0), (2, 0, 0), size_m=(1, 1), step_m=0.1)
    with pytest.raises(InputError, match="empty"):
        pictures.oblique_slice(field, (1, 1, 1), (1, 0, 0), (0, 1, 0), size_m=(1, 1), step_m=0.0)


def test_unknown_is_grey_and_the_surface_changes_colour():
    rgb = pictures.colours(np.array([np.nan, -0.5, -1e-3, 1e-3, 1.9]))
    assert rgb[0].tolist() == [128, 128, 128]
    assert rgb[2, 0] > rgb[2, 2] + 100
    assert rgb[4, 2] > rgb[4, 0] + 50
    assert len(np.unique(rgb, axis=0)) == 5


def test_the_histogram_counts_every_known_cubic_metre_once(field):
    edges, volume = pictures.histogram(field)
    assert volume.sum() == pytest.approx((field.state != UNKNOWN).sum() * 0.05**3)
    inside = volume[edges[1:] <= 0].sum()
    assert inside == pytest.approx((field.values_m < 0).sum() * 0.05**3, rel=0.3)
    unknown = np.full((4, 4, 4), UNKNOWN, np.uint8)
    with pytest.raises(InputError, match="nothing"):
        pictures.histogram(build(unknown, Grid((0, 0, 0), 0.1, (4, 4, 4)), unknown="nan"))


@pytest.mark.parametrize("level", [0.0, 0.2])
def test_an_iso_surface_is_closed_faces_outwards_and_lies_at_its_level(field, level):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = pictures.iso_surface(field, level)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    radius = np.cbrt(mesh.volume / (4 / 3 * np.pi))
    assert 0.5 < radius - level < 0.5 + 2 * field.grid.half_diagonal_m
    np.testing.assert_allclose(field.distance(vertices), level, atol=0.02)


def test_no_surface_gives_no_triangles():
    free = np.full((5, 5, 5), FREE, np.uint8)
    vertices, faces = pictures.iso_surface(build(free, Grid((0, 0, 0), 0.1, free.shape), unknown="nan"))
    assert vertices.shape == (0, 3)
    assert faces.shape == (0, 3)
