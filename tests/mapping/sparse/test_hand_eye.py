"""Where a camera sits on a tracked thing: found from motions of both, and what they leave open is said, not guessed."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight import FloatArray, frames, rotations
from mapping.sparse.recorded_motion import hand_eye
from mapping.sparse.recorded_motion.hand_eye import HandEye

COUNT = 40
T_TRACKED_CAMERA = frames.transform(rotations.exp([0.4, -1.2, 2.3]), [0.1, -0.2, 0.3])
TURN_NOISE_RAD, SHIFT_NOISE_M = np.radians(0.2), 0.003
PAIRS = np.array([(a, b) for a in range(COUNT) for b in range(a + 1, min(a + 6, COUNT))])
T_S = np.linspace(0.0, 6.0, COUNT)
PATH_M = np.stack([0.5 * T_S, np.sin(T_S), 0.3 * np.cos(1.3 * T_S)], axis=-1)
ALL_AXES = np.stack([0.3 * np.sin(1.7 * T_S), 0.2 * np.cos(1.1 * T_S), 0.7 * np.sin(0.8 * T_S)], axis=-1)
YAW_ONLY, NO_TURN = ALL_AXES * [0.0, 0.0, 1.0], 0.0 * ALL_AXES


def moved(turns: FloatArray, positions_m: FloatArray = PATH_M) -> FloatArray:
    """(n, 4, 4) poses of the tracked thing."""
    return frames.transform(rotations.exp(turns), positions_m)


def motions(T: FloatArray, pairs: np.ndarray = PAIRS) -> FloatArray:
    return frames.invert(T[pairs[:, 1]]) @ T[pairs[:, 0]]


def noisy(T: FloatArray, rng: np.random.Generator) -> FloatArray:
    turns, shifts = (std * rng.normal(size=(len(T), 3)) for std in (TURN_NOISE_RAD, SHIFT_NOISE_M))
    return T @ frames.transform(rotations.exp(turns), shifts)


def calibrated(T: FloatArray, *, seed: int = 0) -> HandEye:
    """From recorded poses with noise."""
    recorded = noisy(T, np.random.default_rng(seed))
    return hand_eye.calibrate(motions(T @ T_TRACKED_CAMERA), motions(recorded))


def off(found: HandEye) -> FloatArray:
    """(7,) turn and shift of the camera from where it is, in its own frame, and scale from 1."""
    return np.append(hand_eye.difference(T_TRACKED_CAMERA[None], found.T_tracked_camera[None])[0], found.scale - 1.0)


@settings(max_examples=10)
@given(st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3), st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3))
def test_a_planted_place_is_found(turn: list[float], shift: list[float]) -> None:
    T = frames.transform(rotations.exp(turn), shift)
    poses = moved(ALL_AXES)
    found = hand_eye.calibrate(motions(poses @ T), motions(poses))
    np.testing.assert_allclose(found.T_tracked_camera, T, atol=1e-3)
    assert found.unexplained < 1e-3


@pytest.mark.parametrize("turns", [ALL_AXES, YAW_ONLY, NO_TURN], ids=["all axes", "yaw", "none"])
def test_the_covariance_states_the_error(turns: FloatArray) -> None:
    """Of the place, and of a motion about other axes that is predicted with it."""
    squares, predicted = [], []
    other = motions(moved(ALL_AXES))[[3, 50, 100]]
    true = frames.invert(T_TRACKED_CAMERA) @ other @ T_TRACKED_CAMERA
    for seed in range(8):
        found = calibrated(moved(turns), seed=seed)
        squares.append(off(found) @ np.linalg.solve(found.covariance, off(found)) / 7.0)
        each = hand_eye.difference(true, found.predicted(other))
        predicted.append(np.einsum("ni,nij,nj->n", each, np.linalg.inv(found.covariances(other)), each) / 6.0)
    assert np.mean(squares) < 1.6
    assert np.mean(predicted) < 1.6
    if turns is ALL_AXES:
        assert np.mean(squares) > 0.5  # nor is it called much larger than it is


def test_noise_is_measured() -> None:
    found = calibrated(moved(ALL_AXES))
    assert found.scale == pytest.approx(1.0, abs=0.01)
    assert found.turn_noise_rad == pytest.approx(np.sqrt(2.0) * TURN_NOISE_RAD, rel=0.2)
    assert found.shift_noise_m == pytest.approx(np.sqrt(2.0) * SHIFT_NOISE_M, rel=0.3)
    assert found.unexplained < 0.05


def test_wrong_motions_among_them_do_no_harm() -> None:
    rng = np.random.default_rng(0)
    poses = moved(ALL_AXES)
    recorded = motions(noisy(poses, rng))
    wrong = rng.choice(len(PAIRS), len(PAIRS) // 10, replace=False)
    recorded[wrong] = frames.transform(
        rotations.exp(rng.normal(size=(len(wrong), 3))), rng.normal(size=(len(wrong), 3))
    )
    found = hand_eye.calibrate(motions(poses @ T_TRACKED_CAMERA), recorded)
    assert np.abs(off(found)[:3]).max() < 0.01
    assert np.abs(off(found)[3:]).max() < 0.02


@pytest.mark.parametrize("times", [0.7, 1.0, 1.3])
def test_the_scale_of_recorded_motion_is_measured(times: float) -> None:
    recorded = noisy(moved(ALL_AXES), np.random.default_rng(0))
    recorded[:, :3, 3] *= times
    found = hand_eye.calibrate(motions(moved(ALL_AXES) @ T_TRACKED_CAMERA), motions(recorded))
    std = np.sqrt(found.covariance[6, 6])
    assert std < 0.02
    assert found.scale == pytest.approx(1.0 / times, abs=3.0 * std)
    np.testing.assert_allclose(found.T_tracked_camera, T_TRACKED_CAMERA, atol=0.02)


def test_turns_about_one_axis_leave_the_place_along_it_open() -> None:
    found = calibrated(moved(YAW_ONLY))
    along = T_TRACKED_CAMERA[:3, :3].T @ [0.0, 0.0, 1.0]
    across = T_TRACKED_CAMERA[:3, :3].T @ [1.0, 0.0, 0.0]
    place = found.covariance[3:6, 3:6]
    assert along @ place @ along == pytest.approx(1.0, rel=0.05)  # as little as was known beforehand
    assert np.sqrt(across @ place @ across) < 0.02
    yaw, pitch = (moved(np.array([[0.0, 0.0, 0.0], turn]), np.zeros((2, 3))) for turn in ([0, 0, 0.3], [0, 0.3, 0]))
    std_yaw, std_pitch = (
        np.sqrt(np.linalg.eigvalsh(found.covariances(motions(T, np.array([[0, 1]])))[0, 3:, 3:])[-1])
        for T in (yaw, pitch)
    )
    assert std_yaw < 0.02
    assert std_pitch == pytest.approx(0.3, rel=0.1)


def test_turns_on_the_spot_leave_heading_and_scale_open() -> None:
    """Where only noise was recorded, a scale of 0 would explain it."""
    found = calibrated(moved(YAW_ONLY, 0.0 * PATH_M))
    axis = T_TRACKED_CAMERA[:3, :3].T @ [0.0, 0.0, 1.0]
    assert np.sqrt(axis @ found.covariance[:3, :3] @ axis) > 0.5
    assert found.scale == pytest.approx(1.0, abs=0.01)


def test_an_uncertain_scale_makes_a_shift_uncertain() -> None:
    found = calibrated(moved(ALL_AXES))
    uncertain = dataclasses.replace(found, covariance=np.diag([*np.zeros(6), 0.3**2]), scale=1.0)
    ahead = frames.transform([1.0, 0.0, 0.0, 0.0], [0.4, 0.0, 0.0])[None]
    along = T_TRACKED_CAMERA[:3, :3].T @ [1.0, 0.0, 0.0]
    assert np.sqrt(along @ uncertain.covariances(ahead)[0, 3:, 3:] @ along) == pytest.approx(0.12, rel=0.05)


def test_motion_of_another_flight_stays_unexplained() -> None:
    other = moved(ALL_AXES[::-1], PATH_M[::-1] * [-1.0, 1.0, 1.0])
    found = hand_eye.calibrate(motions(moved(ALL_AXES) @ T_TRACKED_CAMERA), motions(other))
    assert found.unexplained > 0.3
