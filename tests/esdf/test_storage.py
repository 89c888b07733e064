"""Fields on disk: round trip, refusal of what is damaged or newer, and nothing lost when writing fails."""

import base64
import resource

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build, load, save
from flight import FormatError, InputError


@pytest.fixture
def small_field():
    rng = np.random.default_rng(0)
    state = rng.choice(3, size=(12, 9, 15), p=[0.1, 0.8, 0.1]).astype(np.uint8)
    return build(state, Grid((1.0, -2.0, 0.5), (0.1, 0.1, 0.2), state.shape), cap_m=0.7, unknown="nan")


def test_a_field_comes_back_as_it_was(tmp_path, small_field):
    save(tmp_path / "map", small_field)
    back = load(tmp_path / "map")
    assert (back.grid, back.cap_m, back.unknown) == (small_field.grid, small_field.cap_m, small_field.unknown)
    np.testing.assert_array_equal(back.state, small_field.state)
    np.testing.assert_array_equal(back.values_m, small_field.values_m)
    assert back.hash == small_field.hash


def test_a_full_disk_leaves_the_old_field_whole(tmp_path, small_field):
    save(tmp_path / "map", small_field)
    state = np.random.default_rng(1).integers(0, 3, (60, 60, 60)).astype(np.uint8)
    other = build(state, Grid((0, 0, 0), 0.1, state.shape))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))  # as a disk with 10 kB left
    try:
        with pytest.raises(InputError, match="the old one stays"):
            save(tmp_path / "map", other)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert load(tmp_path / "map").hash == small_field.hash
    assert [p.name for p in tmp_path.iterdir()] == ["map"]


VERSION_1_TOML = """\
format = "goshawk-esdf"
version = 1
origin_world_m = [
    0.5,
    -1.0,
    0.0,
]
voxel_m = [
    0.1,
    0.1,
    0.2,
]
shape = [
    3,
    2,
    4,
]
cap_m = 0.7
unknown = "nan"
hash = "7af1f92e7187e0747cc1812df58a34631c0bd3ad55bf172000ddca4005ee1dab"
"""
VERSION_1_VOXELS = (
    "P)h>@EdT%j2mk;8ApktKNbUds|NsC0|NjX96aaH{VRU6KZg6=401yC}000000000^000000001+>=)`A5Xs0;#!#)El3JWxq;934"
    "UQ=qQuA`uymS0p-l$aNvUzCyx5_e0?DNY577iT0EqyqUG#ySc{ItnJ5ItsN4<N+=wMy!AV08mQ-0xbhA000080000X06exx?M?sy"
    "0GI#(00{s900000000000Du7i0001UbYXO5E^csnP)h{{000000RRC2Hvj+ti2wiq000"
)


def test_a_field_written_by_version_1_is_read_by_every_later_one(tmp_path):
    (tmp_path / "esdf.toml").write_text(VERSION_1_TOML)
    (tmp_path / "state.npz").write_bytes(base64.b85decode(VERSION_1_VOXELS))
    field = load(tmp_path)
    state = np.full((3, 2, 4), FREE, np.uint8)
    state[0, 0, 0], state[2, 1, 3] = OCCUPIED, UNKNOWN
    np.testing.assert_array_equal(field.state, state)
    assert field.grid == Grid((0.5, -1.0, 0.0), (0.1, 0.1, 0.2), (3, 2, 4))
    assert (field.cap_m, field.unknown) == (0.7, "nan")
    assert field.values_m[1, 0, 0] == np.float32(0.05)


def test_truncated_voxels_are_refused(tmp_path, small_field):
    save(tmp_path / "map", small_field)
    voxels = tmp_path / "map" / "state.npz"
    for size in (0, 10, voxels.stat().st_size - 5):
        voxels.write_bytes(voxels.read_bytes()[:size])
        with pytest.raises(FormatError, match="damaged"):
            load(tmp_path / "map")


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load(tmp_path / "nothing")


def test_damaged_newer_and_tampered_fields_are_refused(tmp_path, small_field):
    save(tmp_path / "map", small_field)
    about = tmp_path / "map" / "esdf.toml"
    good = about.read_text()
    about.write_text(good.replace("version = 1", "version = 999"))
    with pytest.raises(FormatError, match="update Goshawk"):
        load(tmp_path / "map")
    about.write_text(good.replace("cap_m = 0.7", "cap_m = 0.8"))
    with pytest.raises(FormatError, match="hash"):
        load(tmp_path / "map")
    about.write_text(good[: len(good) // 2])
    with pytest.raises(FormatError):
        load(tmp_path / "map")
