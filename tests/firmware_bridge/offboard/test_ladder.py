"""The guard's ladder: what is lost, what is done about it, and that it never goes back up."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.offboard.ladder import Ladder, Reason, Seen, Stage, Wish

GOOD = Seen(Wish.FLY, False, 0.0, 0.0, True, True, False)


def flying(at_s: float = 10.0) -> Ladder:
    ladder = Ladder()
    for now_s, armed in ((at_s - 0.02, False), (at_s - 0.01, True), (at_s, True)):
        ladder.step(now_s, replace(GOOD, command_s=now_s, pose_s=now_s, armed=armed))
    assert ladder.stage is Stage.FOLLOWING
    return ladder


@pytest.mark.parametrize(
    ("lost", "stage", "reason"),
    [
        ({"planner_gone": True}, Stage.DESCENDING, Reason.PLANNER_GONE),
        ({"command_s": 9.9}, Stage.DESCENDING, Reason.PLANNER_SILENT),
        ({"pose_s": 9.8}, Stage.DESCENDING, Reason.POSE_STALE),
        ({"pose_s": float("nan")}, Stage.DESCENDING, Reason.POSE_STALE),
        ({"pose_s": 10.1}, Stage.DESCENDING, Reason.POSE_STALE),
        ({"other_mode": True}, Stage.DESCENDING, Reason.OTHER_MODE),
        ({"planner_gone": True, "lifted": False}, Stage.DOWN, Reason.PLANNER_GONE),
        ({"command_s": 9.0, "lifted": False}, Stage.DOWN, Reason.PLANNER_SILENT),
        ({"pose_s": 9.0, "lifted": False}, Stage.DOWN, Reason.POSE_STALE),
        ({"wish": Wish.DESCEND, "lifted": False}, Stage.DOWN, Reason.ASKED),
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


def test_a_kill_stops_the_rotors_while_it_descends_but_the_pilots_sticks_are_his():
    ladder = flying()
    assert ladder.step(10.3, replace(GOOD, command_s=10.3, pose_s=10.0)) is Stage.DESCENDING
    killed = replace(GOOD, command_s=10.4, pose_s=10.0, wish=Wish.KILL)
    assert ladder.step(10.4, replace(killed, wish=Wish.STOP)) is Stage.DESCENDING
    assert ladder.step(10.4, killed) is Stage.DOWN
    his = flying()
    assert his.step(10.0, replace(killed, command_s=10.0, sticks_ours=False)) is Stage.PILOT


def test_nothing_is_armed_for_a_planner_that_dies_on_the_ground():
    ladder = Ladder()
    assert ladder.step(1.0, replace(GOOD, armed=False, planner_gone=True)) is Stage.ENDED


def test_a_landed_descent_disarms_and_ends():
    ladder = flying()
    ladder.step(10.01, replace(GOOD, planner_gone=True))
    assert ladder.step(12.0, replace(GOOD, planner_gone=True, landed=True)) is Stage.DOWN
    assert ladder.step(12.1, replace(GOOD, planner_gone=True, armed=False)) is Stage.DOWN  # said before it heard us
    assert ladder.step(12.3, replace(GOOD, planner_gone=True, armed=False)) is Stage.ENDED


def test_a_vehicle_that_stays_armed_is_told_to_disarm_for_seconds():
    ladder = flying()
    ladder.step(10.01, replace(GOOD, command_s=10.01, pose_s=10.01, wish=Wish.STOP))
    assert ladder.step(14.9, GOOD) is Stage.DOWN
    assert ladder.step(15.1, GOOD) is Stage.ENDED


RECEIVER = replace(GOOD, receiver=True)


@pytest.mark.parametrize("over", [{"armed": False}, {"sticks_ours": False}, {"heard_s": 8.0}])
def test_a_pilots_landed_vehicle_keeps_its_throttle_low_until_he_disarms(over):
    ladder = flying()
    stop = replace(RECEIVER, heard_s=10.0, command_s=10.01, pose_s=10.01, wish=Wish.STOP)
    assert ladder.step(10.01, stop) is Stage.DOWN
    assert ladder.step(18.9, replace(RECEIVER, heard_s=18.8)) is Stage.DOWN
    assert ladder.step(19.0, replace(RECEIVER, **{"heard_s": 18.8, **over})) is Stage.ENDED


@pytest.mark.parametrize("unready", [{"armed": True}, {"pose_s": 0.5}, {"pose_s": 1.1}, {"other_mode": True}])
def test_following_begins_only_with_a_fresh_pose_of_a_disarmed_vehicle_in_no_other_mode(unready):
    ready = replace(GOOD, command_s=1.0, pose_s=1.0, armed=False)
    assert Ladder().step(1.0, ready) is Stage.FOLLOWING
    assert Ladder().step(1.0, replace(ready, **unready)) is Stage.WAITING


def test_sticks_that_a_pilot_gives_back_bring_it_down_afresh_if_it_flies():
    for lifted, stage in ((True, Stage.DESCENDING), (False, Stage.DOWN)):
        ladder = flying()
        assert ladder.step(10.01, replace(RECEIVER, heard_s=10.0, sticks_ours=False)) is Stage.PILOT
        assert ladder.step(13.0, replace(RECEIVER, heard_s=13.0, sticks_ours=False)) is Stage.PILOT
        assert ladder.step(13.1, replace(RECEIVER, heard_s=13.1, lifted=lifted)) is stage


def test_a_vehicle_that_its_pilot_armed_with_the_switch_off_is_his():
    ladder = Ladder()
    his = replace(RECEIVER, heard_s=1.0, command_s=1.0, pose_s=1.0)
    ladder.step(1.0, replace(his, armed=False, sticks_ours=False))
    assert ladder.stage is Stage.FOLLOWING
    assert ladder.step(1.01, replace(his, sticks_ours=False)) is Stage.PILOT
    assert ladder.reason is Reason.PILOT_ARMED
    assert Ladder().step(1.0, his) is Stage.PILOT


def test_an_error_of_the_guard_ends_following_in_a_descent():
    for lifted, stage in ((True, Stage.DESCENDING), (False, Stage.DOWN)):
        ladder = flying()
        ladder.fail(10.01, lifted=lifted)
        assert ladder.stage is stage


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
