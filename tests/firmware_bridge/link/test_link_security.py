"""A hostile line: what is not signed with the key, or was recorded, changes nothing and is counted."""

import contextlib
import hashlib
import json
import secrets
import socket
import threading

import numpy as np
import pytest

from firmware_bridge import _controller, keys, mavlink
from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.impairment import Impairment, Line
from firmware_bridge.link import Link, connect
from firmware_bridge.mavlink import Codec, Signing
from flight import FormatError, InputError, LinkError
from tests import waiting


class Endpoint:
    """The vehicle's end of the link on its own: no sockets, no clock but ours, a millisecond a datagram."""

    def __init__(self, key: bytes | None, start_10us: int = 0, boot_id: int = 1) -> None:
        self.controller = _controller.Controller()
        values = np.array([row[3] for row in _controller.parameter_table()], dtype=np.float32)
        assert self.controller.set_parameters(values)[0] == 0
        self.link = _controller.Link(self.controller, key, 1, start_10us, boot_id, 10**9, 0, 5000, 1)
        self.reader = Codec(250, 1, None)
        self.now_us = 1

    def receive(self, data: bytes, *, datagram: bool = True) -> int:
        self.now_us += 5000
        return self.link.receive(data, datagram, self.now_us)

    def sends(self, kind: type) -> list:
        frames = []
        while frame := self.link.transmit(self.now_us):
            frames += self.reader.decode(frame)
        return [frame.message for frame in frames if isinstance(frame.message, kind)]

    def admit(self, codec: Codec) -> bytes:
        """Answer the challenge for a station, as `port.Port` does; the answer's frame."""
        self.now_us += 100_000
        self.receive(codec.encode(m.Heartbeat()))
        challenge = self.sends(m.Ping)[-1]
        answer = codec.encode(
            m.Ping(time_usec=challenge.time_usec, seq=challenge.seq, target_system=1, target_component=1)
        )
        assert self.receive(answer) == 1
        return answer


def station(key: bytes | None, system_id: int = 255, *, like: Link | None = None) -> Codec:
    """Of this id; `like` claims the stream of a link."""
    claimed = like._port.codec.signing.link_id if like else 0
    return Codec(system_id, 190, Signing(key, claimed) if key else None)


def lease(action: int = 1, nonce: int = 7) -> m.LeaseRequest:
    return m.LeaseRequest(target_system=1, target_component=1, nonce=nonce, action=action)


def test_the_vehicles_sha256_is_sha256():
    for n in (0, 1, 55, 56, 63, 64, 65, 119, 120, 500, 4096):
        data = bytes(i * 7 & 0xFF for i in range(n))
        assert _controller.sha256(data) == hashlib.sha256(data).digest(), n


def test_only_the_right_signature_is_accepted(plans):
    endpoint = Endpoint(plans.key)
    right = station(plans.key)
    endpoint.admit(right)
    for codec, column in ((station(None), "without_signature"), (station(b"x" * 32), "wrong_key")):
        before = endpoint.link.counts()[column]
        assert endpoint.receive(codec.encode(lease())) == 0
        assert endpoint.link.counts()[column] == before + 1
    assert not endpoint.sends(m.LeaseStatus)
    assert endpoint.receive(right.encode(lease())) == 1
    assert endpoint.sends(m.LeaseStatus)[0].operator_system == 255


def test_a_recorded_frame_is_refused_now_and_after_a_restart(plans):
    codec = station(plans.key)
    endpoint = Endpoint(plans.key)
    recorded = [endpoint.admit(codec), *(codec.encode(lease(nonce=i)) for i in range(40))]
    assert sum(endpoint.receive(frame) for frame in recorded) == 40
    assert sum(endpoint.receive(frame) for frame in recorded) == 0
    assert endpoint.link.counts()["replayed"] == 42
    for start_10us in (0, codec.signing.last_stamp - 10**7, codec.signing.last_stamp):
        restarted = Endpoint(plans.key, start_10us, boot_id=2)
        assert sum(restarted.receive(frame) for frame in recorded) == 0
        restarted.admit(codec)
        assert sum(restarted.receive(frame) for frame in recorded) == 0
        assert restarted.receive(codec.encode(lease())) == 1


