"""OpenVDB volumes: files of OpenVDB itself, of TinyVDB, and our own, as maps."""

import dataclasses
import struct
from pathlib import Path

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build
from esdf.exchange_vdb import export_vdb
from flight import FlightError, FormatError, InputError
from mapping import foreign_mesh
from mapping.cloud import vdb_file, vdb_tree
from tests.mapping.cloud import openvdb_files
from tests.mapping.cloud.openvdb_files import CENTRE_M, EDGE_M, RADIUS_M

tinyvdb = pytest.importorskip("tinyvdb", reason="TinyVDB writes files of other compressions")
ANY = 10**9


def written(folder: Path, data: bytes) -> Path:
    (folder / "a.vdb").write_bytes(data)
    return folder / "a.vdb"


def own(folder: Path, shape: tuple[int, int, int] = (70, 31, 140)) -> tuple[Path, np.ndarray, Grid]:
    """A map of ours with all three states, tiles of far free space and unknown borders, as a volume."""
    rng = np.random.default_rng(4)
    state = np.full(shape, FREE, np.uint8)
    state[tuple(rng.integers(0, n, 60) for n in shape)] = OCCUPIED
    state[20:30, 5:15, 2:20], state[:, :, 60:70] = OCCUPIED, UNKNOWN
    state[rng.random(shape) < 0.02] = UNKNOWN
    state[0, 0, 0] = state[-1, -1, -1] = OCCUPIED
    grid = Grid((-3.05, 1.0, -0.5), (0.05, 0.05, 0.05), shape)
    export_vdb(folder / "own.vdb", build(state, grid, cap_m=0.4))
    return folder / "own.vdb", state, grid


@pytest.mark.parametrize(("data", "close"), [(openvdb_files.BALL, 1e-6), (openvdb_files.HALF, 2e-4)])
def test_a_ball_of_openvdb_is_at_its_place_and_of_its_size(tmp_path: Path, data: bytes, close: float) -> None:
    volume = vdb_tree.read(written(tmp_path, data), at_most=ANY)
    centres = volume.grid.centre(np.argwhere(volume.active))
    wanted = np.linalg.norm(centres - CENTRE_M, axis=1) - RADIUS_M
    np.testing.assert_allclose(volume.value[volume.active], wanted, atol=close)
    assert (volume.name, volume.kind, volume.creator) == ("ball", "level set", "")
    assert volume.background == pytest.approx(2 * EDGE_M, abs=close)
    assert len(centres) == 612


def test_tiles_and_both_kinds_of_values_off_the_mask_are_what_openvdb_was_told(tmp_path: Path) -> None:
    volume = vdb_tree.read(written(tmp_path, openvdb_files.WILD), at_most=ANY)
    value, active = openvdb_files.wild()
    np.testing.assert_array_equal(volume.active, active)
    np.testing.assert_array_equal(volume.value, value)
    np.testing.assert_allclose(volume.grid.centre([[0, 0, 0]]), [[-8.0, 0.0, 0.0]])


@pytest.mark.parametrize("compression", [0, 1, 2, 3, 4, 6])
@pytest.mark.parametrize("data", [openvdb_files.BALL, openvdb_files.WILD])
def test_another_librarys_compressions_hold_the_same(tmp_path: Path, data: bytes, compression: int) -> None:
    first = vdb_tree.read(written(tmp_path, data), at_most=ANY)
    file = tinyvdb.from_bytes(data)
    file.read_grids()
    again = vdb_tree.read(written(tmp_path, file.to_bytes(compression=compression, level=5)), at_most=ANY)
    np.testing.assert_array_equal(again.active, first.active)
    np.testing.assert_array_equal(again.value[again.active], first.value[first.active])
    assert again.grid == first.grid


def test_our_own_map_comes_back_voxel_for_voxel(tmp_path: Path) -> None:
    file, state, grid = own(tmp_path)
    found = vdb_file.read(file)
    np.testing.assert_array_equal(found.state, state)
    np.testing.assert_allclose(found.grid.low_world_m, grid.low_world_m, atol=1e-12)
    np.testing.assert_allclose(found.grid.voxel_m, grid.voxel_m, rtol=1e-12)
    with pytest.raises(InputError, match="states what is free"):
        vdb_file.space(found, np.zeros((1, 3)))


