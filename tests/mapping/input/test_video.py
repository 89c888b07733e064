"""A video becomes the frames worth mapping, with their times; what is no whole video is refused in one sentence."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

import mapping
from flight import InputError, MapError
from goshawk.rendered import world as rendered_world
from mapping.camera import rig as rigs
from mapping.input import images as image_folder
from mapping.input import video
from mapping.input.selection import SelectionOptions

CAMERA = rigs.forward_camera("PINHOLE", 160, 120, [100.0, 100.0, 80.0, 60.0])
RIG = rigs.Rig((CAMERA,))
RATE_HZ = 25.0


def written(path: Path, frames: list[np.ndarray], codec: str = "MJPG") -> Path:
    height, width = frames[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), RATE_HZ, (width, height))
    assert writer.isOpened()
    for frame in frames:
        writer.write(cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def moving(count: int = 40) -> list[np.ndarray]:
    """A picture that slides and grows: what a camera sees that flies into a room."""
    picture = np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8)
    picture = cv2.normalize(cv2.GaussianBlur(picture, (0, 0), 3.0), None, 0, 255, cv2.NORM_MINMAX)  # type: ignore
    sizes = np.linspace(400, 200, count).astype(int)
    return [cv2.resize(picture[240 - s // 2 :][: s * 3 // 4, 320 - s // 2 :][:, :s], (160, 120)) for s in sizes]


def extracted(path: Path, folder: Path, rig: rigs.Rig = RIG) -> image_folder.ImageSet:
    folder.mkdir()
    video.extract(path, rig, folder, SelectionOptions())
    return image_folder.read_folder(folder, rig)


@pytest.mark.parametrize(("name", "codec"), [("a.avi", "MJPG"), ("a.mp4", "mp4v")])
def test_chosen_frames_come_with_their_times(tmp_path: Path, name: str, codec: str) -> None:
    images = extracted(written(tmp_path / name, moving(), codec), tmp_path / "frames")
    assert 3 <= len(images.instants) < 40
    numbers = np.array([int(Path(instant).stem) for instant in images.instants])
    np.testing.assert_allclose(images.time_s, numbers / RATE_HZ, atol=1e-3)
    assert images.pixels(0, 0).shape == (120, 160, 3)


def test_a_tag_that_asks_to_turn_a_video_turns_no_pixel_and_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mp4", moving(), "mp4v")
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 44  # of the track's header: 3 x 3, 16.16 and 2.30 (ISO/IEC 14496-12, 8.3.2)
    data[matrix : matrix + 20] = struct.pack(">5i", 0, 1 << 16, 0, -(1 << 16), 0)
    path.write_bytes(data)
    assert video.notes(path)[0].startswith("the video's tag asks to turn it by 90 deg")
    assert extracted(path, tmp_path / "frames").pixels(0, 0).shape == (120, 160, 3)
    portrait = rigs.Rig((rigs.forward_camera("PINHOLE", 120, 160, [100.0, 100.0, 60.0, 80.0]),))
    with pytest.raises(InputError, match=r"160x120 pixels as stored .*turn it by 90 deg"):
        extracted(path, tmp_path / "turned", portrait)


@pytest.mark.parametrize(("name", "codec"), [("a.avi", "MJPG"), ("a.mp4", "mp4v")])
def test_a_cut_off_video_is_refused(tmp_path: Path, name: str, codec: str) -> None:
    path = written(tmp_path / name, moving(), codec)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="cut off"):
        extracted(path, tmp_path / "frames")


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "empty.mp4").write_bytes(b"")
    for name in ("text.mp4", "empty.mp4"):
        with pytest.raises(InputError, match="cannot be opened as a video"):
            extracted(tmp_path / name, tmp_path / f"frames {name}")
    with pytest.raises(InputError, match="does not exist"):
        extracted(tmp_path / "none.mp4", tmp_path / "frames")


def test_a_video_without_frames_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "none.avi"
    cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, (160, 120)).release()
    with pytest.raises(InputError, match=r"no frame|cannot be opened"):
        extracted(path, tmp_path / "frames")


def test_a_video_of_another_camera_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.avi", [np.zeros((60, 80), np.uint8)] * 3)
    with pytest.raises(InputError, match="frames of 80x60 pixels"):
        extracted(path, tmp_path / "frames")
    with pytest.raises(InputError, match="has 2: give a folder"):
        extracted(path, tmp_path / "of a rig", rendered_world.default_rig())


def test_a_video_of_a_standing_camera_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.avi", moving()[:1] * 20)
    with pytest.raises(InputError, match="hardly moves in its 20 frames"):
        extracted(path, tmp_path / "frames")


def test_a_video_without_a_source_of_scale_is_refused_before_any_work(tmp_path: Path) -> None:
    path = written(tmp_path / "a.avi", moving())
    with pytest.raises(MapError, match="no metric scale"):
        mapping.build_map(path, RIG, tmp_path / "map")
    assert [file.name for file in tmp_path.iterdir()] == ["a.avi"]


def test_what_is_given_with_a_video_must_fit_its_frames(tmp_path: Path) -> None:
    path, references = written(tmp_path / "walk.avi", moving()), tmp_path / "references.csv"
    length = mapping.Length(1.0, ("000000.png", "x.png"))
    with pytest.raises(InputError, match=r"no 'x\.png'; .* go from 000000\.png to"):
        mapping.build_map(path, RIG, tmp_path / "map", mapping.MapOptions(length=length), until="check")
    references.write_text("image,x_m,y_m,z_m\nx.png,1,2,3\n")
    options = mapping.MapOptions(length=mapping.Length(1.0), references=references)
    with pytest.raises(InputError, match="names none of the images"):
        mapping.build_map(path, RIG, tmp_path / "map", options, until="check")


def test_times_that_do_not_increase_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the time of frame 2"):
        video._require_times(tmp_path, np.array([0.0, 0.1, 0.1, 0.2]))


def test_the_suffix_tells_a_video_from_a_folder(tmp_path: Path) -> None:
    (tmp_path / "walk.mp4").mkdir()
    assert not video.is_video(tmp_path / "walk.mp4")
    assert video.is_video(tmp_path / "WALK.MOV")
    assert not video.is_video(tmp_path / "images")
