"""Kalibr's and COLMAP's rigs: the same rays as there, the same places, and refusals in one sentence."""

import dataclasses

import cv2
import numpy as np
import pytest

from flight import FormatError, InputError, frames, rotations
from mapping.camera import rig_export, rig_import, yaml_import
from mapping.camera.rig import Rig

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
    camera = yaml_import.read(written(tmp_path, EQUI))[0].cameras[0]
    rays = np.random.default_rng(0).normal(size=(50, 3)) * [0.8, 0.6, 0.1] + [0.0, 0.0, 1.0]
    K = np.array([[284.0, 0.0, 319.5], [0.0, 285.0, 239.5], [0.0, 0.0, 1.0]])
    k = np.array([-0.012, 0.002, -0.0008, 0.0001])
    theirs = cv2.fisheye.projectPoints(rays[:, None], np.zeros(3), np.zeros(3), K, k)[0][:, 0]
    np.testing.assert_allclose(camera.project(rays), theirs + 0.5, atol=1e-6)


def test_an_ordinary_lens_is_opencv_s(tmp_path):
    camera = yaml_import.read(written(tmp_path, EQUI))[0].cameras[1]
    u, v = np.meshgrid(np.linspace(-0.65, 0.65, 9), np.linspace(-0.5, 0.5, 9))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
    K = np.array([[460.0, 0.0, 320.0], [0.0, 461.0, 240.0], [0.0, 0.0, 1.0]])
    theirs = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array([-0.05, 0.01, 0.0002, -0.0003]))[0][:, 0]
    np.testing.assert_allclose(camera.project(rays), theirs + 0.5, atol=1e-6)


def test_kalibr_s_eucm_has_alpha_and_beta_in_front(tmp_path):
    text = EQUI.replace(
        "camera_model: pinhole\n  distortion_model: equidistant", "camera_model: eucm\n  distortion_model: none"
    )
    text = text.replace("intrinsics: [284.0", "intrinsics: [0.6, 1.1, 284.0")
    camera = yaml_import.read(written(tmp_path, text))[0].cameras[0]
    assert camera.model == "EUCM"
    assert camera.params.tolist() == [284.0, 285.0, 320.0, 240.0, 0.6, 1.1]


BASALT = """{"value0": {
 "T_imu_cam": [{"px": 0.0, "py": 0.0, "pz": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0},
               {"px": 0.11, "py": 0.0, "pz": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}],
 "intrinsics": [{"camera_type": "kb4", "intrinsics": {"fx": 284, "fy": 285, "cx": 319.5, "cy": 239.5,
                 "k1": -0.012, "k2": 0.002, "k3": -0.0008, "k4": 0.0001}},
                {"camera_type": "eucm", "intrinsics": {"fx": 300, "fy": 300, "cx": 319.5, "cy": 239.5,
                 "alpha": 0.6, "beta": 1.1}}],
 "resolution": [[640, 480], [640, 480]]}}"""


def test_basalt_s_rig_is_kalibr_s(tmp_path):
    rig = rig_import.read_basalt(written(tmp_path, BASALT, "calibration.json"))
    kalibr = yaml_import.read(written(tmp_path, EQUI))[0]
    np.testing.assert_array_equal(rig["cam0"].params, kalibr["cam0"].params)
    np.testing.assert_allclose(rig["cam1"].T_body_camera, kalibr["cam1"].T_body_camera, atol=1e-12)
    assert rig["cam1"].model == "EUCM"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("kb4", "ds"), "cam0 is ds"),
        (('"k4": 0.0001', '"k9": 1'), "k4"),
        (("value0", "value1"), "value0"),
        (("[640, 480]]", "[640]]"), "Basalt"),
        (('"qw": 1.0', '"qw": "w"'), "Basalt"),
        (('"qw": 1.0', '"qw": 0.0'), "quaternion"),
        (('"qw": 1.0', '"qw": NaN'), "quaternion"),
        (('"px": 0.11', '"px": 1e999'), "finite"),
        (("[640, 480]]", "[1e999, 480]]"), "Basalt"),
    ],
)
def test_a_basalt_file_that_cannot_be_is_refused(tmp_path, change, words):
    with pytest.raises((FormatError, InputError), match=words):
        rig_import.read_basalt(written(tmp_path, BASALT.replace(*change), "calibration.json"))


