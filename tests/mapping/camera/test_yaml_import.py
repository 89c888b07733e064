"""Calibrations in YAML of EuRoC, ROS and OpenCV: the rays of OpenCV, and what has no place here is said."""

import contextlib

import cv2
import numpy as np
import pytest

from flight import FlightError, InputError
from mapping.camera import yaml_import
from mapping.camera.rig import Camera

EUROC = """%YAML:1.0
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02, 1.0, 0.0, 0.0, -0.06, 0.0, 0.0, 1.0, 0.01, 0.0, 0.0, 0.0, 1.0]
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.0, 457.0, 367.0, 248.0]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.7e-05]
"""
INFO = """image_width: 752
image_height: 480
camera_name: cam
camera_matrix:
  rows: 3
  cols: 3
  data: [458.0, 0.0, 367.0, 0.0, 457.0, 248.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.28, 0.07, 0.0002, 1.7e-05, 0.0]
"""
OPENCV = """%YAML:1.0
---
image_width: 752
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 458., 0., 367., 0., 457., 248., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.28, 0.07, 0.0002, 1.7e-05, 0. ]
"""
VINS = """%YAML:1.0
---
model_type: PINHOLE
camera_name: camera
image_width: 752
image_height: 480
distortion_parameters: {k1: -0.28, k2: 0.07, p1: 0.0002, p2: 1.7e-05}
projection_parameters: {fx: 458.0, fy: 457.0, cx: 367.0, cy: 248.0}
"""
FISHEYE = """%YAML:1.0
---
model_type: KANNALA_BRANDT
image_width: 752
image_height: 480
projection_parameters: {k2: -0.012, k3: 0.002, k4: -0.0008, k5: 0.0001, mu: 458.0, mv: 457.0, u0: 367.0, v0: 248.0}
"""
KALIBR = """cam0:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [-0.01, 0.002, -0.0008, 0.0001]
  intrinsics: [284.0, 285.0, 320.0, 240.0]
  resolution: [640, 480]
  line_delay: 0.000035
  timeshift_cam_imu: 0.0123
"""
K = np.array([[458.0, 0.0, 367.0], [0.0, 457.0, 248.0], [0.0, 0.0, 1.0]])


def _read(tmp_path, text: str) -> tuple[Camera, tuple[str, ...]]:
    (tmp_path / "c.yaml").write_text(text)
    rig, notes = yaml_import.read(tmp_path / "c.yaml")
    return rig.cameras[0], notes


@pytest.mark.parametrize("text", [EUROC, INFO, OPENCV, VINS])
def test_a_lens_sees_every_ray_where_opencv_does_half_a_pixel_on(tmp_path, text):
    camera, _ = _read(tmp_path, text)
    u, v = np.meshgrid(np.linspace(-0.6, 0.6, 9), np.linspace(-0.4, 0.4, 9))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
    theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array([-0.28, 0.07, 0.0002, 1.7e-05]))[0][:, 0]
    np.testing.assert_allclose(camera.project(rays), theirs + 0.5, atol=1e-6)


def test_a_fisheye_of_camodocal_is_opencv_s(tmp_path):
    camera, _ = _read(tmp_path, FISHEYE)
    rays = np.random.default_rng(0).normal(size=(50, 3)) * [0.8, 0.6, 0.1] + [0.0, 0.0, 1.0]
    k = np.array([-0.012, 0.002, -0.0008, 0.0001])
    theirs = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K, k)[0][:, 0]
    np.testing.assert_allclose(camera.project(rays), theirs + 0.5, atol=1e-6)


def test_what_a_camera_file_has_no_place_for_is_said(tmp_path):
    _, notes = _read(tmp_path, KALIBR)
    assert [note.split(" = ")[0] for note in notes] == ["line_delay", "timeshift_cam_imu"]
    assert "T_BS" in _read(tmp_path, EUROC)[1][0]


def test_a_third_radial_term_or_another_lens_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="CALIB_FIX_K3"):
        _read(tmp_path, INFO.replace("1.7e-05, 0.0]", "1.7e-05, 0.2]"))
    with pytest.raises(InputError, match="MEI"):
        _read(tmp_path, VINS.replace("PINHOLE", "MEI"))


@pytest.mark.parametrize("text", [EUROC, INFO, OPENCV, VINS, FISHEYE, KALIBR])
def test_a_damaged_calibration_is_refused_or_read(tmp_path, text):
    rng = np.random.default_rng(0)
    lines = text.splitlines()
    for _ in range(60):
        k = rng.integers(len(lines))
        wrong = [line[: rng.integers(len(line) + 1)] if i == k else line for i, line in enumerate(lines)]
        with contextlib.suppress(FlightError):  # anything else is a fault
            _read(tmp_path, "\n".join(wrong))
