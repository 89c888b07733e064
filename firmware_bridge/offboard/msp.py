"""MSP version 2, the frames: `$X`, direction, flag, function, size, payload, CRC-8/DVB-S2."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

_HEAD = struct.Struct("<BHH")
_LARGEST = 4096
"""A payload that claims more is noise."""
REQUEST, ANSWER, REFUSED = b"<", b">", b"!"


@dataclass(frozen=True, slots=True)
class Frame:
    """One message."""

    function: int
    payload: bytes
    direction: bytes = REQUEST

    @property
    def refused(self) -> bool:
        """Whether the firmware does not know the request, or its content."""
        return self.direction == REFUSED


def crc8_dvb_s2(data: bytes) -> int:
    """Polynomial 0xD5."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = ((crc << 1) ^ 0xD5) & 0xFF if crc & 0x80 else crc << 1
    return crc


_TABLE = bytes(crc8_dvb_s2(bytes([byte])) for byte in range(256))


def _crc(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc = _TABLE[crc ^ byte]
    return crc


def encode(frame: Frame) -> bytes:
    body = _HEAD.pack(0, frame.function, len(frame.payload)) + frame.payload
    return b"$X" + frame.direction + body + bytes([_crc(body)])


class Decoder:
    """Bytes in, whole frames out; what is damaged is skipped and counted."""

    def __init__(self) -> None:
        self._waiting = b""
        self.damaged = 0

    def feed(self, data: bytes) -> Iterator[Frame]:
        self._waiting += data
        while (begin := self._waiting.find(b"$X")) >= 0:
            self._waiting = self._waiting[begin:]
            if len(self._waiting) < 8:
                return
            direction = self._waiting[2:3]
            _, function, size = _HEAD.unpack_from(self._waiting, 3)
            end = 8 + size
            if direction not in (REQUEST, ANSWER, REFUSED) or size > _LARGEST:
                self._skip()
                continue
            if len(self._waiting) <= end:
                return
            if self._waiting[end] != _crc(self._waiting[3:end]):
                self._skip()
                continue
            frame = Frame(function, self._waiting[8:end], direction)
            self._waiting = self._waiting[end + 1 :]
            yield frame
        self._waiting = self._waiting[-1:] if self._waiting.endswith(b"$") else b""

    def _skip(self) -> None:
        self.damaged += 1
        self._waiting = self._waiting[2:]
