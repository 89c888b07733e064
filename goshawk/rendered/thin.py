"""The furnished room with a net, cables and poles, rendered with several rays a pixel: a thing of half a pixel is half
as dark as one of a pixel, as a lens shows it, and not there in one pixel of two.

Nothing here is shared with what makes the map.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, Grid
from esdf.solids import Box, Cylinder
from flight import FloatArray
from goshawk import _rendering
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import Painted, RenderedScene
from mapping.camera.rig import Camera, Rig
from mapping.dense.views import ImageView

RAYS = 3
"""Along each side of a pixel."""
POLES = {
    "pole of 20 mm": Cylinder((1.6, -0.9, 1.6), 0.010, 3.2),
    "pole of 30 mm": Cylinder((1.0, -1.0, 1.6), 0.015, 3.2),
    "pole of 40 mm": Cylinder((1.0, 0.3, 1.6), 0.020, 3.2),
    "pole of 60 mm": Cylinder((3.9, -2.4, 1.6), 0.030, 3.2),
}
CABLES = {
    "cable of 12 mm": Box((0.1, 0.794, 1.994), (4.9, 0.806, 2.006)),
    "cable of 6 mm": Box((0.1, -0.503, 1.797), (4.9, -0.497, 1.803)),
}
NET_LOW_M, NET_HIGH_M, CORD_M, MESH_M = (1.2, -3.2, 0.4), (3.2, -3.2, 2.4), 0.004, 0.1
"""A net of 4 mm cords, 10 cm apart, .45 m before a shelf."""
STEP_M = 0.01


def scene() -> RenderedScene:
    """The furnished room with all of them."""
    paints = ("metal", "cloth", "plaster", "wood", "cloth", "ink")
    things: list[Painted] = list(zip((*POLES.values(), *CABLES.values()), paints, strict=True))
    return RenderedScene((*rendered_room.furnished().painted, *things, *((cord, "cloth") for cord in net())))


def net() -> list[Box]:
    """The cords."""
    half = 0.5 * CORD_M
    (x0, y, z0), (x1, _, z1) = NET_LOW_M, NET_HIGH_M
    upright = [Box((x - half, y - half, z0), (x + half, y + half, z1)) for x in np.arange(x0, x1 + 1e-9, MESH_M)]
    level = [Box((x0, y - half, z - half), (x1, y + half, z + half)) for z in np.arange(z0, z1 + 1e-9, MESH_M)]
    return upright + level


def views(room: RenderedScene, rig: Rig, T_world_body: FloatArray) -> list[ImageView]:
    """The images of a flight with their true poses."""
    return [
        ImageView(camera, T @ camera.T_body_camera, render(camera, T, room, seed=len(rig) * i + number))
        for i, T in enumerate(T_world_body)
        for number, camera in enumerate(rig)
    ]


def render(camera: Camera, T_world_body: FloatArray, room: RenderedScene, *, seed: int) -> NDArray[np.uint8]:
    """The image of one camera at one body pose (4, 4), the mean of `RAYS` x `RAYS` rays a pixel, and noise."""
    place = {"fx", "fy", "f", "cx", "cy"}
    params = np.array([value * RAYS if name in place else value for name, value in camera.parameters.items()])
    finer = dataclasses.replace(camera, width=RAYS * camera.width, height=RAYS * camera.height, params=params)
    shown = _rendering.render(
        room.solid_table(),
        room.material_table(),
        rendered_room.LAMPS_WORLD_M,
        np.ascontiguousarray(finer.unproject(finer.pixel_centres())),
        np.ascontiguousarray(T_world_body @ camera.T_body_camera),
        rendered_world.GAIN,
        0.0,
        rendered_world.VIGNETTE,
        0,
        rendered_world.THREADS,
    )
    mean = shown.reshape(camera.height, RAYS, camera.width, RAYS).mean(axis=(1, 3), dtype=np.float64)
    noisy = mean + np.random.default_rng(seed).normal(0.0, rendered_world.NOISE_GREY_LEVELS, mean.shape)
    return np.where(mean > 0.0, np.clip(np.round(noisy), 1.0, 255.0), 0.0).astype(np.uint8)


def free_inside(state: NDArray[np.uint8], grid: Grid) -> dict[str, float]:
    """Share of the axis of each thing, without its ends, that lies in free voxels."""
    axes = {name: [_axis(thing)] for name, thing in (POLES | CABLES).items()} | {"net": [_axis(c) for c in net()]}
    shares = {}
    for name, parts in axes.items():
        points = np.concatenate(parts)
        inside = grid.contains(points)
        shares[name] = float((state[tuple(grid.index(points[inside]).T)] == FREE).sum() / len(points))
    return shares


def _axis(thing: Box | Cylinder) -> FloatArray:
    """(n, 3) points along the longest middle line, `STEP_M` apart."""
    low, high = (np.array(corner) for corner in thing.bounds_world_m)
    longest = int(np.argmax(high - low))
    along = np.arange(low[longest] + 0.2, high[longest] - 0.2, STEP_M)
    points = np.tile(0.5 * (low + high), (len(along), 1))
    points[:, longest] = along
    return points
