"""The scores of a map separate an accurate one from an inaccurate, an incomplete and an unsafe one."""

import numpy as np
import pytest

import esdf
from flight import frames, rotations
from goshawk.rendered import accuracy as map_accuracy
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world

SCENE = rendered_room.furnished()
RIG = rendered_world.default_rig(0.1)
CAMERAS = [(camera, T @ camera.T_body_camera) for T in rendered_world.loop_flight(12).T_world_body for camera in RIG]
SEEN = map_accuracy.seen_surface(SCENE, CAMERAS, rng=np.random.default_rng(2))
GRID = esdf.Grid.covering([-5.2, -4.2, -0.2], [5.2, 4.2, 3.4], 0.16)
STATE = esdf.rasterize(SCENE.scene, GRID)


def test_seen_points_lie_on_the_surface() -> None:
    assert len(SEEN) > 10_000
    assert np.abs(SCENE.distance(SEEN)).max() < 1e-9


def test_ground_truth_scores_perfectly() -> None:
    score = map_accuracy.compare(SCENE, SEEN, SEEN, STATE, GRID)
    assert score.median_error_m < 1e-9
    assert (score.share_within_5cm, score.seen_share_within_5cm) == (1.0, 1.0)
    assert (score.seen_share_free, score.seen_share_in_holes, score.free_share_in_matter) == (0.0, 0.0, 0.0)


def test_each_fault_lowers_its_own_score() -> None:
    shifted = map_accuracy.compare(SCENE, SEEN, SEEN + np.array([0.0, 0.0, 0.06]), STATE, GRID)
    assert shifted.share_within_5cm < 0.8
    thin = map_accuracy.compare(SCENE, SEEN, SEEN[SEEN[:, 0] < 0.0], STATE, GRID)
    assert thin.share_within_5cm == 1.0
    assert 0.3 < thin.seen_share_within_5cm < 0.7
    unsafe = STATE.copy()
    unsafe[: STATE.shape[0] // 2] = esdf.FREE
    score = map_accuracy.compare(SCENE, SEEN, SEEN, unsafe, GRID)
    assert 0.3 < score.seen_share_in_holes <= score.seen_share_free < 0.7
    assert score.free_share_in_matter > 0.05


def test_a_map_in_its_own_frame_scores_the_same() -> None:
    T_world_map = frames.transform(rotations.exp(np.array([0.2, 0.1, -0.4])), np.array([1.0, 2.0, 3.0]))
    score = map_accuracy.compare(
        SCENE, SEEN, frames.apply(frames.invert(T_world_map), SEEN), STATE, GRID, T_world_map=T_world_map
    )
    assert score.median_error_m == pytest.approx(0.0, abs=1e-9)
    assert score.seen_share_within_5cm == 1.0
