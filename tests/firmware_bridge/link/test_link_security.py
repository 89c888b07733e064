"""A hostile line: what is not signed with the key, or was recorded, changes nothing and is counted."""

import hashlib
import secrets
import socket
import time

import numpy as np
import pytest

from firmware_bridge import _controller, keys, mavlink
from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.impairment import Impairment, Line
from firmware_bridge.link import connect
from firmware_bridge.mavlink import Codec, Signing
from flight import FormatError, InputError, LinkError

NOW = 5_000_000


class Endpoint:
    """The vehicle's end of the link on its own: no sockets, no clock but ours."""

    def __init__(self, key: bytes | None, start_10us: int = 0) -> None:
        self.controller = _controller.Controller()
        values = np.array([row[3] for row in _controller.parameter_table()], dtype=np.float32)
        assert self.controller.set_parameters(values)[0] == 0
        self.link = _controller.Link(self.controller, key, 1, start_10us, 1, 10**9, 0, 5000, 1)
        self.ears = Codec(250, 1, None)

    def receive(self, data: bytes, *, datagram: bool = True) -> int:
        return self.link.receive(data, datagram, NOW)

    def says(self, kind: type) -> list:
        frames = []
        while frame := self.link.transmit(NOW):
            frames += self.ears.decode(frame)
        return [frame.message for frame in frames if isinstance(frame.message, kind)]


def station(key: bytes | None, system_id: int = 255) -> Codec:
    return Codec(system_id, 190, Signing(key) if key else None)


def lease(action: int = 1, nonce: int = 7) -> m.LeaseRequest:
    return m.LeaseRequest(target_system=1, target_component=1, nonce=nonce, action=action)


def test_the_vehicles_sha256_is_sha256():
    for n in (0, 1, 55, 56, 63, 64, 65, 119, 120, 500, 4096):
        data = bytes(i * 7 & 0xFF for i in range(n))
        assert _controller.sha256(data) == hashlib.sha256(data).digest(), n


def test_only_the_right_signature_opens_the_door(plans):
    endpoint = Endpoint(plans.key)
    for codec, column in ((station(None), "without_signature"), (station(b"x" * 32), "wrong_key")):
        before = endpoint.link.counts()[column]
        assert endpoint.receive(codec.encode(lease())) == 0
        assert endpoint.link.counts()[column] == before + 1
    assert not endpoint.says(m.LeaseStatus)
    assert endpoint.receive(station(plans.key).encode(lease())) == 1
    assert endpoint.says(m.LeaseStatus)[0].operator_system == 255


def test_a_recorded_frame_is_refused_now_and_after_a_restart(plans):
    codec = station(plans.key)
    recorded = [codec.encode(lease(nonce=i)) for i in range(40)]
    endpoint = Endpoint(plans.key)
    assert sum(endpoint.receive(frame) for frame in recorded) == 40
    assert sum(endpoint.receive(frame) for frame in recorded) == 0
    assert endpoint.link.counts()["replayed"] == 40
    restarted = Endpoint(plans.key, start_10us=codec.signing.last_stamp)
    assert sum(restarted.receive(frame) for frame in recorded) == 0
    assert restarted.receive(codec.encode(lease())) == 1


def test_frames_may_overtake_each_other_and_each_counts_once(plans):
    codec = station(plans.key)
    frames = [codec.encode(lease(nonce=i)) for i in range(300)]
    rng = np.random.default_rng(1)
    swapped = [frames[i] for i in np.argsort(np.arange(300) + rng.uniform(0, 6, 300))]
    endpoint = Endpoint(plans.key)
    assert sum(endpoint.receive(frame) for frame in swapped for _ in range(2)) == 300
    ground = Signing(plans.key)
    assert sum(ground.accepts(frame) for frame in swapped for _ in range(2)) == 300


def test_any_number_of_stations_may_follow_each_other_and_none_comes_back_from_a_recording(plans):
    """The vehicle remembers four senders; the one silent for longest makes room, and what it sent stays refused."""
    endpoint = Endpoint(plans.key)
    recorded = []
    for system_id in range(20, 40):
        codec = station(plans.key, system_id)
        recorded.append([codec.encode(lease(action=2)) for _ in range(3)])
        assert sum(endpoint.receive(frame) for frame in recorded[-1]) == 3
        assert sum(endpoint.receive(frame) for frames in recorded for frame in frames) == 0
    replayed = endpoint.link.counts()["replayed"]
    assert replayed == sum(3 * n for n in range(1, 21))
    assert endpoint.receive(station(plans.key, 20).encode(lease())) == 1  # but its next word counts


