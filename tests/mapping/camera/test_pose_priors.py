"""Recorded poses in the adjustment: they hold a weak map, leave a strong one, and are worth what they leave."""

import functools

import numpy as np
import pytest

from flight import FloatArray, frames, rotations
from mapping.camera import adjustment, pose_priors
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.errors import State
from mapping.camera.pose_priors import Judged, Recorded
from tests.mapping.camera import formula

TIMES_S = np.arange(60) / 10.0
SAME = np.eye(4)
CM, DEG = 0.01, float(np.radians(1.0))
T_START_WORLD = frames.transform(rotations.from_yaw(1.0), [5.0, 2.0, 1.0])
T_BODY_THING = frames.transform(rotations.exp([0.4, -1.2, 2.3]), [0.05, -0.1, 0.08])


@functools.cache
def flown(places_each: int, noise_px: float, seed: int = 0) -> tuple[Observations, FloatArray]:
    """Features of places up to 6 m away along a fast flight of 24 m, and the true poses."""
    rng = np.random.default_rng(seed)
    true = formula.pose(TIMES_S)
    places = rng.uniform([-2.0, -4.0, -1.0], [32.0, 4.0, 5.0], (places_each * len(TIMES_S) // 24, 3))
    index, pixels = [], []
    for number, camera in enumerate(formula.RIG):
        for instant, T in enumerate(true):
            inside = frames.apply(frames.invert(T @ camera.T_body_camera), places)
            seen = camera.project(inside)
            shown = np.flatnonzero(camera.contains(seen) & (np.linalg.norm(inside, axis=1) < 6.0))
            index.append(np.column_stack([shown, np.full((len(shown), 2), [instant, number])]))
            pixels.append(seen[shown] + noise_px * rng.normal(size=(len(shown), 2)))
    found, at = np.concatenate(index), np.concatenate(pixels)
    often = np.bincount(found[:, 0], minlength=len(places))[found[:, 0]] > 1
    used, number = np.unique(found[often, 0], return_inverse=True)
    seen = Observations(
        formula.RIG, true, places[used], np.column_stack([number, found[often, 1:]]), at[often], TIMES_S
    )
    return seen, true


def weak() -> tuple[Observations, FloatArray]:
    """One match a square degree, and 1 px of noise."""
    return flown(30, 1.0)


def strong() -> tuple[Observations, FloatArray]:
    return flown(400, 0.2)


def recorded(
    turn: float = 0.2 * DEG,
    shift_m: float = CM,
    *,
    late_s: float = 0.0,
    wander_m: float = 0.0,
    factor: float = 1.0,
    T_body_thing: FloatArray = SAME,
    T_thing_body: FloatArray = SAME,
    stated: tuple[float, float] | None = None,
    seed: int = 1,
) -> Recorded:
    """Poses of a thing on the body, a frame of their own, every 25 ms."""
    rng = np.random.default_rng(seed)
    at_s = np.arange(-1.0, 8.0, 0.025)
    T = formula.pose(at_s) @ T_body_thing
    T = T @ frames.transform(rotations.exp(turn * rng.normal(size=(len(T), 3))), shift_m * rng.normal(size=(len(T), 3)))
    T[:, :3, 3] += wander_m * np.stack([np.sin(2.0 * np.pi * at_s / period) for period in (9.0, 5.0, 7.0)], axis=1)
    T = T_START_WORLD @ T
    T[:, :3, 3] *= factor
    q = rotations.from_matrix(T[:, :3, :3])

    def at(tried_s: float) -> FloatArray:
        when_s = TIMES_S + tried_s - late_s
        k = np.searchsorted(at_s, when_s) - 1
        share = (when_s - at_s[k]) / (at_s[k + 1] - at_s[k])
        places = T[k, :3, 3] + share[:, None] * (T[k + 1, :3, 3] - T[k, :3, 3])
        return frames.transform(rotations.slerp(q[k], q[k + 1], share), places)

    return Recorded("vio", at, T_thing_body, is_dense=True, std=stated)


def off(T: FloatArray, true: FloatArray) -> tuple[float, float]:
    """RMS of positions (m) and turns (rad) from the truth, after the similarity that fits best."""
    a, b = T[:, :3, 3] - T[:, :3, 3].mean(axis=0), true[:, :3, 3] - true[:, :3, 3].mean(axis=0)
    u, s, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    scale = s.sum() / (a**2).sum()
    turns = rotations.log(rotations.from_matrix(np.swapaxes(true[:, :3, :3], 1, 2) @ R @ T[:, :3, :3]))
    shift = b - scale * a @ R.T
    return float(np.sqrt((shift**2).sum(axis=1).mean())), float(np.sqrt((turns**2).sum(axis=1).mean()))


def held(seen: Observations, poses: Recorded) -> tuple[State, State, Judged]:
    """The map by its matches, with the priors, and what these are worth."""
    alone, _ = adjustment.adjust(seen, adjustment.initial(seen), [])
    found = pose_priors.adjusted(seen, alone, poses)
    assert found is not None
    return alone, found[0], found[2]


def test_poses_of_a_centimetre_hold_a_map_of_few_matches() -> None:
    seen, true = weak()
    alone, both, judged = held(seen, recorded())
    assert off(alone.T_world_body, true)[0] > 0.05
    assert off(both.T_world_body, true)[0] < 0.025  # of the poses alone: 17 mm
    assert off(both.T_world_body, true)[1] < 0.4 * off(alone.T_world_body, true)[1]
    assert judged.shift_std_m == pytest.approx(CM, rel=0.35)  # interpolated between two
    assert judged.turn_std_rad == pytest.approx(0.2 * DEG, rel=0.35)


@pytest.mark.parametrize("noise", [(0.2 * DEG, CM), (1.0 * DEG, 10.0 * CM)])
def test_poses_that_are_worse_than_a_map_leave_it(noise: tuple[float, float]) -> None:
    seen, true = strong()
    alone, both, judged = held(seen, recorded(*noise))
    assert off(both.T_world_body, true)[0] < 1.5 * off(alone.T_world_body, true)[0]
    assert judged.shift_std_m == pytest.approx(noise[1], rel=0.35)


def test_poses_that_are_better_than_a_map_make_it_better() -> None:
    seen, true = strong()
    alone, both, _ = held(seen, recorded(0.05 * DEG, 0.05 * CM))
    assert off(both.T_world_body, true)[0] < 0.75 * off(alone.T_world_body, true)[0]


def test_poses_that_wander_do_not_count_as_many() -> None:
    seen, true = strong()
    alone, both, judged = held(seen, recorded(0.01 * DEG, 0.1 * CM, wander_m=0.03))
    assert judged.correlation > 0.8
    assert off(both.T_world_body, true)[0] < 1.2 * off(alone.T_world_body, true)[0]


@pytest.mark.parametrize("scene", [weak, strong])
@pytest.mark.parametrize("late_s", [0.05, -0.05])
def test_a_clock_that_is_50_ms_off_is_found_and_allowed_for(scene, late_s: float) -> None:
    seen, true = scene()
    _, right, _ = held(seen, recorded())
    _, both, judged = held(seen, recorded(late_s=late_s))
    assert judged.late_s == pytest.approx(late_s, abs=0.004)
    assert off(both.T_world_body, true)[0] == pytest.approx(off(right.T_world_body, true)[0], rel=0.3)
    assert "clock is 0.0" in judged.text
    assert ("late" if late_s > 0.0 else "early") in judged.text


def test_neither_frame_nor_scale_nor_place_of_the_tracked_thing_pulls_at_the_map() -> None:
    seen, true = strong()
    alone, both, _ = held(seen, recorded(factor=1.1, T_body_thing=T_BODY_THING, T_thing_body=NEARLY))
    sizes = [np.ptp(state.T_world_body[:, :3, 3], axis=0).max() for state in (alone, both)]
    assert sizes[1] == pytest.approx(sizes[0], rel=5e-4)  # the rig's scale, not that of the poses
    assert off(both.T_world_body, true)[0] < 1.3 * off(alone.T_world_body, true)[0]


NEARLY = frames.invert(T_BODY_THING) @ frames.transform(rotations.exp([0.0, 0.03, 0.0]), [0.05, 0.0, -0.04])
"""The body on the thing, as matches would tell it: some centimetres and degrees off."""


def test_a_stated_deviation_holds_unless_the_residuals_are_larger() -> None:
    seen, _ = strong()
    assert held(seen, recorded(stated=(2.0 * DEG, 5.0 * CM)))[2].shift_std_m == pytest.approx(5.0 * CM)
    assert held(seen, recorded(shift_m=5.0 * CM, stated=(0.2 * DEG, CM)))[2].shift_std_m > 3.0 * CM


def test_one_pose_far_off_does_not_move_its_image() -> None:
    seen, true = weak()
    poses = recorded()

    def with_one_wrong(late_s: float) -> FloatArray:
        T = poses.at(late_s).copy()
        T[20, :3, 3] += [1.0, -2.0, 0.5]
        return T

    _, both, _ = held(seen, Recorded("vio", with_one_wrong, np.eye(4), is_dense=True))
    moved = both.T_world_body[[19, 20, 21], :3, 3] - true[[19, 20, 21], :3, 3]
    assert np.linalg.norm(moved[1] - moved[[0, 2]].mean(axis=0)) < 0.15


def test_the_trial_is_that_of_the_matches_and_the_shape_is_surer_with_priors() -> None:
    seen, true = flown(100, 0.5)
    alone, both = trials.hold(seen), trials.hold(seen, recorded())
    assert [f.candidate for f in both.present] == [f.candidate for f in alone.present]
    assert both.scale_std == alone.scale_std
    assert both.priors is not None
    assert alone.shape_std is not None
    assert both.shape_std is not None
    assert np.median(both.shape_std) < np.median(alone.shape_std)
    assert off(both.T_world_body, true)[0] < 3.0 * np.sqrt(np.mean(both.shape_std**2))


def test_fewer_than_six_poses_hold_nothing() -> None:
    seen, _ = strong()
    poses = recorded()

    def five(late_s: float) -> FloatArray:
        T = poses.at(late_s).copy()
        T[5:] = np.nan
        return T

    state = adjustment.initial(seen)
    assert pose_priors.adjusted(seen, state, Recorded("vio", five, np.eye(4), is_dense=True)) is None


def jumping(T: FloatArray) -> FloatArray:
    T[30:, :3, 3] += [0.3, -0.3, 0.2]
    return T


def turning(T: FloatArray) -> FloatArray:
    T[35:] = frames.transform(rotations.from_yaw(0.1), [0.0, 0.0, 0.0]) @ T[35:]
    return T


def growing(T: FloatArray) -> FloatArray:
    T[:, :3, 3] *= np.linspace(1.0, 1.3, len(T))[:, None]
    return T


@pytest.mark.parametrize("wrong", [jumping, turning, growing])
def test_poses_with_a_jump_or_a_drift_of_scale_are_refused_and_leave_the_map(wrong) -> None:
    seen, _ = weak()
    poses = recorded()
    alone, both, judged = held(
        seen, Recorded("vio", lambda late_s: wrong(poses.at(late_s).copy()), SAME, is_dense=True)
    )
    assert both is alone
    assert "jump" in judged.refused
    assert judged.refused in judged.text
    assert "clock" not in judged.text


def test_poses_that_do_not_settle_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pose_priors, "_ROUNDS", 1)
    seen, _ = weak()
    alone, both, judged = held(seen, recorded())
    assert both is alone
    assert "did not settle" in judged.text


def test_what_all_priors_share_is_not_known_in_the_deviations_of_shape_and_clock() -> None:
    """Errors of the map over what is stated, and of a right clock, over draws: neither is overconfident."""
    ratios, clocks = [], []
    for seed in range(3):
        seen, true = flown(30, 1.0, seed)
        alone, _ = adjustment.adjust(seen, adjustment.initial(seen), [])
        found = pose_priors.adjusted(seen, alone, recorded(seed=seed + 1))
        assert found is not None
        state, pull, judged = found
        std = adjustment.Normal(seen, state, [], pull=pull).shape_std(state)
        ratios.append(off(state.T_world_body, true)[0] / np.sqrt(np.nanmean(std**2)))
        clocks.append(judged.late_s / judged.late_std_s)
    assert np.sqrt(np.mean(np.square(ratios))) < 1.3
    assert np.abs(clocks).max() < 3.0
