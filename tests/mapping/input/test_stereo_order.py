"""Two cameras side by side: what both see lies before them, and behind them if their folders are exchanged."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mapping
from flight import FloatArray, InputError, frames, rotations
from goshawk.rendered import world as rendered_world
from mapping.camera.rig import Camera, Rig
from mapping.input import examination, images, stereo_order
from mapping.input.stereo_order import Features

BASELINE_M = 0.11


def stereo(baseline_m: float = BASELINE_M) -> tuple[Camera, Camera]:
    left = rendered_world.default_rig(0.5).cameras[0]
    T_right = left.T_body_camera.copy()
    T_right[1, 3] -= baseline_m
    return (
        dataclasses.replace(left, name="left", folder="left"),
        dataclasses.replace(left, name="right", folder="right", T_body_camera=T_right),
    )


def seen(camera: Camera, points_body_m: FloatArray, descriptors: np.ndarray) -> Features:
    inside = frames.apply(frames.invert(camera.T_body_camera), points_body_m)
    return Features(inside / np.linalg.norm(inside, axis=1, keepdims=True), descriptors)


def pair(seed: int, cameras: tuple[Camera, Camera], farthest_m: float = 4.0) -> tuple[Features, Features]:
    """What two cameras see of 200 points before them, the second in another order, a tenth of it of other things."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((1.0, -1.0, -1.0), (farthest_m, 1.0, 1.0), (200, 3))
    descriptors = rng.integers(0, 256, (200, 32), dtype=np.uint8)
    order, others = rng.permutation(200), points.copy()
    others[:20] = rng.uniform((1.0, -1.0, -1.0), (farthest_m, 1.0, 1.0), (20, 3))
    return seen(cameras[0], points, descriptors), seen(cameras[1], others[order], descriptors[order])


@given(st.integers(0, 2**32 - 1))
def test_points_before_the_cameras_fit_the_given_order_and_the_exchanged_one_if_they_are_exchanged(seed) -> None:
    cameras = stereo()
    right, wrong = stereo_order.fitting(*pair(seed, cameras), cameras)
    assert not stereo_order.are_exchanged(np.array([(right, wrong)]))
    assert right > 150
    assert stereo_order.fitting(*pair(seed, cameras), (cameras[1], cameras[0])) == (wrong, right)
    assert stereo_order.are_exchanged(np.array([(wrong, right)]))


def test_cameras_at_one_place_and_things_far_away_tell_nothing() -> None:
    for cameras in (stereo(0.0), stereo(0.005)):
        assert stereo_order.fitting(*pair(0, cameras), cameras) == (0, 0)
    far = tuple(Features(each.rays, each.descriptors) for each in pair(0, stereo(), farthest_m=4.0))
    nearly = Features(far[0].rays, far[0].descriptors)
    assert stereo_order.fitting(nearly, nearly, stereo()) == (0, 0)  # no parallax at all
    none = Features(np.zeros((0, 3)), np.zeros((0, 32), np.uint8))
    assert stereo_order.fitting(none, far[1], stereo()) == (0, 0)


def test_some_instants_of_a_fast_flight_to_one_side_are_no_exchange_and_cameras_that_differ_are_not_asked() -> None:
    apart, together, silent = (0, 190), (25, 1), (3, 2)
    assert stereo_order.are_exchanged(np.array([apart] * 9 + [together] + [silent] * 20))
    assert not stereo_order.are_exchanged(np.array([apart] * 7 + [together] * 3))  # although their sum is 1330 to 75
    assert not stereo_order.are_exchanged(np.array([silent] * 40))
    left, right = stereo()
    assert stereo_order.can_tell((left, right))
    assert not stereo_order.can_tell((left, dataclasses.replace(right, width=right.width + 10)))
    for degrees, told in ((5.0, True), (15.0, False)):
        turned = right.T_body_camera.copy()
        turned[:3, :3] = rotations.matrix(rotations.from_yaw(np.radians(degrees))) @ turned[:3, :3]
        assert stereo_order.can_tell((left, dataclasses.replace(right, T_body_camera=turned))) is told


@pytest.mark.slow
def test_exchanged_folders_of_a_parallel_rig_are_named_before_a_map_is_made(tmp_path: Path) -> None:
    rig = Rig(stereo())
    flight = rendered_world.loop_flight(6, share=0.1)
    rendered_world.write_rendered_sequence(tmp_path / "right", rig=rig, flight=flight, seed=1)
    assert examination.examine(images.read_folder(tmp_path / "right", rig)).exchanged == ()
    (tmp_path / "right").rename(tmp_path / "wrong")
    for old, new in (("left", "kept"), ("right", "left"), ("kept", "right")):
        (tmp_path / "wrong" / old).rename(tmp_path / "wrong" / new)
    found = examination.examine(images.read_folder(tmp_path / "wrong", rig))
    assert set(found.exchanged) == {"left", "right"}
    assert "behind them" in found.problems[-1]
    with pytest.raises(InputError, match="seem to be exchanged"):
        mapping.build_map(tmp_path / "wrong", rig, tmp_path / "map")
