"""The image folder is checked before work starts; each fault is one sentence that names the file."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from flight import FormatError, InputError
from mapping.camera.rig import Camera, Rig, forward_camera
from mapping.input import image_file
from mapping.input.images import read_folder, read_table

SINGLE = Rig((forward_camera("SIMPLE_RADIAL_FISHEYE", 64, 48, [40.0, 32.0, 24.0, 0.0]),))
PAIR = Rig(
    tuple(
        Camera(name, name, "SIMPLE_RADIAL_FISHEYE", 64, 48, np.array([40.0, 32.0, 24.0, 0.0]), np.eye(4))
        for name in ("front", "down")
    )
)


def write(path: Path, width: int = 64, height: int = 48) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.random.default_rng(len(path.name)).integers(0, 255, (height, width), dtype=np.uint8))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(4):
        write(tmp_path / f"{k:02d}.jpg")
    return tmp_path


def test_images_come_in_the_order_of_their_names(folder: Path) -> None:
    images = read_folder(folder, SINGLE)
    assert images.instants == ("00.jpg", "01.jpg", "02.jpg", "03.jpg")
    assert images.count == 4
    assert images.relative(2, 0) == "02.jpg"
    assert images.gray(0, 0).shape == (48, 64)
    assert np.isnan(images.time_s).all()


def test_a_rig_pairs_equal_names_and_allows_gaps(tmp_path: Path) -> None:
    for name in ("a.png", "b.png", "c.png"):
        write(tmp_path / "front" / name)
    write(tmp_path / "down" / "b.png")
    images = read_folder(tmp_path, PAIR)
    assert images.present.tolist() == [[True, False], [True, True], [True, False]]
    assert images.relative(1, 1) == "down/b.png"


def test_times_are_read_where_given(folder: Path) -> None:
    (folder / "times.csv").write_text("image,time_s\n01.jpg,0.5\n02.jpg,\n")
    times = read_folder(folder, SINGLE).time_s
    assert times[1] == 0.5
    assert np.isnan(times[[0, 2, 3]]).all()


def refused(folder: Path, rig: Rig, kind: type[Exception], word: str) -> None:
    with pytest.raises(kind, match=word) as caught:
        read_folder(folder, rig)
    assert "\n" not in str(caught.value)


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    refused(tmp_path / "nowhere", SINGLE, InputError, "nowhere is not a folder")


def test_empty_folder_is_refused(tmp_path: Path) -> None:
    refused(tmp_path, SINGLE, InputError, "has no image")


def test_one_image_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "only.png")
    refused(tmp_path, SINGLE, InputError, "has one image")


def test_missing_folder_of_a_camera_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "front" / "a.png")
    refused(tmp_path, PAIR, InputError, "no sub-folder 'down'")


@pytest.mark.parametrize("name", ["02.jpg", "04.png"])
def test_cut_off_image_among_good_ones_is_named(folder: Path, name: str) -> None:
    if not (folder / name).exists():
        write(folder / name)
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: len(whole) * 2 // 3])
    refused(folder, SINGLE, InputError, f"{name} is damaged")


@pytest.mark.parametrize(
    "more", [bytes(512), b"\0\0\0\x18ftypmp42" + bytes(range(256)) * 20, b"SEFH\xff\xd9SEFT", None]
)
@pytest.mark.parametrize("name", ["02.jpg", "04.png"])
def test_bytes_after_the_end_of_an_image_are_not_read(folder: Path, name: str, more: bytes | None) -> None:
    if not (folder / name).exists():
        write(folder / name)
    whole = (folder / name).read_bytes()
    expected = image_file.decode(folder / name, cv2.IMREAD_GRAYSCALE)
    (folder / name).write_bytes(whole + (whole if more is None else more))  # of a multi-picture file, the first one
    np.testing.assert_array_equal(image_file.decode(folder / name, cv2.IMREAD_GRAYSCALE), expected)
    (folder / name).write_bytes(whole[: len(whole) * 2 // 3] + bytes(5000))
    refused(folder, SINGLE, InputError, f"{name} is damaged")


@pytest.mark.parametrize("tag", [2, 3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("name", ["01.jpg", "01.png", "01.tif"])
def test_an_orientation_tag_turns_no_pixel_and_is_named(tmp_path: Path, name: str, tag: int) -> None:
    write(tmp_path / "00.png")
    noise = np.random.default_rng(tag).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    picture = Image.fromarray(noise).resize((64, 48))
    exif = Image.Exif()
    exif[0x0112] = tag
    picture.save(tmp_path / name, exif=exif)
    images = read_folder(tmp_path, SINGLE)
    assert images.notes == (
        f"1 of 2 images of camera 'camera' have an orientation tag ({image_file.ORIENTATIONS[tag]}); pixels were taken "
        "as they are stored",
    )
    off = np.abs(images.pixels(1, 0) - np.asarray(picture, float)).mean()
    assert off == 0.0 or (name == "01.jpg" and off < 5.0)
    assert images.gray(1, 0).shape == (48, 64)


def test_a_file_that_says_it_is_huge_is_asked_for_no_orientation(tmp_path: Path) -> None:
    data = bytearray(cv2.imencode(".jpg", np.zeros((8, 8), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = (20_000).to_bytes(2, "big") * 2
    (tmp_path / "huge.jpg").write_bytes(data)
    assert image_file.orientation(tmp_path / "huge.jpg") == ""


@pytest.mark.parametrize("content", [b"", b"not a picture at all"])
def test_file_that_is_no_image_is_named(folder: Path, content: bytes) -> None:
    (folder / "03.jpg").write_bytes(content)
    refused(folder, SINGLE, InputError, "03.jpg is damaged")


def test_image_of_another_size_is_named_with_both_sizes(folder: Path) -> None:
    write(folder / "02.jpg", 80, 60)
    refused(folder, SINGLE, InputError, "02.jpg is 80x60 pixels.*64x48")


def test_damaged_times_are_refused(folder: Path) -> None:
    (folder / "times.csv").write_text("image,time_s\n01.jpg,soon\n")
    refused(folder, SINGLE, FormatError, "line 2")
    (folder / "times.csv").write_text("name,when\n01.jpg,1\n")
    refused(folder, SINGLE, FormatError, "no column 'image'")


def test_times_of_a_spreadsheet_are_read(folder: Path) -> None:
    """It begins with a byte order mark; a space may follow each comma."""
    (folder / "times.csv").write_text("\ufeffimage, time_s\n01.jpg, 0.5\n")
    assert read_folder(folder, SINGLE).time_s[1] == 0.5


def test_times_of_other_images_are_refused(folder: Path) -> None:
    (folder / "times.csv").write_text("image,time_s\nfront/01.jpg,0.5\nfront/02.jpg,0.6\n")
    refused(folder, SINGLE, InputError, r"names none of the images in .* as in 00\.jpg, not 'front/01\.jpg'")
    (folder / "times.csv").write_text("image,time_s\nfront/01.jpg,0.5\n02.jpg,0.6\n")
    assert read_folder(folder, SINGLE).time_s[2] == 0.6


def test_other_files_beside_the_images_are_left_alone(folder: Path) -> None:
    (folder / "notes.txt").write_text("windy")
    shutil.copy(folder / "00.jpg", folder / ".hidden.jpg")
    assert read_folder(folder, SINGLE).count == 4


def test_a_table_that_names_an_image_twice_is_refused(tmp_path: Path) -> None:
    (tmp_path / "times.csv").write_text("image,time_s\na.png,0.0\nb.png,0.1\na.png,0.2\n")
    with pytest.raises(FormatError, match=r"line 4: a\.png is listed twice"):
        read_table(tmp_path / "times.csv", ("image", "time_s"))