def test_of_anothers_shape_nothing_is_free_and_every_voxel_it_passes_is_occupied(tmp_path: Path) -> None:
    found = vdb_file.read(written(tmp_path, openvdb_files.BALL), unit="m")
    centres = found.grid.centre(np.argwhere(found.state == OCCUPIED))
    distance_m = np.linalg.norm(centres - CENTRE_M, axis=1) - RADIUS_M
    assert set(np.unique(found.state)) == {UNKNOWN, OCCUPIED}
    assert distance_m.max() <= 0.5 * np.sqrt(3.0) * EDGE_M < distance_m.max() + 0.03
    every = np.linalg.norm(found.grid.centre(np.argwhere(found.state >= 0)) - CENTRE_M, axis=1)
    assert len(centres) == (every <= RADIUS_M + 0.5 * np.sqrt(3.0) * EDGE_M).sum()
    outside = found.grid.low_world_m + 0.01
    free = vdb_file.space(found, outside[None]).state == FREE
    assert free.sum() == (found.state == UNKNOWN).sum()


@pytest.mark.parametrize(("up", "axis"), [("x", 0), ("-y", 1), ("z", 2), ("-z", 2)])
def test_up_and_unit_turn_and_scale_the_voxels_as_they_do_meshes(tmp_path: Path, up: str, axis: int) -> None:
    file, state, grid = own(tmp_path, (32, 40, 51))
    turned = vdb_file.read(file, unit="ft", up=up, origin=np.array([1.0, 2.0, 3.0]))
    R, _ = foreign_mesh.rotation(file, up)
    places = 0.3048 * (grid.centre(np.argwhere(state == OCCUPIED)) - [1.0, 2.0, 3.0]) @ R.T
    assert (turned.state[tuple(turned.grid.index(places).T)] == OCCUPIED).all()
    assert (turned.state == OCCUPIED).sum() == len(places)
    assert turned.grid.shape[2] == grid.shape[axis]


def test_what_is_not_read_is_refused_with_the_way_out(tmp_path: Path) -> None:
    old = openvdb_files.BALL[:8] + struct.pack("<I", 221) + openvdb_files.BALL[12:]
    other = openvdb_files.BALL.replace(b"Tree_float_5_4_3", b"Tree_int32_5_4_3")
    for data, said in (
        (openvdb_files.TWO, "several float grids; its grids: one"),
        (other, "no float grid"),
        (old, "format 221, 222 on are read"),
        (b"PK" + bytes(50), "no OpenVDB file"),
        (b"", "no OpenVDB file"),
    ):
        with pytest.raises(FlightError, match=said):
            vdb_file.read(written(tmp_path, data), unit="m")
    with pytest.raises(InputError, match="are read: cut it"):
        vdb_tree.read(written(tmp_path, openvdb_files.BALL), at_most=1000)
    mirrored = openvdb_files.BALL.replace(struct.pack("<d", np.float32(0.1)), struct.pack("<d", -0.1))
    with pytest.raises(InputError, match="turned, mirrored"):
        vdb_tree.read(written(tmp_path, mirrored), at_most=ANY)
    file, _, _ = own(tmp_path, (9, 10, 11))
    with pytest.raises(InputError, match="turns the voxels"):
        vdb_file.read(file, up="0,1,1")


@pytest.mark.parametrize(
    ("changed", "said"), [({"kind": "fog volume"}, "make it a level set"), ({"value": np.nan}, "not all its active")]
)
def test_densities_and_numbers_that_are_none_are_refused(tmp_path: Path, monkeypatch, changed: dict, said: str) -> None:
    volume = vdb_tree.read(written(tmp_path, openvdb_files.BALL), at_most=ANY)
    if "value" in changed:
        changed = {"value": np.where(volume.active & (volume.value < 0.0), np.float32(np.nan), volume.value)}
    monkeypatch.setattr(vdb_tree, "read", lambda *_, **__: dataclasses.replace(volume, **changed))
    with pytest.raises(FlightError, match=said):
        vdb_file.read(tmp_path / "a.vdb", unit="m")


@pytest.mark.parametrize("data", [openvdb_files.BALL, openvdb_files.WILD, openvdb_files.HALF])
def test_a_damaged_file_is_refused_and_never_crashes(tmp_path: Path, data: bytes) -> None:
    rng = np.random.default_rng(5)
    for cut in rng.integers(0, len(data) - 60, 20):
        with pytest.raises(FlightError):
            vdb_tree.read(written(tmp_path, data[:cut]), at_most=10**7)
    for _ in range(60):
        damaged = bytearray(data)
        for at in rng.integers(0, len(data), 3):
            damaged[at] = rng.integers(0, 256)
        try:
            vdb_tree.read(written(tmp_path, bytes(damaged)), at_most=10**7)
        except (FormatError, InputError):
            continue
