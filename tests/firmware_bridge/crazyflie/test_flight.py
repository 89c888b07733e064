"""A plan on a simulated Crazyflie: flown, refused, lost and landed. No Crazyflie has flown it."""

from typing import Any

import numpy as np
import pytest

import vehicle
from firmware_bridge.airborne import tracking
from firmware_bridge.controller import State
from firmware_bridge.crazyflie import flight as procedure
from firmware_bridge.crazyflie import pieces
from firmware_bridge.crazyflie.client import Client
from firmware_bridge.crazyflie.crtp import Packet, endpoint
from firmware_bridge.crazyflie.flight import Flight
from flight import FlightLog, InputError, LinkError
from goshawk.commands.plan import poly4d
from tests.firmware_bridge.crazyflie.simulated_crazyflie import SimulatedCrazyflie, SimulatedTime
from tests.firmware_bridge.offboard import curves
from tests.firmware_bridge.offboard.page import unchecked

WAY = curves.circle()
MODEL = vehicle.example("rigter2019")
PLAN = poly4d.refit(WAY).trajectory
START = WAY.position([0.0])[0]
TAKE_OFF, LAND, GO_TO, START_TRAJECTORY, STOP, DEFINE = 7, 8, 12, 13, 3, 6


def simulated(**more) -> SimulatedCrazyflie:
    return SimulatedCrazyflie(position_m=[START[0] + 0.1, START[1] - 0.1, 0.0], **more)


def fly(simulation: SimulatedCrazyflie, **more) -> tuple[Flight, FlightLog]:
    options: dict[str, Any] = {"arms": True} | more
    ours = Flight(Client(SimulatedTime(simulation)), PLAN, **options)
    return ours, ours.fly()


def aloft(act, after_s: float = 0.0):
    """`each_tick` that acts while the trajectory is flown."""
    begun: list[float] = []

    def tick(simulation: SimulatedCrazyflie) -> None:
        if START_TRAJECTORY in simulation.commands:
            begun.append(simulation.time_s)
        if begun and simulation.time_s - begun[0] >= after_s:
            act(simulation)

    return tick


def test_a_circle_is_flown_as_planned_and_landed():
    simulation = simulated()
    ours, log = fly(simulation)
    assert not ours.ended_early
    assert simulation.commands == [DEFINE, TAKE_OFF, GO_TO, START_TRAJECTORY, LAND, STOP]
    assert not simulation.armed
    assert not simulation.dropped
    on_way = log.columns["mission_state"] == State.TRAJECTORY
    begin = log.time_s[on_way][0]
    planned = WAY.position(np.clip(log.time_s[on_way] - begin, 0.0, WAY.duration_s))
    # the point follows with a lag of .03 s, and the log's phases are good to a sample
    assert np.linalg.norm(log.vector("position_world_m")[on_way] - planned, axis=1).max() < 0.03 * 2.25 + 0.06
    assert tracking(log)["tracking_mean_m"] < 0.03
    assert log.columns["motor_command_2_ratio"][on_way] == pytest.approx(30003 / 65535)
    assert log.columns["battery_v"] == pytest.approx(4.1)


def test_the_memory_holds_the_plan_to_the_bit_and_is_read_back():
    simulation = simulated()
    ours = Flight(Client(SimulatedTime(simulation)), PLAN, arms=False)
    held = ours.upload()
    assert bytes(simulation.memory[: 132 * len(PLAN.durations_s)]) == pieces.packed(PLAN)
    assert simulation.definitions == {1: (0, len(PLAN.durations_s))}
    assert poly4d.compared(WAY, held).largest_m < 0.01
    stored = simulation._stored(0, len(PLAN.durations_s))
    assert [T for T, _ in stored] == pytest.approx(PLAN.durations_s.tolist(), rel=1e-6)


