"""What the page says of the vehicle is as old as it looks: late, silent and half-dead vehicles over a real socket."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import vehicle
from firmware_bridge import SitlVehicle, VehicleState, keys
from firmware_bridge.dialect.generated.messages import Heartbeat, MissionState, MissionStatus, State
from firmware_bridge.mavlink import Codec, Signing
from flight import LinkError, Trajectory, TrajectoryFile
from gcs_web.protocol.vehicle import Vehicle
from gcs_web.vehicle.vehicle_watch import VehicleWatch
from tests.waiting import until


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    keys.create(tmp_path / "link.key")
    return tmp_path / "link.key"


@contextlib.contextmanager
def watching(port: int, key_file: Path) -> Iterator[tuple[VehicleWatch, list[Vehicle]]]:
    watch, told = VehicleWatch(f"udp://127.0.0.1:{port}", key_file=key_file), []
    watch.on_state = told.append
    watch.start()
    try:
        yield watch, told
    finally:
        watch.close()


def sitl_vehicle(key_file: Path, port: int = 0) -> SitlVehicle:
    plant = vehicle.simulate.Plant(vehicle.example("rigter2019"), vehicle.simulate.State(), ground_m=0.0)
    return SitlVehicle(plant, {}, key=keys.load(key_file), port=port)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_a_station_that_is_started_before_its_vehicle_waits_for_it(key_file, monkeypatch):
    monkeypatch.setattr("gcs_web.vehicle.vehicle_watch._RETRY_S", 0.05)
    port = free_port()
    with watching(port, key_file) as (watch, told):
        until(lambda: told and told[-1].link == "lost" and "no vehicle answers" in told[-1].reason)
        with sitl_vehicle(key_file, port):
            until(lambda: told[-1].link == "fresh" and told[-1].mission == "disarmed")
            assert watch.link.state is not None


def test_a_vehicle_that_falls_silent_looks_stale_then_lost(key_file):
    served = sitl_vehicle(key_file)
    with served, watching(int(served.url.rpartition(":")[2]), key_file) as (_, told):
        until(lambda: told and told[-1].link == "fresh")
        served.stop()
        until(lambda: told[-1].link == "lost")
    links = [state.link for state in told]
    assert "stale" in links[links.index("fresh") :]
    assert told[-1].age_s >= 2.0  # rounded to 10 ms


class HalfDeadVehicle:
    """Sends its position once, and heartbeats and its mission's state for ever."""

    def __init__(self, key: bytes) -> None:
        self._codec = Codec(1, 1, Signing(key))
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.05)
        self.port = self._socket.getsockname()[1]
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "HalfDeadVehicle":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        station, said_position = None, False
        while not self._end.is_set():
            with contextlib.suppress(OSError):
                station = self._socket.recvfrom(2048)[1]
            if station is None:
                continue
            messages = [Heartbeat(type=2, autopilot=12), MissionStatus()]
            if not said_position:
                messages.append(State(position_world_m=(1.0, 2.0, 3.0), q_world_body=(1.0, 0.0, 0.0, 0.0)))
                said_position = True
            for message in messages:
                self._socket.sendto(self._codec.encode(message), station)


def test_heartbeats_do_not_keep_an_old_position_fresh(key_file):
    with HalfDeadVehicle(keys.load(key_file)) as vehicle, watching(vehicle.port, key_file) as (_, told):
        until(lambda: told and told[-1].z_m == 3.0)
        until(lambda: told[-1].link == "lost")
        assert told[-1].age_s >= 2.0  # rounded to 10 ms


def test_a_picture_that_cannot_be_drawn_does_not_end_the_watch(key_file):
    served = sitl_vehicle(key_file)
    seen = []

    def draw(position_world_m: np.ndarray, _: np.ndarray) -> None:
        seen.append(position_world_m)
        if len(seen) == 1:
            raise RuntimeError("the 3D view is gone")

    with served, watching(int(served.url.rpartition(":")[2]), key_file) as (watch, told):
        watch.on_pose = draw
        until(lambda: len(seen) > 3 and told[-1].link == "fresh")


def heard(time_s: float, battery_v: float, mission: MissionState) -> VehicleState:
    zeros = np.zeros(3)
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    return VehicleState(0.0, time_s, zeros, upright, zeros, battery_v, mission, "", -1.0, "", 0, 0, True, 1)


def test_the_battery_lasts_until_the_controller_lands_and_not_until_it_would_refuse_to_arm(key_file, monkeypatch):
    """16 V on the ground sag to 14.6 V in the air, and fall by 0.02 V a second from there: 50 s to 13.6 V."""
    watch = VehicleWatch("udp://127.0.0.1:9", key_file=key_file)
    monkeypatch.setattr(watch, "_parameters", {"battery_arm_v": 14.8, "battery_land_v": 13.6})
    for time_s in range(20):
        watch._take_battery(heard(time_s, 16.0, MissionState.ARMED), "armed")
    for time_s in range(20, 23):
        watch._take_battery(heard(time_s, 15.0, MissionState.TAKE_OFF), "take off")
    assert watch._battery_left_s() is None
    for time_s in range(23, 44):
        watch._take_battery(heard(time_s, 14.6 - 0.02 * (time_s - 23), MissionState.HOLD), "hold")
    assert watch._battery_left_s() == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("check", "room_m"), [({}, None), ({"passed": True, "clearance_m": 0.4, "body_radius_m": 0.15}, 0.25)]
)
def test_a_clearance_that_was_not_proved_is_no_room_of_nothing(key_file, check, room_m):
    watch = VehicleWatch("udp://127.0.0.1:9", key_file=key_file)
    hops = Trajectory(np.array([1.0]), np.zeros((1, 4, 2)))
    file = TrajectoryFile(hops, "lap", "ab" * 32, "cd" * 32, np.zeros((2, 3)), check)
    with pytest.raises(LinkError, match="no vehicle answers"):
        watch.fly(file, threading.Event(), lambda _: None)
    assert watch._room_m == (None if room_m is None else pytest.approx(room_m))
