"""The inner loop's lag, by bodies whose lag is known."""

import re

import numpy as np
import pytest

from firmware_bridge.offboard.poses import Pose
from firmware_bridge.offboard.turning.inner_lag import ASSUMED_STD_S, InnerLag
from flight import rotations

ASSUMED_S, DELAY_S, TICK_S, FINE_S = 0.025, 0.006, 0.004, 0.001


def learnt(lags_s, *, seconds=8.0, size_rad_s=1.0, late_s=0.012, noise_rad=1e-3, pose_s=0.01, lost_s=(99.0, 99.0),
          gust_rad_s2=0.0, most_rad_s2=np.inf):  # fmt: skip
    """Of a body that turns about x and y as a curve does, with its lags; poses are noisy and late.

    Gusts turn it, and no torque turns it faster than `most_rad_s2`.
    """
    lag, rng = InnerLag(ASSUMED_S, DELAY_S), np.random.default_rng(2)
    q, rate, late = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), []
    sent = [(0.0, np.zeros(3))]
    for step in range(round(seconds / FINE_S)):
        now_s = step * FINE_S
        if step % round(TICK_S / FINE_S) == 0:
            asked = size_rad_s * np.array([np.sin(2.1 * now_s), np.cos(3.3 * now_s), 0.3])
            sent.append((now_s, asked))
            if lost_s[0] <= now_s < lost_s[1]:
                lag.forget()
                sent[-1] = (now_s, -asked)
            else:
                lag.command(now_s, asked)
        due = next(asked for time_s, asked in reversed(sent) if time_s <= max(now_s - DELAY_S, 0.0))
        turning = np.clip((due - rate) / np.array([*lags_s, ASSUMED_S]), -most_rad_s2, most_rad_s2)
        gusts = gust_rad_s2 * np.array([np.sin(5.0 * now_s), np.cos(4.0 * now_s), 0.0])
        rate += FINE_S * (turning + gusts)
        q = rotations.multiply(q, rotations.exp(FINE_S * rate))
        if step % round(pose_s / FINE_S) == 0:
            turned = rotations.exp(noise_rad * rng.standard_normal(3))
            late.append(Pose(now_s + FINE_S, np.zeros(3), rotations.multiply(q, turned)))
        while late and late[0].time_s <= now_s - late_s:
            lag.pose(late.pop(0))
    return lag


def flown(lags_s, **more):
    return learnt(lags_s, **more).found()


@pytest.mark.parametrize(
    ("lags_s", "more"),
    [
        ((0.04, 0.02), {}),
        ((0.025, 0.06), {"pose_s": 0.02}),
        ((0.04, 0.04), {"pose_s": 0.005, "late_s": 0.03}),
        ((0.04, 0.03), {"noise_rad": 3e-3, "size_rad_s": 2.0, "seconds": 16.0}),
        ((0.04, 0.03), {"lost_s": (3.0, 5.0)}),
    ],
)
def test_the_lag_of_each_axis_is_found_with_its_uncertainty(lags_s, more):
    lags, stds = flown(lags_s, **more)
    assert lags == pytest.approx(lags_s, abs=0.004)
    assert (np.abs(lags - lags_s) < 4.0 * stds + 5e-4).all()
    assert (stds < 0.005).all()


@pytest.mark.parametrize("more", [{"gust_rad_s2": 5.0}, {"gust_rad_s2": 10.0}, {"most_rad_s2": 2.0}])
def test_gusts_and_torques_that_are_short_are_not_taken_for_a_lag_that_is_known(more):
    """Where every turn counted for itself it was 8 or 69 ms, known to 3 or 1."""
    lags, stds = flown((ASSUMED_S, ASSUMED_S), **more)
    assert (np.abs(lags - ASSUMED_S) < 2.0 * stds).all()
    assert (stds <= 1.1 * ASSUMED_STD_S).all()
    assert lags == pytest.approx([ASSUMED_S, ASSUMED_S], abs=0.02)


@pytest.mark.parametrize("more", [{"size_rad_s": 0.15}, {"seconds": 0.3}])
def test_a_flight_that_hardly_turns_leaves_what_was_assumed(more):
    lags, stds = flown((0.06, 0.06), **more)
    assert lags == pytest.approx([ASSUMED_S, ASSUMED_S])
    assert stds == pytest.approx([ASSUMED_STD_S, ASSUMED_STD_S])


def test_what_was_found_is_told_with_what_it_may_be_too():
    """Poses of another clock that are 20 ms old passed for 20 ms of lag that was known to 3 ms."""
    lag = learnt((0.09, 0.03))
    axes = r"roll 6\d ms or more, pitch \d\d ms, known to \d+ ms"
    assert re.fullmatch(axes, lag.words(other_clock=False))
    assert re.fullmatch(f"{axes}, with the unknown age of poses of another clock", lag.words(other_clock=True))
    assert learnt((0.06, 0.06), seconds=0.3).words(other_clock=True) == "roll 25 ms, pitch 25 ms, as assumed"
