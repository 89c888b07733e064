"""A lens that the trial made one of another kind is told to COLMAP in a copy of its database."""

from pathlib import Path

import pycolmap

from mapping.camera.rig import Rig, forward_camera
from mapping.sparse.calibration import calibration
from mapping.sparse.mapper import colmap_model

GUESSED = Rig((forward_camera("RADIAL_FISHEYE", 848, 480, [377.0, 424.0, 240.0, 0.06, -0.002], name="camera"),))
FREED = [376.0, 376.0, 424.0, 240.0, 0.03, 0.08, -0.08, 0.03]
CORRECTED = Rig((forward_camera("OPENCV_FISHEYE", 848, 480, FREED, name="camera"),))


def written(path: Path, rig: Rig) -> Path:
    with pycolmap.Database.open(path) as opened:
        opened.write_camera(colmap_model.colmap_camera(rig.cameras[0], camera_id=1), use_camera_id=True)
    return path


def lens(path: Path) -> pycolmap.Camera:
    with pycolmap.Database.open(path) as opened:
        return opened.read_camera(1)


def test_a_lens_of_another_kind_is_told_to_colmap_in_a_copy(tmp_path):
    database = written(tmp_path / "matches.db", GUESSED)
    (tmp_path / "copy").mkdir()
    told = calibration._with_lenses(database, CORRECTED, tmp_path / "copy")
    camera, kept = lens(told), lens(database)
    assert (camera.model, list(camera.params)) == (pycolmap.CameraModelId.OPENCV_FISHEYE, FREED)
    assert kept.model == pycolmap.CameraModelId.RADIAL_FISHEYE


def test_a_lens_of_the_same_kind_needs_no_copy(tmp_path):
    database = written(tmp_path / "matches.db", GUESSED)
    assert calibration._with_lenses(database, GUESSED, tmp_path) == database