def test_what_is_written_for_colmap_is_read_back_and_taken_by_colmap(tmp_path):
    import pycolmap

    first, second = rig_import.read_basalt(written(tmp_path, BASALT, "calibration.json"))
    rig = Rig((dataclasses.replace(first, name="front: left"), dataclasses.replace(second, name="down")))
    rig_export.write_colmap(tmp_path, rig)
    back = rig_import.read_colmap(tmp_path / "cameras.txt", tmp_path / "rigs.txt")
    for a, b in zip(rig, back, strict=True):
        assert a.name == b.name
        np.testing.assert_array_equal(a.params, b.params)
        np.testing.assert_allclose(a.T_body_camera, b.T_body_camera, atol=1e-12)
    for name in ("images.txt", "frames.txt", "points3D.txt"):
        (tmp_path / name).touch()
    theirs = pycolmap.Reconstruction(tmp_path)
    assert [c.model.name for _, c in sorted(theirs.cameras.items())] == ["OPENCV_FISHEYE", "EUCM"]


def test_tum_s_rows_hold_time_place_and_the_quaternion_with_w_last(tmp_path):
    T = frames.transform(rotations.exp([[0.3, -0.2, 0.9]]), [[1.0, 2.0, 3.0]])
    rig_export.write_tum(tmp_path / "poses.tum", np.array([12.5]), T)
    row = np.loadtxt(tmp_path / "poses.tum")
    np.testing.assert_allclose(row[:4], [12.5, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(rotations.matrix(row[[7, 4, 5, 6]]), T[0, :3, :3], atol=1e-12)
    with pytest.raises(InputError, match="no times"):
        rig_export.write_tum(tmp_path / "poses.tum", np.array([np.nan]), T)


def test_the_second_camera_sits_where_the_chain_says(tmp_path):
    rig = yaml_import.read(written(tmp_path, EQUI))[0]
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
        (("-0.05, 0.01", "-5.0, 9.0"), "folds over"),
        (("cam0:", "x: !!python/object/apply:os.system [true]\ncam0:"), "YAML|camchain"),
    ],
)
def test_a_camchain_that_cannot_be_is_refused(tmp_path, change, words):
    with pytest.raises((FormatError, InputError), match=words):
        yaml_import.read(written(tmp_path, EQUI.replace(*change)))


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
        ("1 SIMPLE_RADIAL 65535 65535 3300 320 240 -0.02\n", None, "folds over"),
        ("1 FOV 640 480 1 2 3 4 5\n", None, "FOV"),
        ("1 PINHOLE 640 480 1 2 3\n", None, "3 params"),
        ("1 PINHOLE 640 480 a b c d\n", None, "finite"),
        (COLMAP, "1 2 CAMERA 1 CAMERA 2 0\n", "no pose"),
        (COLMAP, "1 1 CAMERA 1\n", "does not place camera 2"),
        (COLMAP, "1 2 CAMERA 1 CAMERA 2 1 0 0 0 0 -0.08 0 0\n", "quaternion"),
        (COLMAP, "1 2 IMU 1 CAMERA 2 1 1 0 0 0 0 0 0\n", "cameras only"),
    ],
)
def test_colmap_files_that_cannot_be_are_refused(tmp_path, cameras, rigs, words):
    rig_file = None if rigs is None else written(tmp_path, rigs, "rigs.txt")
    with pytest.raises((FormatError, InputError), match=words):
        rig_import.read_colmap(written(tmp_path, cameras, "cameras.txt"), rig_file)
