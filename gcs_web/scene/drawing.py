"""The 3D scene (path, waypoints, vehicle): arrays in, viser nodes out."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray
from flight.rotations import IDENTITY
from gcs_web.protocol.plan import Series

if TYPE_CHECKING:
    import viser

PLENTY_ABOVE_M = 0.7
"""Clearance this far above the limit has the colour of plenty."""

DARKEST = 0.45
"""Where on viridis and cividis the scales begin: what is darker is lost before the background, 3 to 1 being wanted."""

SURFACE_STD_SPAN_M = 0.05
"""Standard deviation at the upper end of its scale, a voxel; the page's legend has the same."""
COULD_HIDE_SPAN_M = 0.10
"""Thickness at the upper end of the scale of what could hide; the page's legend has the same."""

ARROWS = ((196, 113, 240), (40, 190, 175))
"""Colours of the arrows of residual force and residual torque; the page's legend has the same."""

PREDICTED = (154, 216, 90)
"""Colour of the vehicle as the model predicts it: that of the model's curves."""

_MARK = (196, 113, 240)
_ROTOR_M = 0.075
_HUBS_M = ((0.105, 0.105, 0.02), (-0.105, 0.105, 0.02), (-0.105, -0.105, 0.02), (0.105, -0.105, 0.02))
"""Radius of a drawn rotor, and where the rotors are in body axes."""


def colours(share: FloatArray, scale: str) -> np.ndarray:
    """Colours of a share between the dark and the bright end of a scale: (n, 3) uint8."""
    from matplotlib import colormaps

    place = DARKEST + (1.0 - DARKEST) * np.clip(np.nan_to_num(share, nan=0.0), 0.0, 1.0)
    return (255 * colormaps[scale](place)[..., :3]).astype(np.uint8)


def clearance_colours(clearance_m: FloatArray, required_m: float) -> np.ndarray:
    """Yellow at the required clearance, below it and where it is unknown; blue-green where there is plenty."""
    share = (np.asarray(clearance_m) - required_m) / PLENTY_ABOVE_M
    return colours(1.0 - np.nan_to_num(share, nan=0.0), "viridis")


def signed_colours(share: FloatArray) -> np.ndarray:
    """Blue below zero, grey at it, orange above, from -1 to 1: (n, 3) uint8."""
    ends = np.array([[58, 134, 255], [148, 155, 163], [255, 150, 30]], dtype=np.float64)
    place = np.clip(np.nan_to_num(share), -1.0, 1.0)
    return np.stack([np.interp(place, [-1.0, 0.0, 1.0], ends[:, i]) for i in range(3)], axis=1).astype(np.uint8)


def series_colours(series: Series, what: str, required_m: float) -> np.ndarray:
    """Colours of a path by one of its figures, from the smallest to the largest: (n, 3) uint8."""
    if what == "clearance":
        return clearance_colours(np.array(series.clearance_m), required_m)
    if what == "could_hide":  # where nothing is known, as where no image looked
        thickness_m = 1e-3 * np.array(series.could_hide_mm or [1e3 * COULD_HIDE_SPAN_M] * len(series.time_s))
        return colours(thickness_m / COULD_HIDE_SPAN_M, "cividis")
    values = {
        "speed": series.speed_m_s,
        "thrust": series.thrust_n,
        "tilt": series.tilt_deg,
        "rotor_margin": series.rotor_margin_percent,
    }[what]
    low, high = min(values), max(values)
    return colours((np.array(values) - low) / max(high - low, 1e-9), "cividis")


def draw_path(
    server: "viser.ViserServer",
    positions_world_m: FloatArray,
    colours: np.ndarray,
    *,
    name: str = "/path",
    thickness_m: float = 0.06,
) -> Any:
    """A thick line through (m, 3) positions, coloured at each."""
    pieces = np.stack([positions_world_m[:-1], positions_world_m[1:]], axis=1)
    return draw_pieces(
        server, pieces, np.stack([colours[:-1], colours[1:]], axis=1), name=name, thickness_m=thickness_m
    )


