"""Files for and from other tools."""

import struct
import tracemalloc

import numpy as np
import pytest

from esdf import UNKNOWN, Grid, build
from esdf.exchange import export_npz, export_nrrd, export_ply, import_npz
from esdf.exchange_voxblox import export_layer, import_layer
from flight import FormatError, InputError


@pytest.fixture(scope="module")
def field():
    rng = np.random.default_rng(0)
    state = rng.choice(3, size=(37, 20, 9), p=[0.1, 0.85, 0.05]).astype(np.uint8)
    return build(state, Grid((-0.7, 1.3, -0.2), 0.1, state.shape), cap_m=0.45)


def test_an_archive_comes_back_as_it_was(tmp_path, field):
    export_npz(tmp_path / "field.npz", field)
    back = import_npz(tmp_path / "field.npz")
    assert back.hash == field.hash
    np.testing.assert_array_equal(back.values_m, field.values_m)


def test_a_voxblox_esdf_layer_comes_back_bit_by_bit(tmp_path, field):
    export_layer(tmp_path / "layer.vxblx", field)
    layer = import_layer(tmp_path / "layer.vxblx")
    assert layer.kind == "esdf"
    offset = np.rint((field.grid.low_world_m - layer.grid.low_world_m) / 0.1).astype(int)
    place = tuple(slice(a, a + n) for a, n in zip(offset, field.grid.shape, strict=True))
    known = field.state != UNKNOWN
    np.testing.assert_array_equal(layer.value[place][known], field.values_m[known])
    np.testing.assert_array_equal(layer.weight[place] > 0, known)
    assert layer.weight.sum() == known.sum()
    centres = field.grid.centre([0, 0, 0]), layer.grid.centre(offset)
    np.testing.assert_allclose(*centres, atol=1e-12)


def varint(value):
    out = b""
    while value > 0x7F:
        out, value = out + bytes([value & 0x7F | 0x80]), value >> 7
    return out + bytes([value])


def hand_written_layer(kind, words, *, packed=False, origin=(-0.8, 0.0, 1.6)):
    """A layer with one block of 8^3 voxels, written byte by byte from the format's description."""
    header = b"\x09" + struct.pack("<d", 0.1) + b"\x10\x08" + b"\x1a" + varint(len(kind)) + kind.encode()
    block = b"\x08\x08" + b"\x11" + struct.pack("<d", 0.1)
    for field, value in zip((b"\x19", b"\x21", b"\x29"), origin, strict=True):
        block += field + struct.pack("<d", value)
    block += b"\x30\x01"
    if packed:
        body = b"".join(varint(w) for w in words)
        block += b"\x3a" + varint(len(body)) + body
    else:
        block += b"".join(b"\x38" + varint(w) for w in words)
    return varint(2) + varint(len(header)) + header + varint(len(block)) + block


@pytest.mark.parametrize("packed", [False, True])
def test_a_tsdf_layer_is_read_as_the_format_specifies(tmp_path, packed):
    rng = np.random.default_rng(1)
    distance, weight = rng.normal(size=512).astype(np.float32), rng.integers(0, 3, 512).astype(np.float32)
    words = np.stack([distance.view(np.uint32), weight.view(np.uint32), rng.integers(0, 2**32, 512)], axis=1)
    (tmp_path / "tsdf").write_bytes(hand_written_layer("tsdf", words.ravel().tolist(), packed=packed))
    layer = import_layer(tmp_path / "tsdf")
    assert layer.kind == "tsdf"
    np.testing.assert_allclose(layer.grid.origin_world_m, (-0.8, 0.0, 1.6))
    x, y, z = 3, 5, 6  # x runs fastest
    at = x + 8 * (y + 8 * z)
    assert layer.weight[x, y, z] == weight[at]
    assert np.isnan(layer.value[x, y, z]) if weight[at] == 0 else layer.value[x, y, z] == distance[at]
    np.testing.assert_array_equal(layer.weight.transpose(2, 1, 0).ravel(), weight)


