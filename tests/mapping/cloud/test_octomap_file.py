"""OctoMaps of another program and of our own are read in every state that they hold, or refused in a sentence."""

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pyoctomap
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from flight import FormatError, InputError
from mapping.cloud import octomap_file
from mapping.export import octomap

EDGE_M = 0.1


def scanned(kind: str) -> Any:
    """A tree of pyoctomap in which rays from the origin met the sides of a box."""
    tree: Any = getattr(pyoctomap, kind)(EDGE_M)
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (400, 3))
    places /= np.abs(places).max(axis=1, keepdims=True)
    for place in places * [2.0, 1.5, 1.0]:
        tree.insertPointCloud(place[None], np.zeros(3))
    tree.updateInnerOccupancy()
    return tree


@pytest.mark.parametrize("kind", ["OcTree", "ColorOcTree"])
@pytest.mark.parametrize("suffix", ["bt", "ot"])
def test_every_voxel_is_in_the_state_that_the_other_program_has(tmp_path: Path, kind: str, suffix: str) -> None:
    tree = scanned(kind)
    file = tmp_path / f"map.{suffix}"
    assert (tree.writeBinary if suffix == "bt" else tree.write)(str(file))
    found = octomap_file.read(file)
    cells = np.argwhere(np.ones(found.grid.shape, bool))[::7]
    for cell, place in zip(cells, found.grid.centre(cells), strict=True):
        node = tree.search(place)
        expected = UNKNOWN if node is None else OCCUPIED if tree.isNodeOccupied(node) else FREE
        assert found.state[tuple(cell)] == expected
    assert {*np.unique(found.state).tolist()} == {FREE, OCCUPIED, UNKNOWN}
    assert tree.search(found.grid.low_world_m - 0.5 * EDGE_M) is None


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(*[st.integers(1, 9)] * 3),
    st.tuples(*[st.integers(-9, 9)] * 3),
    st.sampled_from([0, 4]),
)
def test_what_was_exported_comes_back(tmp_path_factory, seed, shape, first, block) -> None:
    state = np.random.default_rng(seed).integers(0, 3, shape).astype(np.uint8)
    state[:block, :block, :block] = OCCUPIED  # so that leaves of higher levels occur
    state[0, 0, 0], state[-1, -1, -1] = FREE, OCCUPIED  # what is known reaches both corners
    grid = Grid(tuple(EDGE_M * np.array(first, float)), (EDGE_M,) * 3, state.shape)
    file = tmp_path_factory.mktemp("octomap") / "map.bt"
    file.write_bytes(octomap.encode(esdf.build(state, grid)))
    found = octomap_file.read(file)
    assert np.array_equal(found.state, state)
    assert found.grid.low_world_m == pytest.approx(grid.low_world_m, abs=1e-9)


@pytest.mark.parametrize("suffix", ["bt", "ot"])
def test_a_map_that_is_cut_off_or_harmed_is_refused(tmp_path: Path, suffix: str) -> None:
    tree = scanned("OcTree")
    file = tmp_path / f"map.{suffix}"
    (tree.writeBinary if suffix == "bt" else tree.write)(str(file))
    whole = file.read_bytes()
    for length in (0, 20, len(whole) // 2, len(whole) - 1, len(whole) - 10):
        file.write_bytes(whole[:length])
        with pytest.raises(FormatError, match="again"):
            octomap_file.read(file)
    rng = np.random.default_rng(0)
    for _ in range(60):  # harm may make another tree, but never a crash
        harmed = bytearray(whole)
        harmed[rng.integers(len(whole))] = rng.integers(256)
        file.write_bytes(harmed)
        with contextlib.suppress(FormatError, InputError):
            octomap_file.read(file)


def test_a_resolution_of_another_unit_and_a_deeper_tree_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "map.bt"
    head = b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres %s\ndata\n"
    file.write_bytes(head % b"50" + b"\x01\x00")
    with pytest.raises(InputError, match="50 m"):
        octomap_file.read(file)
    file.write_bytes(head % b"0.05" + b"\x03\x00" * 16 + b"\x01\x00")
    with pytest.raises(FormatError, match="tree"):
        octomap_file.read(file)
    file.write_bytes(head % b"0.05" + b"\x01\x00" * 1)  # an eighth of all space
    with pytest.raises(InputError, match=r"million|km"):
        octomap_file.read(file)
    file.write_bytes(head.replace(b"id OcTree", b"id Other") % b"0.05")
    with pytest.raises(FormatError, match="Other"):
        octomap_file.read(file)
    with pytest.raises(InputError, match="does not exist"):
        octomap_file.read(tmp_path / "none.bt")


def test_a_tree_of_more_nodes_than_memory_is_for_is_refused_before_it_is_read(tmp_path: Path, monkeypatch) -> None:
    file = tmp_path / "map.ot"
    assert scanned("OcTree").write(str(file))
    count = int(next(line for line in file.read_bytes().split(b"\n") if line.startswith(b"size")).split()[1])
    monkeypatch.setattr(octomap_file, "MOST_NODES", count - 1)
    with pytest.raises(InputError, match="million nodes, at most"):
        octomap_file.read(file)
    monkeypatch.setattr(octomap_file, "MOST_NODES", count)
    assert octomap_file.read(file).state.any()
