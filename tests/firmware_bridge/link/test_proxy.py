"""The signing proxy: a station without the key reads through it, and gives orders only when it is asked to control."""

import json
import secrets
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.dialect.message import Message
from firmware_bridge.mavlink import Codec
from firmware_bridge.proxy import Proxy
from flight import InputError, LinkError
from tests.waiting import PATIENCE_S, until

LISTEN = "127.0.0.1:0"


class Station:
    """A ground station that cannot sign: a socket, a heartbeat, and what it received."""

    def __init__(self, url: str, system_id: int = 77) -> None:
        host, _, port = url.removeprefix("udp://").rpartition(":")
        self.codec = Codec(system_id, 190, None)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, int(port)))
        self.socket.settimeout(0.02)
        self.received: list[Message] = []
        self.raw: list[bytes] = []
        self._beat_s = 0.0

    def send(self, message: Message) -> None:
        self.socket.send(self.codec.encode(message))

    def until(self, holds: Callable[[], object]) -> None:
        deadline_s = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < deadline_s, "it did not come about"
            if time.monotonic() > self._beat_s:
                self._beat_s = time.monotonic() + 0.2
                self.send(m.Heartbeat(type=6, autopilot=8, system_status=4, mavlink_version=3))
            try:
                raw = self.socket.recv(4096)
            except OSError:
                continue
            self.raw.append(raw)
            self.received += [received.message for received in self.codec.decode(raw)]

    def last(self, kind: type[Message]) -> Message | None:
        return next((message for message in reversed(self.received) if isinstance(message, kind)), None)

    def order(self, command: m.Command, value: float = 0.0) -> int:
        """Give an order until it is answered; the reason."""
        request_id = secrets.randbits(32) | 1  # answers go to everybody
        order = m.MissionCommand(request_id=request_id, command=command, value=value)

        def answered() -> Message | None:
            self.send(order)
            return next((r for r in self.received if getattr(r, "request_id", 0) == request_id), None)

        self.until(answered)
        answer = answered()
        assert isinstance(answer, m.MissionResult)
        return answer.reason


@pytest.fixture
def station() -> Iterator[Callable[..., Station]]:
    made: list[Station] = []

    def start(proxy: Proxy, **options: int) -> Station:
        made.append(Station(proxy.url, **options))
        return made[-1]

    yield start
    for one in made:
        one.socket.close()


