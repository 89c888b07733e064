"""`goshawk camera`, and what `goshawk map` says at once about a scale that nothing gives."""

import json

import cv2
import numpy as np
import pytest
from PIL import Image

import mapping
from mapping.camera import rig as rigs
from mapping.camera.rig import Camera, Rig, forward_camera
from tests.goshawk.running import run


@pytest.fixture
def photos(tmp_path):
    """Three pictures, 400 x 300, the first with EXIF of a 28 mm lens (on 35 mm film)."""
    folder = tmp_path / "photos"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for i in range(3):
        image = Image.fromarray(rng.integers(0, 255, (300, 400), dtype=np.uint8))
        exif = image.getexif()
        exif.get_ifd(0x8769)[0xA405] = 28
        image.save(folder / f"{i}.jpg", exif=exif)
    return folder


def test_exif_gives_the_focal_length_with_its_error(photos, tmp_path):
    document = json.loads(run("camera", "new", photos, "--quick", "--out", tmp_path / "c.toml", "--json"))
    camera = mapping.rig.load(tmp_path / "c.toml").cameras[0]
    assert camera.focal_px[0] == pytest.approx(28.0 * 500.0 / 43.27, rel=1e-3)
    assert "EXIF" in document["source"]
    assert not document["calibrated"]
    assert mapping.rig.load(tmp_path / "c.toml").refine_intrinsics


def test_without_exif_the_lens_is_marked_as_a_default(photos, tmp_path):
    for path in photos.iterdir():
        cv2.imwrite(str(path), np.zeros((300, 400), np.uint8))
    said = run("camera", "new", photos, "--quick", "--out", tmp_path / "c.toml")
    assert "default: EXIF names no focal length" in said
    assert "± 40.0 %" in said
    assert "the lens is a default" in said
    assert "scale" in said
    assert "--length" in said
    assert (tmp_path / "c.toml").read_text().startswith("# Lens of the images in photos: default: EXIF")


def test_images_that_cannot_be_placed_leave_the_first_guess_with_a_note(photos, tmp_path):
    said = run("camera", "new", photos, "--out", tmp_path / "c.toml")
    assert "could not be placed" in said


def test_folders_that_are_no_photographs_of_one_camera_are_refused(photos, tmp_path):
    out = ("--out", tmp_path / "c.toml")
    assert "does not exist" in run("camera", "new", tmp_path / "none", *out, code=2)
    assert "2 cameras" not in run("camera", "new", photos.parent, *out, code=2)
    assert "images of 1 cameras" in run("camera", "new", photos.parent, *out, code=2)
    cv2.imwrite(str(photos / "9.png"), np.zeros((400, 300), np.uint8))
    assert "one camera makes one size" in run("camera", "new", photos, *out, code=2)
    (photos / "9.png").write_bytes(b"\x89PNG")
    assert "damaged" in run("camera", "new", photos, *out, code=2)
    (photos / "9.png").unlink()
    for focal_px in (19, 40001, "nan"):
        said = run("camera", "new", photos, *out, "--focal-px", focal_px, code=2)
        assert f"a focal length of {focal_px} px is not from 20 to 40000 px" in said
    assert not (tmp_path / "c.toml").exists()


def test_a_missing_scale_is_reported_before_any_work(photos, tmp_path):
    run("camera", "new", photos, "--quick", "--out", tmp_path / "c.toml")
    said = run("map", "build", photos, "--camera", tmp_path / "c.toml", "--out", tmp_path / "m", code=1)
    for way in ("--length 13.2", "A.jpg,B.jpg", "A rig", "references.csv", "odometry"):
        assert way in said
    assert "checking images" not in said
    rows = "\n".join(["image,x_m,y_m,z_m", *(f"{i}.jpg,0,0,{i}" for i in range(3))])
    (photos / "references.csv").write_text(rows)
    assert "no metric scale" in run(
        "map", "build", photos, "--camera", tmp_path / "c.toml", "--out", tmp_path / "m", code=1
    )


def test_imports_write_what_map_reads(tmp_path):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 640 480 500 500 320 240\n")
    said = run("camera", "import", tmp_path / "cameras.txt", "--out", tmp_path / "c.toml")
    assert "not known" in said
    assert mapping.rig.load(tmp_path / "c.toml").cameras[0].folder == "."
    assert "--overwrite" in run("camera", "import", tmp_path / "cameras.txt", "--out", tmp_path / "c.toml", code=2)


def test_export_writes_what_import_reads(tmp_path):
    rigs.save(tmp_path / "camera.toml", Rig((forward_camera("EUCM", 640, 480, [300, 300, 320, 240, 0.6, 1.1]),)))
    run("camera", "export", tmp_path / "camera.toml", "--out", tmp_path / "colmap")
    again = tmp_path / "again.toml"
    run("camera", "import", tmp_path / "colmap" / "cameras.txt", "--out", again)
    assert rigs.load(again).cameras[0].params.tolist() == [300, 300, 320, 240, 0.6, 1.1]


def test_files_whose_cameras_cannot_be_compared_say_why(tmp_path):
    def written(name, camera):
        rigs.save(tmp_path / name, Rig((camera,)))
        return tmp_path / name

    first = written("a.toml", forward_camera("PINHOLE", 640, 480, [300, 300, 320, 240], name="front"))
    other = written("b.toml", forward_camera("PINHOLE", 640, 480, [300, 300, 320, 240], name="cam0"))
    said = run("camera", "compare", first, other, code=2)
    assert f"{first} has a camera 'front' and {other} does not (it has 'cam0')" in said
    assert "name them alike" in said
    narrow = Camera("front", ".", "PINHOLE", 640, 480, np.array([300, 300, 320, 240]), np.eye(4), 1e-6)
    assert "no direction is seen by both lenses" in run("camera", "compare", first, written("c.toml", narrow), code=2)
