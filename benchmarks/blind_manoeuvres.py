"""The flights of a blind campaign: sums of sines with drawn sizes, speeds and phases, one kind of manoeuvre each."""

from dataclasses import dataclass

import numpy as np
from blind_flight import Array, Reference

TRAINING = ("vertical", "fast", "rotation", "general")
HELD_OUT = ("eight", "helix")
"""The kinds of a campaign; the held-out ones are others than those trained on."""

_KINDS: dict[str, list[list[tuple[float, float]]]] = {
    # x, y, z, yaw: (amplitude, angular frequency) of each sine
    "vertical": [[(0.5, 1.1)], [(0.4, 1.3)], [(2.6, 1.4), (0.06, 4.3)], [(0.7, 0.8)]],
    "fast": [[(6.5, 1.12), (0.05, 3.9)], [(4.0, 1.4), (0.05, 4.3)], [(0.5, 1.7)], [(1.3, 0.5)]],
    "rotation": [[(0.35, 3.1), (0.03, 6.9)], [(0.35, 3.5), (0.03, 6.3)], [(0.25, 2.3)], [(0.7, 1.4), (0.06, 4.9)]],
    "general": [[(3.6, 1.1), (0.2, 3.1)], [(3.0, 1.3), (0.2, 2.8)], [(1.3, 1.2)], [(1.5, 0.6), (0.1, 3.5)]],
    "eight": [[(5.5, 0.85), (0.1, 3.3)], [(2.4, 1.7)], [(1.1, 1.3), (0.08, 3.1)], [(1.2, 0.45), (0.07, 3.9)]],
    "helix": [[(4.2, 1.2)], [(4.2, 1.2), (0.15, 3.1)], [(1.9, 1.45)], [(1.0, 0.7), (0.06, 4.3)]],
}
_LOW: list[list[tuple[float, float]]] = [[(2.0, 0.9)], [(1.6, 0.7), (0.1, 3.1)], [(0.55, 0.8)], [(1.2, 0.6)]]
"""A sweep that dips to the ground: what replaces `general` and `helix` when a campaign goes low."""
CRUISE_HEIGHT_M = 6.0
LOWEST_M = (0.2, 0.24)
"""Drawn lowest point of a low sweep; the ground is at height zero."""


@dataclass(frozen=True, slots=True)
class Path:
    """One flight's reference: sines per axis around a middle."""

    kind: str
    amplitude: Array
    """(4, 2) of x, y, z and yaw."""
    speed: Array
    phase: Array
    middle: Array
    """(4,)."""


def draw(kind: str, low: bool, rng: np.random.Generator) -> Path:
    """A path of one kind; `low` makes the kinds that may go near the ground do so."""
    sweeping = low and kind in ("general", "helix")
    table = np.zeros((4, 2, 2))
    for axis, sines in enumerate(_LOW if sweeping else _KINDS[kind]):
        table[axis, : len(sines)] = sines
    amplitude = table[..., 0] * rng.uniform(0.85, 1.1, (4, 2))
    speed = table[..., 1] * rng.uniform(0.92, 1.08, (4, 2))
    phase = rng.uniform(0.0, 2.0 * np.pi, (4, 2))
    middle = np.array([0.0, 0.0, CRUISE_HEIGHT_M, rng.uniform(-np.pi, np.pi)])
    if kind in ("eight", "helix") and not sweeping:
        # a quarter turn between the level axes makes the curve round
        phase[1, 0] = phase[0, 0] + 0.5 * np.pi
        speed[1, 0] = speed[0, 0] * (2.0 if kind == "eight" else 1.0)
    if sweeping:
        middle[2] = rng.uniform(*LOWEST_M) + amplitude[2].sum()
    return Path(kind, amplitude, speed, phase, middle)


@dataclass(frozen=True, slots=True)
class Paths:
    """A batch of paths, the flight last."""

    amplitude: Array
    speed: Array
    phase: Array
    middle: Array

    @staticmethod
    def of(paths: list[Path]) -> "Paths":
        return Paths(*(np.stack([getattr(p, n) for p in paths], axis=-1) for n in Paths.__slots__))

    def at(self, time_s: float) -> Reference:
        """The set-points of the controllers at one instant."""
        angle = self.speed * time_s + self.phase
        sine, cosine = self.amplitude * np.sin(angle), self.amplitude * np.cos(angle)
        place = self.middle + sine.sum(axis=1)
        pace = (self.speed * cosine).sum(axis=1)
        bend = -(self.speed**2 * sine).sum(axis=1)
        return Reference(place[:3], pace[:3], bend[:3], place[3], pace[3])
