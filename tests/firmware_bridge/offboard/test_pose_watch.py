"""Poses that go on with new stamps and say nothing of the flight are found out; true ones never are."""

import numpy as np
import pytest

from firmware_bridge.offboard.pose_watch import APART_S, SAME_S, PoseWatch
from firmware_bridge.offboard.poses import Pose
from flight import rotations

PERIOD_S = 0.01


def tilted(angle_rad: float) -> np.ndarray:
    return rotations.exp(np.array([angle_rad, 0.0, 0.0]))


def up(angle_rad: float) -> np.ndarray:
    return rotations.matrix(tilted(angle_rad))[2]


def watched(true_rad, told_rad, *, shakes_m: float = 1e-4, flying: bool = True, seconds: float = 2.0) -> float | None:
    """When poses of tilt `told_rad(t)` are found out, of a vehicle with `true_rad(t)`; None: never."""
    watch, rng = PoseWatch(), np.random.default_rng(0)
    for k in range(round(seconds / PERIOD_S)):
        now_s = k * PERIOD_S
        watch.attitude(now_s, up(true_rad(now_s)))
        watch.pose(Pose(now_s - 0.02, shakes_m * rng.standard_normal(3), tilted(told_rad(now_s - 0.02))), flying=flying)
        if watch.lying:
            return now_s
    return None


def test_a_frozen_pose_is_found_out_while_the_vehicle_turns_away():
    """A frozen tilt of .1 rad is answered by a constant rate of 1 rad/s."""
    found_s = watched(lambda t: min(1.0 * max(t - 0.5, 0.0), 1.5), lambda t: 0.0)
    assert found_s is not None
    assert found_s == pytest.approx(0.5 + 0.25 + APART_S, abs=0.06)


def test_a_pose_that_repeats_to_the_last_bit_is_found_out_before_anything_turns():
    found_s = watched(lambda t: 0.0, lambda t: 0.0, shakes_m=0.0)
    assert found_s is not None
    assert found_s <= SAME_S + 2 * PERIOD_S


@pytest.mark.parametrize("flying", [True, False])
def test_true_poses_are_believed_in_quick_turns_and_by_a_firmware_that_errs_a_little(flying):
    assert watched(lambda t: np.sin(5.0 * t), lambda t: np.sin(5.0 * t) + 0.2, flying=flying) is None


def test_on_the_ground_nothing_is_held_against_a_pose():
    assert watched(lambda t: 0.0, lambda t: 0.0, shakes_m=0.0, flying=False) is None
    assert watched(lambda t: 0.5, lambda t: 0.0, flying=False) is None


def test_a_slow_stream_may_repeat_a_pose_once():
    watch = PoseWatch()
    for k in range(20):
        watch.pose(Pose(0.2 * k, np.full(3, float(k // 2)), tilted(0.0)), flying=True)
    assert not watch.lying


def test_a_liar_is_not_believed_again():
    watch = PoseWatch()
    for k in range(20):
        watch.pose(Pose(0.01 * k, np.zeros(3), tilted(0.0)), flying=True)
    assert watch.lying
    watch.pose(Pose(1.0, np.ones(3), tilted(0.1)), flying=True)
    assert watch.lying