def draw_pieces(
    server: "viser.ViserServer | viser.ClientHandle",
    pieces_world_m: FloatArray,
    colours: np.ndarray,
    *,
    name: str,
    thickness_m: float = 0.0,
    thickness_px: float = 0.0,
) -> Any:
    """Thick pieces of a line, (k, 2, 3): both ends of each, with the colour at each or one for all.

    As thick in the world, or on the screen, whichever is given.
    """
    # viser takes a line's colours for linear light, and brightens them on the screen by the inverse of this.
    linear = np.round(255.0 * (colours / 255.0) ** 2.2).astype(np.uint8)
    shown = np.broadcast_to(linear, pieces_world_m.shape)
    return server.scene.add_line_segments(
        name,
        pieces_world_m,
        shown,
        thickness=thickness_px or thickness_m,
        thickness_units="screen" if thickness_px else "world",
    )


def draw_marks(
    server: "viser.ViserServer",
    grounds_world_m: Sequence[tuple[float, float, float]],
    target_world_m: tuple[float, float, float] | None,
) -> list[Any]:
    """A flat disc where the vehicle stands on the ground, a small icosahedron where it looks; None: nowhere."""
    marks: list[Any] = [
        server.scene.add_cylinder(
            f"/ground_{i}", radius=0.2, height=0.01, color=_MARK, position=position, cast_shadow=False
        )
        for i, position in enumerate(grounds_world_m)
    ]
    if target_world_m is not None:
        target = server.scene.add_icosphere(
            "/target", radius=0.08, subdivisions=0, color=_MARK, position=target_world_m, cast_shadow=False
        )
        marks.append(target)
    return marks


def draw_arrows(server: "viser.ViserServer", name: str) -> Any:
    """A residual force and a residual torque, hidden; set `.points`, (2, 2, 3) both ends of each, and `.visible`."""
    points = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]] * 2, dtype=np.float32)
    return server.scene.add_arrows(
        name,
        points,
        np.array(ARROWS, dtype=np.uint8),
        shaft_radius=0.018,
        head_radius=0.045,
        head_length=0.09,
        visible=False,
    )


def draw_vehicle(server: "viser.ViserServer", name: str, *, opacity: float, axes: bool = True) -> Any:
    """A vehicle, hidden, below the node `name`; set `.position`, `.wxyz` and `.visible` of what is returned."""
    frame = server.scene.add_frame(
        name, show_axes=axes, axes_length=0.35, axes_radius=0.015, wxyz=IDENTITY, visible=False
    )
    server.scene.add_box(f"{name}/body", color=(30, 30, 34), dimensions=(0.14, 0.06, 0.04), cast_shadow=False)
    for i, hub in enumerate(_HUBS_M):
        colour = (203, 75, 22) if hub[0] > 0.0 else (60, 60, 66)
        server.scene.add_cylinder(
            f"{name}/rotor_{i}",
            radius=_ROTOR_M,
            height=0.012,
            color=colour,
            position=hub,
            opacity=0.8 * opacity,
            cast_shadow=False,
        )
    return frame


def draw_predicted(server: "viser.ViserServer", name: str) -> Any:
    """The outline of a vehicle with an arrow along body x, hidden; set as that of `draw_vehicle`."""
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    ring = _ROTOR_M * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    tip, barb = (0.3, 0.0, 0.02), 0.06
    lines = [
        *(hub + ring for hub in np.array(_HUBS_M)),
        *(np.array([a, b]) for a, b in ((_HUBS_M[0], _HUBS_M[2]), (_HUBS_M[1], _HUBS_M[3]), ((0.0, 0.0, 0.02), tip))),
        np.array([(tip[0] - barb, barb, tip[2]), tip, (tip[0] - barb, -barb, tip[2])]),
    ]
    pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
    outline = draw_pieces(server, pieces, np.array(PREDICTED), name=name, thickness_m=0.014)
    outline.visible = False
    return outline
