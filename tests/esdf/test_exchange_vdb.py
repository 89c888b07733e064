"""OpenVDB files, as another library reads them."""

import struct

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build
from esdf.exchange_vdb import export_vdb

tinyvdb = pytest.importorskip("tinyvdb", reason="TinyVDB reads what we write")


def read(path):
    file = tinyvdb.open(str(path))
    file.read_grids()
    return file, file.grid(0)


def leaves_of(array, fill):
    """(leaves, 512) in the file's order: upper nodes of 32^3 lower nodes of 16^3 leaves, x slowest in each."""
    a = np.pad(array, [(0, -n % 8) for n in array.shape], constant_values=fill)
    count = [n // 8 for n in a.shape]
    corners = sorted(np.ndindex(*count), key=lambda c: (tuple(i // 512 for i in c), tuple(i // 16 for i in c), c))
    return np.array([a[tuple(slice(8 * i, 8 * i + 8) for i in c)].ravel() for c in corners])


@pytest.mark.parametrize("unknown", ["obstacle", "nan"])
def test_another_library_reads_every_known_voxel(tmp_path, unknown):
    rng = np.random.default_rng(0)
    state = rng.choice(3, size=(30, 21, 27), p=[0.1, 0.85, 0.05]).astype(np.uint8)
    field = build(state, Grid((-0.7, 1.3, -0.2), 0.1, state.shape), cap_m=0.45, unknown=unknown)
    export_vdb(tmp_path / "field.vdb", field)
    file, grid = read(tmp_path / "field.vdb")
    assert (file.grid_count, grid.name, grid.type_name) == (1, "distance", "Tree_float_5_4_3")
    assert grid.float_background() == np.float32(0.45)
    np.testing.assert_allclose(grid.transform["translation"], field.grid.centre([0, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(grid.transform["scale"], [0.1, 0.1, 0.1], atol=1e-12)
    sparse = grid.to_sparse()
    index = np.frombuffer(sparse["coords"], np.int32).reshape(-1, 3)
    got = np.zeros(state.shape, bool)
    got[tuple(index.T)] = True
    np.testing.assert_array_equal(got, state != UNKNOWN)
    np.testing.assert_array_equal(np.frombuffer(sparse["values"], np.float32), field.values_m[tuple(index.T)])


def test_what_is_far_from_everything_costs_nothing_and_nodes_come_in_order(tmp_path):
    state = np.full((152, 24, 136), FREE, np.uint8)
    state[3, 4, 5] = state[140, 10, 130] = OCCUPIED
    state[:, :, 60:70] = UNKNOWN
    field = build(state, Grid((0, 0, 0), (0.1, 0.2, 0.1), state.shape), cap_m=0.5, unknown="nan")
    export_vdb(tmp_path / "field.vdb", field)
    assert (tmp_path / "field.vdb").stat().st_size < 0.5 * field.values_m.nbytes
    _, grid = read(tmp_path / "field.vdb")
    np.testing.assert_allclose(grid.transform["scale"], [0.1, 0.2, 0.1], atol=1e-12)
    nodes = [grid.tree.node(i) for i in range(grid.tree.num_nodes)]
    stored = [node for node in nodes if node.type == "leaf"]
    values = leaves_of(np.where(np.isnan(field.values_m), np.float32(0.5), field.values_m), np.float32(0.5))
    known = leaves_of(state != UNKNOWN, False)
    needed = ~((values == np.float32(0.5)).all(axis=1) & (known.all(axis=1) | ~known.any(axis=1)))
    assert 0 < needed.sum() < len(needed)
    np.testing.assert_array_equal([np.frombuffer(n.data, np.float32) for n in stored], values[needed])
    assert [n.active_voxel_count for n in stored] == known[needed].sum(axis=1).tolist()


def test_the_head_is_that_of_an_openvdb_file(tmp_path):
    field = build(np.full((3, 3, 3), FREE, np.uint8), Grid((0, 0, 0), 0.1, (3, 3, 3)))
    export_vdb(tmp_path / "field.vdb", field, name="clearance")
    head = (tmp_path / "field.vdb").read_bytes()
    assert struct.unpack_from("<qI", head) == (0x56444220, 224)
    assert read(tmp_path / "field.vdb")[1].name == "clearance"