def test_a_recorded_flight_does_not_arm_the_restarted_vehicle_whatever_the_clocks(plans, monkeypatch):
    """28 frames of a session, recorded while the station's clock was an hour ahead of the vehicle's."""
    ahead = mavlink.timestamp_now() + 360_000_000
    monkeypatch.setattr(mavlink, "timestamp_now", lambda: ahead)
    codec = station(plans.key)
    standing = np.array([0.0] * 6 + [1.0] + [0.0] * 6)

    def vehicle(boot_id: int) -> Endpoint:
        endpoint = Endpoint(plans.key, ahead - 360_000_000, boot_id)
        endpoint.controller.tick(2000, standing, 2000, 2000, 0.0)
        return endpoint

    live = vehicle(1)
    orders = [m.MissionCommand(request_id=1, command=m.Command.ARM)]
    orders += [m.MissionCommand(request_id=2, command=m.Command.TAKE_OFF, value=1.5)]
    for order in orders:
        order.target_system = order.target_component = 1
    recorded = [live.admit(codec), *(codec.encode(lease(nonce=i)) for i in range(25))]
    recorded += [codec.encode(order) for order in orders]
    assert sum(live.receive(frame) for frame in recorded[1:]) == 27
    assert live.controller.state() == m.MissionState.TAKE_OFF
    restarted = vehicle(2)
    assert sum(restarted.receive(frame) for _ in range(3) for frame in recorded) == 0
    assert restarted.controller.state() == m.MissionState.DISARMED
    assert restarted.link.counts()["unopened"] == 3 * 28


def test_frames_may_overtake_each_other_and_each_counts_once(plans):
    codec = station(plans.key)
    endpoint = Endpoint(plans.key)
    endpoint.admit(codec)
    frames = [codec.encode(lease(nonce=i)) for i in range(300)]
    rng = np.random.default_rng(1)
    swapped = [frames[i] for i in np.argsort(np.arange(300) + rng.uniform(0, 6, 300))]
    assert sum(endpoint.receive(frame) for frame in swapped for _ in range(2)) == 300
    ground = Signing(plans.key)
    assert sum(ground.accepts(frame) for frame in swapped for _ in range(2)) == 300


def test_any_number_of_stations_may_follow_each_other_and_none_comes_back_from_a_recording(plans):
    """The vehicle remembers four senders; the one unused for longest makes room, and what it sent stays refused."""
    endpoint = Endpoint(plans.key)
    recorded = []
    for system_id in range(20, 40):
        codec = station(plans.key, system_id)
        session = [endpoint.admit(codec), *(codec.encode(lease(action=2)) for _ in range(3))]
        assert sum(endpoint.receive(frame) for frame in session) == 3
        recorded.append(session)
        assert sum(endpoint.receive(frame) for frames in recorded for frame in frames) == 0
    back = station(plans.key, 20)
    assert endpoint.receive(back.encode(lease())) == 0
    endpoint.admit(back)
    assert endpoint.receive(back.encode(lease())) == 1  # what it sends now counts


def test_the_station_in_control_is_never_the_one_that_makes_room(plans):
    endpoint = Endpoint(plans.key)
    pilot = station(plans.key)
    endpoint.admit(pilot)
    assert endpoint.receive(pilot.encode(lease())) == 1
    for system_id in range(20, 30):
        endpoint.admit(station(plans.key, system_id))
    assert endpoint.receive(pilot.encode(lease())) == 1