def test_a_byte_that_its_memory_does_not_keep_is_noticed_and_nothing_is_armed():
    simulation = simulated(damaged_write=300)
    with pytest.raises(LinkError, match="holds other bytes than were written, from 300 on"):
        fly(simulation)
    assert simulation.commands == []
    assert not simulation.armed


def test_a_lost_packet_is_sent_again():
    simulation = simulated()
    takes, count = simulation.take, [0]

    def lossy(raw: bytes) -> list[bytes]:
        count[0] += 1
        if count[0] % 7 == 0:
            return []  # the request is lost
        answers = takes(raw)
        return [] if count[0] % 11 == 0 else answers  # or its answer

    simulation.take = lossy
    ours, _ = fly(simulation)
    assert not ours.ended_early
    assert not simulation.dropped


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"battery_v": 3.6}, "battery: 3.60 V, at least 3.7 a cell"),
        ({"power": 1}, "battery: 4.10 V, charging"),
        ({"power": 3}, "battery"),
        ({"variance_m2": 0.01}, "Kalman filter: sure to 0.100 m, at most 0.05"),
        ({"extra_bits": 32}, "supervisor: tumbled"),
        ({"extra_bits": 64}, "supervisor: locked"),
        ({"extra_bits": 2048}, "supervisor: deck fault"),
        ({"extra_bits": 1024}, "high-level commander: disabled"),
        ({"can_be_armed": False}, "arming: cannot be armed"),
        ({"missing": frozenset({"kalman.varPX"})}, "logs no kalman.varPX"),
    ],
)
def test_what_is_wrong_is_refused_before_anything_turns(more, said):
    simulation = simulated(**more)
    with pytest.raises(LinkError, match=said):
        fly(simulation)
    assert TAKE_OFF not in simulation.commands
    assert not simulation.armed


def test_it_must_stand_near_the_start():
    simulation = SimulatedCrazyflie(position_m=[START[0] + 0.5, START[1], 0.0])
    with pytest.raises(
        LinkError, match=r"the trajectory begins 0\.50 m from above it, at most 0\.3; put it at x 1\.50"
    ):
        fly(simulation)
    assert TAKE_OFF not in simulation.commands


def test_an_estimate_that_wanders_is_refused():
    simulation = simulated()

    def drift(of: SimulatedCrazyflie) -> None:
        of.position_m[1] += 0.001

    simulation.each_tick = drift
    with pytest.raises(LinkError, match="estimate at rest: wanders"):
        fly(simulation)


def test_it_arms_only_when_told_and_else_waits_for_whoever_does(monkeypatch):
    simulation, said = simulated(), []

    def pilot(of: SimulatedCrazyflie) -> None:
        of.armed |= bool(said) and of.time_s > 105.0

    simulation.each_tick = pilot
    ours, _ = fly(simulation, arms=False, progress=lambda stage, fraction: said.append(stage))
    assert said == ["arm now"]
    assert not ours.ended_early
    assert simulation.armed  # who armed it disarms it
    monkeypatch.setattr(procedure, "ARM_S", 1.0)
    with pytest.raises(LinkError, match="was not armed within 1 s"):
        fly(simulated(), arms=False)


def test_one_that_arms_by_itself_is_not_armed():
    simulation = simulated(auto_arms=True, can_be_armed=False)
    ours, _ = fly(simulation, arms=False)
    assert not ours.ended_early


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda of: setattr(of, "power", 3), "the battery is low to the firmware"),
        (lambda of: setattr(of, "off_m", 0.8), "m from where it is to be"),
    ],
)
def test_what_goes_wrong_in_flight_lands(act, said):
    simulation = simulated()
    simulation.each_tick = aloft(act, 1.0)
    ours, log = fly(simulation)
    assert ours.ended_early.startswith("the trajectory: ")
    assert said in ours.ended_early
    assert simulation.commands[-2:] == [LAND, STOP]
    assert not simulation.dropped
    assert log.metadata["ended_early"] == ours.ended_early


