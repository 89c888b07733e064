"""Bad input, one clear error each: every entry of the list of bad inputs of the distance field."""

import resource
from contextlib import contextmanager

import numpy as np
import pytest

from esdf import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    ArraySource,
    Grid,
    build,
    build_blocks,
    certify,
    exchange,
    exchange_voxblox,
    load,
    observe,
    open_blocks,
    pictures,
    save,
)
from flight import FormatError, InputError, Trajectory

GRID = Grid((0, 0, 0), 0.1, (12, 10, 8))


def some_state(seed=0, shape=GRID.shape):
    return np.random.default_rng(seed).choice(3, size=shape, p=[0.1, 0.8, 0.1]).astype(np.uint8)


@contextmanager
def disk_with_room_for(size):
    """Files cannot grow beyond `size` bytes: to a writing program, a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_nan_in_the_states_of_a_map():
    with pytest.raises(InputError, match="floating point"):
        build(np.full(GRID.shape, np.nan), GRID)


@pytest.mark.parametrize("value", [3, 255])
def test_states_that_do_not_exist(value):
    state = some_state()
    state[3, 4, 5] = value
    with pytest.raises(InputError, match=f"state is {value}"):
        build(state, GRID)


def test_nan_in_measurements():
    values = np.zeros(GRID.shape)
    with pytest.raises(InputError, match="finite"):
        observe.state_from_points(np.array([[0.5, 0.5, np.nan]]), np.zeros((1, 3)), GRID)
    with pytest.raises(InputError, match="finite"):
        observe.state_from_points(np.array([[0.5, 0.5, 0.5]]), np.array([[0.0, np.inf, 0.0]]), GRID)
    # A probability or a distance that is no number is a voxel that was not measured.
    values[0, 0, 0] = np.nan
    assert observe.state_from_occupancy(values, GRID)[0, 0, 0] == UNKNOWN


@pytest.mark.parametrize("point", [[np.nan, 0.1, 0.1], [0.1, np.inf, 0.1]])
def test_a_query_at_no_place(point):
    field = build(some_state(), GRID)
    points = np.full((100, 3), 0.5)
    points[57] = point
    for ask in (field.distance, field.gradient, field.hessian, field.status, field.proven_distance):
        with pytest.raises(InputError, match="finite"):
            ask(points)


@pytest.mark.parametrize("points", [[0.1, 0.2, 0.3], [[0.1, 0.2]], np.zeros((2, 3, 1)), "abc", [[1j, 0, 0]], None])
def test_a_query_of_the_wrong_shape(points):
    field = build(some_state(), GRID)
    for ask in (field.distance, field.gradient, field.hessian, field.status, field.proven_distance):
        with pytest.raises(InputError, match="points"):
            ask(points)


def test_an_empty_mask():
    with pytest.raises(InputError, match="at least 1"):
        build(np.zeros((0, 0, 0), np.uint8), Grid((0, 0, 0), 0.1, (0, 0, 0)))
    with pytest.raises(InputError, match="shape"):
        build(np.zeros((0, 0, 0), np.uint8), GRID)
    with pytest.raises(InputError, match="shape"):
        build(np.zeros(GRID.shape[:2], np.uint8), GRID)


@pytest.mark.parametrize("unknown", ["obstacle", "nan"])
def test_an_all_unknown_map_certifies_no_clearance(unknown):
    field = build(np.full(GRID.shape, UNKNOWN, np.uint8), GRID, unknown=unknown)
    distance = field.distance([[0.5, 0.5, 0.5]])[0]
    assert distance < 0 if unknown == "obstacle" else np.isnan(distance)
    coefficients = np.zeros((1, 4, 2))
    coefficients[0, :3] = [[0.3, 0.2], [0.5, 0.0], [0.4, 0.0]]
    verdict = certify(field, Trajectory(np.array([1.0]), coefficients), 0.1)
    assert not verdict.passed
    assert verdict.reason == ("too close" if unknown == "obstacle" else "unknown")
    if unknown == "nan":
        with pytest.raises(InputError, match="nothing in this map is known"):
            pictures.histogram(field)


@pytest.mark.parametrize("voxel_m", [0, -0.1, np.nan, np.inf, (0.1, 0.0, 0.1), "wide"])
def test_voxels_of_no_size(voxel_m):
    with pytest.raises(InputError, match="voxel size"):
        Grid((0, 0, 0), voxel_m, (4, 4, 4))
    if not isinstance(voxel_m, tuple | str):
        with pytest.raises(InputError, match="voxel size"):
            Grid.covering((0, 0, 0), (1, 1, 1), voxel_m)


def test_more_voxels_than_anybody_has():
    with pytest.raises(InputError, match=r"1e\+12 voxels; at most 6.87e\+10"):
        Grid((0, 0, 0), 0.01, (10_000, 10_000, 10_000))
    with pytest.raises(InputError, match=r"1e\+12 voxels"):
        Grid.covering((0, 0, 0), (100, 100, 100), 0.01)


@pytest.mark.parametrize("cap_m", [0, -1, np.nan])
def test_caps_of_no_size(cap_m):
    with pytest.raises(InputError, match="cap_m"):
        build(some_state(), GRID, cap_m=cap_m)


@pytest.fixture
def files(tmp_path):
    """One of every kind of file that is read back, each with its reader."""
    field = build(some_state(), GRID, cap_m=0.5, unknown="nan")
    save(tmp_path / "field", field)
    build_blocks(tmp_path / "blocks", ArraySource(some_state()), GRID, cap_m=0.5)
    exchange.export_npz(tmp_path / "field.npz", field)
    exchange_voxblox.export_layer(tmp_path / "field.voxblox", field)
    return {
        tmp_path / "field" / "esdf.toml": lambda: load(tmp_path / "field"),
        tmp_path / "field" / "state.npz": lambda: load(tmp_path / "field"),
        tmp_path / "blocks" / "blocks.toml": lambda: open_blocks(tmp_path / "blocks"),
        tmp_path / "blocks" / "chunk_0_0_0.values.npy": lambda: open_blocks(tmp_path / "blocks"),
        tmp_path / "blocks" / "chunk_0_0_0.values.index.npy": lambda: open_blocks(tmp_path / "blocks"),
        tmp_path / "blocks" / "chunk_0_0_0.states.npy": lambda: open_blocks(tmp_path / "blocks"),
        tmp_path / "field.npz": lambda: exchange.import_npz(tmp_path / "field.npz"),
        tmp_path / "field.voxblox": lambda: exchange_voxblox.import_layer(tmp_path / "field.voxblox"),
    }


def test_truncated_files(files):
    for path, read in files.items():
        whole = path.read_bytes()
        read()
        for size in {0, 1, 7, len(whole) // 3, len(whole) // 2, len(whole) - 2}:
            path.write_bytes(whole[:size])
            try:
                read()
            except FormatError:
                continue
            pytest.fail(f"{path.name} was read with {size} of {len(whole)} bytes")
        path.write_bytes(whole)
        read()


def test_files_of_a_newer_version(files):
    for path, read in files.items():
        if path.suffix == ".toml":
            path.write_text(path.read_text().replace("version = 1", "version = 2"))
            with pytest.raises(FormatError, match="update Goshawk"):
                read()


def test_files_that_are_not_there(tmp_path):
    for read in (load, open_blocks, exchange.import_npz, exchange_voxblox.import_layer):
        with pytest.raises(InputError, match="exist"):
            read(tmp_path / "nothing")


def test_a_disk_that_fills_up_while_saving_leaves_the_old_file_whole(tmp_path):
    old = build(some_state(), GRID, cap_m=0.5)
    new_grid = Grid((0, 0, 0), 0.1, (60, 60, 60))
    new_state = some_state(1, new_grid.shape)
    new = build(new_state, new_grid, cap_m=0.5)
    writers = {
        "field": lambda field, _: save(tmp_path / "field", field),
        "blocks": lambda field, state: build_blocks(tmp_path / "blocks", ArraySource(state), field.grid, cap_m=0.5),
        "field.npz": lambda field, _: exchange.export_npz(tmp_path / "field.npz", field),
        "field.voxblox": lambda field, _: exchange_voxblox.export_layer(tmp_path / "field.voxblox", field),
        "field.nrrd": lambda field, _: exchange.export_nrrd(tmp_path / "field.nrrd", field),
        "near.ply": lambda field, _: exchange.export_ply(tmp_path / "near.ply", field, closer_than_m=0.3),
    }
    for write in writers.values():
        write(old, some_state())
    before = _contents(tmp_path)
    for name, write in writers.items():
        with disk_with_room_for(20_000), pytest.raises((InputError, OSError)) as refusal:
            write(new, new_state)
        if name in ("field", "blocks"):
            assert "the old one stays" in str(refusal.value)
    assert _contents(tmp_path) == before
    assert load(tmp_path / "field").hash == old.hash


def _contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_source_that_returns_the_wrong_shape_or_states(tmp_path):
    for source in (lambda region: np.ones((3, 3, 3), np.uint8), lambda region: np.full(region.shape, 7, np.uint8)):
        with pytest.raises(InputError, match="the source gave"):
            build_blocks(tmp_path / "map", source, GRID)
    assert not (tmp_path / "map").exists()


def test_a_map_of_one_voxel_works():
    for kind, expected in ((FREE, 0.5), (OCCUPIED, -2.0)):
        field = build(np.full((1, 1, 1), kind, np.uint8), Grid((0, 0, 0), 1.0, (1, 1, 1)))
        assert field.distance([[0.5, 0.5, 0.5]])[0] == pytest.approx(expected)
