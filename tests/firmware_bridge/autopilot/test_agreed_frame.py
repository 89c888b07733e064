"""Whether the autopilot may be told where to be."""

import numpy as np
import pytest

from firmware_bridge.autopilot.agreed_frame import AGREED_S, APART_M, OLD_S, AgreedFrame
from firmware_bridge.offboard.poses import Pose

AT = np.array([1.0, 2.0, 3.0])


def agreed(off_m=0.0, seconds=2.0 * AGREED_S) -> tuple[AgreedFrame, float]:
    frame, now_s = AgreedFrame(), 10.0
    while now_s < 10.0 + seconds:
        now_s += 0.04
        frame.pose(now_s, Pose(now_s, AT, np.array([1.0, 0.0, 0.0, 0.0])))
        frame.estimate(now_s, AT + np.array([off_m, 0.0, 0.0]))
    return frame, now_s


@pytest.mark.parametrize(
    ("off_m", "seconds", "together"),
    [(0.0, 2.0 * AGREED_S, True), (0.9 * APART_M, 2.0 * AGREED_S, True), (1.1 * APART_M, 2.0 * AGREED_S, False),
     (0.0, 0.5 * AGREED_S, False), (np.nan, 2.0 * AGREED_S, False)],
)  # fmt: skip
def test_only_an_estimate_that_has_long_agreed_with_the_poses_is_of_their_frame(off_m, seconds, together):
    frame, now_s = agreed(off_m, seconds)
    assert frame.at(now_s) is together


def test_one_that_jumps_or_falls_silent_is_not():
    frame, now_s = agreed()
    assert not frame.at(now_s + 1.1 * OLD_S)
    frame.estimate(now_s, AT + 1.0)
    assert not frame.at(now_s)
    assert not AgreedFrame().at(0.0)