def test_cancelled_it_lands():
    simulation = simulated()
    ours, _ = fly(simulation, cancel=lambda: len(simulation.way) > 1500)
    assert "cancelled" in ours.ended_early
    assert simulation.commands[-2:] == [LAND, STOP]
    assert not simulation.dropped
    assert not simulation.emergency


def test_an_emergency_stop_stops_the_rotors_wherever_it_is():
    simulation = simulated()
    ours, _ = fly(simulation, stop=lambda: len(simulation.way) > 1500)
    assert "emergency stop" in ours.ended_early
    assert simulation.emergency
    assert LAND not in simulation.commands


def test_an_emergency_stop_while_it_lands_stops_the_rotors():
    simulation = simulated()
    landing: list[float] = []

    def tick(of: SimulatedCrazyflie) -> None:
        if LAND in of.commands:
            landing.append(of.time_s)

    simulation.each_tick = tick
    ours, _ = fly(
        simulation, cancel=lambda: len(simulation.way) > 1500,
        stop=lambda: bool(landing) and simulation.time_s > landing[0] + 0.3,
    )  # fmt: skip
    assert "cancelled; emergency stop" in ours.ended_early
    assert simulation.emergency
    assert simulation.dropped  # it was still high


def test_an_emergency_stop_is_repeated_until_it_is_heard():
    simulation = simulated()
    simulation.each_tick = aloft(lambda of: setattr(of, "deaf", of.time_s < lost_s[0] + 3.0), 1.0)
    lost_s = [130.0]
    ours, _ = fly(simulation, stop=lambda: simulation.time_s > lost_s[0] + 0.5)
    assert "emergency stop" in ours.ended_early
    assert simulation.emergency


def test_one_that_tumbles_is_stopped_and_not_landed():
    simulation = simulated()
    simulation.each_tick = aloft(lambda of: setattr(of, "extra_bits", of.extra_bits | 32), 1.0)
    ours, _ = fly(simulation)
    assert "the supervisor says tumbled" in ours.ended_early
    assert simulation.emergency
    assert LAND not in simulation.commands


def test_a_link_that_is_lost_is_tried_again_and_then_said():
    simulation = simulated()
    simulation.each_tick = aloft(lambda of: setattr(of, "deaf", True), 1.0)
    ours, _ = fly(simulation)
    assert "nothing was heard for 0.5 s" in ours.ended_early
    assert "hovers there until its battery is empty" in ours.ended_early


def test_a_link_that_comes_back_lands_it():
    simulation = simulated()
    lost = aloft(lambda of: setattr(of, "deaf", of.time_s < lost_s[0] + 2.0), 1.0)
    lost_s = [0.0]

    def tick(of: SimulatedCrazyflie) -> None:
        lost_s[0] = lost_s[0] or (of.time_s if START_TRAJECTORY in of.commands else 0.0)
        if lost_s[0]:
            lost(of)

    simulation.each_tick = tick
    ours, _ = fly(simulation)
    assert "nothing was heard" in ours.ended_early
    assert simulation.commands[-2:] == [LAND, STOP]
    assert not simulation.dropped


@pytest.mark.parametrize("lost_s", [6.0, 60.0])
def test_a_link_lost_at_take_off_does_not_pass_for_down(lost_s):
    """What was logged last said that it stood on the ground."""
    simulation, begun, said = simulated(), [], []

    def tick(of: SimulatedCrazyflie) -> None:
        if TAKE_OFF in of.commands:
            begun.append(of.time_s)
            of.deaf = of.time_s - begun[0] < lost_s

    simulation.each_tick = tick
    ours, _ = fly(simulation, progress=lambda stage, _: said.append(stage))
    assert ours.ended_early
    assert simulation.commands[-2:] == [LAND, STOP]
    assert simulation.position_m[2] < 0.05
    assert not simulation.dropped
    assert not simulation.armed
    assert [procedure.ALONE in words for words in said] == [True]


