"""What goes over the line to an autopilot in each stage: by two sockets, at times that are given, without a flight."""

import socket
import time

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from firmware_bridge.autopilot import inner_loop, settings
from firmware_bridge.autopilot.flavour import PX4
from firmware_bridge.autopilot.inner_loop import Autopilot
from firmware_bridge.autopilot.line import MavlinkLine, parsed
from firmware_bridge.autopilot.setup import AutopilotSetup
from firmware_bridge.autopilot.thrust import AutopilotThrust
from firmware_bridge.offboard.ladder import Ladder, Seen, Stage, Wish
from firmware_bridge.offboard.messages import Target
from firmware_bridge.offboard.thrust_map import ThrustMap

OFFBOARD, POSITION = 6 << 16, 3 << 16
THRUST = AutopilotThrust(ThrustMap((0.1, 3.0, 22.0)), linear=False)


class Vehicle:
    """The other end: says what it is told to, and keeps what it hears."""

    def __init__(self, *, waits: bool = False, system: int = 1) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self.socket = socket.socket(type=socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        port = self.socket.getsockname()[1]
        if waits:
            with socket.socket(type=socket.SOCK_DGRAM) as free:
                free.bind(("127.0.0.1", 0))
                port = free.getsockname()[1]
        address = f"mavlink:{'udpin' if waits else 'udp'}://127.0.0.1:{port}"
        self.line = MavlinkLine(parsed(address))
        self.setup = AutopilotSetup(
            address, 1, 255, OFFBOARD, 6, True, THRUST, 0.7, 9.81, "127.0.0.1", 0, 0.0
        )  # fmt: skip
        self.ours = Autopilot(self.setup, self.line)
        self.line_port = port
        self.peer: tuple[str, int] | None = ("127.0.0.1", port) if waits else None
        self.heard: list[mavlink.MAVLink_message] = []

    def tick(self, now_s: float, stage: Stage) -> list[mavlink.MAVLink_message]:
        """What came of one."""
        self.ours.listen(now_s)
        self.ours.command(now_s, stage, 0.0, np.zeros(3))
        found: list[mavlink.MAVLink_message] = []
        while True:
            try:
                data, self.peer = self.socket.recvfrom(65536)
            except BlockingIOError:
                self.heard += found
                return found
            found += self.mav.parse_buffer(data) or ()

    def say(self, message: mavlink.MAVLink_message) -> None:
        assert self.peer is not None
        self.socket.sendto(message.pack(self.mav), self.peer)

    def beat(self, mode: int, *, armed: bool) -> None:
        self.say(self.mav.heartbeat_encode(2, 12, 1 | (128 if armed else 0), mode, 4))

    def asked(self, command: int) -> list[float]:
        said = [message.to_dict() for message in self.heard if message.get_type() == "COMMAND_LONG"]
        return [float(of["param1"]) for of in said if of["command"] == command]


@pytest.fixture
def vehicle():
    made: list[Vehicle] = []

    def make(**more) -> Vehicle:
        made.append(Vehicle(**more))
        return made[-1]

    yield make
    for each in made:
        each.line.close()
        each.socket.close()


def test_a_request_to_arm_is_undone_although_it_is_said_to_be_disarmed(vehicle):
    it = vehicle()
    it.tick(1.0, Stage.FOLLOWING)
    it.beat(OFFBOARD, armed=False)
    it.tick(2.0, Stage.FOLLOWING)
    assert it.asked(400) == [1.0]
    it.tick(2.004, Stage.DOWN)  # at once
    assert it.asked(400) == [1.0, 0.0]
    assert not it.ours.state.arming_told
    it.beat(OFFBOARD, armed=False)  # said before it heard us
    it.tick(2.1, Stage.DOWN)
    assert not it.ours.state.arming_told
    it.beat(OFFBOARD, armed=True)
    it.tick(2.6, Stage.DOWN)
    assert it.ours.state.armed
    assert it.asked(400) == [1.0, 0.0, 0.0]
    it.beat(OFFBOARD, armed=False)
    it.tick(2.8, Stage.DOWN)
    assert it.ours.state.arming_told


def test_a_guard_does_not_end_before_it_is_told_that_nothing_is_armed():
    ladder = Ladder()
    seen = {"planner_gone": False, "armed": False, "sticks_ours": True, "landed": False, "lifted": False}
    for now_s, gone, told in ((0.0, False, False), (0.1, True, False), (0.5, True, False), (0.9, True, True)):
        stage = ladder.step(
            now_s,
            Seen(
                Wish.FLY, command_s=now_s, pose_s=now_s, receiver=True, heard_s=now_s, arming_told=told,
                **{**seen, "planner_gone": gone},
            ),
        )  # fmt: skip
        assert stage is (Stage.FOLLOWING if not gone else Stage.ENDED if told else Stage.DOWN)


@pytest.mark.parametrize("waits", [False, True])
def test_every_missing_message_is_asked_for_until_it_comes(vehicle, waits):
    """PX4 streams attitudes by itself, and one that waits is not known before it is heard."""
    it = vehicle(waits=waits)
    it.tick(0.0, Stage.WAITING)
    for i in range(1, 300):
        it.say(it.mav.attitude_quaternion_encode(0, 1, 0, 0, 0, 0, 0, 0))
        if i > 150:
            it.say(it.mav.local_position_ned_encode(0, 0, 0, 0, 0, 0, 0))
        it.tick(0.01 * i, Stage.WAITING)
        if i == 151:
            early = set(it.asked(511))
            it.heard.clear()
    assert early >= set(inner_loop.INTERVALS_HZ) - {mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION}
    late = set(it.asked(511))
    assert mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED not in late
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in late


def test_heights_count_from_where_it_was_armed(vehicle):
    it = vehicle()
    it.tick(0.0, Stage.WAITING)
    for now_s, armed, down_m in ((1.0, False, -6.0), (2.0, True, -6.0), (3.0, True, -7.5)):
        it.beat(OFFBOARD, armed=armed)
        it.say(it.mav.local_position_ned_encode(0, 0, 0, down_m, 0, 0, 0))
        it.tick(now_s, Stage.WAITING)
    assert it.ours.state.altitude_m == pytest.approx(1.5)


def test_the_mode_is_not_asked_for_again_once_the_pilot_has_left_it(vehicle):
    it = vehicle()
    it.tick(0.0, Stage.FOLLOWING)
    for now_s, mode in ((1.0, OFFBOARD), (2.0, POSITION), (3.0, POSITION), (4.0, POSITION)):
        it.beat(mode, armed=False)
        it.tick(now_s, Stage.FOLLOWING)
    assert it.asked(176) == [1.0]
    assert it.ours.state.left


def test_only_its_own_autopilot_says_where_it_is(vehicle):
    """A station of another id, or another vehicle, does not draw the set-points away."""
    it = vehicle(waits=True)
    it.line.system = 1
    it.tick(0.0, Stage.WAITING)
    it.beat(OFFBOARD, armed=False)
    assert it.tick(1.0, Stage.FOLLOWING)
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        for system, component in ((255, 190), (2, 1), (1, 240)):
            mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
            other.sendto(mav.heartbeat_encode(6, 8, 0, 0, 4).pack(mav), ("127.0.0.1", it.line_port))
        assert it.tick(1.004, Stage.FOLLOWING)
    assert it.line.stations == {255, 2, 1}


def test_what_another_system_tells_of_parameters_is_not_taken(vehicle):
    it = vehicle(waits=True)
    it.tick(0.0, Stage.WAITING)
    other = mavlink.MAVLink(None, srcSystem=77, srcComponent=1)
    message = other.param_value_encode(b"COM_OF_LOSS_T", 0.4, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)
    it.socket.sendto(message.pack(other), ("127.0.0.1", it.line_port))
    values, _, _ = settings._told(it.line, 1, PX4)
    assert not values


def test_the_machines_own_time_goes_into_a_set_point(vehicle):
    it, now_s = vehicle(), time.time()
    (target,) = [m for m in it.tick(now_s, Stage.FOLLOWING) if m.get_type() == "SET_ATTITUDE_TARGET"]
    assert target.time_boot_ms == round(1e3 * now_s) % 2**32


def test_a_target_goes_out_in_north_east_down(vehicle):
    """x north, y west, z up; yaw from x towards y. One sign wrong turns the vehicle the other way at handover."""
    it, three = vehicle(), np.arange(1.0, 4.0)
    it.tick(1.0, Stage.WAITING)
    it.line.send(it.ours._at(2.0, Target(three, 10.0 * three, 100.0 * three, 0.5, -0.2)))
    data, _ = it.socket.recvfrom(65536)
    (sent,) = it.mav.parse_buffer(data)
    assert (sent.x, sent.y, sent.z) == (1.0, -2.0, -3.0)
    assert (sent.vx, sent.vy, sent.vz) == (10.0, -20.0, -30.0)
    assert (sent.afx, sent.afy, sent.afz) == (100.0, -200.0, -300.0)
    assert (sent.yaw, sent.yaw_rate) == pytest.approx((-0.5, 0.2))
    assert (sent.coordinate_frame, sent.type_mask) == (mavlink.MAV_FRAME_LOCAL_NED, 0)
