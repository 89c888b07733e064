"""The planner's side of a flight, with a guard that answers as it is told: before it arms, and when it gives up."""

import contextlib

import numpy as np
import pytest

import vehicle
from firmware_bridge import controller
from firmware_bridge.controller import State
from firmware_bridge.offboard import procedure
from firmware_bridge.offboard.firmware import Alert
from firmware_bridge.offboard.ladder import Reason, Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand, Target
from firmware_bridge.offboard.poses import Pose
from firmware_bridge.offboard.procedure import Flight
from firmware_bridge.offboard.tracker import TARGETS_FROM_M_S, Demand, Tracker
from flight import LinkError
from tests.firmware_bridge.offboard import curves

MODEL = vehicle.example("rigter2019")
TICK_S = 0.004
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class Guard:
    """The guard of a vehicle that stands, as its planner sees it."""

    def __init__(self) -> None:
        self.now_s, self.armed, self.ours, self.mode, self.poses_come = 100.0, False, True, 0, True
        self.alert = Alert.NONE
        self.stage, self.height_m = Stage.WAITING, 0.0
        self.commands: list[PlannerCommand] = []

    def hear(self) -> GuardStatus:
        self.now_s += TICK_S
        fresh = (Pose(self.now_s - 0.01, np.array([0.0, 0.0, self.height_m]), LEVEL),)
        return GuardStatus(
            self.stage, Reason.NONE, self.armed, self.ours, self.now_s, self.now_s, 16.0,
            poses=fresh if self.poses_come else (), other_mode=self.mode, battery_alert=self.alert,
        )  # fmt: skip

    def answer(self, command: PlannerCommand) -> None:
        self.commands.append(command)


def flight(guard: Guard, cancel=lambda: False) -> Flight:
    configuration = controller.parameters_of(MODEL)
    return Flight(guard, lambda poses: Tracker(configuration, poses), curves.circle(), cancel=cancel)  # type: ignore


def test_ctrl_c_while_it_waits_to_arm_asks_for_nothing():
    guard = Guard()
    with pytest.raises(LinkError, match="cancelled"):
        flight(guard, cancel=lambda: guard.now_s > 100.5).fly()
    assert {command.wish for command in guard.commands} == {Wish.WAIT}


def test_ctrl_c_while_the_firmware_is_to_arm_takes_off_nowhere():
    guard = Guard()
    ours = flight(guard, cancel=lambda: guard.armed)

    def arm(command: PlannerCommand) -> None:
        guard.commands.append(command)
        guard.armed = command.wish is Wish.FLY

    guard.answer = arm
    with pytest.raises(LinkError, match="cancelled"):
        ours.fly()
    assert ours.tracker.state is State.ARMED
    assert all(command.force_n == 0.0 for command in guard.commands)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"armed": True}, "it is armed already"),
        ({"mode": 1}, "mode ANGLE is on"),
        ({"poses_come": False}, "no pose has come"),
        ({"alert": Alert.WARNING}, "the battery is low to the firmware, at 16.0 V"),
    ],
)
def test_it_does_not_ask_to_fly(wrong, said, monkeypatch):
    monkeypatch.setattr(procedure, "READY_S", 1.1)
    guard = Guard()
    for name, value in wrong.items():
        setattr(guard, name, value)
    with pytest.raises(LinkError, match=said):
        flight(guard).fly()
    assert {command.wish for command in guard.commands} == {Wish.WAIT}


def test_it_does_not_ask_to_fly_by_a_pose_that_has_stopped(monkeypatch):
    monkeypatch.setattr(procedure, "READY_S", 1.1)
    guard = Guard()
    ours = flight(guard)
    ours._tick()
    guard.poses_come = False
    with pytest.raises(LinkError, match="the last pose is older"):
        ours.fly()
    assert {command.wish for command in guard.commands} == {Wish.WAIT}


