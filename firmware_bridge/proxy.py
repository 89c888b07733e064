"""A local port without signatures for ground stations that cannot sign: QGroundControl, MAVSDK.

    station --(unsigned, this computer only)--> Proxy --(signed with the vehicle's key)--> vehicle

Each station keeps its own system and component id; the proxy signs its frames, answers the vehicle's challenges in its
name, and hands the vehicle's frames, verified, to all stations without their signatures. With `control` it also holds
the operator lease in the name of one station, for as long as that station is there.
"""

import contextlib
import logging
import secrets
import select
import socket
import threading
import time
from dataclasses import dataclass
from typing import Self

from firmware_bridge.dialect.generated.messages import Heartbeat, LeaseRequest, LeaseStatus, MissionStatus, Ping
from firmware_bridge.dialect.message import Message
from firmware_bridge.mavlink import Codec, Received, Signing
from firmware_bridge.port import parse_url, patience_s
from flight import InputError, LinkError

logger = logging.getLogger(__name__)

DEFAULT_LISTEN = "127.0.0.1:14551"
OWN_SYSTEM = 253
"""System id under which the proxy itself looks for the vehicle."""
STATION_SILENT_S = 2.5
"""A station that has been silent for longer holds no control: the vehicle's own link-loss reaction must follow."""
_STATION_FORGOTTEN_S = 15.0
_STATIONS = 4
_HEARTBEAT_S = 0.5
_COMPONENT, _GROUND_STATION, _NO_AUTOPILOT = 190, 6, 8
_MAVLINK_1 = b"\xfe"
_BUFFER_BYTES = 4 << 20

Address = tuple[str, int]


@dataclass(slots=True)
class _Station:
    """A ground station behind the proxy."""

    codec: Codec
    """Signs in its name."""
    seen_s: float


@dataclass(frozen=True, slots=True)
class ProxyStatus:
    """How the proxy is doing."""

    vehicle: str
    """Address of the vehicle."""
    vehicle_silent_s: float
    """Since the vehicle's last verified frame."""
    stations: tuple[str, ...]
    """System/component ids of the stations behind the proxy."""
    in_control: str
    """The one of them that controls the vehicle; empty if none does."""
    operator_system: int
    """System id of the station that controls the vehicle, wherever it is; 0 nobody."""
    to_vehicle: int
    """Frames signed and sent."""
    to_stations: int
    """Frames verified and handed on."""
    refused: int
    """Frames from the vehicle's address that were unsigned, wrongly signed or repeated."""

    def as_dict(self) -> dict[str, object]:
        """JSON-able."""
        return {name: getattr(self, name) for name in self.__slots__}


def parse_listen(text: str) -> tuple[str, int]:
    """Host and port of `host:port`.

    Raises:
        InputError: it is not such an address.
    """
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal() and int(port) < 65536):
        raise InputError(f"{text!r} is not HOST:PORT, like {DEFAULT_LISTEN} (port 0 takes a free one)")
    return host, int(port)


@dataclass(slots=True)
class _Lease:
    """Control of the vehicle, held in the name of one station."""

    holder: tuple[int, int] | None = None
    """Its system and component id: the first station that was received."""
    nonce: int = 0
    """Of the last request; the vehicle's answer carries it."""
    granted: bool = False
    """Whether the vehicle has granted it; until another station takes it."""
    lost: bool = False
    """Another station took control: it is not taken back."""


@dataclass(slots=True)
class _Counts:
    to_vehicle: int = 0
    to_stations: int = 0


