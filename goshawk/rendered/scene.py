"""The furnished room of the rendered world: analytic solids, so that the distance to its surfaces is a formula.

World z is up, the origin lies on the floor in the middle of the room. A wall with two doorways divides the room, so
that a flight through both halves has to weave.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from esdf.solids import Box, Cylinder, Room, Scene, Solid, Sphere
from flight import FloatArray, InputError

SIZE_M = (10.0, 8.0, 3.2)
LAMPS_WORLD_M = np.array([[-2.6, 0.3, 2.9], [2.6, -0.3, 2.9]])

# albedo, largest patch (m), patch contrast, longest noise wave (m), noise contrast
_PAINT = {
    "plaster": (0.60, 0.55, 0.28, 0.60, 0.30),
    "brick": (0.42, 0.30, 0.38, 0.40, 0.26),
    "wood": (0.27, 0.35, 0.26, 0.25, 0.24),
    "cloth": (0.22, 0.26, 0.28, 0.20, 0.24),
    "metal": (0.74, 0.40, 0.38, 0.30, 0.24),
    "plain": (0.66, 1.00, 0.00, 1.00, 0.00),
    "paper": (0.85, 1.00, 0.00, 1.00, 0.00),
    "ink": (0.10, 1.00, 0.00, 1.00, 0.00),
}
Painted = tuple[Solid, str]


@dataclass(frozen=True, slots=True)
class RenderedScene:
    """Textured solids: the renderer's input, and the ground truth of the surfaces."""

    painted: tuple[Painted, ...]
    """Boxes, rooms, spheres and upright cylinders, each with the name of its paint; their union is matter."""
    period_m: float = 0.0
    """The paint repeats after this distance along x, y and z, as tiles and wallpaper do; 0: it does not."""

    @property
    def scene(self) -> Scene:
        """The solids without their paint."""
        return Scene([solid for solid, _ in self.painted])

    def distance(self, points_world_m: ArrayLike) -> FloatArray:
        """(n, 3) to (n,) metres to the nearest surface, negative inside matter."""
        return self.scene.distance(points_world_m)

    def solid_table(self) -> FloatArray:
        """(n, 8) rows for the kernel: kind, centre, half extents, material. Each solid has a material of its own."""
        return np.array([[*_shape(solid), float(number)] for number, (solid, _) in enumerate(self.painted)])

    def material_table(self) -> FloatArray:
        """(n, 7) rows for the kernel: albedo, patch size and contrast, noise size and contrast, seed, period."""
        rows = enumerate(self.painted)
        return np.array([[*_PAINT[paint], 7919.0 * (number + 1), self.period_m] for number, (_, paint) in rows])


def _shape(solid: Solid) -> list[float]:
    """Kind, centre and half extents (of a sphere its radius, of a cylinder radius, radius, half height)."""
    match solid:
        case Box() | Room():
            low, high = np.array(solid.low_world_m), np.array(solid.high_world_m)
            kind = 0.0 if isinstance(solid, Box) else 3.0
            return [kind, *(0.5 * (low + high)).tolist(), *(0.5 * (high - low)).tolist()]
        case Sphere():
            return [1.0, *solid.centre_world_m, *[solid.radius_m] * 3]
        case Cylinder():
            return [2.0, *solid.centre_world_m, solid.radius_m, solid.radius_m, 0.5 * solid.height_m]
    raise InputError(f"the renderer cannot draw {type(solid).__name__}; it draws Box, Room, Sphere and Cylinder")


def furnished() -> RenderedScene:
    """The 10 x 8 x 3.2 m room that the demo, the examples and the accuracy tests use."""
    room = Room((-SIZE_M[0] / 2, -SIZE_M[1] / 2, 0.0), (SIZE_M[0] / 2, SIZE_M[1] / 2, SIZE_M[2]))
    return RenderedScene(((room, "plaster"), *_dividing_wall(), *_tables(), *_shelves(), *_loose_things()))


def _pillar(x_m: float, y_m: float, radius_m: float, height_m: float) -> Cylinder:
    return Cylinder((x_m, y_m, height_m / 2), radius_m, height_m)


def _rod(diameter_m: float, x_m: float, y_m: float) -> Cylinder:
    return _pillar(x_m, y_m, 0.5 * diameter_m, SIZE_M[2])


RODS = (
    _rod(0.030, 1.6, -0.9), _rod(0.006, 1.0, -0.9), _rod(0.006, 4.2, 1.2), _rod(0.012, 1.6, 0.3),
    _rod(0.012, 0.7, -3.2), _rod(0.020, 1.0, 0.2), _rod(0.020, 3.9, -2.4), _rod(0.030, 1.9, -3.0),
    _rod(0.050, 0.6, 1.1), _rod(0.050, 4.0, 2.1),
)  # fmt: skip
"""Upright from floor to ceiling in the half x > 0, some .9 to 1.9 m from the path; the first is "the pole"."""
OTHER_RODS = (
    _rod(0.030, 4.69, -1.08), _rod(0.020, 1.64, -0.94), _rod(0.030, 2.23, 0.79), _rod(0.040, 1.51, 3.57),
    _rod(0.040, 4.75, 0.12), _rod(0.050, 1.13, -0.40), _rod(0.050, 4.27, 1.05), _rod(0.060, 3.73, -1.75),
    _rod(0.030, 2.41, -0.81), _rod(0.040, 1.95, 0.36),
)  # fmt: skip
"""At random places beside the path, instead of `RODS`."""
CABLE = Box((0.1, 0.794, 1.994), (4.9, 0.806, 2.006))
"""12 mm thick, across that half."""
PLAIN_WALL = Box((4.96, -3.0, 0.0), (5.0, 2.4, 3.2))
"""In front of the wall x = 5, without any texture."""


