"""Selected images: enough parallax between them, the sharp ones, and few where the camera only turns or stands."""

import cv2
import numpy as np
import pytest

from flight import FloatArray, InputError, rotations
from mapping.camera import rig as rigs
from mapping.input import selection
from mapping.input.selection import SelectionOptions

CAMERA = rigs.forward_camera("PINHOLE", 320, 240, [200.0, 200.0, 160.0, 120.0])
NEAR_M, FAR_M = 2.0, 4.0
rng = np.random.default_rng(0)
PICTURES = [cv2.GaussianBlur(rng.integers(0, 255, (600, 800), dtype=np.uint8), (0, 0), 2.0) for _ in range(2)]
PICTURES = [cv2.normalize(p, None, 0, 255, cv2.NORM_MINMAX) for p in PICTURES]  # type: ignore[call-overload]


def view(x_m: float, yaw_rad: float = 0.0) -> np.ndarray:
    """Two walls, the upper half of the image nearer: what a camera at `x_m`, turned to the left, sees of them."""
    rays = CAMERA.unproject(CAMERA.pixel_centres()) @ rotations.matrix(rotations.exp([0.0, -yaw_rad, 0.0])).T
    halves = []
    for picture, depth_m in zip(PICTURES, (NEAR_M, FAR_M), strict=True):
        at = rays / rays[..., 2:] * depth_m + [x_m, 0.0, 0.0]
        u, v = (np.float32(100.0 * at[..., k] + o) for k, o in ((0, 400.0), (1, 300.0)))
        halves.append(cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT))
    return np.concatenate([halves[0][:120], halves[1][120:]])


def chosen(images: list[np.ndarray], **options: float) -> list[int]:
    return selection.choose(iter(images), CAMERA, SelectionOptions(**options))


def test_less_parallax_between_them_takes_more_images() -> None:
    steps_m = np.linspace(0.0, 1.0, 81)
    few, many = (chosen([view(x) for x in steps_m], parallax_rad=angle) for angle in (0.05, 0.02))
    assert few[0] == many[0] == 0
    assert 3 <= len(few) < len(many) < 40
    assert (np.diff(few) > 0).all()


def test_a_standing_camera_is_one_image() -> None:
    noise = [rng.normal(0.0, 2.0, (240, 320)) for _ in range(20)]
    assert chosen([np.clip(view(0.0) + n, 0, 255).astype(np.uint8) for n in noise]) == [0]


def test_a_turn_takes_fewer_images_than_a_step_aside_of_the_same_motion() -> None:
    turned = chosen([view(0.0, yaw) for yaw in np.linspace(0.0, 0.6, 61)])
    assert 3 <= len(turned) <= 1 + 0.6 / 0.07 / 1.5


def test_of_neighbours_the_sharp_one_is_chosen() -> None:
    images = [view(x) for x in np.linspace(0.0, 0.8, 61)]
    blurred = [k for k in range(1, 61) if k % 4]
    for k in blurred:
        images[k] = cv2.blur(images[k], (1, 9))
    found = chosen(images, parallax_rad=0.03)
    assert len(found) >= 4
    assert not set(found[1:-1]) & set(blurred)


def test_blank_images_do_not_hang_it() -> None:
    assert len(chosen([np.full((240, 320), 90, np.uint8)] * 35)) == 6


def test_a_rotation_is_found_and_leaves_no_parallax() -> None:
    directions: FloatArray = rng.normal(size=(200, 3)) + np.array([0.0, 0.0, 3.0])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    R = rotations.matrix(rotations.exp([0.1, -0.2, 0.3]))
    np.testing.assert_allclose(selection.rotation_between(directions, directions @ R.T), R, atol=1e-9)
    assert selection.parallax_rad(directions @ R.T, directions @ R.T) == 0.0
    about_x = rotations.matrix(rotations.exp([0.2, 0.0, 0.0]))
    across = np.array([[0.0, 0.6, 0.8], [0.0, 0.0, 1.0], [np.nan, 0.0, 1.0]])
    assert selection.parallax_rad(across, across @ about_x.T) == pytest.approx(0.2)


def test_options_out_of_range_are_refused() -> None:
    for wrong in ({"parallax_rad": 0.0}, {"parallax_rad": float("nan")}, {"least_overlap": 1.0}):
        with pytest.raises(InputError):
            SelectionOptions(**wrong)