def test_an_error_of_ours_in_the_air_lands_it():
    simulation = simulated()

    def cancel() -> bool:
        if len(simulation.way) > 1500:
            raise RuntimeError("of our own")
        return False

    ours, _ = fly(simulation, cancel=cancel)
    assert ours.ended_early == "RuntimeError: of our own"
    assert simulation.commands[-2:] == [LAND, STOP]
    assert not simulation.dropped


class BreakingLine(SimulatedTime):
    """A local socket that fails at once, between two instants after the trajectory's start."""

    def __init__(self, simulation: SimulatedCrazyflie, until_s: float) -> None:
        super().__init__(simulation)
        self._until_s, self._begun_s, self.failures = until_s, float("inf"), 0

    def _fail(self) -> None:
        now_s = self.now_s()
        if START_TRAJECTORY in self._simulation.commands:
            self._begun_s = min(self._begun_s, now_s)
        if 1.0 < now_s - self._begun_s < self._until_s:
            self.failures += 1
            assert self.failures < 5000, "it spins"
            raise LinkError("broken")

    def passed_s(self) -> float:
        return self.now_s() - self._begun_s

    def send(self, packet) -> None:
        self._fail()
        super().send(packet)

    def receive(self, wait_s: float):
        self._fail()
        return super().receive(wait_s)


@pytest.mark.parametrize("until_s", [20.0, 2000.0])
def test_a_local_socket_that_breaks_is_tried_ten_times_a_second_at_most(until_s, monkeypatch):
    """It spun a processor for a quarter of an hour, as nothing waited; one that mends lands."""
    simulation = simulated()
    line = BreakingLine(simulation, until_s)
    monkeypatch.setattr(procedure, "EMPTY_S", 60.0)
    ours = Flight(Client(line), PLAN, arms=True)
    ours.fly()
    assert "broken" in ours.ended_early
    assert line.failures <= 10.0 * min(until_s, procedure.EMPTY_S) + 20
    assert (simulation.position_m[2] < 0.05) == (until_s < procedure.EMPTY_S)


@pytest.mark.parametrize("until_s", [3.0, 20.0, 2000.0])
@pytest.mark.parametrize("asked", ["before the break", "in it"])
def test_an_emergency_stop_outlasts_a_line_that_breaks_or_says_that_it_did_not_arrive(until_s, asked, monkeypatch):
    """It gave up after 5 s, and said that the rotors were off while it hovered."""
    simulation = simulated()
    line = BreakingLine(simulation, until_s)
    monkeypatch.setattr(procedure, "EMPTY_S", 60.0)
    asks = {"before the break": lambda: line.passed_s() > 0.999, "in it": lambda: line.failures > 0}
    ours = Flight(Client(line), PLAN, arms=True, stop=asks[asked])
    ours.fly()
    heard = until_s < procedure.EMPTY_S
    assert simulation.emergency == heard
    assert (procedure._STOPPED in ours.ended_early) == heard
    assert ("emergency stop not delivered" in ours.ended_early) != heard


def test_a_stop_is_obeyed_between_two_tries_to_land_by_a_line_that_breaks():
    """A send that fails at once never waited, so nothing asked for the stop: it was landed instead."""
    simulation = simulated()
    line = BreakingLine(simulation, 4.0)
    ours = Flight(Client(line), PLAN, arms=True, stop=lambda: line.passed_s() > 3.0)
    ours.fly()
    assert simulation.emergency
    assert LAND not in simulation.commands


def _arming(simulation: SimulatedCrazyflie, *, answers: bool) -> list[int]:
    """What is asked of its arming from here on."""
    takes, asked = simulation.take, list[int]()

    def take(raw: bytes) -> list[bytes]:
        arming = raw[0] >> 4 == 9 and raw[0] & 3 == 1
        asked.extend([raw[2]] if arming else [])
        done = takes(raw)
        return [] if arming and not answers else done

    simulation.take = take
    return asked


