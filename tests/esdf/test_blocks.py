"""Maps on disk: bit-equal to the map in memory, whatever the engine and the chunk size."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from esdf import (
    ArraySource,
    Edit,
    Editor,
    Grid,
    SolidSource,
    block_field,
    blocks,
    build,
    build_blocks,
    certify,
    edit_blocks,
    open_blocks,
    rasterize,
    solids,
    update_blocks,
)
from flight import FormatError, InputError, Trajectory

SHAPE = (70, 45, 40)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    """Chunks of two bricks, so that a small map has many."""
    for module in (blocks, block_field):
        monkeypatch.setattr(module, "CHUNK", (32, 32, 32))
    monkeypatch.setattr(blocks.chunk_regions, "__defaults__", ((32, 32, 32),))


def random_map(rng, voxel=(0.1, 0.1, 0.1)):
    state = rng.choice(3, size=SHAPE, p=[0.003, 0.994, 0.003]).astype(np.uint8)
    state[:20, :20, 20:] = 0
    return state, Grid((-1.0, 2.0, 0.3), voxel, SHAPE)


@pytest.mark.parametrize("unknown", ["obstacle", "nan"])
@pytest.mark.parametrize("voxel", [(0.1, 0.1, 0.1), (0.1, 0.15, 0.08)])
def test_a_map_on_disk_is_bit_equal_to_the_one_in_memory(tmp_path, unknown, voxel):
    rng = np.random.default_rng(0)
    state, grid = random_map(rng, voxel)
    field = build(state, grid, cap_m=0.7, unknown=unknown)
    on_disk = build_blocks(tmp_path / "map", ArraySource(state), grid, cap_m=0.7, unknown=unknown)
    points = rng.uniform(grid.low_world_m - 0.2, grid.high_world_m + 0.2, (20_000, 3))
    points[:2] = grid.low_world_m, grid.high_world_m
    for got, expected in zip(on_disk.distance_and_gradient(points), field.distance_and_gradient(points), strict=True):
        np.testing.assert_array_equal(got, expected)
    np.testing.assert_array_equal(on_disk.status(points), field.status(points))
    np.testing.assert_array_equal(on_disk.states(grid.everything), state)


@pytest.mark.parametrize("kind", [0, 1, 2])
@pytest.mark.parametrize("unknown", ["obstacle", "nan"])
def test_maps_that_are_the_same_everywhere_need_no_bricks(tmp_path, kind, unknown):
    state, grid = np.full(SHAPE, kind, np.uint8), Grid((0, 0, 0), 0.1, SHAPE)
    on_disk = build_blocks(tmp_path / "map", ArraySource(state), grid, cap_m=0.3, unknown=unknown)
    points = np.random.default_rng(6).uniform(0, np.array(SHAPE) * 0.1, (2000, 3))
    np.testing.assert_array_equal(
        on_disk.distance(points), build(state, grid, cap_m=0.3, unknown=unknown).distance(points)
    )
    np.testing.assert_array_equal(on_disk.states(grid.everything), state)


def test_every_engine_writes_the_same_bytes(tmp_path):
    state, grid = random_map(np.random.default_rng(1))
    np.save(tmp_path / "state.npy", state)
    source = ArraySource(tmp_path / "state.npy")
    with ThreadPoolExecutor(3) as threads, ThreadPoolExecutor(1) as one:
        results = {
            "default": build_blocks(tmp_path / "default", source, grid),
            "one": build_blocks(tmp_path / "one", source, grid, executor=one),
            "threads": build_blocks(tmp_path / "threads", source, grid, executor=threads),
        }
    assert len({r.hash for r in results.values()}) == 1
    assert len({_bytes(tmp_path / name) for name in results}) == 1


@pytest.mark.slow
def test_processes_and_dask_write_the_same_bytes_as_one_thread(tmp_path):
    scene = [solids.Sphere((5.0, 5.0, 2.0), 1.0), solids.Box((12.0, 0.0, 0.0), (13.0, 20.0, 3.0))]
    grid = Grid((0, 0, 0), 0.05, (520, 300, 60))
    source = SolidSource(scene, grid)
    with ThreadPoolExecutor(1) as one, ProcessPoolExecutor(2) as processes:
        build_blocks(tmp_path / "one", source, grid, executor=one)
        build_blocks(tmp_path / "processes", source, grid, executor=processes)
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "processes")
    distributed = pytest.importorskip("dask.distributed", reason="Dask is an optional engine")
    with distributed.Client(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        build_blocks(tmp_path / "dask", source, grid, executor=client.get_executor())
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "dask")


def _bytes(folder):
    return tuple((p.name, p.read_bytes()) for p in sorted(folder.iterdir()))


def test_edits_give_the_same_map_on_disk_and_in_memory(tmp_path):
    rng = np.random.default_rng(2)
    state, grid = random_map(rng)
    edits = [
        Edit("add", solids.Sphere((1.0, 4.0, 2.0), 0.5)),
        Edit("remove", solids.Box((1.0, 3.0, 1.0), (3.0, 5.0, 2.5))),
        Edit("no-fly", solids.Prism(((3, 3), (5, 3), (4, 5)), 0.5, 2.0), "yard"),
    ]
    edited = Editor(build(state, grid), edits).field
    on_disk = build_blocks(tmp_path / "map", ArraySource(state), grid, edits=edits)
    points = rng.uniform(grid.low_world_m, grid.high_world_m, (5000, 3))
    np.testing.assert_array_equal(on_disk.distance(points), edited.distance(points))


def test_an_update_is_the_same_bytes_as_a_rebuild_and_leaves_open_fields_alone(tmp_path):
    state, grid = random_map(np.random.default_rng(7))
    wall = Edit("add", solids.Box((0.0, 3.0, 1.0), (0.4, 4.0, 2.0)))
    before = build_blocks(tmp_path / "map", ArraySource(state), grid, cap_m=0.5)
    points = np.random.default_rng(8).uniform(grid.low_world_m, grid.high_world_m, (5000, 3))
    old = before.distance(points)
    update_blocks(tmp_path / "map", ArraySource(state), solids.covered_region(wall.solid, grid), edits=[wall])
    build_blocks(tmp_path / "rebuilt", ArraySource(state), grid, cap_m=0.5, edits=[wall])
    assert _bytes(tmp_path / "map") == _bytes(tmp_path / "rebuilt")
    np.testing.assert_array_equal(before.distance(points), old)
    assert (open_blocks(tmp_path / "map", in_memory=True).distance(points) != old).any()


def test_the_list_of_edits_lives_with_the_map_and_is_replayed_on_every_rebuild(tmp_path):
    rng = np.random.default_rng(9)
    state, grid = random_map(rng)
    source, points = ArraySource(state), rng.uniform(grid.low_world_m, grid.high_world_m, (5000, 3))
    shelf = Edit("add", solids.Box((0.0, 3.0, 1.0), (0.4, 4.0, 2.0)))
    yard = Edit("no-fly", solids.Prism(((4, 3), (5.5, 3), (5, 5)), 0.5, 2.0), "yard")
    hole = Edit("remove", solids.Sphere((0.2, 3.5, 1.5), 0.4))
    mapped = build_blocks(tmp_path / "map", source, grid, cap_m=0.5)
    for edits in ([shelf], [shelf, yard], [shelf, yard, hole], [yard, hole], [hole, yard], [yard], []):
        field = edit_blocks(tmp_path / "map", source, edits)
        assert field.edits == open_blocks(tmp_path / "map").edits == tuple(edits)
        in_memory = Editor(build(state, grid, cap_m=0.5), edits).field
        np.testing.assert_array_equal(field.distance(points), in_memory.distance(points))
        build_blocks(tmp_path / "rebuilt", source, grid, cap_m=0.5, edits=edits)
        assert _bytes(tmp_path / "map") == _bytes(tmp_path / "rebuilt")
    assert open_blocks(tmp_path / "map").hash == mapped.hash

    edit_blocks(tmp_path / "map", source, [shelf, yard])
    again, _ = random_map(rng)
    rebuilt = build_blocks(tmp_path / "map", ArraySource(again), grid, cap_m=0.5)
    assert rebuilt.edits == (shelf, yard)
    expected = Editor(build(again, grid, cap_m=0.5), [shelf, yard]).field
    np.testing.assert_array_equal(rebuilt.distance(points), expected.distance(points))
    assert build_blocks(tmp_path / "map", source, grid, cap_m=0.5, edits=[]).hash == mapped.hash


def test_an_edit_of_a_large_map_touches_only_the_chunks_near_it(tmp_path):
    state, grid = random_map(np.random.default_rng(10))
    build_blocks(tmp_path / "map", ArraySource(state), grid, cap_m=0.3)
    before = {p.name: p.stat().st_ino for p in (tmp_path / "map").glob("chunk_*.values.npy")}
    far_apart = [Edit("add", solids.Sphere(c, 0.15)) for c in ((-0.8, 2.3, 0.6), (5.8, 6.3, 4.0))]
    edit_blocks(tmp_path / "map", ArraySource(state), far_apart)
    after = {p.name: p.stat().st_ino for p in (tmp_path / "map").glob("chunk_*.values.npy")}
    changed = {name.removeprefix("chunk_").split(".")[0] for name in before if before[name] != after[name]}
    assert len(before) == 12
    assert changed == {"0_0_0", "1_1_0", "1_1_1", "2_1_0", "2_1_1"}


def test_a_crop_is_the_field_of_that_part(tmp_path):
    state, grid = random_map(np.random.default_rng(3))
    on_disk = build_blocks(tmp_path / "map", ArraySource(state), grid)
    region = grid.region((0.0, 3.0, 1.0), (4.0, 5.0, 3.0))
    crop = on_disk.crop(region)
    np.testing.assert_array_equal(crop.state, state[region.slices])
    np.testing.assert_array_equal(crop.values_m, build(state[region.slices], grid.part(region)).values_m)


def test_solids_of_any_size_are_a_source(tmp_path):
    scene = solids.Scene([solids.Sphere((1.0, 4.0, 2.0), 0.5), solids.Room((-0.8, 2.2, 0.5), (5.8, 6.3, 4.0))])
    grid = Grid((-1.0, 2.0, 0.3), 0.1, SHAPE)
    on_disk = build_blocks(tmp_path / "map", SolidSource(scene.solids, grid), grid)
    np.testing.assert_array_equal(on_disk.states(grid.everything), rasterize(scene, grid))


def test_a_curve_is_certified_on_disk_as_in_memory(tmp_path):
    state, grid = random_map(np.random.default_rng(4))
    coefficients = np.zeros((1, 4, 2))
    coefficients[0, :3] = [[0.5, 1.0], [5.0, 0.1], [1.0, 0.1]]
    path = Trajectory(np.array([3.0]), coefficients)
    on_disk = build_blocks(tmp_path / "map", ArraySource(state), grid)
    assert str(certify(on_disk, path, 0.1)) == str(certify(build(state, grid), path, 0.1))


def test_damaged_maps_are_refused_and_failed_builds_leave_the_old_one(tmp_path):
    state, grid = random_map(np.random.default_rng(5))
    old = build_blocks(tmp_path / "map", ArraySource(state), grid)

    def broken(region):
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left"):
        build_blocks(tmp_path / "map", broken, grid)
    assert open_blocks(tmp_path / "map").hash == old.hash
    with pytest.raises(InputError, match="bound"):
        build_blocks(tmp_path / "other", ArraySource(state), grid, cap_m=float("inf"))
    bricks = tmp_path / "map" / "chunk_0_0_0.values.npy"
    bricks.write_bytes(bricks.read_bytes()[:5000])
    with pytest.raises(FormatError, match="damaged"):
        open_blocks(tmp_path / "map")
    (tmp_path / "map" / "blocks.toml").unlink()
    with pytest.raises(InputError, match="does not exist"):
        open_blocks(tmp_path / "map")
