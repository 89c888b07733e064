"""The guard's ladder: what is lost, what is done about it, and that it never goes back up."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.offboard.ladder import PLANNER_SILENT_S, POSE_STALE_S, Ladder, Reason, Seen, Stage, Wish

GOOD = Seen(Wish.FLY, False, 0.0, 0.0, True, True, False)


def flying(at_s: float = 10.0) -> Ladder:
    ladder = Ladder()
    for now_s in (at_s - 0.01, at_s):
        ladder.step(now_s, replace(GOOD, command_s=now_s, pose_s=now_s))
    assert ladder.stage is Stage.FOLLOWING
    return ladder


@pytest.mark.parametrize(
    ("lost", "stage", "reason"),
    [
        ({"planner_gone": True}, Stage.DESCENDING, Reason.PLANNER_GONE),
        ({"command_s": 10.0 - PLANNER_SILENT_S}, Stage.DESCENDING, Reason.PLANNER_SILENT),
        ({"pose_s": 10.0 - POSE_STALE_S}, Stage.DESCENDING, Reason.POSE_STALE),
        ({"wish": Wish.DESCEND}, Stage.DESCENDING, Reason.ASKED),
        ({"sticks_ours": False}, Stage.PILOT, Reason.PILOT_TOOK_OVER),
        ({"armed": False}, Stage.DOWN, Reason.DISARMED),
        ({"wish": Wish.STOP}, Stage.DOWN, Reason.NONE),
    ],
)
def test_every_loss_has_its_stage(lost, stage, reason):
    ladder = flying()
    assert ladder.step(10.01, replace(GOOD, **{"command_s": 10.01, "pose_s": 10.01, **lost})) is stage
    assert ladder.reason is reason


def test_nothing_is_armed_for_a_planner_that_dies_on_the_ground():
    ladder = Ladder()
    assert ladder.step(1.0, replace(GOOD, armed=False, planner_gone=True)) is Stage.ENDED


def test_a_landed_descent_disarms_and_ends():
    ladder = flying()
    ladder.step(10.01, replace(GOOD, planner_gone=True))
    assert ladder.step(12.0, replace(GOOD, planner_gone=True, landed=True)) is Stage.DOWN
    assert ladder.step(12.1, replace(GOOD, planner_gone=True, armed=False)) is Stage.ENDED


seen = st.builds(
    Seen, st.sampled_from(Wish), st.booleans(), st.floats(8, 13), st.floats(8, 13), st.booleans(), st.booleans(),
    st.booleans(),
)  # fmt: skip


@given(st.lists(seen, max_size=20))
def test_it_never_follows_again_once_it_has_stopped(history):
    ladder, stages = flying(), []
    for i, now in enumerate(history):
        stages.append(ladder.step(10.0 + 0.1 * i, now))
    stopped = [i for i, stage in enumerate(stages) if stage is not Stage.FOLLOWING]
    assert not stopped or all(stage is not Stage.FOLLOWING for stage in stages[stopped[0] :])
    ended = [i for i, stage in enumerate(stages) if stage is Stage.ENDED]
    assert not ended or all(stage is Stage.ENDED for stage in stages[ended[0] :])