def test_a_station_without_the_key_reads_the_vehicle_unsigned(serve, plans, station):
    served = serve()
    with Proxy(served.url, plans.key, listen=LISTEN) as proxy:
        one = station(proxy)
        one.until(lambda: one.last(m.State) and one.last(m.Heartbeat))
        assert all(raw[2] & 1 == 0 for raw in one.raw)
        one.send(m.ParamRequestRead(param_index=0, target_system=1, target_component=1))
        one.until(lambda: one.last(m.ParamValue))
        assert proxy.status.stations == ("77/190",)
        assert one.order(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL
        assert proxy.status.in_control == ""


def test_with_control_the_first_station_gives_orders_and_the_second_does_not(serve, plans, station):
    served = serve()
    with Proxy(served.url, plans.key, listen=LISTEN, control=True) as proxy:
        first, second = station(proxy), None
        first.until(lambda: proxy.status.in_control == "77/190")
        second = station(proxy, system_id=78)
        second.until(lambda: second.last(m.State))
        assert first.order(m.Command.ARM) == 0
        assert second.order(m.Command.DISARM) == m.LinkReason.NOT_IN_CONTROL


def test_control_ends_when_the_link_to_the_station_is_lost_and_when_the_proxy_ends(
    serve, plans, station, dial, monkeypatch
):
    served, asked, ask = serve(), [], Proxy._ask_for_control
    monkeypatch.setattr(Proxy, "_ask_for_control", lambda self, action: asked.append(action) or ask(self, action))
    watcher = dial(served, system_id=5)
    with Proxy(served.url, plans.key, listen=LISTEN, control=True) as proxy:
        one = station(proxy)
        one.until(lambda: proxy.status.in_control)
        until(lambda: watcher.state.operator_system == 0)
        assert asked[-1] == 1  # it ended by itself
        one.until(lambda: proxy.status.in_control)
    assert asked[-1] == 0  # it was given back
    until(lambda: watcher.state.operator_system == 0)


def test_control_taken_by_force_is_not_taken_back(serve, plans, station, dial):
    served = serve()
    other = dial(served, system_id=5)
    with Proxy(served.url, plans.key, listen=LISTEN, control=True) as proxy:
        one = station(proxy)
        one.until(lambda: proxy.status.in_control)
        other.take_control(force=True)
        one.until(lambda: proxy.status.operator_system == 5)
        assert one.order(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL
        other.close()
        one.until(lambda: proxy.status.operator_system == 0)
        later_s = time.monotonic() + 1.5  # three renewals
        one.until(lambda: time.monotonic() > later_s)
        assert one.order(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL


def test_control_comes_back_after_the_vehicle_was_switched_off_and_on(serve, plans, station):
    """It challenges every stream anew; the proxy answers for its stations."""
    served = serve()
    with Proxy(served.url, plans.key, listen=LISTEN, control=True) as proxy:
        one = station(proxy)
        one.until(lambda: proxy.status.in_control)
        served.restart()
        one.until(lambda: not proxy.status.in_control)
        one.until(lambda: proxy.status.in_control)
        assert one.order(m.Command.ARM) == 0


@pytest.mark.parametrize("control", [False, True])
def test_a_station_with_the_id_of_the_operator_elsewhere_is_not_taken_for_it(serve, plans, station, dial, control):
    served = serve()
    operator = dial(served, system_id=77)
    operator.take_control()
    with Proxy(served.url, plans.key, listen=LISTEN, control=control) as proxy:
        one = station(proxy, system_id=77)
        one.until(lambda: proxy.status.operator_system == 77)
        started_s = time.monotonic()
        one.until(lambda: time.monotonic() > started_s + 1.0)
        one.send(m.MissionCommand(request_id=9, command=m.Command.ARM, target_system=1, target_component=1))
        one.until(lambda: time.monotonic() > started_s + 1.5)
        assert operator.state.mission is m.MissionState.DISARMED
        assert proxy.status.in_control == ""


def test_a_wrong_key_a_missing_vehicle_and_a_taken_port_are_named(serve, plans):
    served = serve()
    with pytest.raises(LinkError, match="not with our key"), Proxy(served.url, b"x" * 32, listen=LISTEN, timeout_s=1.5):
        pass
    silent = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    silent.bind(("127.0.0.1", 0))
    nobody = f"udp://127.0.0.1:{silent.getsockname()[1]}"
    with pytest.raises(LinkError, match=r"no vehicle answers at .* within \d+(\.\d+)? s"):
        Proxy(nobody, plans.key, listen=LISTEN, timeout_s=0.3).serve()
    with pytest.raises(LinkError, match=r"cannot listen at .* in use"):
        Proxy(nobody, plans.key, listen=nobody.removeprefix("udp://"))
    silent.close()
    for bad in ("here", "127.0.0.1:", ":14551", "127.0.0.1:70000"):
        with pytest.raises(InputError, match="HOST:PORT"):
            Proxy(served.url, plans.key, listen=bad)


def test_the_verb_serves_until_ctrl_c_and_gives_control_back(serve, plans, dial, tmp_path, station):
    served = serve()
    watcher = dial(served, system_id=5)
    key_file = tmp_path / "link.key"
    key_file.write_text(plans.key.hex())
    key_file.chmod(0o600)
    arguments = [sys.executable, "-m", "goshawk", "proxy", "--url", served.url, "--key", str(key_file)]
    arguments += ["--listen", LISTEN, "--control", "--json"]
    running = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert running.stdout
        first = json.loads(running.stdout.readline())
        one = Station(first["listening"])
        one.until(lambda: watcher.state.operator_system == 77)
        reported: list[str] = []
        reader = threading.Thread(target=lambda: [reported.append(line) for line in running.stdout])
        reader.start()
        one.until(lambda: reported and json.loads(reported[-1])["in_control"] == "77/190")
        running.send_signal(2)
        reader.join()
        running.wait(PATIENCE_S)
        err = running.stderr.read()
        one.socket.close()
    finally:
        running.kill()
    assert running.returncode == 130
    assert "stopped" in err
    assert "Traceback" not in err
    until(lambda: watcher.state.operator_system == 0)


def test_the_verb_names_the_fault(tmp_path, capsys):
    from goshawk.cli import main

    with pytest.raises(SystemExit) as ended:
        main(["proxy", "--key", str(tmp_path / "none.key")])
    assert ended.value.code == 2
    assert "no link key at" in capsys.readouterr().err


def test_of_two_proxies_for_stations_of_one_id_one_is_in_control(serve, plans, station):
    served = serve()
    with Proxy(served.url, plans.key, listen=LISTEN, control=True) as first:
        one = station(first)
        one.until(lambda: first.status.in_control == "77/190")
        with Proxy(served.url, plans.key, listen=LISTEN, control=True) as second:
            other = station(second)
            other.until(lambda: second.status.operator_system == 77)
            assert second.status.in_control == ""
            one.until(lambda: one.order(m.Command.ARM) == 0)
