"""Depth images: metres out of either unit, and each fault of a folder of them named before any work."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from flight import InputError
from mapping.camera import rig as rigs
from mapping.input import images as image_folder
from mapping.input.depth_images import DepthFolder

CAMERA = rigs.forward_camera("PINHOLE", 40, 30, [30.0, 30.0, 20.0, 15.0])
RIG = rigs.Rig((CAMERA,))


@pytest.fixture
def depth_m() -> np.ndarray:
    depth_m = np.random.default_rng(0).uniform(0.5, 5.0, (30, 40)).round(3)
    depth_m[:4] = 0.0
    return depth_m


def written(folder: Path, depth: np.ndarray, suffix: str = ".png", count: int = 3) -> Path:
    (folder / "images").mkdir()
    (folder / "depth").mkdir()
    noise = np.random.default_rng(1).integers(0, 255, (30, 40), dtype=np.uint8)
    for k in range(count):
        cv2.imwrite(str(folder / "images" / f"{k}.png"), noise)
        cv2.imwrite(str(folder / "depth" / f"{k}{suffix}"), depth)
    return folder / "depth"


def read(folder: Path, unit_m: float | None = None) -> image_folder.ImageSet:
    return image_folder.read_folder(folder / "images", RIG, depths=DepthFolder(folder / "depth", unit_m))


def test_millimetres_and_metres_are_read_alike(tmp_path: Path, depth_m: np.ndarray) -> None:
    for name, values, suffix in (
        ("whole", np.round(1000.0 * depth_m).astype(np.uint16), ".png"),
        ("tiff", np.round(1000.0 * depth_m).astype(np.uint16), ".tiff"),
        ("float", depth_m.astype(np.float32), ".tif"),
    ):
        (tmp_path / name).mkdir()
        written(tmp_path / name, values, suffix)
        np.testing.assert_allclose(read(tmp_path / name).depth_m(1, 0), depth_m, atol=1e-6)


def test_another_unit_is_read_when_it_is_given(tmp_path: Path, depth_m: np.ndarray) -> None:
    written(tmp_path, np.round(5000.0 * depth_m).astype(np.uint16))
    np.testing.assert_allclose(read(tmp_path, 0.0002).depth_m(0, 0), depth_m, atol=1e-6)


def test_a_saturated_whole_number_is_unknown_and_no_free_space(tmp_path: Path, depth_m: np.ndarray) -> None:
    values = np.round(1000.0 * depth_m).astype(np.uint16)
    values[10:14] = 65535
    written(tmp_path, values)
    assert (read(tmp_path).depth_m(0, 0)[10:14] == 0.0).all()


def test_pixels_that_are_not_a_number_are_unknown(tmp_path: Path, depth_m: np.ndarray) -> None:
    values = depth_m.astype(np.float32)
    values[4], values[5], values[6] = np.nan, np.inf, -np.inf
    values[6] = np.nan
    written(tmp_path, values, ".tif")
    back = read(tmp_path).depth_m(0, 0)
    assert not back[:7].any()
    np.testing.assert_allclose(back[7:], depth_m[7:], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "suffix", "said"),
    [
        (lambda d: d.round().astype(np.uint16), ".png", "seems to be in metres"),
        (lambda d: (1000.0 * d).astype(np.float32), ".tif", "seems to be in millimetres"),
        (lambda d: (1000.0 * d[:20]).astype(np.uint16), ".png", "40x20 pixels, its image 40x30"),
        (lambda d: (50.0 * d).astype(np.uint8), ".png", "not a depth image"),
        (lambda d: np.dstack([d] * 3).astype(np.float32), ".tif", "not a depth image"),
        (lambda d: (d - 1.0).astype(np.float32), ".tif", "depths are positive"),
        (lambda d: np.zeros(d.shape, np.uint16), ".png", "all depths are 0"),
    ],
)
def test_each_fault_is_named(tmp_path: Path, depth_m: np.ndarray, change, suffix: str, said: str) -> None:
    written(tmp_path, change(depth_m), suffix)
    with pytest.raises(InputError, match=said):
        read(tmp_path)


def test_a_missing_and_a_cut_off_depth_image_are_named(tmp_path: Path, depth_m: np.ndarray) -> None:
    folder = written(tmp_path, np.round(1000.0 * depth_m).astype(np.uint16))
    whole = (folder / "1.png").read_bytes()
    (folder / "1.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"1\.png is damaged"):
        read(tmp_path)
    (folder / "1.png").unlink()
    with pytest.raises(InputError, match=r"1\.png does not exist"):
        read(tmp_path)


def test_depth_goes_with_one_camera_without_distortion(tmp_path: Path, depth_m: np.ndarray) -> None:
    depths = DepthFolder(written(tmp_path, np.round(1000.0 * depth_m).astype(np.uint16)))
    fisheye = rigs.forward_camera("SIMPLE_RADIAL_FISHEYE", 40, 30, [30.0, 20.0, 15.0, 0.0])
    with pytest.raises(InputError, match="without distortion"):
        image_folder.read_folder(tmp_path / "images", rigs.Rig((fisheye,)), depths=depths)
    with pytest.raises(InputError, match="a unit of depth"):
        DepthFolder(tmp_path, float("nan"))
