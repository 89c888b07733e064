"""Vehicles on this machine and on its networks: who answers a heartbeat that is sent to all, as ground stations do."""

import contextlib
import fcntl
import secrets
import socket
import struct
import time
from collections.abc import Sequence
from pathlib import Path

from firmware_bridge import keys
from firmware_bridge.dialect.generated.messages import Heartbeat
from firmware_bridge.mavlink import MAGIC, Codec, Signing
from firmware_bridge.port import DEFAULT_PORT
from flight import FlightError, LinkError
from gcs_web.protocol.vehicle import FoundVehicle

Address = tuple[str, int]

PORTS = range(DEFAULT_PORT, DEFAULT_PORT + 10)
"""That vehicles listen at, and simulated ones one after the other."""
LISTEN_S = 1.5
_AGAIN_S = 0.4
_MOST = 32
"""Vehicles; more are left out."""
_MAGICS = {MAGIC: 5, 0xFE: 3}
"""First byte of a frame of MAVLink 2 and 1, and where the system id stands."""
_GROUND_STATION, _NO_AUTOPILOT = 6, 8
_OWN, _BROADCAST = 0x8915, 0x8919
"""Of an interface: SIOCGIFADDR and SIOCGIFBRDADDR of Linux."""
_THIS_MACHINE, _DEFAULT_ROUTE = "127.0.0.1", "255.255.255.255"


def look(key_file: Path | None = None, *, to: Sequence[Address] = (), listen_s: float = LISTEN_S) -> list[FoundVehicle]:
    """Ask once, and say who answered, by address.

    Args:
        key_file: with whose key the question is signed; without a key it is not signed, and some do not answer.
        to: where it is asked; nothing: this machine, and all of each network at `DEFAULT_PORT`.
        listen_s: how long is listened.

    Raises:
        LinkError: nobody answered, and no network could be asked.
    """
    asked = to or [*((_THIS_MACHINE, port) for port in PORTS), *((each, DEFAULT_PORT) for each in networks())]
    sent: set[str] = set()
    codec = Codec(255, 190, _signing(key_file))
    found: dict[Address, FoundVehicle] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        asking.settimeout(0.05)
        end_s, next_s = time.monotonic() + listen_s, 0.0
        while (now_s := time.monotonic()) < end_s and len(found) < _MOST:
            if now_s >= next_s:
                next_s = now_s + _AGAIN_S
                sent |= _ask(asking, codec, asked)
            with contextlib.suppress(OSError):  # nothing yet, or nobody there
                frame, address = asking.recvfrom(65536)
                if (system := _system(frame)) is not None:
                    found[address] = FoundVehicle(f"udp://{address[0]}:{address[1]}", system)
    if not found and not to and sent <= {_THIS_MACHINE}:
        raise LinkError("nobody on this machine answered, and it is in no network that could be asked: connect it")
    twice = {(own, port) for own in _addresses(_OWN) for host, port in found if host == _THIS_MACHINE} - {*to}
    return [found[address] for address in sorted(found) if address[0] == _THIS_MACHINE or address not in twice]


def networks() -> list[str]:
    """Addresses at which all of each network hear; where the system does not tell them, that of the default route."""
    return sorted(_addresses(_BROADCAST) - {"0.0.0.0"}) or [_DEFAULT_ROUTE]


def _addresses(which: int) -> set[str]:
    found = set()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for _, name in socket.if_nameindex():
            with contextlib.suppress(OSError):  # it has none, or this is not Linux
                answer = fcntl.ioctl(asking, which, struct.pack("256s", name.encode()[:15]))
                found.add(socket.inet_ntoa(answer[20:24]))
    return found


def _ask(asking: socket.socket, codec: Codec, to: Sequence[Address]) -> set[str]:
    """Hosts and networks to which it could be sent."""
    sent = set()
    for address in to:
        message = Heartbeat(type=_GROUND_STATION, autopilot=_NO_AUTOPILOT, system_status=4, mavlink_version=3)
        with contextlib.suppress(OSError):  # no such network
            asking.sendto(codec.encode(message), address)
            sent.add(address[0])
    return sent


def _system(frame: bytes) -> int | None:
    """Id of the system that sent a MAVLink frame; None for anything else, and for ground stations' own ids."""
    place = _MAGICS.get(frame[0]) if len(frame) >= 8 else None
    return None if place is None or frame[place] in (0, 255) else frame[place]


def _signing(key_file: Path | None) -> Signing | None:
    try:
        return Signing(keys.load(key_file), 2 + secrets.randbelow(254))
    except FlightError:
        return None
