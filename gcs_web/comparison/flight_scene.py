"""Recorded flights in the 3D view: paths, and the vehicle as measured, planned and predicted at the cursor's moment."""

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray
from gcs_web.comparison import arrows, predicted
from gcs_web.comparison.arrows import Wrench
from gcs_web.flights.recorded import Path3D
from gcs_web.protocol.comparison import ArrowScale
from gcs_web.scene import drawing, picking
from sysid.estimator.validation.comparison import Deviation

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
        self._moved_s: dict[str, float] = {}
        self._wrenches: dict[str, Wrench] = {}
        self._arrows: dict[str, Any] = {}
        self._scale: ArrowScale | None = None
        self._drawn: list[Any] = []
        self._vehicles: list[Any] = []
        self._planned: Any = None
        self._predicted: Any = None
        self._deviations: dict[str, Deviation] = {}
        self._stretches: Sequence[tuple[str, float, float]] = ()
        self._marks: list[Any] = []
        self.on_moment: Callable[[float], None] = lambda _: None
        """A path was clicked; the time there as moved, s."""
        server.scene.on_click()(self._clicked)

    def draw(
        self,
        paths: Mapping[str, Path3D],
        values: Mapping[str, tuple[FloatArray, FloatArray]],
        moved_s: Mapping[str, float],
        wrenches: Mapping[str, Wrench],
        deviations: Mapping[str, Deviation],
    ) -> tuple[ArrowScale | None, float | None]:
        """Draw these flights and no others.

        Args:
            values: by flight, times and signed values by which its path is coloured, blue - grey - orange over the
                same symmetric range for all; NaN where nothing is known. Where nothing is, and others, are plain.
            moved_s: by flight, what is added to its time to stand beside the others; those without stay.
            wrenches: by flight, the residual that is drawn as arrows at its vehicle; those without have none.
            deviations: by flight, on its shifted time and NaN in each gap, where its vehicle is predicted; only the
                first flight's is drawn.

        Returns:
            The scale of the arrows, and the value at the upper end of the colours; None where nothing is known.
        """
        with self._lock, self._server.atomic():
            for node in (*self._drawn, *self._vehicles, *self._arrows.values()):
                node.remove()
            self._paths, self._drawn, self._vehicles = dict(paths), [], []
            self._moved_s, self._wrenches, self._deviations = dict(moved_s), dict(wrenches), dict(deviations)
            self._scale = arrows.scale(wrenches.values())
            self._arrows = {
                name: drawing.draw_arrows(self._server, f"/flown_arrows_{i}") for i, name in enumerate(wrenches)
            }
            reach = _reach(values)
            for i, (name, path) in enumerate(paths.items()):
                colours = np.tile(np.array(_COLOURS[i % len(_COLOURS)], dtype=np.uint8), (len(path.time_s), 1))
                if name in values and reach is not None:
                    shown = np.interp(path.time_s, *values[name], left=np.nan, right=np.nan)
                    known = np.isfinite(shown)
                    colours[known] = drawing.signed_colours(shown[known] / reach)
                self._drawn.append(drawing.draw_path(self._server, path.position_world_m, colours, name=f"/flown_{i}"))
                self._vehicles.append(
                    drawing.draw_vehicle(self._server, f"/flown_vehicle_{i}", opacity=1.0, axes=False)
                )
            if self._planned is None and paths:
                self._planned = drawing.draw_vehicle(self._server, "/flown_planned", opacity=0.4, axes=False)
                self._predicted = drawing.draw_predicted(self._server, "/flown_predicted")
            for node in (self._planned, self._predicted) if self._planned is not None else ():
                node.visible = False
            self._draw_marks()
            return self._scale, reach

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
                    drawing.draw_pieces(self._server, pieces, _MARK, name=f"/moments_{i}", thickness_m=_MARK_M)
                )

    def look(self, time_s: float | None) -> None:
        """Draw the vehicles where they were, with their arrows; the first also where planned and where predicted."""
        with self._lock, self._server.atomic():
            for i, (vehicle, (name, path)) in enumerate(zip(self._vehicles, self._paths.items(), strict=True)):
                at_s = None if time_s is None else time_s - self._moved_s.get(name, 0.0)
                _place(vehicle, path.time_s, path.position_world_m, path.q_world_body, at_s)
                if name in self._arrows:
                    self._point(self._arrows[name], path, self._wrenches[name], at_s)
                if i == 0 and self._planned is not None:
                    _place(self._planned, path.time_s, path.planned_world_m, path.planned_q_world_body, at_s)
                    self._predict(path, self._deviations.get(name), at_s)

    def _predict(self, path: Path3D, deviation: Deviation | None, time_s: float | None) -> None:
        """Draw the vehicle where the model predicts it; not where the comparison has no prediction."""
        self._predicted.visible = False
        if time_s is None or deviation is None or path.q_world_body is None:
            return
        k = _row(path.time_s, time_s)
        pose = predicted.at(deviation, time_s, path.position_world_m[k], path.q_world_body[k])
        if pose is not None:
            self._predicted.position, self._predicted.wxyz = tuple(pose[0]), tuple(pose[1])
            self._predicted.visible = True

    def _point(self, node: Any, path: Path3D, wrench: Wrench, time_s: float | None) -> None:
        """Draw a flight's arrows as they are at a moment, from its vehicle; none in a gap."""
        node.visible = False
        if time_s is None or self._scale is None or path.q_world_body is None:
            return
        k = _row(path.time_s, time_s)
        lengths_m = arrows.at(wrench, time_s, path.q_world_body[k], self._scale)
        if lengths_m is not None:
            begin_m = np.broadcast_to(path.position_world_m[k], (2, 3))
            node.points = np.stack([begin_m, begin_m + lengths_m], axis=1).astype(np.float32)
            node.visible = True

    def _clicked(self, event: "viser.SceneClickEvent") -> None:
        with self._lock:
            paths = [(path, self._moved_s.get(name, 0.0)) for name, path in self._paths.items()]
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        for path, by_s in paths:
            k = picking.nearest_on_path(origin, direction, path.position_world_m)
            if k is not None:
                self.on_moment(float(path.time_s[k] + by_s))
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
    k = _row(when, time_s)
    known = bool(np.isfinite(position[k]).all())
    if known:
        vehicle.position = tuple(position[k])
        if q is not None and np.isfinite(q[k]).all():
            vehicle.wxyz = tuple(q[k])
    vehicle.visible = known


def _row(when: FloatArray, time_s: float) -> int:
    return int(np.clip(np.searchsorted(when, time_s), 0, len(when) - 1))


def _reach(values: Mapping[str, tuple[FloatArray, FloatArray]]) -> float | None:
    """Half the range of the scale: the largest value but for the last hundredth, the same for all flights."""
    every = np.abs(np.concatenate([np.zeros(0), *(value for _, value in values.values())]))
    known = every[np.isfinite(every)]
    return max(float(np.quantile(known, 0.99)), 1e-12) if len(known) else None
