"""The layer of inferred surface: kept, refused when damaged, and carried along when a map is moved or joined."""

from pathlib import Path

import numpy as np
import pytest

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Grid, regrid
from esdf import moved as moving
from flight import FormatError, frames, rotations
from mapping import inferred_layer

GRID = Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (12, 10, 8))


def layered(seed: int = 0) -> tuple[esdf.Field, np.ndarray]:
    """A field, and some of its unknown voxels marked."""
    rng = np.random.default_rng(seed)
    state = rng.choice([UNKNOWN, FREE, OCCUPIED], GRID.shape).astype(np.uint8)
    return esdf.build(state, GRID, cap_m=0.5), (state == UNKNOWN) & (rng.random(GRID.shape) < 0.5)


def test_it_is_read_as_it_was_written_and_empty_in_a_map_without_it(tmp_path: Path) -> None:
    _, marked = layered()
    inferred_layer.save(tmp_path / "inferred.npz", marked)
    np.testing.assert_array_equal(inferred_layer.load(tmp_path / "inferred.npz", GRID.shape), marked)
    assert not inferred_layer.load(tmp_path / "none.npz", GRID.shape).any()


def test_a_damaged_newer_or_other_layer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "inferred.npz"
    inferred_layer.save(path, np.ones(GRID.shape, bool))
    whole = path.read_bytes()
    with pytest.raises(FormatError, match=r"shape \(12, 10, 8\), the field bool of \(12, 10, 9\)"):
        inferred_layer.load(path, (12, 10, 9))
    for broken in (b"", b"text", whole[:40], whole[:-30]):
        path.write_bytes(broken)
        with pytest.raises(FormatError, match="damaged"):
            inferred_layer.load(path, GRID.shape)
    np.savez(path, version=2, inferred=np.ones(GRID.shape, bool))
    with pytest.raises(FormatError, match="newer"):
        inferred_layer.load(path, GRID.shape)
    for wrong in (np.ones(GRID.shape), np.array([None])):
        np.savez(path, version=1, inferred=wrong)
        with pytest.raises(FormatError):
            inferred_layer.load(path, GRID.shape)


def test_moved_there_and_back_it_marks_the_same_voxels_and_only_unknown_ones() -> None:
    field, marked = layered()
    still = frames.transform(rotations.from_yaw([0.0]), [[3.0, -2.0, 1.0]])[0]
    shifted = moving.moved_field(field, still)
    np.testing.assert_array_equal(inferred_layer.moved(marked, field, still, shifted), marked)
    turn = frames.transform(rotations.from_yaw([0.5 * np.pi]), [[0.3, 0.1, 0.0]])[0]
    turned = moving.moved_field(field, turn)
    there = inferred_layer.moved(marked, field, turn, turned)
    assert (turned.state[there] == UNKNOWN).all()
    places = frames.apply(frames.invert(turn), turned.grid.centre(np.argwhere(there)))
    assert marked[tuple(GRID.index(places).T)].all()
    assert there.any()


def test_moved_by_half_a_voxel_it_ends_with_the_map() -> None:
    field, marked = layered()
    T = frames.transform(rotations.from_yaw([0.0]), [[0.05, 0.05, 0.05]])[0]
    shifted = moving.moved_field(field, T, lattice=GRID)  # centres of its outer voxels lie on the faces of the old grid
    there = inferred_layer.moved(marked, field, T, shifted)
    assert there.any()
    assert (shifted.state[there] == UNKNOWN).all()


def test_what_one_of_two_maps_saw_is_not_inferred_in_both() -> None:
    (first, marked), (second, also) = layered(0), layered(1)
    both = regrid.merge(first, second)
    joined = inferred_layer.joined(both, [(marked, first), (also, second)])
    seen = (first.state != UNKNOWN) | (second.state != UNKNOWN)
    assert not (joined & seen).any()
    np.testing.assert_array_equal(joined, (marked | also) & ~seen)
