"""Vehicles are found by a heartbeat that is sent to all: who answers is one, whoever else speaks is not."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import vehicle
from firmware_bridge import SitlVehicle, keys
from firmware_bridge.dialect.generated.messages import Heartbeat
from firmware_bridge.mavlink import Codec
from flight import LinkError
from gcs_web.vehicle import discovery
from tests.waiting import until


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    keys.create(tmp_path / "link.key")
    return tmp_path / "link.key"


def sitl(key_file: Path) -> SitlVehicle:
    plant = vehicle.simulate.Plant(vehicle.example("rigter2019"), vehicle.simulate.State(), ground_m=0.0)
    return SitlVehicle(plant, {}, key=keys.load(key_file))


def place(url: str) -> tuple[str, int]:
    host, _, port = url.removeprefix("udp://").rpartition(":")
    return host, int(port)


@contextlib.contextmanager
def answering(answer: bytes) -> Iterator[tuple[str, int]]:
    """Somebody at a port of this machine who says the same to everything."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as served:
        served.bind(("127.0.0.1", 0))
        served.settimeout(0.05)
        over = threading.Event()

        def serve() -> None:
            while not over.is_set():
                with contextlib.suppress(OSError):
                    served.sendto(answer, served.recvfrom(65536)[1])

        thread = threading.Thread(target=serve)
        thread.start()
        yield served.getsockname()
        over.set()
        thread.join()


def test_two_vehicles_are_found_once_each_and_a_silent_port_is_none(key_file):
    with sitl(key_file) as one, sitl(key_file) as two:
        asked = [place(one.url), place(two.url), ("127.0.0.1", 9)]
        there = sorted([one.url, two.url])
        until(lambda: sorted(each.url for each in discovery.look(key_file, to=asked, listen_s=0.8)) == there, "both")


@pytest.mark.parametrize(
    ("answer", "systems"),
    [
        (Codec(7, 1, None).encode(Heartbeat()), [7]),
        (bytes([0xFE, 9, 0, 5, 1, 0, *range(9), 0, 0]), [5]),
        (Codec(255, 190, None).encode(Heartbeat()), []),
        (b"hello", []),
        (b"", []),
        (bytes([0xFD]), []),
    ],
)
def test_who_speaks_mavlink_and_is_no_ground_station_is_a_vehicle(key_file, answer, systems):
    with answering(answer) as address:
        found = discovery.look(key_file, to=[address], listen_s=0.4)
    assert [each.system for each in found] == systems


def test_each_network_of_this_machine_is_asked_and_not_only_that_of_the_default_route():
    own = discovery._addresses(discovery._OWN) - {"127.0.0.1"}
    assert len(discovery.networks()) >= 1
    if own:
        assert "255.255.255.255" not in discovery.networks()


def test_a_machine_without_a_network_says_so_and_not_that_nobody_answered(monkeypatch):
    monkeypatch.setattr(discovery, "networks", lambda: ["no such host"])
    monkeypatch.setattr(discovery, "PORTS", range(9, 10))
    with pytest.raises(LinkError, match="in no network"):
        discovery.look(listen_s=0.2)


def test_without_a_key_it_asks_all_the_same(tmp_path):
    with answering(Codec(7, 1, None).encode(Heartbeat())) as address:
        assert len(discovery.look(tmp_path / "none.key", to=[address], listen_s=0.4)) == 1
