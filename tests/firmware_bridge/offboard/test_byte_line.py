"""The line: only to this machine, never half a message, and back after it broke."""

import socket

import pytest

from firmware_bridge.offboard.byte_line import LastingLine, TcpLine, connect
from flight import InputError, LinkError


def pair() -> tuple[socket.socket, socket.socket]:
    """Both ends of a connection with small buffers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        ours = socket.socket()
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        ours.connect(server.getsockname())
        theirs, _ = server.accept()
        theirs.settimeout(1.0)
        return ours, theirs


@pytest.mark.parametrize(
    "address",
    [
        "betaflight:tcp://192.168.1.20:5761",
        "betaflight:tcp://8.8.8.8:5761",
        "betaflight:tcp://[fe80::1]:5761",
        "betaflight:tcp://0.0.0.0:5761",
        "betaflight:tcp://quad.local:5761",
        "betaflight:tcp://localhost.example.org:5761",
        "betaflight:serial:///dev/ttyACM0",
    ],
)
def test_nothing_is_opened_that_may_be_a_real_vehicle(address, monkeypatch):
    monkeypatch.setattr(socket, "create_connection", lambda *_, **__: pytest.fail("it was opened"))
    with pytest.raises(InputError, match="the Betaflight bridge has flown only the SITL"):
        connect(address)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "[::1]"])
def test_this_machine_is_tried(host):
    with pytest.raises(LinkError, match="nothing answers"):
        connect(f"betaflight:tcp://{host}:1", patience_s=0.0)


def test_a_full_buffer_drops_whole_messages_and_loses_no_byte_of_one():
    ours, theirs = pair()
    line = TcpLine(ours)
    sent = [bytes([i % 251]) * 999 for i in range(500)]
    for message in sent:
        line.write(message)
    assert line._outbox.dropped > 100
    theirs.settimeout(0.2)
    got = b""
    for _ in range(1000):
        try:
            got += theirs.recv(65536)
        except TimeoutError:
            break
        line.write(b"z" * 999)
    assert len(got) > 999
    for begin in range(0, len(got) - 998, 999):
        assert len(set(got[begin : begin + 999])) == 1


def test_a_broken_line_is_opened_again():
    now = [0.0]
    pairs = [pair() for _ in range(2)]
    lines = iter([TcpLine(ours) for ours, _ in pairs])
    line = LastingLine(next(lines), lambda: next(lines), lambda: now[0])
    pairs[0][1].close()
    assert line.read() == b""
    assert line.broke == 1
    line.write(b"heard")
    assert pairs[1][1].recv(16) == b"heard"


def test_a_line_that_cannot_be_opened_again_is_tried_now_and_then_and_never_raises():
    now, opened = [0.0], []
    ours, theirs = pair()

    def again() -> TcpLine:
        opened.append(now[0])
        raise LinkError("not there")

    line = LastingLine(TcpLine(ours), again, lambda: now[0])
    theirs.close()
    for _ in range(100):
        now[0] += 0.01
        line.write(b"x")
        line.read()
    assert 3 <= len(opened) <= 8
