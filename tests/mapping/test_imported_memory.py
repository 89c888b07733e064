"""The budget of an import: what it takes is known, and told, before any work begins."""

from pathlib import Path

import numpy as np
import pytest

import esdf
from esdf import OCCUPIED, Grid
from flight import InputError
from mapping import imported
from mapping.cloud import octomap_file
from mapping.export import octomap

GRID = Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), (2000, 1000, 200))
"""A hall of 100 x 50 x 10 m."""


def test_a_hall_fits_where_there_is_memory(monkeypatch) -> None:
    monkeypatch.setattr(imported, "free_memory_bytes", lambda: 6 * 2**30)
    imported.require_few(GRID, "cut the mesh", coarser=True)


def test_too_little_memory_is_said_with_a_voxel_that_fits(monkeypatch) -> None:
    monkeypatch.setattr(imported, "free_memory_bytes", lambda: 2_000_000_000)
    with pytest.raises(
        InputError, match=r"take 5\.6 GB of memory; 2\.0 GB are free here: take --voxel 0\.074"
    ) as refused:
        imported.require_few(GRID, "cut the mesh", coarser=True)
    edge_m = float(str(refused.value).split("--voxel ")[1].split(",")[0])
    shape = tuple(int(np.ceil(size_m / edge_m)) for size_m in (100.0, 50.0, 10.0))
    imported.require_few(Grid((0.0, 0.0, 0.0), (edge_m,) * 3, shape), "cut the mesh")


def test_more_voxels_than_ever_are_refused_whatever_memory_there_is(monkeypatch) -> None:
    monkeypatch.setattr(imported, "free_memory_bytes", lambda: 10**12)
    with pytest.raises(InputError, match="at most 450 million: cut the mesh"):
        imported.require_few(Grid((0.0, 0.0, 0.0), (0.05, 0.05, 0.05), (2000, 2000, 200)), "cut the mesh")


def test_what_is_connected_with_a_place_is_found_in_every_layer() -> None:
    closed = np.zeros((9, 5, 5), bool)
    closed[4] = True
    grid = Grid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), closed.shape)
    found = imported.connected(closed, grid, np.array([[1.5, 2.5, 2.5]]), "mesh", "lies in it")
    assert found[:4].all()
    assert not found[4:].any()
    both = imported.connected(closed, grid, np.array([[1.5, 2.5, 2.5], [7.5, 0.5, 0.5]]), "mesh", "lies in it")
    assert (both == ~closed).all()


@pytest.mark.parametrize(("version", "line"), [("1", "4:cpu,memory:/a/b"), ("2", "0::/a/b")])
def test_a_limit_of_the_container_counts_and_so_does_one_above_it(tmp_path: Path, monkeypatch, version, line) -> None:
    _, most, used, cached = imported._LIMITS[version]
    monkeypatch.setitem(imported._LIMITS, version, (tmp_path, most, used, cached))
    for folder, limit in (("", "max"), ("a", "3000"), ("a/b", "4000")):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / most).write_text(limit + "\n")
        (tmp_path / folder / used).write_text("1500\n")
        (tmp_path / folder / "memory.stat").write_text(f"anon 9\n{cached} 500\n")
    assert imported._left_bytes(line) == [3000, 2000]
    assert imported._left_bytes("3:cpuset:/a/b") == []
    assert imported._left_bytes(line.replace("/a/b", "/elsewhere")) == []
    assert imported.free_memory_bytes() > 0


def test_an_octomap_is_within_the_same_budget(tmp_path: Path, monkeypatch) -> None:
    state = np.zeros((20, 20, 20), np.uint8)
    state[3, 3, 3], state[17, 17, 17] = OCCUPIED, OCCUPIED
    (tmp_path / "a.bt").write_bytes(
        octomap.encode(esdf.build(state, Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (20, 20, 20))))
    )
    assert octomap_file.read(tmp_path / "a.bt").state.size == 15**3
    monkeypatch.setattr(imported, "free_memory_bytes", lambda: 40_000)
    with pytest.raises(InputError, match=r"GB are free here: cut a\.bt, or make it coarser"):
        octomap_file.read(tmp_path / "a.bt")
