"""Scans as laspy and pye57 write them are read as they are, with the places of the scanner; damage is a sentence."""

import struct
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from flight import FormatError, InputError
from mapping.cloud import columns, e57_file, point_cloud

RNG = np.random.default_rng(6)
POINTS = RNG.uniform(-5.0, 5.0, (4000, 3))
CORNER = np.array([512_000.0, 5_403_000.0, 410.0])


def las(path: Path, kind: int = 6, points: np.ndarray = POINTS) -> Path:
    header = laspy.LasHeader(point_format=kind, version="1.4" if kind > 5 else "1.2")
    header.scales, header.offsets = [1e-4] * 3, CORNER
    data = laspy.LasData(header)
    data.x, data.y, data.z = (points + CORNER).T
    if kind not in (0, 2):
        data.gps_time = np.arange(len(points)) / 100.0
    data.write(path)
    return path


def e57(path: Path, stations: tuple[Any, ...], points: np.ndarray = POINTS) -> Path:
    pye57 = pytest.importorskip("pye57", reason="has no wheels for this platform")
    file = pye57.E57(str(path), mode="w")
    for q, place in stations:
        columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points.T.copy(), strict=True))
        columns["cartesianInvalidState"] = (np.arange(len(points)) % 10 == 0).astype(int)
        file.write_scan_raw(columns, rotation=np.array(q), translation=np.array(place))
    file.close()
    return path


@pytest.mark.parametrize(("kind", "suffix"), [*((kind, "las") for kind in (0, 1, 3, 6, 7)), (1, "laz"), (6, "laz")])
def test_a_las_file_has_the_places_and_times_that_laspy_wrote(tmp_path: Path, suffix: str, kind: int) -> None:
    found = columns.read(las(tmp_path / f"scan.{suffix}", kind))
    assert np.stack([found[name] for name in "xyz"], axis=1) == pytest.approx(POINTS + CORNER, abs=6e-5)
    assert ("gps_time" in found) == (kind != 0)
    if kind != 0:
        assert np.array_equal(found["gps_time"], np.arange(4000) / 100.0)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_las_file_that_lies_or_is_cut_off_is_refused(tmp_path: Path, suffix: str) -> None:
    whole = las(tmp_path / f"whole.{suffix}").read_bytes()
    file = tmp_path / f"bad.{suffix}"
    for share in (0.0, 0.01, 0.6, 0.99) if suffix == "las" else (0.0, 0.99):
        file.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(FormatError, match="again"):
            columns.read(file)
    for count, error in ((2**50, InputError), (29_000_000, FormatError), (0, FormatError)):
        file.write_bytes(whole[:247] + struct.pack("<Q", count) + whole[255:])
        with pytest.raises(error, match=r"million|cut off|no points"):
            columns.read(file)
    file.write_bytes(whole[:131] + struct.pack("<d", np.nan) + whole[139:])
    with pytest.raises(FormatError, match="scales"):
        columns.read(file)


def test_records_without_end_and_a_chunk_table_of_gigabytes_end_soon(tmp_path: Path) -> None:
    whole = las(tmp_path / "whole.laz").read_bytes()
    file = tmp_path / "bad.laz"
    file.write_bytes(whole[:100] + struct.pack("<I", 2**31 - 1) + whole[104:])
    assert len(columns.read(file)["x"]) == 4000
    offset = struct.unpack_from("<I", whole, 96)[0]
    file.write_bytes(whole[:offset] + struct.pack("<q", offset + 8) + whole[offset + 8 :])
    with pytest.raises(FormatError, match="damaged"):
        columns.read(file)


