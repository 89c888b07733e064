"""Layers of voxblox, written byte by byte from its format, as maps."""

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build
from esdf.exchange_voxblox import export_layer
from flight import FlightError, InputError
from mapping import imported
from mapping.cloud import voxblox_file
from tests.esdf.test_exchange import hand_written_layer

SIDE = 8
FAR = ((0.0, 0.0, 0.0), (800.0, 800.0, 800.0))


def words(kind: str, values: np.ndarray, seen: np.ndarray) -> list[int]:
    """Of a block (x, y, z), x fastest."""
    columns = [values.astype(np.float32).view(np.uint32), seen.astype(np.uint32)]
    if kind == "tsdf":
        columns = [columns[0], seen.astype(np.float32).view(np.uint32), np.zeros_like(columns[0])]
    return np.stack([column.transpose(2, 1, 0).ravel() for column in columns], axis=1).ravel().tolist()


@pytest.mark.parametrize(
    ("kind", "occupied", "free"),
    [("esdf", 0.08, 0.09), ("tsdf", 0.08, 0.09), ("occupancy", 0.6, -0.9), ("occupancy", 800.0, -800.0)],
)
def test_a_layer_is_the_map_that_it_states(tmp_path: Path, kind: str, occupied: float, free: float) -> None:
    rng = np.random.default_rng(2)
    wanted = rng.choice(3, (SIDE,) * 3).astype(np.uint8)
    values = np.choose(wanted, [occupied, free, occupied])
    layer = tmp_path / "layer.vxblx"
    layer.write_bytes(hand_written_layer(kind, words(kind, values, wanted != UNKNOWN)))
    found = voxblox_file.read(layer)
    assert {UNKNOWN: 0, FREE: 1, OCCUPIED: 2} == {0: 0, 1: 1, 2: 2}  # as `np.choose` takes them
    np.testing.assert_array_equal(found.state, wanted)
    np.testing.assert_allclose(found.grid.origin_world_m, (-0.8, 0.0, 1.6))
    assert found.grid.voxel_m == (0.1, 0.1, 0.1)


@pytest.mark.parametrize("kind", ["esdf", "tsdf"])
def test_a_pole_thinner_than_its_voxels_stays_in_a_layer_of_centre_distances(tmp_path: Path, kind: str) -> None:
    """As voxblox' own layers state them: a pole of 3 cm between four columns of voxels, 5.6 cm off it."""
    middle = (np.arange(SIDE) + 0.5) * 0.1
    x, y, _ = np.meshgrid(middle, middle, middle, indexing="ij")
    distance = np.hypot(x - 0.4, y - 0.4) - 0.015
    layer = tmp_path / "pole.vxblx"
    layer.write_bytes(hand_written_layer(kind, words(kind, distance, np.ones_like(distance))))
    state = voxblox_file.read(layer).state
    assert (state[3:5, 3:5] == OCCUPIED).all()
    assert (state == OCCUPIED).sum() == 4 * SIDE


@pytest.mark.parametrize(("flags", "seen"), [(0, False), (1, True), (2, False), (3, False), (8, False), (9, True)])
def test_what_voxblox_only_assumes_about_the_robot_stays_unknown(tmp_path: Path, flags: int, seen: bool) -> None:
    """Flags of an ESDF's voxel: 1 observed, 2 hallucinated, 8 fixed; one voxel of the block is plainly observed."""
    given = np.full((SIDE,) * 3, flags)
    given[0, 0, 0] = 1
    layer = tmp_path / "a.vxblx"
    layer.write_bytes(hand_written_layer("esdf", words("esdf", np.full((SIDE,) * 3, 2.0), given)))
    state = voxblox_file.read(layer).state
    assert state[0, 0, 0] == FREE
    assert (state.ravel()[1:] == (FREE if seen else UNKNOWN)).all()


def test_what_is_exported_comes_back_with_what_is_not_free_grown_by_the_voxels_about_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    state = rng.choice(3, size=(37, 20, 9), p=[0.003, 0.994, 0.003]).astype(np.uint8)
    field = build(state, Grid((-0.7, 1.3, -0.2), (0.1, 0.1, 0.1), state.shape), cap_m=0.45)
    export_layer(tmp_path / "a.vxblx", field)
    back = voxblox_file.read(tmp_path / "a.vxblx")
    first = np.rint((field.grid.low_world_m - back.grid.low_world_m) / 0.1).astype(int)
    place = tuple(slice(a, a + n) for a, n in zip(first, state.shape, strict=True))
    grown = (state == FREE) & (field.values_m <= field.grid.half_diagonal_m)
    assert grown.any()
    beside = ndimage.binary_dilation(state != FREE, np.ones((3, 3, 3)), border_value=1)  # outside it is unknown
    assert beside[grown].all()
    np.testing.assert_array_equal(back.state[place], np.where(grown, OCCUPIED, state))
    assert (back.state != UNKNOWN).sum() == (state != UNKNOWN).sum()


def test_blocks_far_apart_are_refused_before_memory_is_taken(tmp_path: Path) -> None:
    whole = np.ones((SIDE,) * 3)
    blocks = [hand_written_layer("esdf", words("esdf", whole, whole), origin=place) for place in FAR]
    second = blocks[1].index(b"\x08\x08\x11") - 2  # its length, before the block
    (tmp_path / "a.vxblx").write_bytes(b"\x03" + blocks[0][1:] + blocks[1][second:])
    with pytest.raises(InputError, match="million voxels"):
        voxblox_file.read(tmp_path / "a.vxblx")


@pytest.mark.parametrize(
    ("free_bytes", "said"), [(9_000, "takes 0.0 GB of memory"), (16_000, "0.0005 million are read")]
)
def test_a_layer_is_refused_where_there_is_too_little_memory(
    tmp_path: Path, free_bytes: int, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = np.ones((SIDE,) * 3)
    (tmp_path / "a.vxblx").write_bytes(hand_written_layer("esdf", words("esdf", whole, whole)))
    monkeypatch.setattr(imported, "free_memory_bytes", lambda: free_bytes)
    with pytest.raises(InputError, match=said):
        voxblox_file.read(tmp_path / "a.vxblx")
    monkeypatch.setattr(imported, "free_memory_bytes", lambda: 32 * SIDE**3)
    assert voxblox_file.read(tmp_path / "a.vxblx").state.size == SIDE**3


@pytest.mark.parametrize("damage", ["none", "cut", "unseen", "far"])
def test_what_is_no_map_is_refused_by_name(tmp_path: Path, damage: str) -> None:
    layer, whole = tmp_path / "a.vxblx", np.ones((SIDE,) * 3)
    data = hand_written_layer("esdf", words("esdf", whole, whole * (damage != "unseen")))
    if damage == "far":
        data = hand_written_layer("esdf", words("esdf", whole, whole), origin=(5e7, 0.0, 0.0))
    if damage != "none":
        layer.write_bytes(data[: 200 if damage == "cut" else None])
    with pytest.raises(FlightError, match=r"a\.vxblx"):
        voxblox_file.read(layer)
