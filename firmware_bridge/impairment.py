"""A bad radio, simulated: datagrams are lost, late, doubled, swapped, damaged or queued behind a slow line."""

import heapq
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from flight import InputError

Tag = TypeVar("Tag")


@dataclass(frozen=True, slots=True)
class Impairment:
    """What the line does to each datagram, the same in both directions. The default is a perfect line."""

    loss_ratio: float = 0.0
    """Probability that a datagram vanishes."""
    delay_s: float = 0.0
    """One-way delay."""
    jitter_s: float = 0.0
    """Further delay, uniform in 0 to this; swaps datagrams."""
    duplicate_ratio: float = 0.0
    """Probability that a datagram arrives twice."""
    corrupt_ratio: float = 0.0
    """Probability that one random bit of a datagram is flipped."""
    rate_bytes_s: float = float("inf")
    """How fast the line carries bytes."""
    queue_s: float = 0.5
    """What would wait longer than this for the slow line is dropped."""

    def __post_init__(self) -> None:
        for name in ("loss_ratio", "duplicate_ratio", "corrupt_ratio"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"{name} is {getattr(self, name):g}; it must be from 0 to 1")
        if not (self.delay_s >= 0.0 and self.jitter_s >= 0.0 and self.rate_bytes_s > 0.0 and self.queue_s > 0.0):
            raise InputError(
                f"delay {self.delay_s:g} s and jitter {self.jitter_s:g} s must not be negative, "
                f"rate {self.rate_bytes_s:g} bytes/s and queue {self.queue_s:g} s must be positive"
            )

    @property
    def perfect(self) -> bool:
        return self == Impairment(queue_s=self.queue_s)


@dataclass(slots=True)
class Line(Generic[Tag]):
    """One direction of an impaired line, for anything that travels with its datagram (an address)."""

    impairment: Impairment
    rng: np.random.Generator
    waiting: list[tuple[float, int, bytes, Tag]] = field(default_factory=list[tuple[float, int, bytes, Tag]])
    free_at_s: float = 0.0
    count: int = 0

    def push(self, datagram: bytes, tag: Tag, now_s: float) -> None:
        """Put a datagram on the line."""
        how, rng = self.impairment, self.rng
        start_s = max(now_s, self.free_at_s)
        if start_s - now_s > how.queue_s:
            return
        self.free_at_s = start_s + len(datagram) / how.rate_bytes_s
        if rng.random() < how.loss_ratio:
            return
        if rng.random() < how.corrupt_ratio:
            damaged = bytearray(datagram)
            damaged[rng.integers(len(damaged))] ^= 1 << int(rng.integers(8))
            datagram = bytes(damaged)
        for _ in range(2 if rng.random() < how.duplicate_ratio else 1):
            due_s = self.free_at_s + how.delay_s + how.jitter_s * rng.random()
            self.count += 1
            heapq.heappush(self.waiting, (due_s, self.count, datagram, tag))

    def pop(self, now_s: float) -> list[tuple[bytes, Tag]]:
        """What has arrived by now."""
        arrived: list[tuple[bytes, Tag]] = []
        while self.waiting and self.waiting[0][0] <= now_s:
            arrived.append(heapq.heappop(self.waiting)[2:])
        return arrived

    def next_s(self) -> float:
        """When the next one arrives; infinite if none is under way."""
        return self.waiting[0][0] if self.waiting else float("inf")
