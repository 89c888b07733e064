"""nvblox' ESDF layers as PLY, written as its `PlyWriter` does, and our own, as maps. nvblox itself is not run."""

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import InputError
from goshawk.commands.map import import_map
from mapping.cloud import distance_points
from mapping.export import surfaces

EDGE_M = 0.05
LOW = np.array([-1.2, 3.6, -0.4])


def text_ply(file: Path, places: np.ndarray, intensity: np.ndarray, *, name: str = "intensity") -> Path:
    """As nvblox writes: text with six digits."""
    columns = "".join(f"property float {column}\n" for column in ("x", "y", "z", name))
    rows = "\n".join(f"{x:.6g} {y:.6g} {z:.6g} {d:.6g}" for (x, y, z), d in zip(places, intensity, strict=True))
    file.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(places)}\n{columns}end_header\n{rows}\n")
    return file


def layer(shape: tuple[int, int, int] = (30, 24, 16)) -> tuple[np.ndarray, np.ndarray]:
    """Distances in metres from middle to middle of voxels, negative inside, and which are observed."""
    solid = np.zeros(shape, bool)
    solid[:, :, :2] = solid[8:14, 6:12, :10] = True
    site = solid & ~np.asarray(ndimage.binary_erosion(solid, border_value=1), bool)
    distance = EDGE_M * np.minimum(np.asarray(ndimage.distance_transform_edt(~site)), 40.0)
    observed = np.random.default_rng(1).random(shape) < 0.9
    return np.where(solid, -distance, distance), observed


def states(distance: np.ndarray, observed: np.ndarray) -> np.ndarray:
    state = np.where(distance > 0.5 * EDGE_M, FREE, OCCUPIED).astype(np.uint8)
    state[~observed] = UNKNOWN
    return state


def places_of(observed: np.ndarray) -> np.ndarray:
    return LOW + EDGE_M * (np.argwhere(observed) + 0.5)


def test_an_esdf_of_nvblox_is_the_map_that_it_states(tmp_path: Path) -> None:
    distance, observed = layer()
    observed[0, 0, 0] = observed[-1, -1, -1] = True
    order = np.random.default_rng(2).permutation(int(observed.sum()))  # its blocks come in any order
    file = text_ply(tmp_path / "esdf.ply", places_of(observed)[order], distance[observed][order])
    assert distance_points.is_layer(file)
    found = distance_points.read(file)
    np.testing.assert_array_equal(found.state, states(distance, observed))
    np.testing.assert_allclose(found.grid.low_world_m, LOW, atol=1e-4)
    np.testing.assert_allclose(found.grid.voxel_m, EDGE_M, rtol=1e-4)
    nearer = np.where(distance == EDGE_M, 0.8 * EDGE_M, distance)  # of a surface that passes such voxels
    close = distance_points.read(text_ply(tmp_path / "near.ply", places_of(observed), nearer[observed]))
    np.testing.assert_array_equal(close.state == OCCUPIED, observed & (nearer < EDGE_M))
    with pytest.raises(InputError, match="16 layers of voxels; --heights"):
        distance_points.read(file, (0.0, 2.0))


def test_a_slice_holds_between_the_heights_that_are_stated(tmp_path: Path) -> None:
    distance, observed = layer()
    places = places_of(observed[:, :, 5:6]) + np.array([0.0, 0.0, 5 * EDGE_M])
    file = text_ply(tmp_path / "slice.ply", places, distance[:, :, 5][observed[:, :, 5]])
    assert distance_points.is_layer(file)
    with pytest.raises(InputError, match="--heights"):
        distance_points.read(file)
    found = distance_points.read(file, (0.5, 1.0))
    assert found.grid.shape == (30, 24, 10)
    assert (found.state == states(distance, observed)[:, :, 5, None]).all()
    assert (found.grid.low_world_m[2], found.grid.high_world_m[2]) == pytest.approx((0.5, 1.0))


def test_a_scan_on_a_lattice_is_no_layer_and_a_tsdf_is_refused(tmp_path: Path) -> None:
    _, observed = layer()
    places, rng = places_of(observed), np.random.default_rng(3)
    for intensity in (
        rng.uniform(0.0, 1.0, len(places)),
        rng.integers(0, 255, len(places)),
        np.zeros(len(places)),
        np.ones(len(places)),
        (places[:, 0] < 0.0).astype(float),  # a label
        0.2 + 0.4 * (places[:, 0] - places[:, 0].min()),  # as smooth as distances
        rng.integers(0, 2, len(places)),  # its layer of free space
        rng.uniform(0.5, 1.0, len(places)),  # its occupancy, of which it writes what is occupied only
    ):
        assert not distance_points.is_layer(text_ply(tmp_path / "scan.ply", places, intensity))
    scattered = places + rng.normal(0.0, 0.01, places.shape)
    distance = layer()[0][observed]
    far = np.repeat([[*np.arange(30) * 0.01, 4e6]], 3, axis=0).T  # more voxels than can be counted
    assert not distance_points.is_layer(text_ply(tmp_path / "scan.ply", far, np.zeros(31)))
    assert not distance_points.is_layer(text_ply(tmp_path / "scan.ply", scattered, np.abs(distance)))
    assert not distance_points.is_layer(text_ply(tmp_path / "scan.ply", places, distance, name="quality"))
    with pytest.raises(InputError, match="TSDF"):
        distance_points.is_layer(text_ply(tmp_path / "t.ply", places, np.clip(1.3 * distance + 0.01, -0.2, 0.2)))


def test_distances_of_our_own_give_a_map_its_states_again(tmp_path: Path) -> None:
    distance, observed = layer()
    x, y, z = LOW.tolist()
    grid = Grid((x, y, z), (EDGE_M, EDGE_M, EDGE_M), distance.shape)
    field_m = np.where(states(distance, observed) == FREE, np.abs(distance) - 0.5 * EDGE_M, -0.02)
    (tmp_path / "d.ply").write_bytes(surfaces.distances(grid.centre(np.argwhere(observed)), field_m[observed]))
    assert distance_points.is_layer(tmp_path / "d.ply")
    found = distance_points.read(tmp_path / "d.ply")
    at = np.rint((found.grid.low_world_m - LOW) / EDGE_M).astype(int)
    part = tuple(slice(a, a + n) for a, n in zip(at, found.grid.shape, strict=True))
    np.testing.assert_array_equal(found.state, states(distance, observed)[part])
    assert "states what is free" in import_map.look(tmp_path / "d.ply", None, None, None)
    assert not import_map.takes(tmp_path / "d.ply", "--voxel")


def test_points_that_are_no_lattice_are_refused_where_they_claim_to_be_one(tmp_path: Path) -> None:
    places = np.random.default_rng(4).uniform(0.0, 2.0, (50, 3))
    (tmp_path / "d.ply").write_bytes(surfaces.distances(places, np.ones(50)))
    with pytest.raises(InputError, match="on no lattice"):
        distance_points.read(tmp_path / "d.ply")
