"""Logged values of a Crazyflie: found by name in its table of contents, streamed in blocks of at most 26 bytes."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from firmware_bridge.crazyflie.client import LOG, Client
from flight import FloatArray, LinkError

_LAYOUTS = {1: "B", 2: "H", 3: "I", 4: "b", 5: "h", 6: "i", 7: "f"}
"""By the firmware's type."""
_ITEM, _INFO = 2, 3
_RESET, _CREATE, _START = 5, 6, 8
_MOST_BYTES = 26
_WRAPS_MS = 1 << 24


@dataclass(slots=True)
class Block:
    """Values that are logged together."""

    names: tuple[str, ...]
    """As `group.name`."""
    period_ms: int
    layout: struct.Struct = field(default_factory=lambda: struct.Struct("<"))
    heard_s: float = -float("inf")
    """When one came last."""
    time_s: list[float] = field(default_factory=list[float])
    rows: list[tuple[float, ...]] = field(default_factory=list[tuple[float, ...]])

    def last(self, name: str) -> float:
        """NaN before the first."""
        return self.rows[-1][self.names.index(name)] if self.rows else float("nan")

    def columns(self) -> dict[str, FloatArray]:
        values = np.array(self.rows, dtype=np.float64).reshape(-1, len(self.names))
        return {name: values[:, i] for i, name in enumerate(self.names)}


class Variables:
    """The blocks of one flight."""

    def __init__(self, client: Client, blocks: Sequence[Block]) -> None:
        """Find the names and start the blocks.

        Raises:
            LinkError: the firmware does not have one of them, or refuses a block.
        """
        self._client, self.blocks = client, list(blocks)
        self._last_ms: dict[int, int] = {}
        self._begin_ms: int | None = None
        types = _found(client, {name for block in blocks for name in block.names})
        client.on_log = self._take
        _control(client, bytes([_RESET]), "the reset of its log blocks")
        for number, block in enumerate(self.blocks):
            block.layout = struct.Struct("<" + "".join(_LAYOUTS[types[name][1]] for name in block.names))
            assert block.layout.size <= _MOST_BYTES, block.names
            rows = b"".join(struct.pack("<BH", types[name][1], types[name][0]) for name in block.names)
            _control(client, bytes([_CREATE, number]) + rows, f"the log block of {', '.join(block.names)}")
            period = struct.pack("<H", block.period_ms)
            _control(client, bytes([_START, number]) + period, f"the start of log block {number}")

    def _take(self, data: bytes) -> None:
        """Number, milliseconds in 24 bits, values; of what is older or repeated only the first counts."""
        if len(data) < 4 or data[0] >= len(self.blocks):
            return
        block = self.blocks[data[0]]
        stamp_ms = int.from_bytes(data[1:4], "little")
        if len(data) < 4 + block.layout.size or not self._newer(data[0], stamp_ms):
            return
        self._begin_ms = stamp_ms if self._begin_ms is None else self._begin_ms
        block.heard_s = self._client.now_s
        block.time_s.append(1e-3 * self._since(stamp_ms))
        block.rows.append(tuple(map(float, block.layout.unpack_from(data, 4))))

    def _newer(self, number: int, stamp_ms: int) -> bool:
        last_ms = self._last_ms.get(number)
        if last_ms is not None and not 0 < (stamp_ms - last_ms) % _WRAPS_MS < _WRAPS_MS // 2:
            return False
        self._last_ms[number] = stamp_ms
        return True

    def _since(self, stamp_ms: int) -> int:
        """Milliseconds since the first, before it below 0; the stamp's 24 bits last for 4.6 hours."""
        assert self._begin_ms is not None
        return (stamp_ms - self._begin_ms + _WRAPS_MS // 2) % _WRAPS_MS - _WRAPS_MS // 2


def _control(client: Client, request: bytes, what: str) -> None:
    data = client.ask(LOG, 1, request, answer=request[:2], what=what)
    if len(data) >= 3 and data[2] and request[0] != _RESET:
        raise LinkError(f"the Crazyflie refuses {what} ({data[2]})")


def _found(client: Client, names: set[str]) -> dict[str, tuple[int, int]]:
    """Index and type by name."""
    info = client.ask(LOG, 0, bytes([_INFO]), answer=bytes([_INFO]), what="its table of logged values")
    found: dict[str, tuple[int, int]] = {}
    for index in range(int.from_bytes(info[1:3], "little")):
        request = struct.pack("<BH", _ITEM, index)
        item = client.ask(LOG, 0, request, answer=request, what=f"logged value {index}")
        group, name, *_ = item[4:].split(b"\0")
        full = f"{group.decode('ascii', 'replace')}.{name.decode('ascii', 'replace')}"
        if full in names:
            found[full] = index, item[3] & 0x0F
        if len(found) == len(names):
            return found
    missing = ", ".join(sorted(names - set(found)))
    raise LinkError(f"the Crazyflie's firmware logs no {missing}; update it, or build it with the Kalman estimator")