def test_who_cancels_before_it_arms_arms_nothing():
    simulation = simulated()
    asked = _arming(simulation, answers=True)
    with pytest.raises(LinkError, match="arming: cancelled"):
        fly(simulation, cancel=lambda: True)
    assert not asked


def test_an_arming_that_was_not_answered_is_undone():
    simulation = simulated()
    asked = _arming(simulation, answers=False)
    with pytest.raises(LinkError, match="does not answer: arming"):
        fly(simulation)
    assert asked[0] == 1
    assert not simulation.armed


def test_a_short_answer_of_its_memory_is_an_error_of_the_link():
    simulation, last = simulated(), 132 * len(PLAN.durations_s) - 24
    takes = simulation.take

    def short(raw: bytes) -> list[bytes]:
        reading = raw[0] >> 4 == 4 and raw[0] & 3 == 1 and int.from_bytes(raw[2:6], "little") >= last
        return [answer[:-4] if reading else answer for answer in takes(raw)]

    simulation.take = short
    with pytest.raises(LinkError, match=r"read back \d+ of \d+ bytes"):
        fly(simulation)


def test_a_flight_over_the_wrap_of_its_clock_has_one_time():
    """The log's stamps have 24 bits of milliseconds: 4.66 hours."""
    simulation = simulated(time_s=16767.0)
    ours, log = fly(simulation)
    assert not ours.ended_early
    assert np.diff(log.time_s).max() < 0.05
    assert log.time_s[-1] - log.time_s[0] > WAY.duration_s


def test_a_refusal_of_the_commander_is_told_in_words():
    simulation = simulated(refuses={START_TRAJECTORY: 8})
    ours, _ = fly(simulation)
    assert "refuses the trajectory's start: Exec format error (8)" in ours.ended_early
    assert simulation.commands[-2:] == [LAND, STOP]


def test_a_packet_that_is_too_long_is_an_error_of_ours():
    with pytest.raises(ValueError, match="31 bytes"):
        Packet(8, 0, bytes(31)).pack()
    assert Packet.unpack(b"\xff") is None
    assert Packet.unpack(Packet(9, 1, b"ab").pack()) == Packet(9, 1, b"ab")


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("crazyflie:radio://0/80/2M/E7E7E7E7E7", "the radio is not driven here"),
        ("crazyflie:usb://0", "no Crazyflie's address"),
        ("crazyflie:udp://127.0.0.1", "no Crazyflie's address"),
        ("crazyflie:udp://[::1]:19850", "no Crazyflie's address"),
        ("crazyflie:udp://10.0.0.5:19850", "is not this machine"),
    ],
)
def test_other_addresses_are_refused(address, said):
    with pytest.raises(InputError, match=said):
        endpoint(address)


def test_the_command_of_the_page_asks_for_a_checked_plan(documented, tmp_path):
    (block,) = documented
    (command,) = block.commands
    done = unchecked(tmp_path, command)
    assert done.returncode != 0
    assert "has not passed the final gate" in done.stderr


def test_a_low_start_is_approached_from_above():
    low = curves.hover(height_m=0.1, seconds=1.0)
    simulation = SimulatedCrazyflie()
    ours = Flight(Client(SimulatedTime(simulation)), poly4d.refit(low).trajectory, arms=True)
    ours.fly()
    assert not ours.ended_early
    assert max(place[2] for _, place in simulation.way) == pytest.approx(0.3, abs=0.02)


def test_the_late_answer_to_another_request_is_not_taken_for_this_ones():
    """A byte that its memory did not keep would pass for one that it did."""
    simulation = simulated()
    takes, held = simulation.take, []

    def late(raw: bytes) -> list[bytes]:
        answers, before = takes(raw), list(held)
        held[:] = answers
        return before + answers

    simulation.take = late
    ours = Flight(Client(SimulatedTime(simulation)), PLAN, arms=False)
    ours.upload()
    assert bytes(simulation.memory[: 132 * len(PLAN.durations_s)]) == pieces.packed(PLAN)
