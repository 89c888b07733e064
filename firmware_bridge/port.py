"""One ground station's end of the link: a UDP socket, a thread that listens, questions with retries."""

import contextlib
import ipaddress
import logging
import os
import queue
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import TypeVar
from urllib.parse import urlsplit

from firmware_bridge.dialect.generated.messages import (
    Heartbeat,
    LeaseRequest,
    LeaseStatus,
    MissionStatus,
    Ping,
    State,
)
from firmware_bridge.dialect.message import Message
from firmware_bridge.line import LineMeter
from firmware_bridge.mavlink import Codec, Received
from flight import InputError, LinkError

logger = logging.getLogger(__name__)

Answer = TypeVar("Answer", bound=Message)
DEFAULT_PORT = 14550
_HEARTBEAT_S = 0.5
_RENEWAL_S = 0.33  # nine tries to keep a lease of 3 s
_SLOW_BYTES_S = 4e3  # on a line that carries less both come half as often
_RETRY_S = 0.1
_PATIENT_TRIES, _LONGEST_RETRY_S = 8, 0.5
_NAME_BYTES = 24
_LEASE_S = 3.0
"""TC_LINK_LEASE_US: control ends so long after its last renewal."""
_LEAST_TRIES = 5  # on a stalled machine time runs out without the vehicle having had a chance
_GROUND_STATION, _NO_AUTOPILOT = 6, 8
_BUFFER_BYTES = 4 << 20  # a log download comes in bursts