def hazardous(upright: tuple[Cylinder, ...] = RODS) -> RenderedScene:
    """The furnished room with what a map of images misses most easily: thin rods, a cable, a plain stretch of wall."""
    rods = [(rod, ("metal", "cloth", "plaster", "wood")[number % 4]) for number, rod in enumerate(upright)]
    return RenderedScene((*furnished().painted, *rods, (CABLE, "cloth"), (PLAIN_WALL, "plain")))


def tiled(period_m: float = 0.5) -> RenderedScene:
    """The same room without furniture, papered and tiled: one place looks like the other half a metre on."""
    room = Room((-SIZE_M[0] / 2, -SIZE_M[1] / 2, 0.0), (SIZE_M[0] / 2, SIZE_M[1] / 2, SIZE_M[2]))
    return RenderedScene(((room, "plaster"), *_dividing_wall()), period_m)


def _dividing_wall() -> list[Painted]:
    """Across the room at x = 0, with doorways 1.3 m wide at y = -2 and y = 2, 2.3 m high."""
    walls = [((-0.08, a, 0.0), (0.08, b, 3.2)) for a, b in ((-4.0, -2.65), (-1.35, 1.35), (2.65, 4.0))]
    lintels = [((-0.08, y - 0.65, 2.3), (0.08, y + 0.65, 3.2)) for y in (-2.0, 2.0)]
    return [(Box(lower, upper), "brick") for lower, upper in walls + lintels]


def _tables() -> list[Painted]:
    parts: list[Painted] = []
    for x, y in ((-2.7, 0.0), (3.0, 2.9)):
        parts.append((Box((x - 0.8, y - 0.45, 0.70), (x + 0.8, y + 0.45, 0.76)), "wood"))
        legs = [(x + sx, y + sy) for sx in (-0.74, 0.74) for sy in (-0.39, 0.39)]
        parts += [(Box((a - 0.03, b - 0.03, 0.0), (a + 0.03, b + 0.03, 0.70)), "metal") for a, b in legs]
    return parts


def _shelves() -> list[Painted]:
    """One along the wall x = -5, one along y = -4: boards between two sides, and boxes on the boards."""
    heights = (0.3, 0.9, 1.5, 2.1)
    parts = [(Box((-5.0, -1.5, z), (-4.65, 1.0, z + 0.04)), "wood") for z in heights]
    parts += [(Box((-5.0, y, 0.0), (-4.65, y + 0.04, 2.1)), "wood") for y in (-1.5, 0.96)]
    parts += [(Box((1.2, -4.0, z), (3.6, -3.65, z + 0.04)), "wood") for z in heights]
    parts += [(Box((x, -4.0, 0.0), (x + 0.04, -3.65, 2.1)), "wood") for x in (1.2, 3.56)]
    return [
        *parts,
        (Box((-4.95, -1.2, 0.34), (-4.7, -0.6, 0.70)), "cloth"),
        (Box((-4.95, 0.0, 0.94), (-4.72, 0.5, 1.30)), "cloth"),
        (Box((-4.95, -0.9, 1.54), (-4.7, -0.2, 1.80)), "metal"),
        (Box((1.5, -3.95, 0.94), (2.1, -3.70, 1.25)), "cloth"),
        (Box((2.6, -3.95, 1.54), (3.2, -3.72, 1.95)), "metal"),
    ]


def _loose_things() -> list[Painted]:
    return [
        (_pillar(-2.3, -2.3, 0.16, 3.2), "brick"),
        (_pillar(2.3, 0.2, 0.20, 3.2), "plaster"),
        (_pillar(-3.9, 3.3, 0.28, 0.8), "metal"),
        (_pillar(0.9, 3.4, 0.22, 0.6), "cloth"),
        (Box((-4.9, -3.9, 0.0), (-4.0, -3.0, 0.9)), "cloth"),
        (Box((-4.7, -3.7, 0.9), (-4.15, -3.15, 1.4)), "wood"),
        (Box((4.1, -1.0, 0.0), (4.95, 0.3, 0.45)), "cloth"),
        (Box((4.3, -3.8, 0.0), (4.9, -3.1, 1.7)), "metal"),
        (Box((-1.6, 3.3, 0.0), (-0.7, 3.95, 1.1)), "wood"),
        (Sphere((-2.5, 0.1, 0.94), 0.18), "cloth"),
        (Sphere((3.2, 2.8, 0.98), 0.22), "metal"),
        (Sphere((4.5, -0.4, 0.70), 0.25), "brick"),
    ]
