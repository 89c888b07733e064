"""Kalibr's and COLMAP's rigs: the same rays as there, the same places, and refusals in one sentence."""

import cv2
import numpy as np
import pytest

from flight import FormatError, InputError
from mapping import rig_import

EQUI = """
cam0:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [-0.012, 0.002, -0.0008, 0.0001]
  intrinsics: [284.0, 285.0, 319.5, 239.5]
  resolution: [640, 480]
  rostopic: /cam0
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: [-0.05, 0.01, 0.0002, -0.0003]
  intrinsics: [460.0, 461.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam1
"""


def written(tmp_path, text: str, name: str = "camchain.yaml"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_a_kalibr_fisheye_sees_every_ray_where_opencv_does_half_a_pixel_on(tmp_path):
    camera = rig_import.read_kalibr(written(tmp_path, EQUI)).cameras[0]
    rays = np.random.default_rng(0).normal(size=(50, 3)) * [0.8, 0.6, 0.1] + [0.0, 0.0, 1.0]
    K = np.array([[284.0, 0.0, 319.5], [0.0, 285.0, 239.5], [0.0, 0.0, 1.0]])
    k = np.array([-0.012, 0.002, -0.0008, 0.0001])
    theirs = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K, k)[0][:, 0]
    np.testing.assert_allclose(camera.project(rays), theirs + 0.5, atol=1e-6)


def test_an_ordinary_lens_is_held_within_a_pixel(tmp_path):
    camera = rig_import.read_kalibr(written(tmp_path, EQUI)).cameras[1]
    u, v = np.meshgrid(np.linspace(-0.65, 0.65, 9), np.linspace(-0.5, 0.5, 9))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
    K = np.array([[460.0, 0.0, 320.0], [0.0, 461.0, 240.0], [0.0, 0.0, 1.0]])
    theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array([-0.05, 0.01, 0.0002, -0.0003]))[0][:, 0]
    assert np.abs(camera.project(rays) - theirs - 0.5).max() < 1.0


def test_the_second_camera_sits_where_the_chain_says(tmp_path):
    rig = rig_import.read_kalibr(written(tmp_path, EQUI))
    assert rig.baseline_m == pytest.approx(0.11)
    # camera x is to the right: the second camera sits 11 cm to the right of the first, which looks along body x
    np.testing.assert_allclose(rig["cam1"].T_body_camera[:3, 3], [0.0, -0.11, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("camera_model: pinhole", "camera_model: omni"), "omni"),
        (("[640, 480]", "[640]"), "resolution"),
        (("284.0", "wide"), "intrinsics"),
        (("[1.0, 0.0, 0.0, -0.11]", "[2.0, 0.0, 0.0, -0.11]"), "rigid"),
        (("cam0:", "cam9:"), "camchain"),
        (("cam0:", "cam0: ["), "YAML"),
        (("-0.05, 0.01", "-5.0, 9.0"), "calibrate"),
        (("cam0:", "x: !!python/object/apply:os.system [true]\ncam0:"), "YAML|camchain"),
    ],
)
def test_a_camchain_that_cannot_be_is_refused(tmp_path, change, words):
    with pytest.raises((FormatError, InputError), match=words):
        rig_import.read_kalibr(written(tmp_path, EQUI.replace(*change)))


COLMAP = """# Camera list with one line of data per camera:
1 OPENCV_FISHEYE 640 480 284 285 320 240 -0.012 0.002 -0.0008 0.0001
2 SIMPLE_RADIAL 640 480 600 320 240 -0.02
"""
RIGS = "1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 -0.08 0 0\n"


def test_colmap_cameras_keep_their_lens_and_take_the_rig_s_places(tmp_path):
    rig = rig_import.read_colmap(written(tmp_path, COLMAP, "cameras.txt"), written(tmp_path, RIGS, "rigs.txt"))
    assert rig["camera1"].params.tolist() == [284, 285, 320, 240, -0.012, 0.002, -0.0008, 0.0001]
    assert rig.baseline_m == pytest.approx(0.08)
    np.testing.assert_allclose(rig["camera2"].T_body_camera[:3, 3], [0.0, -0.08, 0.0], atol=1e-12)
    ray, r2 = np.array([[0.3, 0.2, 1.0]]), 0.13
    expected = 600 * ray[0, :2] * (1.0 - 0.02 * r2) + [320, 240]
    assert np.abs(rig["camera2"].project(ray)[0] - expected).max() < 0.1


@pytest.mark.parametrize(
    ("cameras", "rigs", "words"),
    [
        (COLMAP, None, "--rig"),
        ("", None, "no camera"),
        ("1 FOV 640 480 1 2 3 4 5\n", None, "FOV"),
        ("1 PINHOLE 640 480 1 2 3\n", None, "3 params"),
        ("1 PINHOLE 640 480 a b c d\n", None, "finite"),
        (COLMAP, "1 2 CAMERA 1 CAMERA 2 0\n", "no pose"),
        (COLMAP, "1 1 CAMERA 1\n", "does not place camera 2"),
        (COLMAP, "1 2 IMU 1 CAMERA 2 1 1 0 0 0 0 0 0\n", "cameras only"),
    ],
)
def test_colmap_files_that_cannot_be_are_refused(tmp_path, cameras, rigs, words):
    rig_file = None if rigs is None else written(tmp_path, rigs, "rigs.txt")
    with pytest.raises((FormatError, InputError), match=words):
        rig_import.read_colmap(written(tmp_path, cameras, "cameras.txt"), rig_file)
