"""Files of points, written here by Open3D, trimesh and by hand, are read as they are, or refused in a sentence."""

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import open3d
import pytest
import trimesh

from flight import FlightError, FormatError, InputError
from mapping.cloud import columns, point_file

RNG = np.random.default_rng(5)
POINTS = RNG.uniform(-5.0, 5.0, (50, 3))
TIMES = np.arange(50.0)
FIELDS = "VERSION 0.7\nFIELDS x y z time\nSIZE 8 8 8 8\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 50\nHEIGHT 1\nPOINTS 50\n"


def written(path: Path, coding: str) -> Path:
    if coding == "trimesh":
        trimesh.PointCloud(POINTS).export(path)
        return path
    library: Any = open3d  # its stubs know no arrays
    cloud = library.t.geometry.PointCloud(POINTS)
    cloud.point["time"] = TIMES[:, None]
    text, compressed = coding == "text", coding == "compressed"
    assert library.t.io.write_point_cloud(str(path), cloud, write_ascii=text, compressed=compressed)
    return path


@pytest.mark.parametrize("suffix", ["ply", "pcd"])
@pytest.mark.parametrize("coding", ["text", "binary", "compressed", "trimesh"])
def test_points_come_back_as_another_program_wrote_them(tmp_path: Path, suffix: str, coding: str) -> None:
    if (suffix, coding) == ("pcd", "trimesh"):
        pytest.skip("trimesh writes no PCD")
    columns = point_file.read(written(tmp_path / f"cloud.{suffix}", coding))
    atol = 1e-5 if coding in ("text", "trimesh") else 0.0
    assert np.stack([columns[name] for name in "xyz"], axis=1) == pytest.approx(POINTS, abs=max(atol, 1e-12))
    if coding != "trimesh":
        assert np.array_equal(columns["time"], TIMES)


def test_numbers_of_either_byte_order_and_fields_of_many_numbers_keep_their_place(tmp_path: Path) -> None:
    head = "ply\nformat binary_big_endian 1.0\nelement vertex 50\nproperty uchar red\n"
    head += "property float x\nproperty double y\nproperty short z\nelement face 0\nend_header\n"
    rows = np.zeros(50, [("red", "u1"), ("x", ">f4"), ("y", ">f8"), ("z", ">i2")])
    rows["x"], rows["y"], rows["z"] = POINTS.T
    (tmp_path / "big.ply").write_bytes(head.encode() + rows.tobytes())
    columns = point_file.read(tmp_path / "big.ply")
    assert np.array_equal(columns["y"], POINTS[:, 1])
    assert np.array_equal(columns["x"], POINTS[:, 0].astype(np.float32))
    head = "FIELDS x normal z _ y\nSIZE 4 4 4 1 8\nTYPE F F F U F\nCOUNT 1 3 1 4 1\nPOINTS 50\nDATA binary\n"
    rows = np.zeros(50, [("x", "<f4"), ("n", "<f4", 3), ("z", "<f4"), ("_", "u1", 4), ("y", "<f8")])
    rows["x"], rows["y"], rows["z"] = POINTS.T
    (tmp_path / "many.pcd").write_bytes(head.encode() + rows.tobytes())
    columns = point_file.read(tmp_path / "many.pcd")
    assert np.array_equal(columns["y"], POINTS[:, 1])
    assert np.array_equal(columns["z"], POINTS[:, 2].astype(np.float32))


@pytest.mark.parametrize("suffix", ["ply", "pcd"])
@pytest.mark.parametrize("coding", ["text", "binary", "compressed"])
def test_a_file_cut_off_anywhere_is_refused(tmp_path: Path, suffix: str, coding: str) -> None:
    whole = written(tmp_path / f"whole.{suffix}", coding).read_bytes()
    lines = 2 if coding == "text" else 1  # of text, the last line may lack its end
    for share in (0.0, 0.05, 0.2, 0.5, 0.9, 1.0 - lines * 20 / len(whole)):
        (tmp_path / f"cut.{suffix}").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(FormatError, match=r"cut off|again"):
            point_file.read(tmp_path / f"cut.{suffix}")


def test_a_header_that_lies_is_refused_before_memory_is_set_aside(tmp_path: Path) -> None:
    for coding in ("binary", "compressed"):
        whole = written(tmp_path / "whole.pcd", coding).read_bytes()
        for count in (b"51", b"29999999"):
            lie = whole.replace(b"POINTS 50", b"POINTS " + count).replace(b"WIDTH 50", b"WIDTH " + count)
            (tmp_path / "lie.pcd").write_bytes(lie)
            with pytest.raises(FormatError, match="cut off"):
                point_file.read(tmp_path / "lie.pcd")
    for count, error, match in (
        ("9" * 12, InputError, "million"),
        ("0", FormatError, "no points"),
        ("-5", FormatError, "'-5'"),
    ):
        (tmp_path / "huge.ply").write_text(
            f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n"
            "end_header\n1 2 3\n"
        )
        with pytest.raises(error, match=match):
            point_file.read(tmp_path / "huge.ply")


def test_bytes_changed_at_random_are_read_or_refused_but_crash_nothing(tmp_path: Path) -> None:
    file = tmp_path / "changed.pcd"
    for coding in ("text", "binary", "compressed"):
        whole = written(tmp_path / "whole.pcd", coding).read_bytes()
        for _ in range(60):
            changed = bytearray(whole)
            for place in RNG.integers(0, RNG.choice([250, len(whole)]), 2):
                changed[place] = RNG.integers(256)
            file.write_bytes(changed)
            with contextlib.suppress(FlightError):
                columns = point_file.read(file)
                assert {len(columns[name]) for name in "xyz"} == {50}


def test_what_is_no_cloud_is_refused_in_a_sentence(tmp_path: Path) -> None:
    def refused(name: str, text: str) -> str:
        (tmp_path / name).write_text(text)
        with pytest.raises(FlightError) as caught:
            point_file.read(tmp_path / name)
        return str(caught.value)

    rows = "1 2 3 4\n" * 50
    with pytest.raises(InputError, match="convert it"):
        columns.read(tmp_path / "a.xyz")
    assert "no PLY file" in refused("a.ply", "")
    assert "no PCD file" in refused("a.pcd", "")
    assert "no y" in refused("a.pcd", FIELDS.replace("x y z", "x k z") + "DATA ascii\n" + rows)
    assert "is there twice" in refused("a.pcd", FIELDS.replace("z time", "z x") + "DATA ascii\n" + rows)
    assert "WIDTH times HEIGHT 49" in refused("a.pcd", FIELDS.replace("WIDTH 50", "WIDTH 49") + "DATA ascii\n" + rows)
    assert "differ in length" in refused("a.pcd", FIELDS.replace("COUNT 1", "COUNT") + "DATA ascii\n" + rows)
    assert "'lz4'" in refused("a.pcd", FIELDS + "DATA lz4\n" + rows)
    assert "of type Q" in refused("a.pcd", FIELDS.replace("TYPE F", "TYPE Q") + "DATA ascii\n" + rows)
    assert "has 3 numbers" in refused("a.pcd", FIELDS + "DATA ascii\n" + "1 2 3\n" * 50)
    assert "cannot be read" in refused("a.pcd", FIELDS + "DATA ascii\n" + rows.replace("4\n", "four\n", 1))
    listed = "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n"
    assert "no number" in refused("a.ply", listed)
    assert "must come first" in refused("a.ply", listed.replace("vertex", "camera"))
    with pytest.raises(InputError, match="does not exist"):
        columns.read(tmp_path / "none.pcd")
