"""What the 3D view shows of the map beside its mesh: slice, cameras, points, edits with handles, measured points.

viser is given numbers and fixed names only, as in `view3d`.
"""

import logging
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import esdf
from esdf.visibility import Visibility
from flight import FlightError, FloatArray
from gcs_web.document.map_edits import MapEdit, shape_of
from gcs_web.map import bodies, display_points, slices
from gcs_web.map.bodies import Place
from gcs_web.map.mesh_view import MeshView
from gcs_web.protocol.map import Layer, MapAction, Shape, Slice
from gcs_web.scene import drawing
from gcs_web.scene.detail_view import DetailView
from mapping import Map
from mapping.dense.confidence import MeasuredSurface
from mapping.sparse import localization_map

if TYPE_CHECKING:
    import viser

logger = logging.getLogger(__name__)

_COLOURS: dict[MapAction, tuple[int, int, int]] = {
    "add": (240, 184, 73), "no-fly": (255, 122, 102), "clear": (121, 176, 255), "remove": (121, 176, 255),
}  # fmt: skip
_PREVIEW, _CAMERA, _MEASURED = (255, 255, 255), (139, 151, 162), (121, 176, 255)
_FREE_AXES = {"corner": (True, True, False), "top": (False, False, True), "radius": (True, False, False)}
"""Axes along which a handle can be moved, by the first word of its name."""
_FRUSTUM_M = 0.18
_POINT_M = 0.015
_TICK_M = 0.12
_MOST_TICKS = 8