@pytest.mark.parametrize(("height_m", "wish"), [(1.5, Wish.DESCEND), (0.1, Wish.STOP)])
def test_a_controller_that_gives_up_in_the_air_leaves_it_to_the_guard(height_m, wish, monkeypatch):
    guard = Guard()
    ours = flight(guard)
    ours._tick()
    ours._stood_m, ours._wish, guard.height_m = 0.0, Wish.FLY, height_m
    ours.tracker.predictor.reset()
    monkeypatch.setattr(Tracker, "state", property(lambda _: State.FAULT))
    for _ in range(5):
        ours._tick()
    assert guard.commands[-1].wish is wish


@pytest.mark.parametrize(("alert", "ends"), [(Alert.WARNING, False), (Alert.CRITICAL, True)])
def test_a_battery_that_is_critical_ends_the_flight_and_a_low_one_does_not(alert, ends, monkeypatch):
    monkeypatch.setattr(controller.Controller, "state", property(lambda _: State.TAKE_OFF))
    guard = Guard()
    ours = flight(guard)
    guard.alert = alert
    ours._tick()
    monitored = pytest.raises(LinkError, match=r"take-off: the battery is at 16\.0 V, critical")
    with monitored if ends else contextlib.nullcontext():
        ours._watch("take-off")


def test_a_low_battery_is_no_reason_for_what_takes_long_in_flight(monkeypatch):
    monkeypatch.setattr(controller.Controller, "state", property(lambda _: State.LANDING))
    guard = Guard()
    ours = flight(guard)
    for _ in range(300):
        ours._tick()
    guard.alert, guard.armed, ours._wish = Alert.WARNING, True, Wish.FLY
    with pytest.raises(LinkError, match="landing within 0 s") as late:
        ours._until(lambda: False, 0.1, "landing")
    assert "battery" not in str(late.value)


def test_a_pilot_is_told_to_disarm():
    guard, said = Guard(), []
    ours = flight(guard)
    ours._progress = lambda stage, fraction: said.append(stage)
    guard.stage, guard.armed = Stage.DOWN, True
    ours._ask_pilot_to_disarm()
    assert said == ["landed: disarm now"]
    guard.armed = False
    ours._ask_pilot_to_disarm()
    assert len(said) == 1


def test_who_hovers_far_from_the_height_asked_does_not_start():
    guard = Guard()
    ours = flight(guard)
    guard.height_m = 0.42
    for _ in range(3):
        ours._tick()
    ours._require_height(0.45)
    with pytest.raises(
        LinkError, match=r"the hover is -0\.58 m off the height asked for, at most 0\.2; its rotors give 100%"
    ):
        ours._require_height(1.0)


def test_whatever_ends_it_in_the_air_its_log_is_returned(monkeypatch):
    monkeypatch.setattr(procedure, "STEP_S", 0.5)
    guard = Guard()
    ours = flight(guard)

    def arm(command: PlannerCommand) -> None:
        guard.armed = command.wish is Wish.FLY

    def fail(*_) -> None:
        raise ZeroDivisionError("of ours")

    guard.answer = arm
    monkeypatch.setattr(ours, "_reach", fail)
    log = ours.fly()
    assert log.metadata["ended_early"] == "ZeroDivisionError: of ours"
    assert log.metadata["thrust_share"] == "1.000"


@pytest.mark.parametrize(
    ("speed_m_s", "sent", "said"),
    [(1.0, 0.0, "0% of the path by position targets: never above 1.4 m/s"),
     (2.0, 0.0, "0% of the path by position targets: no metre of way that agreed"),
     (2.0, np.nan, "100% of the path by position targets")],
)  # fmt: skip
def test_why_no_position_target_was_flown_is_kept_in_the_log(speed_m_s, sent, said):
    flies = flight(Guard())
    flies.tracker.gives_targets = True
    target = Target(np.zeros(3), np.zeros(3), np.zeros(3), 0.0, 0.0) if speed_m_s > TARGETS_FROM_M_S else None
    flies.tracker.tick = lambda now_s, **_: Demand(now_s, 0.0, np.zeros(3), now_s, target)
    flies._keep = lambda *_: None  # it has not moved
    flies._tick()
    path = {"mission_state": np.full(3, float(State.TRAJECTORY)), "collective_force_n": np.full(3, sent)}
    assert flies._targets_flown(path) == said
