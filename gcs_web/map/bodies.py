"""Bodies of edits of the map: their edges, the handles by which they are changed. Numbers in, numbers out."""

from collections.abc import Sequence

import numpy as np

from flight import FloatArray
from gcs_web.protocol.map import Shape

Place = tuple[float, float, float]
"""A point, world."""

_SMALLEST_M = 0.02
"""Of a body that a handle is drawn together to."""
_MOST_BALLS = 200
"""Of a drawn stroke."""
_AROUND = np.linspace(0.0, 2.0 * np.pi, 33)


def outline(shape: Shape) -> FloatArray:
    """Edges of a body as line segments (m, 2, 3), world."""
    centre = np.array(shape.centre_m)
    if shape.form == "stroke":
        line = np.array([*shape.points_m, shape.points_m[-1]])
        return np.stack([line[:-1], line[1:]], axis=1)
    if shape.form == "sphere":
        circles = []
        for axis in range(3):
            ring = np.zeros((len(_AROUND), 3))
            ring[:, (axis + 1) % 3], ring[:, (axis + 2) % 3] = np.cos(_AROUND), np.sin(_AROUND)
            circles.append(np.stack([ring[:-1], ring[1:]], axis=1))
        return centre + shape.radius_m * np.concatenate(circles)
    half = 0.5 * np.array(shape.size_m)
    if shape.form == "prism":
        corners = np.array(shape.corners_m)
    else:
        corners = centre[:2] + half[:2] * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    low, high = (np.column_stack([corners, np.full(len(corners), centre[2] + s * half[2])]) for s in (-1.0, 1.0))
    rings = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in (low, high)]
    return np.concatenate([*rings, np.stack([low, high], axis=1)])


def along(points_m: Sequence[Place], step_m: float) -> FloatArray:
    """Points (n, 3) of a polyline, at most a step apart, and so few that a browser draws them."""
    line = np.array(points_m)
    if len(line) == 1:
        return line
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = int(np.clip(np.ceil(way_m[-1] / step_m) + 1, 2, _MOST_BALLS))
    at_m = np.linspace(0.0, way_m[-1], count)
    return np.stack([np.interp(at_m, way_m, line[:, axis]) for axis in range(3)], axis=1)


def handles(shape: Shape) -> dict[str, Place]:
    """Where a body can be taken: its centre, and what gives its size."""
    x, y, z = shape.centre_m
    if shape.form == "stroke":
        return {}
    if shape.form == "sphere":
        return {"centre": shape.centre_m, "radius": (x + shape.radius_m, y, z)}
    top = z + 0.5 * shape.size_m[2]
    if shape.form == "prism":
        corners = {f"corner_{i}": (cx, cy, z) for i, (cx, cy) in enumerate(shape.corners_m)}
        return {"centre": shape.centre_m, "top": (x, y, top), **corners}
    return {"centre": shape.centre_m, "size": (x + 0.5 * shape.size_m[0], y + 0.5 * shape.size_m[1], top)}


def pulled(shape: Shape, handle: str, to_world_m: FloatArray) -> Shape:
    """The body after one of its handles was moved; what is opposite to it stays where it is."""
    centre, size = np.array(shape.centre_m), np.array(shape.size_m)
    corners = np.array(shape.corners_m).reshape(-1, 2)
    radius_m = shape.radius_m
    if handle == "centre":
        corners = corners + (to_world_m - centre)[:2]
        centre = to_world_m
    elif handle == "radius":
        radius_m = max(float(to_world_m[0] - centre[0]), _SMALLEST_M)
    elif handle == "top":
        low = centre[2] - 0.5 * size[2]
        size[2] = max(to_world_m[2] - low, _SMALLEST_M)
        centre[2] = low + 0.5 * size[2]
    elif handle == "size":
        low = centre - 0.5 * size
        size = np.maximum(to_world_m - low, _SMALLEST_M)
        centre = low + 0.5 * size
    else:
        corners[int(handle.removeprefix("corner_"))] = to_world_m[:2]
    if shape.form == "prism" and len(corners):
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        centre = np.array([*middle, centre[2]])
    flat = [(round(float(x), 3), round(float(y), 3)) for x, y in corners]
    return Shape(shape.form, triple(centre), triple(size), round(radius_m, 3), flat)


def walls(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Sides of a prism as triangles."""
    n = len(shape.corners_m)
    corners, z, half = np.array(shape.corners_m), shape.centre_m[2], 0.5 * shape.size_m[2]
    vertices = np.concatenate([np.column_stack([corners, np.full(n, z + s * half)]) for s in (-1.0, 1.0)])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    return vertices.astype(np.float32), faces.astype(np.uint32)


def triple(values: FloatArray) -> Place:
    """A point as messages have it, to the millimetre."""
    x, y, z = (round(float(value), 3) for value in values)
    return (x, y, z)
