"""A hall of 18 x 12 x 5 m with racks, pillars and crates, and a loop through it: larger than the furnished room."""

import numpy as np

from esdf.solids import Box, Cylinder, Room
from goshawk.rendered.scene import Painted, RenderedScene

SIZE_M = (18.0, 12.0, 5.0)
# Round both racks and between them; x, y, z of a closed loop
LOOP_WORLD_M = np.array(
    [
        [-7.0, -4.3, 1.5],
        [-3.5, -4.6, 1.7],
        [0.5, -4.3, 2.0],
        [4.5, -4.5, 1.8],
        [7.2, -3.4, 1.6],
        [7.4, -0.8, 1.8],
        [5.0, 0.1, 2.1],
        [1.0, -0.2, 2.3],
        [-2.6, 0.2, 2.0],
        [-4.6, 1.6, 1.8],
        [-4.5, 3.8, 1.7],
        [-6.0, 4.9, 1.5],
        [-7.5, 3.0, 1.6],
        [-7.6, -0.5, 1.8],
    ]
)


def furnished() -> RenderedScene:
    """The hall; its origin lies on the floor in the middle."""
    x_m, y_m, z_m = SIZE_M
    walls = Room((-x_m / 2, -y_m / 2, 0.0), (x_m / 2, y_m / 2, z_m))
    return RenderedScene(((walls, "plaster"), *_rack(-2.3), *_rack(2.6), *_pillars(), *_crates()))


def _rack(y_m: float) -> list[Painted]:
    """Along x from -2 to 5 m: four boards between uprights, and goods on the boards."""
    heights_m = (0.2, 1.1, 2.0, 2.9)
    parts: list[Painted] = [(Box((-2.0, y_m - 0.4, z), (5.0, y_m + 0.4, z + 0.06)), "wood") for z in heights_m]
    parts += [(Box((x, y_m - 0.4, 0.0), (x + 0.1, y_m + 0.4, 3.4)), "metal") for x in (-2.1, 0.2, 2.5, 5.0)]
    goods = np.random.default_rng(5)
    for z in heights_m:
        for x in (-1.7, -0.6, 0.7, 1.6, 2.9, 3.9):
            length_m, depth_m, height_m = goods.uniform([0.4, 0.3, 0.25], [0.8, 0.7, 0.7])
            low, high = (x, y_m - 0.5 * depth_m, z + 0.06), (x + length_m, y_m + 0.5 * depth_m, z + 0.06 + height_m)
            parts.append((Box(low, high), ("cloth", "wood", "brick", "metal")[int(goods.integers(4))]))
    return parts


def _pillars() -> list[Painted]:
    places = [(-5.8, -2.0), (-5.8, 1.2), (6.2, -2.2), (6.2, 2.4)]
    return [(Cylinder((x, y, SIZE_M[2] / 2), 0.22, SIZE_M[2]), "brick") for x, y in places]


def _crates() -> list[Painted]:
    return [
        (Box((-8.8, -5.8, 0.0), (-7.6, -5.0, 1.0)), "wood"),
        (Box((-8.6, -5.7, 1.0), (-7.8, -5.1, 1.6)), "cloth"),
        (Box((-8.9, 4.6, 0.0), (-8.1, 5.8, 1.4)), "metal"),
        (Box((7.6, 4.0, 0.0), (8.8, 5.6, 1.2)), "cloth"),
        (Box((7.8, -5.8, 0.0), (8.9, -5.0, 1.8)), "brick"),
        (Box((-1.2, 5.2, 0.0), (0.6, 5.95, 1.1)), "wood"),
        (Box((2.8, 5.3, 0.0), (4.4, 5.95, 0.8)), "metal"),
        (Box((-0.4, -5.95, 0.0), (1.4, -5.4, 0.9)), "cloth"),
        (Box((-8.95, -1.6, 0.0), (-8.5, 0.4, 2.2)), "brick"),
        (Box((8.5, -1.4, 0.0), (8.95, 0.8, 2.0)), "wood"),
    ]
