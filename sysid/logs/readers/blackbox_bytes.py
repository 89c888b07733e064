"""The numbers of a Betaflight blackbox log: variable bytes, and small groups behind a tag.

The encodings are described in https://betaflight.com/docs/development/Blackbox-Internals
"""

from collections.abc import Callable


class Bytes:
    """A place in the content of a file."""

    __slots__ = ("at", "content", "end")

    def __init__(self, content: bytes, at: int, end: int) -> None:
        self.content, self.at, self.end = content, at, end

    def byte(self) -> int:
        """
        Raises:
            EOFError: there is none.
        """
        if self.at >= self.end:
            raise EOFError
        self.at += 1
        return self.content[self.at - 1]

    def little(self, count: int) -> int:
        """A signed number of `count` bytes."""
        if self.at + count > self.end:
            raise EOFError
        self.at += count
        return int.from_bytes(self.content[self.at - count : self.at], "little", signed=True)

    def unsigned(self) -> int:
        """Seven bits a byte, the least first; at most 32 bits."""
        value = shift = 0
        while shift < 35:
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value & 0xFFFFFFFF
            shift += 7
        return 0

    def signed(self) -> int:
        """Zigzag: the sign is the last bit."""
        value = self.unsigned()
        return (value >> 1) ^ -(value & 1)


def _sign(value: int, bits: int) -> int:
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def _one(read: Callable[[Bytes], int]) -> Callable[[Bytes, int], list[int]]:
    return lambda data, count: [read(data) for _ in range(count)]


def _eight(data: Bytes, count: int) -> list[int]:
    """A tag with one bit a number says which are not zero; a single number has no tag."""
    if count == 1:
        return [data.signed()]
    tag = data.byte()
    return [data.signed() if tag >> i & 1 else 0 for i in range(count)]


def _four(data: Bytes, count: int) -> list[int]:
    """A tag with two bits a number: none, 4, 8 or 16 bits, the high ones first, in a stream of half bytes."""
    tag = data.byte()
    half = -1

    def nibble() -> int:
        nonlocal half
        if half >= 0:
            value, half = half, -1
            return value
        byte = data.byte()
        half = byte & 15
        return byte >> 4

    values = []
    for i in range(4):
        size, value = (0, 1, 2, 4)[tag >> 2 * i & 3], 0
        for _ in range(size):
            value = value << 4 | nibble()
        values.append(_sign(value, 4 * size) if size else 0)
    return values[:count]


def _sized(data: Bytes, tag: int) -> list[int]:
    """Three numbers of 1 to 4 bytes, two bits of the tag each."""
    return [data.little(1 + (tag >> 2 * i & 3)) for i in range(3)]


def _three(data: Bytes, _: int) -> list[int]:
    """Three numbers of 2, 4, 6 or up to 32 bits, by the two highest bits."""
    first = data.byte()
    kind = first >> 6
    if kind == 0:
        return [_sign(first >> 4, 2), _sign(first >> 2, 2), _sign(first, 2)]
    if kind == 1:
        second = data.byte()
        return [_sign(first, 4), _sign(second >> 4, 4), _sign(second, 4)]
    if kind == 2:
        return [_sign(first, 6), _sign(data.byte(), 6), _sign(data.byte(), 6)]
    return _sized(data, first)


def _three_unlike(data: Bytes, _: int) -> list[int]:
    """Three numbers of 2 2 2, 5 5 4, 8 7 7 or up to 32 bits, by the two highest bits."""
    first = data.byte()
    kind = first >> 6
    if kind == 0:
        return [_sign(first >> 4, 2), _sign(first >> 2, 2), _sign(first, 2)]
    if kind == 3:
        return _sized(data, first)
    bits = first << 8 | data.byte()
    if kind == 1:
        return [_sign(bits >> 9, 5), _sign(bits >> 4, 5), _sign(bits, 4)]
    bits = bits << 8 | data.byte()
    return [_sign(bits >> 14, 8), _sign(bits >> 7, 7), _sign(bits, 7)]


READERS: dict[int, tuple[int, Callable[[Bytes, int], list[int]]]] = {
    # encoding in the header: how many fields of it that follow each other go together, and how they are read
    0: (1, _one(Bytes.signed)),
    1: (1, _one(Bytes.unsigned)),
    3: (1, _one(lambda data: -_sign(data.unsigned(), 14))),
    6: (8, _eight),
    7: (3, _three),
    8: (4, _four),
    9: (1, lambda _, count: [0] * count),
    10: (3, _three_unlike),
}