def test_damaged_and_foreign_layers_are_refused(tmp_path):
    good = hand_written_layer("esdf", [0] * 1024)
    path = tmp_path / "layer"
    for broken in (good[:-3], good[: len(good) // 2], b"", b"\x00", b"hello world, this is no layer", good[:40]):
        path.write_bytes(broken)
        with pytest.raises(FormatError, match="voxblox"):
            import_layer(path)
    path.write_bytes(hand_written_layer("icp", [0] * 1024))
    with pytest.raises(FormatError, match="'icp'"):
        import_layer(path)
    path.write_bytes(hand_written_layer("esdf", [0] * 1000))
    with pytest.raises(FormatError, match="1000 words"):
        import_layer(path)
    with pytest.raises(InputError):
        import_layer(tmp_path / "none")


def test_a_layer_is_written_block_by_block(tmp_path):
    """Beside the field no more memory than a block needs: a hall has 400 million voxels."""
    field = build(np.ones((96, 96, 96), np.uint8), Grid((0, 0, 0), (0.1, 0.1, 0.1), (96, 96, 96)), cap_m=1.0)
    tracemalloc.start()
    try:
        export_layer(tmp_path / "layer", field)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3 * field.grid.voxels < (tmp_path / "layer").stat().st_size


def test_of_several_layers_in_a_file_the_first_is_read_and_the_others_are_whole(tmp_path):
    tsdf, other = hand_written_layer("tsdf", [1] * 1536), hand_written_layer("esdf", [0] * 1024)
    (tmp_path / "both").write_bytes(tsdf + other)
    layer = import_layer(tmp_path / "both")
    assert (layer.kind, layer.layers) == ("tsdf", 2)
    for behind in (other[:-1], other[:30], b"\x00", b"rubbish"):
        (tmp_path / "both").write_bytes(tsdf + behind)
        with pytest.raises(FormatError, match="both is not a whole voxblox layer"):
            import_layer(tmp_path / "both")


@pytest.mark.parametrize("origin", [(0.05, 0.0, 0.0), (0.0, np.nan, 0.0), (0.0, 0.0, np.inf)])
def test_a_block_that_starts_beside_the_lattice_is_refused(tmp_path, origin):
    (tmp_path / "layer").write_bytes(hand_written_layer("esdf", [0] * 1024, origin=origin))
    with pytest.raises(FormatError, match=r"no multiple of the voxel of 0\.1 m"):
        import_layer(tmp_path / "layer")
    rounded = tuple(float(np.float32(a)) for a in (1234.4, -0.8, 1.6))  # as voxblox writes it
    (tmp_path / "layer").write_bytes(hand_written_layer("esdf", [0] * 1024, origin=rounded))
    np.testing.assert_allclose(import_layer(tmp_path / "layer").grid.origin_world_m, (1234.4, -0.8, 1.6))


def test_a_lattice_that_voxblox_cannot_hold_is_refused(tmp_path):
    state = np.ones((4, 4, 4), np.uint8)
    for grid in (Grid((0.05, 0, 0), 0.1, state.shape), Grid((0, 0, 0), (0.1, 0.1, 0.2), state.shape)):
        with pytest.raises(InputError, match="resample"):
            export_layer(tmp_path / "layer", build(state, grid))


def test_damaged_newer_and_altered_archives_are_refused(tmp_path, field):
    path = tmp_path / "field.npz"
    export_npz(path, field)
    with np.load(path) as archive:
        content = dict(archive)
    np.savez(path, **{**content, "version": 2})
    with pytest.raises(FormatError, match="update Goshawk"):
        import_npz(path)
    np.savez(path, **{**content, "distance_m": content["distance_m"] + 1})
    with pytest.raises(FormatError, match="do not match its states"):
        import_npz(path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(FormatError):
        import_npz(path)
    with pytest.raises(InputError):
        import_npz(tmp_path / "none.npz")


def test_a_nrrd_volume_says_where_it_is_and_holds_the_distances(tmp_path, field):
    export_nrrd(tmp_path / "field.nrrd", field)
    header, data = (tmp_path / "field.nrrd").read_bytes().split(b"\n\n", 1)
    lines = dict(line.split(": ", 1) for line in header.decode().splitlines()[1:])
    assert lines["sizes"] == "37 20 9"
    assert eval(lines["space origin"]) == pytest.approx(field.grid.centre([0, 0, 0]))
    volume = np.frombuffer(data, "<f4").reshape(9, 20, 37)
    np.testing.assert_array_equal(volume.transpose(2, 1, 0), field.values_m)


def test_a_ply_cloud_opens_in_another_program(tmp_path, field):
    trimesh = pytest.importorskip("trimesh")
    count = export_ply(tmp_path / "near.ply", field, closer_than_m=0.1)
    cloud = trimesh.load(tmp_path / "near.ply")
    assert len(cloud.vertices) == count > 0
    assert (np.abs(field.distance(cloud.vertices)) < 0.1 + 1e-3).all()