def test_every_damaged_frame_is_refused(plans):
    endpoint = Endpoint(plans.key)
    codec = station(plans.key)
    for bit in range(8 * len(codec.encode(lease()))):
        frame = bytearray(codec.encode(lease()))
        frame[bit // 8] ^= 1 << bit % 8
        assert endpoint.receive(bytes(frame)) == 0, bit


def test_oversized_and_cut_frames_are_no_frames(plans):
    """A length byte that claims more than the message has, more than came, or less: no frame; the next one counts."""
    endpoint = Endpoint(plans.key)
    codec = station(plans.key)
    for claimed in range(256):
        frame = bytearray(codec.encode(lease()))
        if claimed == frame[1]:
            continue
        frame[1] = claimed
        assert endpoint.receive(bytes(frame)) == 0
        padded = bytes(frame) + secrets.token_bytes(300)
        assert endpoint.receive(padded) == 0
    for length in range(len(codec.encode(lease()))):
        assert endpoint.receive(codec.encode(lease())[:length]) == 0
    assert endpoint.receive(secrets.token_bytes(65_000)) == 0
    assert endpoint.receive(codec.encode(lease())) == 1
    assert not endpoint.says(m.TrajectoryStatus)


def test_a_whole_frame_that_is_longer_than_its_message_does_not_spill(plans):
    """255 bytes of payload for a message of 13, with a good checksum and signature: the surplus means nothing."""
    endpoint = Endpoint(plans.key)
    codec = station(plans.key)

    class LongLease(m.LeaseRequest):
        def pack(self) -> bytes:
            return m.LeaseRequest.pack(self).ljust(m.LeaseRequest.STRUCT.size, b"\0").ljust(255, b"\xff")

    long_lease = LongLease(target_system=1, target_component=1, nonce=7, action=1)
    assert endpoint.receive(codec.encode(long_lease)) == 1
    assert endpoint.says(m.LeaseStatus)[0].operator_system == 255


def test_whole_frames_are_found_in_rubbish_in_any_cut(plans):
    rng = np.random.default_rng(3)
    codec = station(plans.key)
    stream = b""
    for i in range(50):
        rubbish = bytes(rng.choice([0xFD, 0x00, 0x2A, 0xFF], rng.integers(0, 30)))
        stream += rubbish + b"\0" * 300 + codec.encode(lease(nonce=i))
    endpoint = Endpoint(plans.key)
    accepted, position = 0, 0
    while position < len(stream):
        n = int(rng.integers(1, 40))
        accepted += endpoint.receive(stream[position : position + n], datagram=False)
        position += n
    assert accepted == 50


def test_frames_for_others_and_from_our_own_id_are_ignored(plans):
    endpoint = Endpoint(plans.key)
    assert endpoint.receive(station(plans.key).encode(m.LeaseRequest(target_system=2, target_component=1))) == 0
    assert endpoint.receive(station(plans.key, system_id=1).encode(lease())) == 0
    assert endpoint.link.counts()["not_for_us"] == 2


def test_a_repeated_order_is_answered_and_not_carried_out_again(plans):
    endpoint = Endpoint(None)
    codec = station(None)
    standing = np.array([0.0] * 6 + [1.0] + [0.0] * 6)
    endpoint.controller.tick(2000, standing, 2000, 2000, 0.0)
    endpoint.receive(codec.encode(lease()))
    arm = codec.encode(m.MissionCommand(target_system=1, target_component=1, request_id=9, command=m.Command.ARM))
    endpoint.receive(arm)
    assert [(r.reason, r.mission_state) for r in endpoint.says(m.MissionResult)] == [(0, m.MissionState.ARMED)]
    assert endpoint.controller.command(m.Command.DISARM, 0.0) == 0
    endpoint.receive(arm)
    assert [(r.reason, r.mission_state) for r in endpoint.says(m.MissionResult)] == [(0, m.MissionState.DISARMED)]


def test_one_station_is_in_control_and_the_others_watch(serve, dial, plans):
    served = serve()
    pilot, guest = dial(served), dial(served, system_id=200)
    pilot.take_control()
    with pytest.raises(LinkError, match="station 255 is in control"):
        guest.take_control()
    with pytest.raises(LinkError, match="station 255 is in control"):
        guest.upload(plans.file(1))
    assert guest.try_command(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL
    assert guest.read_back() is None
    guest.take_control(force=True)
    time.sleep(0.8)  # the pilot's renewals come to nothing
    assert pilot.try_command(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL
    assert guest.state.in_control
    assert not pilot.state.in_control
    guest.close()
    pilot.take_control()


def test_control_ends_when_its_holder_falls_silent(serve, dial, plans):
    served = serve()
    pilot = dial(served)
    pilot.take_control()
    pilot._port.keep_lease = False  # a crash: no renewal, no farewell
    guest = dial(served, system_id=200)
    with pytest.raises(LinkError, match="in control"):
        guest.take_control()
    time.sleep(3.2)
    guest.take_control()


def test_a_flood_of_foreign_frames_does_not_disturb_the_flight(serve, dial, plans):
    served = serve(speed=2.0)
    link = dial(served)
    link.upload(plans.file(1))
    host, port = served.url.removeprefix("udp://").split(":")
    foreign, wrong = station(None, 9), station(secrets.token_bytes(32), 9)
    sent = []

    def flood(stage: str, _: float) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
            for i in range(50):
                kill = m.MissionCommand(target_system=1, target_component=1, request_id=i + 1, command=m.Command.KILL)
                frame = (foreign if i % 2 else wrong).encode(kill) if i % 5 else secrets.token_bytes(200)
                attacker.sendto(frame, (host, int(port)))
                sent.append(stage)

    log = link.fly(progress=flood)
    on_path = log.columns["mission_state"] == m.MissionState.TRAJECTORY
    error_m = np.linalg.norm(
        (log.vector("position_world_m") - log.vector("setpoint_position_world_m"))[on_path], axis=1
    )
    assert len(sent) > 1000
    assert error_m.mean() < 0.02
    counts = served.counts()
    assert counts["without_signature"] > 100
    assert counts["wrong_key"] > 100


def test_another_key_is_named_as_the_cause(serve):
    served = serve()
    with pytest.raises(LinkError, match="not with our key"):
        connect(served.url, key=b"x" * 32, timeout_s=1.0)
    unsigned = serve(key=None)
    with pytest.raises(LinkError, match="not with our key"):
        connect(unsigned.url, key=b"x" * 32, timeout_s=1.0)
    with connect(unsigned.url, unsigned=True) as link:
        link.take_control()


def test_a_station_whose_clock_is_behind_is_heard(serve, dial, monkeypatch):
    served = serve()
    late = mavlink.timestamp_now()
    monkeypatch.setattr(mavlink, "timestamp_now", lambda: late - 360_000_000)  # an hour
    dial(served).take_control()


def test_a_key_file_is_private_and_never_overwritten(tmp_path):
    path = tmp_path / "keys" / "link.key"
    key = keys.load_or_create(path)
    assert keys.load(path) == key
    assert keys.load_or_create(path) == key
    assert path.stat().st_mode & 0o777 == 0o600
    with pytest.raises(InputError, match="not overwritten"):
        keys.create(path)
    path.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        keys.load(path)
    path.chmod(0o600)
    path.write_text("12 34")
    with pytest.raises(FormatError, match="64 hexadecimal"):
        keys.load(path)
    with pytest.raises(InputError, match="no link key"):
        keys.load(tmp_path / "none")


def test_lines_are_the_same_for_the_same_seed():
    def run() -> list[bytes]:
        line = Line(Impairment(loss_ratio=0.3, corrupt_ratio=0.2, jitter_s=0.1), np.random.default_rng(5))
        for i in range(50):
            line.push(bytes([i] * 10), None, 0.0)
        return [datagram for datagram, _ in line.pop(1.0)]

    assert run() == run()
    assert 20 < len(run()) < 48
