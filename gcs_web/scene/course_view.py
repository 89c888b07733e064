"""Gates and the tube of a mission in the 3D scene: arrays in, viser nodes out."""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray
from flight.mission import Gate

if TYPE_CHECKING:
    import viser

_FRAME = (196, 113, 240)
_TUBE = (90, 160, 220)
_OPENING_ALPHA, _TUBE_ALPHA = 0.18, 0.12
_SIDES = 12
"""Of the tube's cross-section."""
_ARROW_M = 0.4


def gate_lines(gate: Gate, centre_world_m: Sequence[float]) -> FloatArray:
    """(5, 2, 3) the four sides of the opening, and a line from its middle in the direction of the passage."""
    left, up = gate.edges_m
    corners = np.array(centre_world_m) + np.array([left + up, left - up, -left - up, up - left])
    ahead = np.cross(left, up)
    arrow = [centre_world_m, centre_world_m + _ARROW_M * ahead / np.linalg.norm(ahead)]
    return np.concatenate([np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), [arrow]])


def tube_mesh(line_world_m: FloatArray, radius_m: float) -> tuple[FloatArray, np.ndarray]:
    """Vertices (n, 3) and faces (f, 3) of a tube round a polyline (m, 3): a cylinder each line, a ball each point."""
    import trimesh

    parts = [
        trimesh.creation.cylinder(radius_m, segment=np.stack([a, b]), sections=_SIDES, cap=False)
        for a, b in pairwise(line_world_m)
        if np.linalg.norm(b - a) > 1e-6
    ]
    for point in line_world_m:
        ball = trimesh.creation.icosphere(subdivisions=1, radius=radius_m)
        parts.append(ball.apply_translation(point))
    first = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + n for part, n in zip(parts, first, strict=True)]
    return np.concatenate([part.vertices for part in parts]), np.concatenate(faces)


def draw_gate(server: "viser.ViserServer", gate: Gate, centre_world_m: Sequence[float]) -> list[Any]:
    """The frame of the opening that the vehicle's centre may pass, with its direction, and a pane in it."""
    lines = gate_lines(gate, centre_world_m)
    frame = server.scene.add_line_segments(
        f"/gate_{gate.waypoint}/frame",
        lines.astype(np.float32),
        np.full((len(lines), 2, 3), _FRAME, dtype=np.uint8),
        thickness=0.04,
        thickness_units="world",
    )
    pane = server.scene.add_mesh_simple(
        f"/gate_{gate.waypoint}/pane",
        lines[:4, 0].astype(np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32),
        color=_FRAME,
        opacity=_OPENING_ALPHA,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )
    return [frame, pane]


def draw_tube(server: "viser.ViserServer", line_world_m: FloatArray, radius_m: float) -> list[Any]:
    vertices, faces = tube_mesh(line_world_m, radius_m)
    tube = server.scene.add_mesh_simple(
        "/tube",
        vertices.astype(np.float32),
        faces.astype(np.uint32),
        color=_TUBE,
        opacity=_TUBE_ALPHA,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )
    return [tube]
