"""The guard, tick by tick, with a firmware that answers as it is told and a planner at the other end of a socket."""

import socket
import struct
import time
from dataclasses import replace

import numpy as np
import pytest

from firmware_bridge.offboard import guard
from firmware_bridge.offboard.firmware import Alert, Firmware, Function
from firmware_bridge.offboard.guard import Guard
from firmware_bridge.offboard.ladder import Reason, Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand, Setup, Target
from firmware_bridge.offboard.msp import ANSWER, Decoder, Frame, encode
from firmware_bridge.offboard.poses import Pose, tum_line
from firmware_bridge.offboard.rate_profile import RateProfile
from firmware_bridge.offboard.sticks import Sticks
from firmware_bridge.offboard.thrust_map import ThrustMap

MASS_KG, G, PERIOD_S = 0.7, 9.81, 0.004
WEIGHT_N = MASS_KG * G
SETUP = Setup("", "", 0, 0.0, RateProfile((17.0, 17.0, 17.0)), ThrustMap((0.0, 4.0, 18.0)), MASS_KG, G, True, 4, 1900)
ARM, ANGLE, OVERRIDE = 1, 2, 4
BOXES = bytes([0, 1, 50])


class Answering:
    """A line to a firmware, simulated: it arms at the pulse that arms and is as level as it is told."""

    def __init__(self) -> None:
        self._decoder, self._out = Decoder(), b""
        self.channels: tuple[int, ...] = ()
        self.sent: list[tuple[int, ...]] = []
        self.modes, self.roll_rad, self.arms_by_pulse, self.alert = 0, 0.0, True, Alert.NONE

    def write(self, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            if frame.function == Function.SET_RAW_RC:
                self.channels = struct.unpack("<8H", frame.payload)
                self.sent.append(self.channels)
                if self.arms_by_pulse:
                    self.modes = self.modes & ~ARM | (ARM if self.channels[4] == 1900 else 0)
            elif (answer := self._answer(frame.function)) is not None:
                self._out += encode(Frame(frame.function, answer, ANSWER))

    def _answer(self, function: int) -> bytes | None:
        if function == Function.BOX_IDS:
            return BOXES
        if function == Function.STATUS_EX:
            return struct.pack("<HHHIBHBB", 0, 0, 0, self.modes, 0, 0, 0, 0) + struct.pack("<BI", 0, 0)
        if function == Function.ATTITUDE:
            return struct.pack("<3h", round(np.degrees(self.roll_rad) * 10.0), 0, 0)
        if function == Function.BATTERY_STATE:
            return struct.pack("<BHBHhBH", 4, 1500, 148, 0, 0, self.alert, 1480)
        return None

    def read(self, wait_s: float = 0.0) -> bytes:
        data, self._out = self._out, b""
        return data

    def close(self) -> None: ...


class Scene:
    """A guard, its firmware, and a planner that hovers at 1 m."""

    def __init__(self, setup: Setup = SETUP) -> None:
        self.line, self.now_s = Answering(), 100.0
        self.planner, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        theirs.setblocking(False)
        self.planner.setblocking(False)
        self.poses: list[Pose] = []
        self.guard = Guard(setup, Sticks(setup, Firmware(self.line)), self._taken, theirs)
        self.wish, self.force_n, self.height_m, self.shakes, self.answers = Wish.WAIT, 0.0, 0.0, True, True
        self.status: GuardStatus | None = None
        self.rng = np.random.default_rng(0)
        self.goes_on = True
        self.target: Target | None = None

    def _taken(self, now_s: float) -> list[Pose]:
        poses, self.poses = self.poses, []
        return poses

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            if round(self.now_s / PERIOD_S) % 3 == 0:
                place = np.array([0.0, 0.0, self.height_m]) + 1e-4 * self.shakes * self.rng.standard_normal(3)
                self.poses.append(Pose(self.now_s, place, np.array([1.0, 0.0, 0.0, 0.0])))
            if self.answers:
                command = PlannerCommand(
                    self.now_s, self.now_s - 0.01, self.force_n, np.zeros(3), self.wish, self.target
                )
                self.planner.send(command.pack())
            self.goes_on = self.goes_on and self.guard.tick(self.now_s)
            self._listen()

    def _listen(self) -> None:
        while True:
            try:
                self.status = GuardStatus.unpack(self.planner.recv(8192))
            except BlockingIOError:
                return

    @property
    def stage(self) -> Stage:
        assert self.status is not None
        return self.status.stage

    @property
    def reason(self) -> Reason:
        assert self.status is not None
        return self.status.reason

    @property
    def throttle_us(self) -> int:
        return self.line.channels[2]


def hovering(setup: Setup = SETUP) -> Scene:
    scene = Scene(setup)
    if not setup.by_msp_alone:
        scene.line.arms_by_pulse, scene.line.modes = False, OVERRIDE
    scene.run(0.5)
    scene.wish = Wish.FLY
    scene.run(0.3)
    scene.line.modes |= 0 if setup.by_msp_alone else ARM
    scene.run(0.3)
    for k in range(100):
        scene.force_n, scene.height_m = 1.05 * WEIGHT_N, 0.01 * k
        scene.run(0.01)
    scene.force_n = WEIGHT_N
    scene.run(1.0)
    assert scene.stage is Stage.FOLLOWING
    assert scene.status is not None
    assert scene.status.armed
    return scene


def test_frozen_poses_end_following_though_the_planner_believes_them():
    scene = hovering()
    scene.shakes = False
    scene.run(0.3)
    assert (scene.stage, scene.reason) == (Stage.DESCENDING, Reason.POSE_STALE)


def test_the_firmwares_alert_of_the_battery_reaches_the_planner():
    scene = Scene()
    for alert in Alert:
        scene.line.alert = alert
        scene.run(0.1)
        assert scene.status is not None
        assert scene.status.battery_alert is alert
        assert scene.status.battery_v == pytest.approx(14.8)
    scene.line.alert = 3  # none is there
    scene.run(0.1)
    assert scene.status.battery_alert is Alert.NONE


def test_poses_that_the_firmwares_attitude_contradicts_end_following():
    scene = hovering()
    scene.line.roll_rad = 0.4
    scene.run(0.4)
    assert (scene.stage, scene.reason) == (Stage.DESCENDING, Reason.POSE_STALE)
    assert scene.line.channels[0] < 1450  # levels by the firmware's attitude, not by that of the poses


def test_on_the_ground_frozen_poses_and_a_dead_planner_spin_nothing_up():
    scene = Scene()
    scene.run(0.5)
    scene.wish, scene.shakes = Wish.FLY, False
    scene.run(0.5)
    assert scene.stage is Stage.FOLLOWING
    scene.answers = False
    scene.run(0.2)
    assert scene.stage is Stage.DOWN
    assert scene.throttle_us == 1000
    scene.run(0.5)
    assert not scene.goes_on
    disarmed = [channels for channels in scene.line.sent if channels[4] == 1000]
    assert len(disarmed) * PERIOD_S > 0.2


def test_a_mode_that_comes_on_in_flight_ends_following_and_centres_the_sticks():
    scene = hovering()
    scene.line.roll_rad = 0.1
    scene.line.modes |= ANGLE
    scene.run(0.1)
    assert (scene.stage, scene.reason) == (Stage.DESCENDING, Reason.OTHER_MODE)
    assert scene.line.channels[:2] == (1500, 1500)
    assert scene.line.channels[4] == 1900


def test_a_mode_that_is_on_keeps_it_on_the_ground_and_is_named():
    scene = Scene()
    scene.line.modes = ANGLE
    scene.run(0.5)
    scene.wish = Wish.FLY
    scene.run(0.2)
    assert scene.stage is Stage.WAITING
    assert scene.status is not None
    assert scene.status.other_mode == 1
    assert scene.line.channels[4] == 1000


def test_an_error_of_the_guard_brings_it_down_and_the_sticks_go_on(capsys):
    scene = hovering()

    def broken(now_s: float) -> list[Pose]:
        raise ZeroDivisionError("of its own")

    scene.guard._poses = broken
    sent = len(scene.line.sent)
    scene.run(2 * PERIOD_S)
    assert scene.guard._motion(scene.now_s) is None, "poses from before may have been the error"
    scene.run(0.5)
    assert (scene.stage, scene.reason) == (Stage.DESCENDING, Reason.GUARD_FAULT)
    assert len(scene.line.sent) - sent >= 0.5 / PERIOD_S - 2
    assert scene.throttle_us > 1200
    assert capsys.readouterr().err.count("of its own") == 1


RECEIVER = replace(SETUP, by_msp_alone=False)


def test_sticks_given_back_after_a_while_find_a_hover_not_an_old_descent():
    scene = hovering(RECEIVER)
    hover_us = scene.throttle_us
    scene.line.modes &= ~OVERRIDE
    scene.run(0.1)
    assert (scene.stage, scene.reason) == (Stage.PILOT, Reason.PILOT_TOOK_OVER)
    scene.height_m = 3.0
    scene.run(4.0)
    assert scene.throttle_us == pytest.approx(hover_us, abs=10)
    scene.line.modes |= OVERRIDE
    scene.run(0.1)
    assert scene.stage is Stage.DESCENDING
    assert scene.throttle_us > hover_us - 120
    scene.run(2.0)
    old = scene.guard._descent
    scene.line.modes &= ~OVERRIDE
    scene.height_m = 6.0
    scene.run(0.5)
    scene.line.modes |= OVERRIDE
    scene.run(0.1)
    assert scene.stage is Stage.DESCENDING
    assert scene.guard._descent is not old  # that of a lower height would end too soon
    assert scene.guard._motion(scene.now_s) is not None
    assert scene.throttle_us > hover_us - 120


def test_a_landed_vehicle_with_a_receiver_keeps_low_throttle_until_its_pilot_disarms():
    scene = hovering(RECEIVER)
    scene.wish = Wish.STOP
    scene.run(6.0)
    assert scene.goes_on
    assert scene.throttle_us == 1000
    scene.line.modes &= ~ARM
    scene.run(0.5)
    assert not scene.goes_on


class TargetsTold(Sticks):
    """An inner loop whose own position loops fly where it is told a target."""

    def command(self, now_s, stage, force_n, rate_body_rad_s, target=None) -> None:
        self.by_targets = target is not None
        super().command(now_s, stage, force_n, rate_body_rad_s)


def test_nothing_is_learnt_of_a_force_that_was_not_sent():
    """It hovers by its own loops while 20 % more is asked for: its descent would begin with that."""
    scene = hovering()
    hover_n = scene.guard._airborne.hover_n
    scene.guard._firmware = TargetsTold(SETUP, scene.guard._firmware._firmware)
    scene.target, scene.force_n = Target(np.array([0.0, 0.0, 1.0]), np.zeros(3), np.zeros(3), 0.0, 0.0), 1.2 * WEIGHT_N
    scene.run(1.0)
    assert scene.status is not None
    assert scene.status.by_targets
    assert scene.guard._airborne.hover_n == pytest.approx(hover_n)
    motion = scene.guard._predictor.at(scene.now_s)
    assert motion.force_n == pytest.approx(WEIGHT_N, rel=0.05)
    assert abs(motion.velocity_world_m_s[2]) < 0.05
    scene.answers = False
    scene.run(0.2)
    assert scene.stage is Stage.DESCENDING
    assert not scene.status.by_targets


def test_poses_that_queued_while_the_line_opened_do_not_make_another_clock():
    """Of our own clock, but old when they are read: taken for another's, late would be timely for the flight."""
    with socket.socket(type=socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    setup = replace(SETUP, pose_host="127.0.0.1", pose_port=port)
    planner, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

    def opened():
        old = Pose(time.time() - 0.2, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        with socket.socket(type=socket.SOCK_DGRAM) as out:
            out.sendto(tum_line(old), ("127.0.0.1", port))
        line = Answering()
        return Sticks(setup, Firmware(line)), line.close

    planner.shutdown(socket.SHUT_WR)  # a planner that is gone ends it on the ground
    guard.run(setup, opened, theirs)
    status = GuardStatus.unpack(planner.recv(8192))
    assert not status.other_clock
    assert not status.poses
