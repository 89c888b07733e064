"""A plan on a simulated Crazyflie by UDP, flown by a process of its own in the machine's time."""

import multiprocessing
import os
import subprocess
import sys

import numpy as np
import pytest

import vehicle
from firmware_bridge.controller import State
from firmware_bridge.crazyflie import flight as procedure
from firmware_bridge.crazyflie import process
from firmware_bridge.crazyflie.client import Client
from firmware_bridge.crazyflie.crtp import UdpTransport
from flight import InputError, LinkError, TrajectoryFile, silent, trajectory
from goshawk.commands.fly import crazyflie
from goshawk.commands.plan import poly4d
from tests import waiting
from tests.firmware_bridge.crazyflie.simulated_crazyflie import SimulatedCrazyflie, UdpServer
from tests.firmware_bridge.crazyflie.test_flight import LAND, MODEL, PLAN, START_TRAJECTORY, STOP, WAY
from tests.firmware_bridge.offboard import curves

SEEN = procedure.Seen(State.TRAJECTORY, np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), 3.9, 1.0)
SHORT = curves.hover(height_m=0.5, seconds=1.0)


@pytest.fixture
def server():
    serving = UdpServer(SimulatedCrazyflie(auto_arms=True))
    serving.start()
    yield serving
    serving.ends = True
    serving.join()


def test_by_udp_it_flies_in_a_process_of_its_own(server):
    file = TrajectoryFile(SHORT, "hover", "", "", SHORT.position([0.0, SHORT.duration_s]), {})
    said: list[str] = []
    log, early = crazyflie.fly(
        vehicle.example("rigter2019"), file, f"crazyflie:udp://127.0.0.1:{server.port}", arms=False,
        progress=lambda stage, fraction: said.append(stage), cancel=lambda: False,
    )  # fmt: skip
    assert not early
    assert said[0] == procedure.ALONE
    assert log.metadata["failsafe"] == procedure.ALONE
    assert int(log.metadata["pieces"]) <= poly4d.MOST_PIECES
    assert server.simulation.commands[-2:] == [LAND, STOP]


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"rate_rad_s": 0.4}, r"turns at \d+ deg/s about (roll|pitch) at .* allow 23 .*limits of the vehicle file"),
        ({"rotor_speed_max_rad_s": 1005.0}, r"takes [\d.]+ N at [\d.]+ s, the rotors give [\d.]+ N"),
    ],
)
def test_a_plan_that_the_vehicle_cannot_follow_is_refused_before_anything_is_sent(server, limits, said):
    slow = vehicle.example("rigter2019").with_limits(**limits)
    file = TrajectoryFile(WAY, "circle", "", "", WAY.position([0.0, WAY.duration_s]), {})
    with pytest.raises(InputError, match=said):
        crazyflie.fly(
            slow, file, f"crazyflie:udp://127.0.0.1:{server.port}", arms=True, progress=silent, cancel=lambda: False
        )
    assert not server.simulation.commands


def test_nobody_there_is_said():
    order = process.Order("crazyflie:udp://127.0.0.1:9", PLAN, arms=False, motor_of_rotor=(0, 1, 2, 3))
    with pytest.raises(LinkError, match="does not answer: its memories"):
        process.fly(order, progress=silent, cancel=lambda: False)


def test_a_reader_that_stops_holds_up_no_flight():
    ours, theirs = multiprocessing.Pipe()
    sent = 0
    while process.has_room(theirs) and sent < 100_000:
        theirs.send(SEEN)
        sent += 1
    assert 10 < sent < 100_000
    while ours.poll():
        ours.recv()
    assert process.has_room(theirs)
    theirs.close()
    assert not process.has_room(theirs)


@pytest.mark.slow
def test_one_who_asked_and_hangs_does_not_keep_the_crazyflie_in_the_air(server):
    """A pipe that is full from the beginning: nothing waits for it before the landing."""
    plan = poly4d.refit(SHORT).trajectory
    order = process.Order(f"crazyflie:udp://127.0.0.1:{server.port}", plan, False, (0, 1, 2, 3))
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    while process.has_room(theirs):
        theirs.send(SEEN)
    flying = multiprocessing.get_context("spawn").Process(target=process._main, args=(order, theirs), daemon=True)
    flying.start()
    theirs.close()
    try:
        waiting.until(lambda: STOP in server.simulation.commands)
        assert not server.simulation.dropped
    finally:
        ours.close()
        flying.join()


@pytest.mark.slow
def test_if_the_one_who_asked_is_killed_the_crazyflie_lands(server, tmp_path):
    long = curves.hover(height_m=0.5, seconds=60.0)
    trajectory.save(tmp_path / "way.json", TrajectoryFile(long, "way", "", "", long.position([0.0, 60.0]), {}))
    program = (
        "import sys; from pathlib import Path; import vehicle; from flight import trajectory, silent\n"
        "from goshawk.commands.fly import crazyflie\n"
        "if __name__ == '__main__':\n"
        "    item = trajectory.load(Path(sys.argv[1]))\n"
        "    crazyflie.fly(vehicle.example('rigter2019'), item, sys.argv[2], arms=False, progress=silent,\n"
        "                  cancel=lambda: False)\n"
    )
    (tmp_path / "asks.py").write_text(program)
    address = f"crazyflie:udp://127.0.0.1:{server.port}"
    command = [sys.executable, str(tmp_path / "asks.py"), str(tmp_path / "way.json"), address]
    asks = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": os.getcwd()})
    waiting.until(lambda: START_TRAJECTORY in server.simulation.commands)
    asks.kill()
    asks.wait()
    waiting.until(lambda: server.simulation.commands[-1] == STOP)
    assert LAND in server.simulation.commands
    assert not server.simulation.dropped


def test_a_socket_that_breaks_is_opened_anew(server):
    transport = UdpTransport("127.0.0.1", server.port)
    client = Client(transport)
    client.bits()
    transport._socket.close()
    with pytest.raises(LinkError, match="broke"):
        client.bits()
    client.bits()
    transport.close()


def test_a_plan_may_turn_as_fast_as_the_vehicle_files_limits_allow():
    times = np.arange(0.0, WAY.duration_s, 0.01)
    peak = float(np.abs(vehicle.flatness.state(MODEL, WAY, times).rate_body_rad_s[:, :2]).max())
    item = TrajectoryFile(WAY, "circle", "", "", WAY.position([0.0, WAY.duration_s]), {})
    crazyflie._require_followable(MODEL.with_limits(rate_rad_s=1.05 * peak), item)
    with pytest.raises(InputError, match="the vehicle file's limits allow"):
        crazyflie._require_followable(MODEL.with_limits(rate_rad_s=0.9 * peak), item)
