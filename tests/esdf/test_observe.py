"""Maps from sensors: nothing measured is lost, nothing unknown becomes free."""

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build, solids
from esdf.observe import state_from_mesh, state_from_occupancy, state_from_points, state_from_tsdf
from flight import InputError

GRID = Grid((-1.0, -1.0, -1.0), 0.1, (20, 20, 20))
SPHERE = solids.Sphere((0.05, -0.1, 0.1), 0.6)


def sphere_cloud(rng, n=20_000):
    direction = rng.normal(size=(n, 3))
    return np.array(SPHERE.centre_world_m) + 0.6 * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def test_rays_free_what_they_pass_and_occupy_where_they_end():
    rng = np.random.default_rng(0)
    ends = sphere_cloud(rng)
    state = state_from_points(ends, SPHERE.centre_world_m, GRID)
    assert (state[tuple(GRID.index(ends).T)] == OCCUPIED).all()
    along = np.array(SPHERE.centre_world_m) + rng.uniform(0, 1, (len(ends), 1)) * (
        ends - np.array(SPHERE.centre_world_m)
    )
    assert (state[tuple(GRID.index(along).T)] != UNKNOWN).all()
    distance = SPHERE.distance(GRID.centres().reshape(-1, 3)).reshape(GRID.shape)
    assert (state[distance > GRID.half_diagonal_m] == UNKNOWN).all()
    assert (state[distance < -GRID.half_diagonal_m] == FREE).all()


def test_a_ray_frees_every_voxel_it_crosses_and_no_other():
    rng = np.random.default_rng(1)
    for _ in range(200):
        start, end = rng.uniform(-1.5, 1.5, (2, 3))
        state = state_from_points(end[None], start, GRID)
        along = start + np.linspace(0, 1, 20_001)[:, None] * (end - start)
        crossed = np.zeros(GRID.shape, bool)
        index = GRID.index(along[GRID.contains(along)])
        crossed[tuple(np.minimum(index, np.array(GRID.shape) - 1).T)] = True
        marked = state != UNKNOWN
        assert not (crossed & ~marked).any()
        extra = GRID.centres()[marked & ~crossed]  # corners cut by less than the sampling
        assert len(extra) <= 1


def test_a_ray_that_passes_never_erases_a_hit_and_distant_points_are_not_trusted():
    hits = np.array([[0.05, 0.05, 0.05], [0.95, 0.05, 0.05]])
    for order in ([0, 1], [1, 0]):
        state = state_from_points(hits[order], (-0.95, 0.05, 0.05), GRID)
        assert state[tuple(GRID.index(hits[:1])[0])] == OCCUPIED
    state = state_from_points(hits[1:], (-0.95, 0.05, 0.05), GRID, range_m=1.0)
    assert not (state == OCCUPIED).any()
    assert state[:, 10, 10].tolist() == [FREE] * 10 + [UNKNOWN] * 10


def test_a_mesh_occupies_every_voxel_its_surface_passes_through():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.6)
    observed = np.full(GRID.shape, FREE, np.uint8)
    state = state_from_mesh(mesh.vertices, mesh.faces, GRID, observed=observed)
    rng = np.random.default_rng(2)
    corner = mesh.triangles[rng.integers(0, len(mesh.faces), 50_000)]
    weight = rng.dirichlet((1, 1, 1), 50_000)
    on_surface = np.einsum("nc,nci->ni", weight, corner)
    assert (state[tuple(GRID.index(on_surface).T)] == OCCUPIED).all()
    nearest = np.abs(np.linalg.norm(GRID.centres()[state == OCCUPIED], axis=1) - 0.6)
    assert nearest.max() < GRID.half_diagonal_m + 0.02  # the facets lie up to 2 cm inside the sphere
    assert (state_from_mesh(mesh.vertices, mesh.faces, GRID) != FREE).all()


def test_a_tsdf_keeps_its_surface_and_unobserved_voxels_stay_unknown():
    centres = GRID.centres().reshape(-1, 3)
    distance = -SPHERE.distance(centres).reshape(GRID.shape)  # seen from inside the sphere
    weight = (distance > -0.15).astype(float)
    state = state_from_tsdf(np.clip(distance, -0.3, 0.3), weight, GRID)
    surface = sphere_cloud(np.random.default_rng(3))
    assert (state[tuple(GRID.index(surface).T)] == OCCUPIED).all()
    assert (state[distance < -0.15] == UNKNOWN).all()
    field = build(state, GRID)
    inside = centres[distance.ravel() > 0.2]
    assert (field.distance(inside) <= -SPHERE.distance(inside) + 1e-6).all()


def test_occupancy_between_the_thresholds_is_unknown():
    p = np.full(GRID.shape, np.nan)
    p[0, 0, :3] = 0.1, 0.5, 0.9
    assert state_from_occupancy(p, GRID)[0, 0, :4].tolist() == [FREE, UNKNOWN, OCCUPIED, UNKNOWN]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: state_from_points([[0, 0, np.nan]], (0, 0, 0), GRID), "not finite"),
        (lambda: state_from_points([[0, 0]], (0, 0, 0), GRID), "wanted|shape|number"),
        (lambda: state_from_mesh([[0, 0, 0]], [[0, 1, 2]], GRID), "vertex 2"),
        (lambda: state_from_mesh([[0, 0, 0]], np.empty((0, 3)), GRID), "m >= 1"),
        (lambda: state_from_mesh([[0, 0, np.inf]], [[0, 0, 0]], GRID), "not finite"),
        (lambda: state_from_tsdf(np.zeros((2, 2, 2)), np.zeros((2, 2, 2)), GRID), "shape"),
        (lambda: state_from_occupancy(np.zeros(GRID.shape), GRID, free_below=0.9), "ordered"),
    ],
)
def test_bad_measurements_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