def test_every_damaged_frame_is_refused(plans):
    endpoint = Endpoint(plans.key)
    codec = station(plans.key)
    endpoint.admit(codec)
    for bit in range(8 * len(codec.encode(lease()))):
        frame = bytearray(codec.encode(lease()))
        frame[bit // 8] ^= 1 << bit % 8
        assert endpoint.receive(bytes(frame)) == 0, bit


def test_oversized_and_cut_frames_are_no_frames(plans):
    """A length byte that claims more than the message has, more than came, or less: no frame; the next one counts."""
    endpoint = Endpoint(plans.key)
    codec = station(plans.key)
    endpoint.admit(codec)
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
    assert not endpoint.sends(m.TrajectoryStatus)


def test_a_whole_frame_that_is_longer_than_its_message_does_not_spill(plans):
    """255 bytes of payload for a message of 13, with a good checksum and signature: the surplus means nothing."""
    endpoint = Endpoint(plans.key)
    codec = station(plans.key)
    endpoint.admit(codec)

    class LongLease(m.LeaseRequest):
        def pack(self) -> bytes:
            return m.LeaseRequest.pack(self).ljust(m.LeaseRequest.STRUCT.size, b"\0").ljust(255, b"\xff")

    long_lease = LongLease(target_system=1, target_component=1, nonce=7, action=1)
    assert endpoint.receive(codec.encode(long_lease)) == 1
    assert endpoint.sends(m.LeaseStatus)[0].operator_system == 255


def test_whole_frames_are_found_in_rubbish_in_any_cut(plans):
    rng = np.random.default_rng(3)
    codec = station(plans.key)
    endpoint = Endpoint(plans.key)
    endpoint.admit(codec)
    stream = b""
    for i in range(50):
        rubbish = bytes(rng.choice([0xFD, 0x00, 0x2A, 0xFF], rng.integers(0, 30)))
        stream += rubbish + b"\0" * 300 + codec.encode(lease(nonce=i))
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
    assert [(r.reason, r.mission_state) for r in endpoint.sends(m.MissionResult)] == [(0, m.MissionState.ARMED)]
    assert endpoint.controller.command(m.Command.DISARM, 0.0) == 0
    endpoint.receive(arm)
    assert [(r.reason, r.mission_state) for r in endpoint.sends(m.MissionResult)] == [(0, m.MissionState.DISARMED)]


def test_one_station_is_in_control_and_the_others_watch(serve, dial, plans):
    served = serve()
    pilot, guest = dial(served), dial(served, system_id=200)
    pilot.take_control()
    with pytest.raises(LinkError, match=r"station 255 \(.+\) is in control"):
        guest.take_control()
    with pytest.raises(LinkError, match=r"station 255 \(.+\) is in control"):
        guest.upload(plans.file(1))
    assert guest.try_command(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL
    assert guest.read_back() is None
    guest.take_control(force=True)
    waiting.until(lambda: not pilot.state.in_control, "the refusal of the pilot's renewals")
    assert pilot.try_command(m.Command.ARM) == m.LinkReason.NOT_IN_CONTROL
    assert guest.state.in_control
    assert not pilot.state.in_control
    guest.close()
    pilot.take_control()


def test_control_of_a_holder_that_fell_silent_is_waited_for(serve, dial):
    served = serve()
    pilot = dial(served)
    pilot.take_control()
    pilot._port.keep_lease = False  # a crash: no renewal, no farewell
    guest = dial(served, system_id=200)
    guest.take_control()
    assert guest.try_command(m.Command.LOG_STOP) == 0


def test_a_flood_of_foreign_frames_does_not_disturb_the_flight(serve, dial, plans):
    """Unsigned ones, wrongly signed ones of a stranger, and wrongly signed ones that claim to be of the pilot."""
    served = serve(speed=2.0)
    link = dial(served)
    link.upload(plans.file(1))
    host, port = served.url.removeprefix("udp://").split(":")
    other_key = secrets.token_bytes(32)
    attackers = [station(None, 9), station(other_key, 9), station(other_key, 255, like=link)]
    sent = []

    def flood(stage: str, _: float) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
            for i in range(50):
                kill = m.MissionCommand(target_system=1, target_component=1, request_id=i + 1, command=m.Command.KILL)
                frame = attackers[i % 3].encode(kill) if i % 5 else secrets.token_bytes(200)
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
    assert counts["unopened"] > 100
    assert counts["wrong_key"] + counts["over_budget"] > 100
    np.testing.assert_allclose(np.diff(log.time_s), 0.005, atol=1e-9)  # not a tick was left out


def test_kill_gets_through_a_flood_that_claims_to_be_of_the_pilot(serve, dial):
    """At the rate of a small flight computer, not of this one."""
    served = serve(signature_checks_per_s=500)
    link = dial(served)
    link.take_control()
    link.command(m.Command.ARM)
    host, port = served.url.removeprefix("udp://").split(":")
    forger, over = station(secrets.token_bytes(32), 255, like=link), threading.Event()

    def flood() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
            while not over.wait(0.001):
                for _ in range(10):
                    attacker.sendto(forger.encode(lease(action=2)), (host, int(port)))

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        waiting.until(lambda: served.counts()["over_budget"] > 100)
        link.command(m.Command.KILL)
    finally:
        over.set()
        thread.join()


def test_the_stations_statistics_count_what_the_vehicle_refused_of_others(serve, dial):
    served = serve()
    link = dial(served)

    def refused() -> int:
        counts = served.counts()
        return sum(counts.values()) - counts["accepted"] - counts["sent"]

    waiting.until(lambda: link.statistics.refused_by_vehicle == refused())  # of the greeting before it signed, too
    before, received = link.statistics.refused_by_vehicle, link.statistics.counts.received_bytes
    host, port = served.url.removeprefix("udp://").split(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(station(None).encode(lease()), (host, int(port)))
    waiting.until(lambda: link.statistics.refused_by_vehicle == before + 1)
    assert link.statistics.counts.received_bytes > received
    assert link.statistics.counts.refused == 0  # this station refused nothing


def test_a_vehicle_without_listeners_accepts_signed_stations_only(serve, dial, plans):
    served = serve(listeners=False)
    dial(served).take_control()
    with pytest.raises(LinkError, match="no vehicle answers"):
        connect(served.url, unsigned=True, timeout_s=0.5)


def test_the_sitl_vehicle_keeps_its_boot_count_and_stamp_over_a_restart(serve, dial, monkeypatch, tmp_path):
    """A station keeps its connection over restarts, also when the vehicle's clock is set back by an hour meanwhile."""
    memory = tmp_path / "vehicle.json"
    served = serve(state_file=memory)
    link = dial(served)
    link.take_control()
    first = json.loads(memory.read_text())
    now = mavlink.timestamp_now()
    monkeypatch.setattr("firmware_bridge.sitl_vehicle.timestamp_now", lambda: now - 360_000_000)
    served.restart()
    second = json.loads(memory.read_text())
    assert second["boots"] == first["boots"] + 1
    assert second["stamp_10us"] > now
    link.take_control()
    assert link.try_command(m.Command.ARM) == 0
    again = serve(state_file=memory)
    assert json.loads(memory.read_text())["boots"] == first["boots"] + 2
    dial(again).take_control()
    memory.write_text("{}")
    with pytest.raises(FormatError, match="not the memory of a SITL vehicle"):
        serve(state_file=memory)


def test_stations_and_listeners_without_messages_are_forgotten(serve, monkeypatch):
    monkeypatch.setattr("firmware_bridge.sitl_vehicle._FORGET_S", 0.3)
    served = serve()
    host, port = served.url.removeprefix("udp://").split(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.settimeout(waiting.PATIENCE_S)
        listener.sendto(station(None, 9).encode(m.Heartbeat()), (host, int(port)))
        assert listener.recv(2000)
        waiting.until(lambda: not served._guests)
        listener.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while listener.recv(2000):
                pass
        listener.settimeout(0.3)
        with pytest.raises(TimeoutError):
            listener.recv(2000)


def test_another_key_is_named_as_the_cause(serve):
    served = serve()
    with pytest.raises(LinkError, match="not with our key"):
        connect(served.url, key=b"x" * 32, timeout_s=1.0)
    unsigned = serve(key=None)
    with pytest.raises(LinkError, match="not with our key"):
        connect(unsigned.url, key=b"x" * 32, timeout_s=1.0)
    with connect(unsigned.url, unsigned=True) as link:
        link.take_control()


def test_a_station_whose_clock_is_behind_is_accepted(serve, dial, monkeypatch):
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
