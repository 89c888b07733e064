"""Masks: no feature, no depth and no free space where they are black, and each fault of a folder of them named."""

import dataclasses
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from flight import InputError
from mapping.camera import rig as rigs
from mapping.dense.stereo import DepthImage
from mapping.input import images as image_folder
from mapping.sparse.features import features

SIZE = (120, 160)
RIG = rigs.Rig((rigs.forward_camera("PINHOLE", 160, 120, [90.0, 90.0, 80.0, 60.0]),))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    (tmp_path / "images").mkdir()
    (tmp_path / "masks").mkdir()
    for k in range(3):
        picture = cv2.resize(rng.integers(0, 255, (30, 40), dtype=np.uint8), (160, 120), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(tmp_path / "images" / f"{k}.jpg"), picture)
    return tmp_path


def mask(left_out: slice) -> np.ndarray:
    drawn = np.full(SIZE, 255, np.uint8)
    drawn[:, left_out] = 0
    return drawn


def read(folder: Path) -> image_folder.ImageSet:
    return image_folder.read_folder(folder / "images", RIG, masks=folder / "masks")


def test_no_feature_lies_in_masked_pixels(folder: Path) -> None:
    cv2.imwrite(str(folder / "masks" / "camera.png"), mask(slice(0, 70)))
    for found in features.of_set(read(folder), 500):
        assert len(found.pixels) > 20
        assert (found.pixels[:, 0] >= 70.0).all()
    free = image_folder.read_folder(folder / "images", RIG)
    assert any((found.pixels[:, 0] < 60.0).any() for found in features.of_set(free, 500))


def test_each_image_may_have_a_mask_of_its_own(folder: Path) -> None:
    for k in range(3):
        cv2.imwrite(str(folder / "masks" / f"{k}.png"), mask(slice(10 * k, 10 * k + 10)))
    for k in range(3):
        used = read(folder).used(k, 0)
        assert used is not None
        assert np.flatnonzero(~used[5]).tolist() == list(range(10 * k, 10 * k + 10))
    (folder / "masks" / "1.png").unlink()
    with pytest.raises(InputError, match=r"1\.png does not exist"):
        read(folder)


@pytest.mark.parametrize(
    ("drawn", "said"),
    [
        (None, "has no mask of these images"),
        (np.zeros(SIZE, np.uint8), "leaves out 100%"),
        (np.full((60, 80), 255, np.uint8), "80x60 pixels"),
    ],
)
def test_each_fault_is_named(folder: Path, drawn: np.ndarray | None, said: str) -> None:
    if drawn is not None:
        cv2.imwrite(str(folder / "masks" / "camera.png"), drawn)
    with pytest.raises(InputError, match=said):
        read(folder)


@pytest.mark.parametrize("misspelled", ["dwon.png", "down.jpg", "dwon/0.png", "down/0.jpg"])
def test_a_misspelled_mask_beside_a_right_one_is_an_error(folder: Path, misspelled: str) -> None:
    camera = RIG.cameras[0]
    rig = rigs.Rig(tuple(dataclasses.replace(camera, name=name, folder=name) for name in ("front", "down")))
    for name in ("front", "down"):
        shutil.copytree(folder / "images", folder / "rig" / name)
    place = folder / "masks" / misspelled
    place.parent.mkdir(exist_ok=True)
    for path in (folder / "masks" / "front.png", place):
        cv2.imwrite(str(path), mask(slice(0, 70)))
    with pytest.raises(InputError, match=r"dwon|down/0.png does not exist|down\.jpg"):
        image_folder.read_folder(folder / "rig", rig, masks=folder / "masks")
    place.rename(folder / "masks" / "down.png")
    found = image_folder.read_folder(folder / "rig", rig, masks=folder / "masks")
    assert all(found.used(*shot) is not None for shot in found.pairs())


def test_a_masked_depth_image_has_neither_depth_nor_free_space_there() -> None:
    ones = np.ones((60, 80), np.float32)
    depth = DepthImage(ones, 0.1 * ones, ones, 1.3 * ones, 0.5)
    used = mask(slice(0, 51)) > 0  # column 50 is half of the depth image's column 25
    left = depth.where(used)
    for values, given in ((left.inverse_range, 1.0), (left.bound, 1.3)):
        assert not values[:, :26].any()
        np.testing.assert_array_equal(values[:, 26:], np.float32(given))
