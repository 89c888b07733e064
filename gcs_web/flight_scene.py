"""Recorded flights in the 3D view: paths, and the vehicle as measured and as planned at the moment of the cursor."""

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray
from gcs_web import picking, scene
from gcs_web.recorded import Path3D

if TYPE_CHECKING:
    import viser

_COLOURS = ((242, 245, 247), (121, 176, 255), (240, 184, 73), (154, 216, 90))
"""Of the paths, in the order they were opened."""
_MARK, _MARK_M = np.array((196, 113, 240)), 0.12
"""Colour and thickness of marked stretches: the colour of residuals, thicker than the path."""


class FlightScene:
    """Thread-safe. Draws nothing until a flight is shown."""

    def __init__(self, server: "viser.ViserServer") -> None:
        self._server = server
        self._lock = threading.RLock()
        self._paths: dict[str, Path3D] = {}
        self._drawn: list[Any] = []
        self._vehicles: list[Any] = []
        self._planned: Any = None
        self._stretches: Sequence[tuple[str, float, float]] = ()
        self._marks: list[Any] = []
        self.on_moment: Callable[[float], None] = lambda _: None
        """A path was clicked; the flight's time there, s."""
        server.scene.on_click()(self._clicked)

    def draw(self, paths: Mapping[str, Path3D], values: Mapping[str, tuple[FloatArray, FloatArray]]) -> None:
        """Draw these flights and no others.

        Args:
            values: by flight, times and signed values by which its path is coloured, blue - grey - orange over the
                same symmetric range for all; NaN where nothing is known. Where nothing is, and others, are plain.
        """
        with self._lock, self._server.atomic():
            for node in (*self._drawn, *self._vehicles):
                node.remove()
            self._paths, self._drawn, self._vehicles = dict(paths), [], []
            reach = _reach(values)
            for i, (name, path) in enumerate(paths.items()):
                colours = np.tile(np.array(_COLOURS[i % len(_COLOURS)], dtype=np.uint8), (len(path.time_s), 1))
                if name in values:
                    shown = np.interp(path.time_s, *values[name], left=np.nan, right=np.nan)
                    known = np.isfinite(shown)
                    colours[known] = scene.signed_colours(shown[known] / reach)
                self._drawn.append(scene.draw_path(self._server, path.position_world_m, colours, name=f"/flown_{i}"))
                self._vehicles.append(scene.draw_vehicle(self._server, f"/flown_vehicle_{i}", opacity=1.0))
            if self._planned is None and paths:
                self._planned = scene.draw_vehicle(self._server, "/flown_planned", opacity=0.4)
            if self._planned is not None:
                self._planned.visible = False
            self._draw_marks()

    def mark(self, stretches: Sequence[tuple[str, float, float]]) -> None:
        """Mark parts of the paths that are drawn: flight, from and to on its shifted time, s."""
        with self._lock, self._server.atomic():
            self._stretches = tuple(stretches)
            self._draw_marks()

    def _draw_marks(self) -> None:
        for node in self._marks:
            node.remove()
        self._marks = []
        for i, (name, path) in enumerate(self._paths.items()):
            spans = [(from_s, to_s) for flight, from_s, to_s in self._stretches if flight == name]
            pieces = _pieces(path, spans)
            if len(pieces):
                self._marks.append(
                    scene.draw_pieces(self._server, pieces, _MARK, name=f"/moments_{i}", thickness_m=_MARK_M)
                )

    def look(self, time_s: float | None) -> None:
        """Draw the vehicles where they were, and that of the first flight where it should have been."""
        with self._lock, self._server.atomic():
            for vehicle, path in zip(self._vehicles, self._paths.values(), strict=True):
                _place(vehicle, path.time_s, path.position_world_m, path.q_world_body, time_s)
            first = next(iter(self._paths.values()), None)
            if self._planned is not None and first is not None:
                _place(self._planned, first.time_s, first.planned_world_m, first.planned_q_world_body, time_s)

    def _clicked(self, event: "viser.SceneClickEvent") -> None:
        with self._lock:
            paths = list(self._paths.values())
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        for path in paths:
            k = picking.nearest_on_path(origin, direction, path.position_world_m)
            if k is not None:
                self.on_moment(float(path.time_s[k]))
                return


def _pieces(path: Path3D, spans_s: Sequence[tuple[float, float]]) -> FloatArray:
    """(k, 2, 3) both ends of every piece of a path that lies within one of the spans in part."""
    begins, ends = path.time_s[:-1], path.time_s[1:]
    inside = np.zeros(len(begins), dtype=bool)
    for from_s, to_s in spans_s:
        inside |= (ends > from_s) & (begins < to_s)
    pieces = np.stack([path.position_world_m[:-1], path.position_world_m[1:]], axis=1)[inside]
    return pieces[np.isfinite(pieces).all(axis=(1, 2))]


def _place(
    vehicle: Any, when: FloatArray, position: FloatArray | None, q: FloatArray | None, time_s: float | None
) -> None:
    if time_s is None or position is None:
        vehicle.visible = False
        return
    k = int(np.clip(np.searchsorted(when, time_s), 0, len(when) - 1))
    known = bool(np.isfinite(position[k]).all())
    if known:
        vehicle.position = tuple(position[k])
        if q is not None and np.isfinite(q[k]).all():
            vehicle.wxyz = tuple(q[k])
    vehicle.visible = known


def _reach(values: Mapping[str, tuple[FloatArray, FloatArray]]) -> float:
    """Half the range of the scale: the largest value but for the last hundredth, the same for all flights."""
    every: Sequence[FloatArray] = [np.abs(value) for _, value in values.values()]
    return max(float(np.nanquantile(np.concatenate(every), 0.99)) if every else 0.0, 1e-12)