class MapView:
    """Thread-safe."""

    def __init__(self, server: "viser.ViserServer", mesh: MeshView, cache: Path) -> None:
        """`cache`: folder for the points as they are shown."""
        self._server, self.mesh, self._cache = server, mesh, cache
        self._lock = threading.RLock()
        self._area: Map | None = None
        self._field: esdf.Field | None = None
        """Of a preview; None for the map's own."""
        self._hidden: Visibility | None = None
        self._inferred: slices.Marked | None = None
        self._surface: MeasuredSurface | None = None
        self._slice: Slice | None = None
        self._layers: frozenset[Layer] = frozenset({"mesh", "edits"})
        self._required_m = 0.0
        self._edits: tuple[MapEdit, ...] = ()
        self._drawn: list[Any] = []
        self._cameras: list[Any] = []
        self._ruler: list[Any] = []
        self._axes = server.scene.add_frame("/axes", axes_length=1.0, axes_radius=0.012, visible=False)
        self._points = DetailView(server, "/points", self._put_points, display_points.MOST_FINE_POINTS)
        self._points_lock, self._points_key = threading.Lock(), ""
        self._marks: list[Any] = []
        self._preview: list[Any] = []
        self._handles: dict[str, Any] = {}
        self._shape: Shape | None = None
        self._action: MapAction = "no-fly"
        self.measuring = False
        self.on_shape: Callable[[Shape, bool], None] = lambda _s, _e: None
        """A handle of the previewed body was moved: the body now, and whether the handle was let go."""
        self.on_measure: Callable[[Place], None] = lambda _: None
        """A place was clicked while measuring."""

    def close(self) -> None:
        self.mesh.close()
        self._points.close()

    def draw(self, area: Map) -> None:
        """Show another map, or the same with other edits."""
        with self._lock, self._server.atomic():
            self._area, self._hidden, self._inferred, self._surface, self._field = area, None, None, None, None
            _remove(self._cameras)
            self._draw_slice()
            self._draw_layers()
        self._draw_points()

    def show(self, wanted: Slice | None, layers: Sequence[Layer]) -> None:
        self.mesh.show("mesh" in layers, by_height="heights" in layers)
        with self._lock, self._server.atomic():
            self._slice, self._layers = wanted, frozenset(layers)
            self._axes.visible = "axes" in layers
            self._draw_slice()
            self._draw_layers()
        self._draw_points()

    @property
    def required_m(self) -> float:
        """What the document asks of a path."""
        return self._required_m

    def require_clearance(self, required_m: float) -> None:
        with self._lock:
            if required_m != self._required_m:
                self._required_m = required_m
                self._draw_slice()

    def draw_edits(self, edits: tuple[MapEdit, ...]) -> None:
        with self._lock, self._server.atomic():
            self._edits = edits
            self._draw_edits()

    def preview(self, action: MapAction, shape: Shape | None, field: esdf.Field | None) -> None:
        """Draw a body with handles, and the slice as it would be; a shape of None ends it."""
        with self._lock, self._server.atomic():
            if shape is None or self._shape is None or shape.form != self._shape.form:
                _remove(list(self._handles.values()))
                self._handles.clear()
            is_other_field = field is not self._field
            self._action, self._shape, self._field = action, shape, field
            self._draw_preview()
            self._draw_handles()
            if is_other_field:  # not at every place of a stroke: a slice takes tenths of a second
                self._draw_slice()

    def mark(self, points_world_m: Sequence[Place]) -> None:
        """Draw measured points, and the line between two."""
        with self._lock, self._server.atomic():
            _remove(self._marks)
            self._marks = [
                self._server.scene.add_icosphere(
                    f"/measured/{i}", radius=0.04, color=_MEASURED, position=point, cast_shadow=False
                )
                for i, point in enumerate(points_world_m)
            ]
            if len(points_world_m) == 2:
                self._marks.append(self._lines("/measured/line", np.array([points_world_m]), _MEASURED, 2.0))

    def click(self, origin_m: FloatArray, direction: FloatArray) -> None:
        """A click while measuring, by its ray: origin (3,) and unit direction, world."""
        hit = self.mesh.first_hit(origin_m, direction)
        place = self.pick(origin_m, direction, None if hit is None else hit[0])
        if place is not None:
            self.on_measure(place)

    def pick(self, origin_m: FloatArray, direction: FloatArray, hit_m: FloatArray | None) -> Place | None:
        """The point that a click means: on the slice, where it is nearer than the mesh; None where it meets neither.

        Args:
            origin_m: (3,) world, of the click's ray.
            direction: (3,) world, unit length.
            hit_m: (3,) where the ray meets the mesh.
        """
        with self._lock:
            area, wanted = self._area, self._slice
        near = None if hit_m is None else float(np.linalg.norm(hit_m - origin_m))
        if area is not None and wanted is not None:
            normal = slices.normal(wanted)
            if abs(direction @ normal) > 1e-6:
                along_m = float((wanted.at_m - origin_m @ normal) / (direction @ normal))
                point = origin_m + along_m * direction
                if along_m > 0.0 and (near is None or along_m < near) and area.field.grid.contains(point[None])[0]:
                    return bodies.triple(point)
        return None if hit_m is None else bodies.triple(hit_m)

    # --- slice and layers ---

    def picture(self, wanted: Slice) -> slices.Picture | None:
        """A slice as it is drawn now; None without a map."""
        with self._lock:
            return None if self._area is None else self._picture(self._area, wanted)

    def _picture(self, area: Map, wanted: Slice) -> slices.Picture:
        if wanted.of == "could_hide" and self._hidden is None:
            self._hidden = area.visibility()
        if wanted.of == "unknown" and self._inferred is None:
            self._inferred = area.inferred()
        if wanted.of == "surface_std" and self._surface is None:
            self._surface = area.surface()
        field = self._field or area.field
        return slices.draw(area, field, wanted, self._required_m, self._hidden, self._inferred, self._surface)

    def _draw_slice(self) -> None:
        area, wanted = self._area, self._slice
        if area is None or wanted is None:
            self._server.scene.remove_by_name("/slice")
            return
        picture = self._picture(area, wanted)
        self._server.scene.add_image(
            "/slice", picture.rgba, *picture.size_m, format="png", wxyz=tuple(picture.q_world_image),
            position=tuple(picture.centre_world_m), cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def _draw_layers(self) -> None:
        self._draw_edits()
        area = self._area
        if area is None:
            return
        if "cameras" not in self._layers:
            _remove(self._cameras)
        elif not self._cameras:
            self._cameras += self._make_cameras(area)
        _remove(self._ruler)
        if "axes" in self._layers:
            self._ruler += self._make_ruler(area)

    def _make_ruler(self, area: Map) -> list[Any]:
        """Metres along the mapped box's lower edges in x and y, so that lengths can be read in every view."""
        grid = area.field.grid
        low_m, size_m = np.asarray(grid.low_world_m), np.asarray(grid.shape) * grid.voxel_m
        segments, drawn = list[FloatArray](), list[Any]()
        for axis in range(2):
            step_m = _ruler_step_m(float(size_m[axis]))
            along, across = np.eye(3)[axis], np.eye(3)[1 - axis]
            ends_m = np.arange(0.0, size_m[axis] + 1e-6, step_m)
            segments.append(np.stack([low_m, low_m + ends_m[-1] * along]))
            for at_m in ends_m:
                mark = low_m + at_m * along
                segments.append(np.stack([mark, mark + _TICK_M * across]))
                if at_m > 0.0:
                    place = tuple(mark - _TICK_M * across)
                    name = f"/ruler/{axis}/{round(at_m)}"
                    drawn.append(self._server.scene.add_label(name, f"{at_m:g} m", position=place))
        return [self._lines("/ruler/lines", np.array(segments), _MEASURED, 2.0), *drawn]

    def _make_cameras(self, area: Map) -> list[Any]:
        segments = [
            _frustum(pose @ camera.T_body_camera, camera.width / camera.height)
            for pose in area.T_world_body
            for camera in area.rig.cameras
        ]
        return [self._lines("/cameras", np.concatenate(segments), _CAMERA, 1.0)] if segments else []

    def _draw_points(self) -> None:
        """Not while the scene waits: a large cloud takes a minute, the first time."""
        with self._points_lock:
            area, wanted = self._area, "points" in self._layers
            self._points.set_visible(wanted)
            if area is None or not wanted:
                return
            try:
                shown = display_points.load(localization_map.file(area.folder / "localization"), self._cache)
            except FlightError as error:
                logger.info("%s", error)  # a map without them
                shown = None
            key = "" if shown is None else shown.key
            if key != self._points_key:
                self._points.show(shown)
                self._points_key = key

    def _put_points(self, into: "viser.SceneApi", name: str, points_world_m: np.ndarray, fine: bool) -> Any:
        """Coloured by height, to show their shape."""
        assert self._area is not None
        grid = self._area.field.grid
        share = (points_world_m[:, 2] - grid.low_world_m[2]) / (grid.shape[2] * grid.voxel_m[2])
        size_m = _POINT_M if fine else 2.0 * _POINT_M
        colours = drawing.colours(share, "cividis")
        return into.add_point_cloud(name, points_world_m, colours, point_size=size_m, precision="float32")

    # --- edits ---

    def _draw_edits(self) -> None:
        _remove(self._drawn)
        if "edits" not in self._layers:
            return
        for edit in self._edits:
            shape, colour = shape_of(edit.edit().solid), _COLOURS[edit.action]
            if np.isfinite(shape.centre_m).all():
                self._drawn += self._body(f"/edits/{edit.id}", shape, colour, 0.18)

    def _draw_preview(self) -> None:
        _remove(self._preview)
        if self._shape is not None:
            self._preview = self._body("/preview", self._shape, _COLOURS[self._action], 0.35, edge=_PREVIEW)

    def _body(
        self, name: str, shape: Shape, colour: tuple[int, int, int], opacity: float, *, edge: Any = None
    ) -> list[Any]:
        drawn: list[Any] = [self._lines(f"{name}/edges", bodies.outline(shape), edge or colour, 1.5)]
        nodes, name = self._server.scene, f"{name}/body"
        style: dict[str, Any] = {"opacity": opacity, "cast_shadow": False}
        if shape.form == "stroke":
            import trimesh

            ball = trimesh.creation.icosphere(subdivisions=2, radius=shape.radius_m)
            places = bodies.along(shape.points_m, 0.5 * shape.radius_m)
            still = np.tile([1.0, 0.0, 0.0, 0.0], (len(places), 1))
            mesh = ball.vertices.astype(np.float32), ball.faces.astype(np.uint32)
            return [*drawn, nodes.add_batched_meshes_simple(name, *mesh, still, places, batched_colors=colour, **style)]
        if shape.form == "prism":
            walls = nodes.add_mesh_simple(name, *bodies.walls(shape), color=colour, side="double", **style)
            return [*drawn, walls]
        style |= {"color": colour, "position": shape.centre_m}
        if shape.form == "sphere":
            return [*drawn, nodes.add_icosphere(name, radius=shape.radius_m, **style)]
        return [*drawn, nodes.add_box(name, dimensions=shape.size_m, **style)]

    def _draw_handles(self) -> None:
        shape = self._shape
        if shape is None:
            return
        places = bodies.handles(shape)
        for gone in self._handles.keys() - places.keys():
            self._handles.pop(gone).remove()
        for name, place in places.items():
            if name not in self._handles:
                made = self._server.scene.add_transform_controls(
                    f"/handles/{name}",
                    scale=0.5 if name == "centre" else 0.3,
                    disable_rotations=True,
                    depth_test=False,
                    active_axes=_FREE_AXES.get(name.split("_")[0], (True, True, True)),
                    position=place,
                )
                made.on_update(lambda event, name=name: self._pulled(name, event))
                self._handles[name] = made
            else:
                self._handles[name].position = place

    def _pulled(self, name: str, event: Any) -> None:
        with self._lock, self._server.atomic():
            if self._shape is None or event.phase == "start":
                return
            shape = bodies.pulled(self._shape, name, np.array(event.target.position, dtype=np.float64))
            self._shape = shape
            self._draw_preview()
            for other, place in bodies.handles(shape).items():
                if other != name and other in self._handles:
                    self._handles[other].position = place
        self.on_shape(shape, event.phase == "end")

    def _lines(self, name: str, segments: FloatArray, colour: tuple[int, int, int], width_px: float) -> Any:
        return self._server.scene.add_line_segments(
            name, segments.astype(np.float32), colour, thickness=width_px, thickness_units="screen"
        )


def _ruler_step_m(length_m: float) -> float:
    """1, 2, 5, 10 ... m, so that there are few marks."""
    return next(
        step * 10.0**power
        for power in range(6)
        for step in (1.0, 2.0, 5.0)
        if length_m <= _MOST_TICKS * step * 10**power
    )


def _frustum(T_world_camera: FloatArray, aspect: float) -> FloatArray:
    """A camera's pyramid as line segments (8, 2, 3)."""
    x, y = 0.5 * aspect * _FRUSTUM_M, 0.5 * _FRUSTUM_M
    corners = np.array([[-x, -y, _FRUSTUM_M], [x, -y, _FRUSTUM_M], [x, y, _FRUSTUM_M], [-x, y, _FRUSTUM_M]])
    segments = np.concatenate(
        [np.stack([np.zeros((4, 3)), corners], axis=1), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)]
    )
    return segments @ T_world_camera[:3, :3].T + T_world_camera[:3, 3]


def _remove(drawn: list[Any]) -> None:
    for each in drawn:
        each.remove()
    drawn.clear()
