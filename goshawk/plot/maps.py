"""A distance field: slices, what lies behind a path seen from above, how much volume is how far from a surface."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from esdf import Field, pictures
from esdf.field import KNOWN, OUTSIDE, UNMAPPED, SampledField
from flight import FloatArray
from planner.request.space import DistanceField
from sysid.report import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

_MOST_PIXELS = 700
"""Along either side of what lies behind a path."""
_LINES_M = 0.5
"""Between two contour lines of a slice."""


def map_slice(
    field: SampledField, at_m: float, axis: pictures.Axis = "z", *, style: drawing.Style = "light"
) -> "Figure":
    """The distance to the nearest surface where one world coordinate is `at_m`; grey is unknown.

    Raises:
        InputError: the plane misses the map, or there is no such style.
    """
    return slices({f"{axis} = {at_m:g} m": pictures.axis_slice(field, axis, at_m)}, style=style)


def slices(shown: Mapping[str, pictures.Slice], *, style: drawing.Style = "light") -> "Figure":
    """Slices of fields side by side in the same colours, each under its title; from red to orange is the surface."""
    full = max(map(_farthest, shown.values()))
    deepest = min(float(np.nanmin(_known(p), initial=0.0)) for p in shown.values())
    tallest = max(p.distance_m.shape[0] / p.distance_m.shape[1] for p in shown.values())
    wide = 8.0 if len(shown) == 1 else 6.0  # a page shows a wide figure smaller, and its words with it
    with drawing.styled(style):
        figure, axes = drawing.figure(
            1, len(shown), (wide * len(shown), wide * float(np.clip(0.82 * tallest, 0.2, 0.9)) + 0.8)
        )
        for panel, (title, picture) in zip(axes[0], shown.items(), strict=True):
            draw_slice(panel, picture, full)
            drawing.plain(panel, title, _label(picture.right_world_m), _label(picture.up_world_m))
            panel.grid(False)
        grey = "; grey: unknown" if any((p.status == UNMAPPED).any() for p in shown.values()) else ""
        label = f"distance to the nearest surface (m){grey}"
        figure.colorbar(_scale(deepest, full), ax=axes[0].tolist(), label=label, fraction=0.04)
    return figure


def draw_slice(panel: "Axes", picture: pictures.Slice, full: float | None = None) -> None:
    """A slice in its colours, with contour lines, on axes that are there; `full` is the distance of the last colour."""
    full, known = full or _farthest(picture), _known(picture)
    rgba = np.full((*picture.distance_m.shape, 4), 255, dtype=np.uint8)
    rgba[..., :3] = pictures.colours(picture.distance_m, full_m=full)
    rgba[picture.status == UNMAPPED, :3] = 128
    rgba[picture.status == OUTSIDE, 3] = 0
    panel.imshow(rgba, origin="lower", extent=picture.extent_m, interpolation="nearest")
    if full > _LINES_M and np.isfinite(known).sum() > 3 and min(picture.distance_m.shape) > 1:
        levels = np.arange(_LINES_M, full, _LINES_M)
        how: dict[str, Any] = {"extent": picture.extent_m, "origin": "lower", "colors": drawing.CELL_INK}
        lines = panel.contour(known, levels=levels, linewidths=0.5, **how)
        panel.clabel(lines, fmt="%g m", fontsize=7)


def _known(picture: pictures.Slice) -> FloatArray:
    """Its distances, NaN also where the map counts unknown space as an obstacle."""
    return np.where(picture.status == UNMAPPED, np.nan, picture.distance_m)


def _farthest(picture: pictures.Slice) -> float:
    return float(np.nanmax(np.abs(_known(picture)), initial=1e-3))


def _scale(deepest: float, full: float) -> "ScalarMappable":
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    steps = pictures.colours(np.linspace(deepest, full, 256), full_m=full) / 255.0
    return ScalarMappable(Normalize(deepest, full), ListedColormap(steps.tolist()))


def _label(step_world_m: FloatArray) -> str:
    """Label of a picture's axis: the world coordinate, if it runs along one."""
    along = np.flatnonzero(step_world_m)
    return f"{'xyz'[along[0]]} (m)" if len(along) == 1 and step_world_m[along[0]] > 0.0 else "m"


def distances(field: Field, *, style: drawing.Style = "light") -> "Figure":
    """How much of the known map is how far from the nearest surface.

    Raises:
        InputError: nothing in the map is known.
    """
    edges_m, volume_m3 = pictures.histogram(field)
    with drawing.styled(style) as look:
        figure, axes = drawing.figure(1, 1, (7.0, 4.0))
        panel = axes[0, 0]
        panel.stairs(volume_m3, edges_m, fill=True, color=look.colours[1])
        panel.set_yscale("log")
        drawing.plain(panel, "", "signed distance to the nearest surface (m)", "volume (m³)")
    return figure


def behind(panel: "Axes", field: DistanceField, low_m: FloatArray, high_m: FloatArray, z_m: float) -> None:
    """Obstacles and unknown space at one height, from above, behind what is drawn on `panel`; free space is paper.

    Args:
        low_m, high_m: (2,) corners in x and y.
    """
    look = drawing.look()
    step = float((high_m - low_m).max()) / _MOST_PIXELS
    x, y = (np.arange(low + 0.5 * step, high, step) for low, high in zip(low_m, high_m, strict=True))
    points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), z_m)], axis=-1).reshape(-1, 3)
    distance_m = np.asarray(field.distance(points)).reshape(len(y), len(x))
    from matplotlib.colors import to_rgba

    cells = np.zeros((len(y), len(x), 4))
    status = getattr(field, "status", None)  # a formula knows all of space
    unknown = np.isnan(distance_m) if status is None else (status(points) != KNOWN).reshape(distance_m.shape)
    cells[distance_m < 0.0] = to_rgba(look.ink, 0.55)
    cells[unknown] = to_rgba(look.pale, 0.6)
    extent = (x[0] - 0.5 * step, x[-1] + 0.5 * step, y[0] - 0.5 * step, y[-1] + 0.5 * step)
    panel.imshow(cells, origin="lower", extent=extent, interpolation="nearest", zorder=0)