class Proxy:
    """Serves stations at `url` until `stop`; in its own thread when used as a context manager."""

    def __init__(
        self,
        vehicle_url: str,
        key: bytes,
        *,
        listen: str = DEFAULT_LISTEN,
        control: bool = False,
        timeout_s: float = 3.0,
    ) -> None:
        """Bind the local port and open the way to the vehicle; nothing is sent yet.

        Args:
            key: the 32 bytes that the vehicle signs with.
            listen: where stations connect, `host:port`.
            control: hold the operator lease for the first station; else stations may only read.
            timeout_s: how long to wait for the vehicle at the start.

        Raises:
            InputError: an address or the key cannot be used.
            LinkError: the local port is taken, or the vehicle's address cannot be reached.
        """
        if len(key) != 32:
            raise InputError(f"a link key has 32 bytes, this one {len(key)}")
        self.vehicle_url, self.control, self.timeout_s = vehicle_url, control, timeout_s
        # a stream of its own beside other proxies and stations of the same id
        self._signing = Signing(key, 2 + secrets.randbelow(254))
        self._own = Codec(OWN_SYSTEM, _COMPONENT, self._signing)
        self._stations: dict[Address, _Station] = {}
        self._vehicle: tuple[int, int] | None = None
        self._vehicle_seen_s = 0.0
        self._operator: tuple[int, int] | None = None
        self._lease = _Lease()
        self._counts = _Counts()
        self._closing = threading.Event()
        self._ready = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._local = _bind(*parse_listen(listen))
        try:
            self._remote = _connect(vehicle_url)
        except BaseException:
            self._local.close()
            raise

    @property
    def url(self) -> str:
        """Where stations connect."""
        host, port = self._local.getsockname()[:2]
        return f"udp://{host}:{port}"

    @property
    def running(self) -> bool:
        """Whether the thread of the context manager still serves."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def status(self) -> ProxyStatus:
        """Now; from any thread."""
        holder = self._lease.holder if self._lease.granted and self._lease.holder == self._operator else None
        return ProxyStatus(
            vehicle=self.vehicle_url,
            vehicle_silent_s=round(time.monotonic() - self._vehicle_seen_s, 2),
            stations=tuple(f"{s.codec.system_id}/{s.codec.component_id}" for s in list(self._stations.values())),
            in_control=f"{holder[0]}/{holder[1]}" if holder else "",
            operator_system=self._operator[0] if self._operator else 0,
            to_vehicle=self._counts.to_vehicle,
            to_stations=self._counts.to_stations,
            refused=self._own.counts.refused,
        )

    # -- running ---------------------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        """Serve in a thread of its own, once the vehicle has been received."""
        self._thread = threading.Thread(target=self._run, name="proxy", daemon=True)
        self._thread.start()
        while not self._ready.wait(0.02):
            if not self._thread.is_alive():
                self._thread.join()
                raise self._failure or LinkError("the proxy ended before it was ready")
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        if self._thread:
            self._thread.join()
        if self._failure:
            raise self._failure

    def stop(self) -> None:
        """End `serve`; from any thread."""
        self._closing.set()

    def _run(self) -> None:
        try:
            self.serve()
        except BaseException as error:
            self._failure = error

    def serve(self) -> None:
        """Wait for the vehicle, then relay until `stop`.

        Raises:
            LinkError: the vehicle was not received within the time-out.
        """
        try:
            self._wait_for_vehicle()
            self._ready.set()
            next_s = 0.0
            while not self._closing.is_set():
                now_s = time.monotonic()
                if now_s >= next_s:
                    next_s = now_s + _HEARTBEAT_S
                    self._every_half_second(now_s)
                self._relay(0.05)
        finally:
            self._give_back()
            self._local.close()
            self._remote.close()

    def _wait_for_vehicle(self) -> None:
        started_s, next_s = time.monotonic(), 0.0
        while self._vehicle is None and not self._closing.is_set():
            now_s = time.monotonic()
            if now_s - started_s > patience_s(self.timeout_s):
                raise self._silence()
            if now_s >= next_s:
                next_s = now_s + 0.2
                self._to_vehicle(self._own, _heartbeat())
            self._relay(0.05)

    def _silence(self) -> LinkError:
        if refused := self._own.counts.refused:
            return LinkError(
                f"the vehicle at {self.vehicle_url} sends, but not with our key ({refused} frames refused): "
                "it is unsigned or signs with another key file"
            )
        waited_s = patience_s(self.timeout_s)
        return LinkError(
            f"no vehicle answers at {self.vehicle_url} within {waited_s:.3g} s; is it on, the port right, "
            "and our key its key?"
        )

    def _every_half_second(self, now_s: float) -> None:
        self._to_vehicle(self._own, _heartbeat())
        for address, station in list(self._stations.items()):
            if now_s - station.seen_s > _STATION_FORGOTTEN_S:
                del self._stations[address]
        if self._lease.holder and not self._holders():
            self._lease = _Lease(lost=self._lease.lost)  # the next station may have it
        if any(now_s - station.seen_s < STATION_SILENT_S for station in self._holders()):
            self._ask_for_control(1)

    def _holders(self) -> list[_Station]:
        """The station in whose name control is held; twice when it uses two sockets."""
        return [s for s in self._stations.values() if _id(s.codec) == self._lease.holder]

    def _ask_for_control(self, action: int) -> None:
        """Take it if it is free, renew it, or (0) give it back."""
        lease = self._lease
        if not self.control or lease.lost or lease.holder is None or self._vehicle is None:
            return
        if not lease.granted and self._operator == lease.holder:
            return  # somebody else has control under the same id
        lease.nonce = secrets.randbits(32)
        request = LeaseRequest(lease.nonce, *self._vehicle, action)
        self._to_vehicle(self._holders()[0].codec, request)

    def _give_back(self) -> None:
        if self._lease.granted and self._holders():
            self._ask_for_control(0)

    # -- relaying --------------------------------------------------------------------------------------------------

    def _relay(self, wait_s: float) -> None:
        readable, _, _ = select.select([self._local, self._remote], [], [], wait_s)
        if self._remote in readable:
            for datagram, _ in _datagrams(self._remote):
                for received in self._own.decode(datagram):
                    self._from_vehicle(received)
        if self._local in readable:
            for datagram, address in _datagrams(self._local):
                self._from_station(datagram, address)

    def _from_vehicle(self, received: Received) -> None:
        sender, message = (received.system_id, received.component_id), received.message
        if self._vehicle is None and isinstance(message, Heartbeat) and message.autopilot != _NO_AUTOPILOT:
            self._vehicle = sender
        if sender != self._vehicle:
            return
        self._vehicle_seen_s = time.monotonic()
        if isinstance(message, Ping) and message.target_system == 0:
            self._answer_challenge(message)
            return
        if isinstance(message, MissionStatus):
            self._note_operator((message.operator_system, message.operator_component))
        if isinstance(message, LeaseStatus) and self._lease.nonce and message.nonce == self._lease.nonce:
            self._note_answer(message)
        self._to_stations(received)

    def _note_answer(self, status: LeaseStatus) -> None:
        """Whether control is held in our stream; another one may be of a station with the same id."""
        lease, operator = self._lease, (status.operator_system, status.operator_component)
        ours = operator == lease.holder and status.operator_link == self._signing.link_id
        if lease.granted and operator == lease.holder and not ours:
            lease.lost = True
            logger.warning("another station %d took control of the vehicle; start the proxy again", operator[0])
        lease.granted = ours

    def _answer_challenge(self, ping: Ping) -> None:
        """Return the vehicle's nonce in the name of everybody behind the proxy, so that their streams open."""
        assert self._vehicle
        answer = Ping(ping.time_usec, ping.seq, *self._vehicle)
        for codec in (self._own, *(station.codec for station in self._stations.values())):
            self._to_vehicle(codec, answer)

    def _note_operator(self, operator: tuple[int, int]) -> None:
        """Who has control, by the vehicle's status."""
        lease = self._lease
        self._operator = operator
        if lease.granted and operator[0] and operator != lease.holder:
            lease.lost, lease.granted = True, False
            logger.warning("station %d took control of the vehicle; start the proxy again to take it back", operator[0])

    def _to_stations(self, received: Received) -> None:
        if not self._stations:
            return
        plain = Codec(received.system_id, received.component_id, None, sequence=received.sequence)
        frame = plain.encode(received.message)
        for address in self._stations:
            with contextlib.suppress(OSError):  # gone, or its buffer is full: a lost datagram
                self._local.sendto(frame, address)
        self._counts.to_stations += 1

    def _from_station(self, datagram: bytes, address: Address) -> None:
        if (
            datagram[:1] == _MAVLINK_1 and len(datagram) > 5
        ):  # some begin so, and go on in MAVLink 2 once they receive it
            self._station_of((datagram[3], datagram[4]), address)
            return
        reader = Codec(OWN_SYSTEM, _COMPONENT, None)
        for received in reader.decode(datagram):
            sender = (received.system_id, received.component_id)
            station = self._station_of(sender, address)
            if station is None:
                continue
            self._lease.holder = self._lease.holder or sender
            if self._may_send(station):
                self._to_vehicle(station.codec, received.message)

    def _station_of(self, sender: tuple[int, int], address: Address) -> _Station | None:
        """The station that sends from there; None if there are too many, or it calls itself what it cannot be."""
        if sender[0] in (0, OWN_SYSTEM, self._vehicle[0] if self._vehicle else 0):
            return None
        station = self._stations.get(address)
        if station is None or _id(station.codec) != sender:
            if station is None and len(self._stations) >= _STATIONS:
                return None
            station = self._stations[address] = _Station(Codec(*sender, self._signing), 0.0)
            logger.info("station %d/%d at %s:%d", *sender, *address[:2])
        station.seen_s = time.monotonic()
        return station

    def _may_send(self, station: _Station) -> bool:
        """Not under the id of a station elsewhere that is in control: its frames would pass for the operator's."""
        if self._operator is None:
            return False  # it is not known yet who is in control
        mine = self._lease.granted and _id(station.codec) == self._lease.holder
        return mine or _id(station.codec) != self._operator

    def _to_vehicle(self, codec: Codec, message: Message) -> None:
        with contextlib.suppress(OSError):  # nobody listens there (yet): as silent as a lost datagram
            self._remote.send(codec.encode(message))
            self._counts.to_vehicle += 1


def _id(codec: Codec) -> tuple[int, int]:
    return codec.system_id, codec.component_id


def _heartbeat() -> Heartbeat:
    return Heartbeat(type=_GROUND_STATION, autopilot=_NO_AUTOPILOT, system_status=4, mavlink_version=3)


def _datagrams(source: socket.socket) -> list[tuple[bytes, Address]]:
    """All that wait, at most 200, so that neither side starves the other."""
    found: list[tuple[bytes, Address]] = []
    for _ in range(200):
        try:
            found.append(source.recvfrom(65536))
        except BlockingIOError:
            break
        except OSError:  # an earlier datagram found nobody
            continue
    return found


def _bind(host: str, port: int) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        bound = socket.socket(family, kind)
        bound.setblocking(False)
        bound.bind(address)
    except OSError as error:
        raise LinkError(f"cannot listen at {host}:{port} ({error.strerror or error}); choose another port") from error
    return bound


def _connect(url: str) -> socket.socket:
    host, port = parse_url(url)
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        connected = socket.socket(family, kind)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        connected.setblocking(False)
        connected.connect(address)
    except OSError as error:
        raise LinkError(f"{url} cannot be reached: {error}") from error
    return connected