def patience_s(timeout_s: float) -> float:
    """A time-out that is meant for an idle machine, as many times longer as the processors are over-subscribed.

    The load is what the system reports for the last minute: processes that run or wait for a processor.
    """
    try:
        load = os.getloadavg()[0]
    except (AttributeError, OSError):  # not every system keeps count
        load = 0.0
    return timeout_s * max(1.0, load / (os.cpu_count() or 1))


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches a socket at `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def parse_url(url: str) -> tuple[str, int]:
    """Host and port of `udp://host:port`.

    Raises:
        InputError: it is not such an address.
    """
    try:
        parts = urlsplit(url if "://" in url else f"udp://{url}")
        host, port = parts.hostname, parts.port or DEFAULT_PORT
    except ValueError as error:
        raise InputError(f"{url} is not an address: {error}") from error
    if parts.scheme != "udp" or not host:
        raise InputError(f"{url!r} is not an address of a vehicle; write udp://host:port, e.g. udp://127.0.0.1:14550")
    return host, port


class Port:
    """Sends messages to one vehicle and hands out what it says. Made by `open_port`."""

    def __init__(self, url: str, codec: Codec, timeout_s: float) -> None:
        self.url = url
        self.codec = codec
        self._timeout_s = timeout_s
        self.vehicle: tuple[int, int] | None = None
        """System and component id, once it was heard."""
        self.last_heard_s = 0.0
        self.latest: dict[type[Message], Message] = {}
        self.heard_s: dict[type[Message], float] = {}
        """When the latest of each kind came: positions may stop while heartbeats go on."""
        self.keep_lease = False
        self.session = secrets.randbits(32) or 1
        """What the vehicle knows us by: two stations may have the same id."""
        self.control_lost = ""
        """Who took control from us, in words; empty while nobody did."""
        self.line = LineMeter()
        self._answered = False
        self._renewed: dict[int, tuple[float, float]] = {}
        """When the renewals under way were sent, and the limit that they reported, by nonce."""
        self._subscribers: list[tuple[tuple[type[Message], ...], queue.SimpleQueue[Message]]] = []
        self._lock = threading.Lock()
        self._closing = threading.Event()
        host, port = parse_url(url)
        try:
            family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            self._socket.settimeout(0.05)
            self._socket.connect(address)
        except OSError as error:
            raise LinkError(f"{url} cannot be reached: {error}") from error
        self._thread = threading.Thread(target=self._listen, name=f"link {url}", daemon=True)
        self._thread.start()

    @property
    def timeout_s(self) -> float:
        """Silence longer than this is a dead link; longer on a busy machine."""
        return patience_s(self._timeout_s)

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def send(self, message: Message) -> None:
        """Send to the vehicle. Whether it arrives only an answer can tell."""
        if self.vehicle and hasattr(message, "target_system"):
            message.target_system, message.target_component = self.vehicle  # pyright: ignore[reportAttributeAccessIssue]
        if hasattr(message, "session"):
            message.session = self.session  # pyright: ignore[reportAttributeAccessIssue]
        if isinstance(message, LeaseRequest):
            message.line_bytes_per_s = round(self.line.limit_bytes_s)
        self._send(message)

    def _send(self, message: Message) -> None:
        with self._lock:
            frame = self.codec.encode(message)
        with contextlib.suppress(OSError):  # nobody listens there (yet): as silent as a lost datagram
            self._socket.send(frame)

    @contextlib.contextmanager
    def inbox(self, *kinds: type[Message]) -> Iterator["queue.SimpleQueue[Message]"]:
        """A queue that receives every message of these kinds while the block runs."""
        entry = (kinds, queue.SimpleQueue[Message]())
        with self._lock:
            self._subscribers.append(entry)
        try:
            yield entry[1]
        finally:
            with self._lock:
                self._subscribers.remove(entry)

    def ask(
        self,
        request: Message,
        kind: type[Answer],
        fits: Callable[[Answer], bool],
        *,
        retry_s: float = _RETRY_S,
        steady: bool = False,
    ) -> Answer:
        """Send a request until an answer fits.

        Args:
            retry_s: between tries, at least; longer where the round trip is, and after some tries.
            steady: never longer.

        Raises:
            LinkError: none came within the time-out; the message has what was measured of the line.
        """
        started_s = time.monotonic()
        tries = 0
        with self.inbox(kind) as inbox:
            while time.monotonic() - started_s < self.timeout_s or tries < _LEAST_TRIES:
                tries += 1
                self.send(request)
                sent_s = time.monotonic()
                until_s = sent_s + (retry_s if steady else self._backed_off_s(retry_s, tries))
                while (left_s := until_s - time.monotonic()) > 0.0:
                    try:
                        answer = inbox.get(timeout=left_s)
                    except queue.Empty:
                        break
                    if isinstance(answer, kind) and fits(answer):
                        self._answered = True
                        if tries == 1:  # else which of the tries it answers is not known (Karn's rule)
                            self.line.round_trip.measured(time.monotonic() - sent_s)
                        return answer
        raise self.silence()

    def _backed_off_s(self, retry_s: float, tries: int) -> float:
        """On a slow line a try costs what others need; on a lossy one it costs nothing."""
        trip_s = self.line.round_trip.mean_s if self.line.limit_bytes_s > 0.0 else 0.0
        backed_off_s = max(retry_s, 1.5 * trip_s) * 1.5 ** max(tries - _PATIENT_TRIES, 0)
        return min(backed_off_s, max(_LONGEST_RETRY_S, 1.5 * trip_s))

    def lease(self, action: int) -> LeaseStatus:
        """Ask for control (see GOSHAWK_LEASE_REQUEST): who has it now. If it is us it is renewed from now on.

        Raises:
            LinkError: no answer.
        """
        nonce = secrets.randbits(32)
        request = LeaseRequest(nonce=nonce, action=action, name=_own_name())
        answer = self.ask(request, LeaseStatus, lambda status: status.nonce == nonce)
        self.keep_lease = self._is_ours(answer)
        if self.keep_lease:
            self.control_lost = ""
        return answer

    def _is_ours(self, status: LeaseStatus) -> bool:
        holder = status.operator_system, status.operator_component, status.operator_session
        return holder == (self.codec.system_id, self.codec.component_id, self.session)

    def silence(self) -> LinkError:
        """The error for a vehicle that does not answer, with what is known about why."""
        counts = self.codec.counts
        if self.vehicle is None and counts.refused:
            return LinkError(
                f"the vehicle at {self.url} sends, but not with our key ({counts.refused} frames refused): "
                "it is unsigned or signs with another key file"
            )
        if self.vehicle is None:
            return LinkError(
                f"no vehicle answers at {self.url} within {self.timeout_s:.3g} s; is it on, and the port right?"
            )
        silent_s = time.monotonic() - self.last_heard_s
        if silent_s < 1.5:
            return LinkError(
                f"the vehicle at {self.url} is alive but did not answer within {self.timeout_s:.3g} s "
                f"({self.line.words()}); {self._advice()}"
            )
        return LinkError(f"the link to {self.url} is lost: no message for {silent_s:.1f} s")

    def _advice(self) -> str:
        if self.codec.signing is not None and not self._answered:
            return "does it have our key?"
        return "come closer, or make the link's time-out longer"

    def wait_for_vehicle(self) -> None:
        """Return once a vehicle was heard.

        Raises:
            LinkError: none was within the time-out.
        """
        started_s = time.monotonic()
        tries = 0
        while self.vehicle is None:
            tries += 1
            if time.monotonic() - started_s > self.timeout_s and tries > 10 * _LEAST_TRIES:
                raise self.silence()
            time.sleep(0.005)

    def _listen(self) -> None:
        next_heartbeat_s = next_renewal_s = 0.0
        while not self._closing.is_set():
            now_s = time.monotonic()
            limit_bytes_s = self.line.limit_bytes_s
            spread = 2.0 if 0.0 < limit_bytes_s < _SLOW_BYTES_S else 1.0
            if now_s >= next_heartbeat_s:
                next_heartbeat_s = now_s + spread * _HEARTBEAT_S
                self.send(Heartbeat(type=_GROUND_STATION, autopilot=_NO_AUTOPILOT, system_status=4, mavlink_version=3))
            if now_s >= next_renewal_s and (self.keep_lease or limit_bytes_s > 0.0):
                next_renewal_s = now_s + spread * _RENEWAL_S
                self._renew(now_s)
            try:
                datagram = self._socket.recv(65536)
            except OSError:  # a time-out, or "connection refused" for an earlier datagram
                if self._socket.fileno() >= 0 and self.last_heard_s < now_s - 1.0:
                    self._closing.wait(0.01)
                continue
            found = self.codec.decode(datagram)
            for received in found:
                if (received.system_id, received.component_id) == self.vehicle:
                    self.line.received(received.sequence, len(datagram) // len(found), time.monotonic())
                self._deliver(received)

    def _renew(self, now_s: float) -> None:
        """Keep control, if we have it, and report what the line carries."""
        nonce = secrets.randbits(32)
        under_way = {nonce: sent for nonce, sent in self._renewed.items() if sent[0] > now_s - _LEASE_S}
        self._renewed = under_way | {nonce: (now_s, self.line.limit_bytes_s)}
        self.send(LeaseRequest(nonce=nonce, action=1 if self.keep_lease else 3))

    def _note_lease(self, status: LeaseStatus, now_s: float) -> None:
        """An answer to whoever asked: how long it took if it was us, and whether control is lost."""
        if (renewal := self._renewed.pop(status.nonce, None)) is not None:
            sent_s, limit_bytes_s = renewal
            self.line.round_trip.measured(now_s - sent_s)
            self.line.reported(limit_bytes_s, now_s)
        if status.operator_system and self.keep_lease and not self._is_ours(status):
            self.keep_lease = False
            self.control_lost = f"{station_words(status)} took control of the vehicle"
            logger.warning("%s at %s", self.control_lost, self.url)

    def _deliver(self, received: Received) -> None:
        message = received.message
        sender = (received.system_id, received.component_id)
        if isinstance(message, Ping) and not message.target_system and not message.target_component:
            # the vehicle's challenge: it lets us in when its number comes back with our signature
            self._send(
                Ping(time_usec=message.time_usec, seq=message.seq, target_system=sender[0], target_component=sender[1])
            )
            return
        if self.vehicle is None and _speaks_for_a_vehicle(message):
            self.vehicle = sender
        if sender != self.vehicle:
            return
        self.last_heard_s = time.monotonic()
        if isinstance(message, LeaseStatus):
            self._note_lease(message, self.last_heard_s)
        with self._lock:
            self.heard_s[type(message)] = self.last_heard_s
            self.latest[type(message)] = message
            for kinds, inbox in self._subscribers:
                if isinstance(message, kinds):
                    inbox.put(message)


def station_words(status: LeaseStatus) -> str:
    """The station in control, for people."""
    name = f" ({status.operator_name})" if status.operator_name else ""
    return f"station {status.operator_system}{name}"


def _own_name() -> str:
    """Computer and process: two stations of one computer differ."""
    process = f":{os.getpid()}"
    return socket.gethostname().encode("ascii", "replace").decode()[: _NAME_BYTES - len(process)] + process


def _speaks_for_a_vehicle(message: Message) -> bool:
    """Heartbeats come once a second and may get lost; our own telemetry tells as well."""
    if isinstance(message, Heartbeat):
        return message.autopilot != _NO_AUTOPILOT
    return isinstance(message, State | MissionStatus)
