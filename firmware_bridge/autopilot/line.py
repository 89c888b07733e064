"""MAVLink to an autopilot by UDP, on this machine."""

import select
import socket
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from firmware_bridge.dialect.generated import autopilot_messages, messages
from firmware_bridge.dialect.generated.messages import Heartbeat
from firmware_bridge.dialect.message import Message
from firmware_bridge.mavlink import Codec, Received
from firmware_bridge.port import is_loopback
from flight import InputError, LinkError

PREFIX = "mavlink:"
AUTOPILOT_COMPONENT = 1
OWN_SYSTEM, OWN_COMPONENT = 255, 191
"""A ground station's id, which ArduPilot's failsafe watches, and an onboard computer's."""
_KINDS = {**messages.BY_ID, **autopilot_messages.BY_ID}
_BOUNDS = (-90.0, 90.0), (-180.0, 180.0), (-1000.0, 10000.0)
"""Of an origin: degrees, degrees, metres."""
_FORM = (
    "mavlink:udp://127.0.0.1:PORT, or mavlink:udpin://127.0.0.1:PORT to wait for its first message; "
    "after it at most ?origin=LAT,LON,ALT&vision=on&targets=position"
)


@dataclass(frozen=True, slots=True)
class Address:
    """Where the autopilot is."""

    host: str
    port: int
    waits: bool
    """Its messages come to this port; we answer where they come from."""
    origin: tuple[float, float, float] | None = None
    """Latitude and longitude in degrees, metres above the sea: of the local frame, for an estimator without GPS."""
    vision: bool = False
    """Pass poses on to its estimator."""
    position: bool = False
    """On the path its own position loops fly, told where to be; its estimator's frame is that of the poses then."""


def parsed(text: str) -> Address:
    """Of `mavlink:udp://HOST:PORT?origin=LAT,LON,ALT&vision=on&targets=position`.

    Raises:
        InputError: it is none, or not on this machine.
    """
    parts = urlsplit(text.removeprefix(PREFIX))
    try:
        query = {name: values[-1] for name, values in parse_qs(parts.query, strict_parsing=bool(parts.query)).items()}
        unknown = set(query) - {"origin", "vision", "targets"}
        if parts.scheme not in ("udp", "udpin") or not parts.hostname or not parts.port or unknown:
            raise ValueError
        origin = tuple(float(word) for word in query["origin"].split(",")) if "origin" in query else None
        if origin is not None and not (len(origin) == 3 and all(map(_within, origin, _BOUNDS))):
            raise ValueError
        vision = {"on": True, "off": False, None: False}[query.get("vision")]
        position = {"position": True, "rates": False, None: False}[query.get("targets")]
    except (ValueError, KeyError):
        raise InputError(f"{text!r} is no autopilot's address; give {_FORM}") from None
    _require_this_machine(text, parts.hostname)
    return Address(parts.hostname, parts.port, parts.scheme == "udpin", origin, vision, position)  # pyright: ignore[reportArgumentType]


def _within(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]


def _require_this_machine(text: str, host: str) -> None:
    if host == "::1":
        raise InputError(f"{text!r}: MAVLink goes by IPv4 here; give {_FORM}")
    if not is_loopback(host):
        raise InputError(
            "the MAVLink bridge has flown neither PX4 nor ArduPilot, only a simulated autopilot; "
            f"{text!r} is not this machine: give {_FORM}"
        )


class MavlinkLine:
    """Messages out and in; what is damaged or of another dialect is not looked at."""

    def __init__(self, address: Address, *, own_system: int = OWN_SYSTEM, system: int | None = None) -> None:
        """
        Args:
            system: whose autopilot we answer; None: any.

        Raises:
            InputError: the port cannot be listened at.
        """
        self._codec = Codec(own_system, OWN_COMPONENT, None, kinds=_KINDS)
        self._socket = socket.socket(type=socket.SOCK_DGRAM)
        self.system = system
        self.stations = set[int]()
        """Systems, no autopilots, whose heartbeats have come."""
        self._to = None if address.waits else (address.host, address.port)
        try:
            self._socket.bind((address.host, address.port) if address.waits else ("127.0.0.1", 0))
        except OSError as error:
            raise InputError(f"MAVLink cannot be listened for at port {address.port}: {error}") from error
        self._socket.setblocking(False)

    def send(self, message: Message) -> None:
        """What a full buffer or nobody takes is lost, as on every radio.

        Raises:
            LinkError: the line is gone.
        """
        if self._to is None:
            return
        try:
            self._socket.sendto(self._codec.encode(message), self._to)
        except (BlockingIOError, ConnectionRefusedError):
            return
        except OSError as error:
            raise LinkError(f"the line to the autopilot broke: {error}") from error

    def receive(self, wait_s: float = 0.0) -> list[Received]:
        """What has come; nothing after `wait_s` is empty."""
        found: list[Received] = []
        if wait_s > 0.0 and not select.select([self._socket], [], [], wait_s)[0]:
            return found
        while True:
            try:
                data, sender = self._socket.recvfrom(65536)
            except (BlockingIOError, ConnectionRefusedError):
                return found
            except OSError as error:
                raise LinkError(f"the line to the autopilot broke: {error}") from error
            for received in self._codec.decode(data):
                found.append(received)
                if received.component_id == AUTOPILOT_COMPONENT and self.system in (None, received.system_id):
                    self._to = sender
                elif self._is_station(received):
                    self.stations.add(received.system_id)

    @staticmethod
    def _is_station(received: Received) -> bool:
        ours = (received.system_id, received.component_id) == (OWN_SYSTEM, OWN_COMPONENT)  # by a router, an echo
        return isinstance(received.message, Heartbeat) and not ours

    def close(self) -> None:
        self._socket.close()