def test_each_scan_of_an_e57_file_lies_at_its_pose_and_was_measured_from_there(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57", reason="has no wheels for this platform")
    turned = ([np.cos(0.4), 0.0, 0.0, np.sin(0.4)], [2.0, -1.0, 1.5])
    file = e57(tmp_path / "two.e57", (([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), turned))
    found = columns.read(file)
    read = [pye57.E57(str(file)).read_scan(k, ignore_missing_fields=True) for k in range(2)]
    for name, own in (("x", "cartesianX"), ("y", "cartesianY"), ("z", "cartesianZ")):
        assert found[name] == pytest.approx(np.concatenate([scan[own] for scan in read]), abs=1e-9)
    places = np.stack([found[name] for name in point_cloud.VIEWPOINT], axis=1)
    assert np.unique(places, axis=0).tolist() == [[0.0, 0.0, 1.0], [2.0, -1.0, 1.5]]
    assert len(places) == 2 * 3600


def test_integers_of_an_e57_file_take_as_few_bits_as_their_range() -> None:
    for least, most in ((0, 1), (-5, 1000), (-(2**31), 2**31 - 1), (-(2**40), 2**40), (7, 7)):
        bits = (most - least).bit_length()
        values = np.array([least + int(share * (most - least)) for share in RNG.uniform(0.0, 1.0, 100)])
        packed = sum(int(value - least) << (bits * k) for k, value in enumerate(values))
        stream = packed.to_bytes(-(-100 * bits // 8), "little")
        field = e57_file._Field("x", "", bits, least, 0.5, 3.0)
        assert np.array_equal(e57_file._decoded(field, stream, 100), 0.5 * values + 3.0)


def test_an_e57_file_with_one_bit_changed_or_cut_off_is_refused(tmp_path: Path) -> None:
    whole = e57(tmp_path / "whole.e57", (([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),)).read_bytes()
    file = tmp_path / "bad.e57"
    for at in (60, len(whole) // 2, len(whole) - 10):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        with pytest.raises(FormatError, match="checksum"):
            columns.read(file)
    for length in (0, 40, 1024, len(whole) - 1024):
        file.write_bytes(whole[:length])
        with pytest.raises(FormatError, match="cut off"):
            columns.read(file)


def test_a_scan_of_a_national_grid_is_moved_by_the_origin_that_the_message_names(tmp_path: Path) -> None:
    file = las(tmp_path / "scan.las")
    with pytest.raises(InputError, match=r"give --origin 5119[0-9]0|give --origin 512"):
        point_cloud.read(file)
    cloud = point_cloud.read(file, origin=CORNER, sensor_world_m=np.array([1.0, 2.0, 3.0]))
    assert cloud.points_world_m == pytest.approx(POINTS, abs=6e-5)
    poses = tmp_path / "poses.tum"
    rows = [(0.1 * k, CORNER[0] + 0.01 * k, *CORNER[1:], 0, 0, 0, 1) for k in range(401)]
    poses.write_text("".join(" ".join(f"{value:.6f}" for value in row) + "\n" for row in rows))
    cloud = point_cloud.read(file, origin=CORNER, poses=poses)
    assert cloud.origins_world_m is not None
    assert cloud.origins_world_m[:, 0] == pytest.approx(np.arange(4000) / 1000.0, abs=1e-6)


def test_scans_are_joined_each_with_its_place_and_in_one_unit(tmp_path: Path) -> None:
    files = [las(tmp_path / f"{name}.las") for name in "ab"]
    places = [np.array([0.0, 0.0, 1.0]), np.array([3.0, 0.0, 1.0])]
    clouds = [
        point_cloud.read(file, origin=CORNER, sensor_world_m=place) for file, place in zip(files, places, strict=True)
    ]
    both = point_cloud.joined(clouds)
    assert both.origins_world_m is not None
    assert np.array_equal(both.origins_world_m[[0, -1]], places)
    assert len(both.points_world_m) == 8000
    assert both.sensor == "of each of 2 files: one place, as given"
    millimetres = point_cloud.read(las(tmp_path / "mm.las", points=1000.0 * POINTS), origin=CORNER)
    with pytest.raises(InputError, match="unit"):
        point_cloud.joined([clouds[0], millimetres])
