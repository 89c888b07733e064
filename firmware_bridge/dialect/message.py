"""What every message of the dialect can do: become a payload and come from one (trailing zeros cut)."""

import struct
from dataclasses import dataclass, fields
from typing import ClassVar, Self


@dataclass(slots=True)
class Message:
    """Base of the generated message classes. Fields in wire order; arrays are tuples, char arrays are str."""

    ID: ClassVar[int]
    CRC_EXTRA: ClassVar[int]
    STRUCT: ClassVar[struct.Struct]
    ARRAYS: ClassVar[tuple[int, ...]]
    """Per field: 0 for a number, n for an array of n numbers, -1 for text."""

    def pack(self) -> bytes:
        """The payload, without its trailing zero bytes (one byte stays)."""
        flat: list[object] = []
        for field, length in zip(fields(self), self.ARRAYS, strict=True):
            value = getattr(self, field.name)
            if length < 0:
                flat.append(value.encode("ascii", "replace"))
            elif length:
                flat.extend(value)
            else:
                flat.append(value)
        return self.STRUCT.pack(*flat).rstrip(b"\0") or b"\0"

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """The message of a payload; missing bytes are zeros, further ones (a newer dialect's) are ignored."""
        size = cls.STRUCT.size
        flat = cls.STRUCT.unpack(payload[:size].ljust(size, b"\0"))
        values: list[object] = []
        position = 0
        for length in cls.ARRAYS:
            if length < 0:
                values.append(flat[position].split(b"\0", 1)[0].decode("ascii", "replace"))
            elif length:
                values.append(flat[position : position + length])
            else:
                values.append(flat[position])
            position += max(length, 1)
        return cls(*values)
