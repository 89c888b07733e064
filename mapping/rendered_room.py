"""The furnished room of the rendered world: analytic solids, so that the distance to its surfaces is a formula.

World z is up, the origin lies on the floor in the middle of the room. A wall with two doorways divides the room, so
that a flight through both halves has to weave.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flight import FloatArray

SIZE_M = (10.0, 8.0, 3.2)
LAMPS_WORLD_M = np.array([[-2.6, 0.3, 2.9], [2.6, -0.3, 2.9]])

# albedo, largest patch (m), patch contrast, longest noise wave (m), noise contrast
_PAINT = {
    "plaster": (0.60, 0.55, 0.28, 0.60, 0.30),
    "brick": (0.42, 0.30, 0.38, 0.40, 0.26),
    "wood": (0.27, 0.35, 0.26, 0.25, 0.24),
    "cloth": (0.22, 0.26, 0.28, 0.20, 0.24),
    "metal": (0.74, 0.40, 0.38, 0.30, 0.24),
}
_KINDS = ("box", "sphere", "cylinder", "room")


@dataclass(frozen=True, slots=True)
class Solid:
    """One piece of matter. A room is the inside of a box: its matter is outside."""

    kind: str
    """box, sphere, cylinder (axis along z) or room."""
    centre_world_m: tuple[float, float, float]
    """Its middle."""
    half_m: tuple[float, float, float]
    """Half extents; of a sphere (radius, -, -), of a cylinder (radius, radius, half height)."""
    paint: str
    """One of plaster, brick, wood, cloth, metal."""

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        """(n, 3) to (n,) metres to the surface, negative inside the matter."""
        offset = np.abs(np.asarray(points_world_m, dtype=np.float64) - self.centre_world_m)
        if self.kind == "sphere":
            return np.linalg.norm(offset, axis=-1) - self.half_m[0]
        if self.kind == "cylinder":
            offset = np.stack([np.hypot(offset[..., 0], offset[..., 1]), offset[..., 2]], axis=-1)
            beyond = offset - (self.half_m[0], self.half_m[2])
        else:
            beyond = offset - self.half_m
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
        distance = outside + np.minimum(beyond.max(axis=-1), 0.0)
        return -distance if self.kind == "room" else distance


@dataclass(frozen=True, slots=True)
class RenderedScene:
    """Painted solids: what the renderer draws, and the truth about where the surfaces are."""

    solids: tuple[Solid, ...]
    """Their union is matter, everything else is air."""

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        """(n, 3) to (n,) metres to the nearest surface, negative inside matter (there, a bound from above)."""
        return np.min([solid.distance(points_world_m) for solid in self.solids], axis=0)

    def solid_table(self) -> FloatArray:
        """(n, 8) rows for the kernel: kind, centre, half extents, material. Each solid has a material of its own."""
        return np.array(
            [[_KINDS.index(s.kind), *s.centre_world_m, *s.half_m, number] for number, s in enumerate(self.solids)]
        )

    def material_table(self) -> FloatArray:
        """(n, 6) rows for the kernel: albedo, patch size and contrast, noise size and contrast, seed."""
        return np.array([[*_PAINT[s.paint], 7919.0 * (number + 1)] for number, s in enumerate(self.solids)])


def furnished() -> RenderedScene:
    """The 10 x 8 x 3.2 m room that the demo, the examples and the accuracy tests use."""
    room = Solid("room", (0.0, 0.0, SIZE_M[2] / 2), (SIZE_M[0] / 2, SIZE_M[1] / 2, SIZE_M[2] / 2), "plaster")
    return RenderedScene((room, *_dividing_wall(), *_tables(), *_shelves(), *_loose_things()))


def _dividing_wall() -> list[Solid]:
    """Across the room at x = 0, with doorways 1.3 m wide at y = -2 and y = 2, 2.3 m high."""
    walls = [((-0.08, a, 0.0), (0.08, b, 3.2)) for a, b in ((-4.0, -2.65), (-1.35, 1.35), (2.65, 4.0))]
    lintels = [((-0.08, y - 0.65, 2.3), (0.08, y + 0.65, 3.2)) for y in (-2.0, 2.0)]
    return [_box(lower, upper, "brick") for lower, upper in walls + lintels]


def _tables() -> list[Solid]:
    parts: list[Solid] = []
    for x, y in ((-2.7, 0.0), (3.0, 2.9)):
        parts.append(_box((x - 0.8, y - 0.45, 0.70), (x + 0.8, y + 0.45, 0.76), "wood"))
        legs = [(x + sx, y + sy) for sx in (-0.74, 0.74) for sy in (-0.39, 0.39)]
        parts += [_box((a - 0.03, b - 0.03, 0.0), (a + 0.03, b + 0.03, 0.70), "metal") for a, b in legs]
    return parts


def _shelves() -> list[Solid]:
    """One along the wall x = -5, one along y = -4: boards between two sides, and boxes on the boards."""
    heights = (0.3, 0.9, 1.5, 2.1)
    parts = [_box((-5.0, -1.5, z), (-4.65, 1.0, z + 0.04), "wood") for z in heights]
    parts += [_box((-5.0, y, 0.0), (-4.65, y + 0.04, 2.1), "wood") for y in (-1.5, 0.96)]
    parts += [_box((1.2, -4.0, z), (3.6, -3.65, z + 0.04), "wood") for z in heights]
    parts += [_box((x, -4.0, 0.0), (x + 0.04, -3.65, 2.1), "wood") for x in (1.2, 3.56)]
    return [
        *parts,
        _box((-4.95, -1.2, 0.34), (-4.7, -0.6, 0.70), "cloth"),
        _box((-4.95, 0.0, 0.94), (-4.72, 0.5, 1.30), "cloth"),
        _box((-4.95, -0.9, 1.54), (-4.7, -0.2, 1.80), "metal"),
        _box((1.5, -3.95, 0.94), (2.1, -3.70, 1.25), "cloth"),
        _box((2.6, -3.95, 1.54), (3.2, -3.72, 1.95), "metal"),
    ]


def _loose_things() -> list[Solid]:
    return [
        _pillar(-2.3, -2.3, 0.16, 3.2, "brick"),
        _pillar(2.3, 0.2, 0.20, 3.2, "plaster"),
        _pillar(-3.9, 3.3, 0.28, 0.8, "metal"),
        _pillar(0.9, 3.4, 0.22, 0.6, "cloth"),
        _box((-4.9, -3.9, 0.0), (-4.0, -3.0, 0.9), "cloth"),
        _box((-4.7, -3.7, 0.9), (-4.15, -3.15, 1.4), "wood"),
        _box((4.1, -1.0, 0.0), (4.95, 0.3, 0.45), "cloth"),
        _box((4.3, -3.8, 0.0), (4.9, -3.1, 1.7), "metal"),
        _box((-1.6, 3.3, 0.0), (-0.7, 3.95, 1.1), "wood"),
        Solid("sphere", (-2.5, 0.1, 0.94), (0.18, 0.18, 0.18), "cloth"),
        Solid("sphere", (3.2, 2.8, 0.98), (0.22, 0.22, 0.22), "metal"),
        Solid("sphere", (4.5, -0.4, 0.70), (0.25, 0.25, 0.25), "brick"),
    ]


def _box(lower_m: tuple[float, float, float], upper_m: tuple[float, float, float], paint: str) -> Solid:
    x, y, z = ((a + b) / 2 for a, b in zip(lower_m, upper_m, strict=True))
    dx, dy, dz = ((b - a) / 2 for a, b in zip(lower_m, upper_m, strict=True))
    return Solid("box", (x, y, z), (dx, dy, dz), paint)


def _pillar(x_m: float, y_m: float, radius_m: float, height_m: float, paint: str) -> Solid:
    return Solid("cylinder", (x_m, y_m, height_m / 2), (radius_m, radius_m, height_m / 2), paint)
