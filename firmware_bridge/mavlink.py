"""MAVLink 2 frames on the ground side: messages to datagrams and back, signed with a shared key.

The vehicle's twin is controller/src/link/transport/frame.c; both are tested against each other and against pymavlink.
"""

import binascii
import hashlib
import heapq
import hmac
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from firmware_bridge.dialect.generated.messages import BY_ID
from firmware_bridge.dialect.message import Message

MAGIC = 0xFD
_HEADER = 10
_SIGNATURE = 13
_RECENT = 64
_EPOCH_S = 1420070400  # 2015-01-01 UTC, the epoch of MAVLink's signature time stamps
_REVERSED = bytes(int(f"{i:08b}"[::-1], 2) for i in range(256))


def crc16(data: bytes) -> int:
    """CRC-16/MCRF4XX. It is CRC-CCITT with all bits mirrored, and that one the standard library computes in C."""
    crc = binascii.crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[crc >> 8] | _REVERSED[crc & 0xFF] << 8


def timestamp_now() -> int:
    """Now, in units of 10 microseconds since MAVLink's epoch."""
    return int((time.time() - _EPOCH_S) * 1e5)


@dataclass(frozen=True, slots=True)
class Received:
    """A message and who sent it."""

    message: Message
    system_id: int
    component_id: int
    sequence: int


@dataclass(slots=True)
class _Stream:
    """The time stamps accepted last. Frames may overtake each other; none counts twice."""

    recent: list[int] = field(default_factory=list[int])
    """Heap of the newest ones."""
    newest: int = -1
    floor: int = -1
    """At or below this all is refused."""

    def accepts(self, stamp: int) -> bool:
        if stamp <= self.floor or (stamp <= self.newest and stamp in self.recent):
            return False
        self.newest = max(self.newest, stamp)
        heapq.heappush(self.recent, stamp)
        if len(self.recent) > _RECENT:
            self.floor = heapq.heappop(self.recent)
        return True


@dataclass(slots=True)
class Signing:
    """Signs with a shared 32-byte key and refuses what is unsigned, wrongly signed, or was received before.

    Its clock is real time or later: it follows any newer stamp that is validly signed. So a station whose clock is
    behind the vehicle's adopts the vehicle's time.
    """

    key: bytes
    link_id: int = 0
    streams: dict[tuple[int, int, int], "_Stream"] = field(default_factory=dict[tuple[int, int, int], "_Stream"])
    """Per (system, component, link)."""
    last_stamp: int = 0

    def signature(self, body: bytes) -> bytes:
        """Link id, time stamp and the six bytes that sign them and `body`."""
        self.last_stamp = max(self.last_stamp + 1, timestamp_now())
        stamped = body + bytes([self.link_id]) + self.last_stamp.to_bytes(6, "little")
        return stamped[len(body) :] + hashlib.sha256(self.key + stamped).digest()[:6]

    def accepts(self, raw: bytes) -> bool:
        """Whether a raw frame carries a good and new signature. A good one moves its stream on."""
        if not raw[2] & 1:
            return False
        if not hmac.compare_digest(hashlib.sha256(self.key + raw[:-6]).digest()[:6], raw[-6:]):
            return False
        stream = (raw[5], raw[6], raw[-_SIGNATURE])
        stamp = int.from_bytes(raw[-12:-6], "little")
        if not self.streams.setdefault(stream, _Stream()).accepts(stamp):
            return False
        self.last_stamp = max(self.last_stamp, stamp)
        return True


@dataclass(slots=True)
class Counts:
    """What went through a codec."""

    sent: int = 0
    sent_bytes: int = 0
    received: int = 0
    received_bytes: int = 0
    damaged: int = 0
    """Not a frame, or a frame whose checksum fails."""
    unknown: int = 0
    """Well-formed frames of messages that are not in the dialect."""
    refused: int = 0
    """Unsigned, wrongly signed, or replayed."""


@dataclass(slots=True)
class Codec:
    """One end of the link: numbers and signs what goes out, checks what comes in."""

    system_id: int
    component_id: int
    signing: Signing | None
    counts: Counts = field(default_factory=Counts)
    sequence: int = 0
    kinds: Mapping[int, type[Message]] = field(default_factory=lambda: BY_ID)
    """The dialect, by id."""

    def encode(self, message: Message) -> bytes:
        """A whole frame."""
        payload = message.pack()
        flags = 1 if self.signing else 0
        head = bytes([len(payload), flags, 0, self.sequence, self.system_id, self.component_id])
        body = head + message.ID.to_bytes(3, "little") + payload
        frame = bytes([MAGIC]) + body + crc16(body + bytes([message.CRC_EXTRA])).to_bytes(2, "little")
        if self.signing:
            frame += self.signing.signature(frame)
        self.sequence = (self.sequence + 1) & 0xFF
        self.counts.sent += 1
        self.counts.sent_bytes += len(frame)
        return frame

    def decode(self, datagram: bytes) -> list[Received]:
        """The messages of a datagram that can be trusted; the rest is counted."""
        self.counts.received_bytes += len(datagram)
        messages: list[Received] = []
        position = 0
        while position < len(datagram):
            raw = _frame_at(datagram, position)
            if raw is None:
                self.counts.damaged += 1
                break  # a datagram holds whole frames: behind a broken one there is nothing to find
            position += len(raw)
            received = self._receive(raw)
            if received:
                messages.append(received)
        return messages

    def _receive(self, raw: bytes) -> Received | None:
        kind = self.kinds.get(int.from_bytes(raw[7:10], "little"))
        if kind is None:
            self.counts.unknown += 1
            return None
        end = _HEADER + raw[1]
        if crc16(raw[1:end] + bytes([kind.CRC_EXTRA])) != int.from_bytes(raw[end : end + 2], "little"):
            self.counts.damaged += 1
            return None
        if self.signing and not self.signing.accepts(raw):
            self.counts.refused += 1
            return None
        self.counts.received += 1
        return Received(kind.unpack(raw[_HEADER:end]), raw[5], raw[6], raw[4])


def _frame_at(datagram: bytes, position: int) -> bytes | None:
    """The raw frame that starts at `position`, or None when none does."""
    if len(datagram) - position < _HEADER + 2 or datagram[position] != MAGIC or datagram[position + 2] & ~1:
        return None
    length = _HEADER + datagram[position + 1] + 2 + (_SIGNATURE if datagram[position + 2] & 1 else 0)
    return datagram[position : position + length] if position + length <= len(datagram) else None
