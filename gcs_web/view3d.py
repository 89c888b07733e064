"""The 3D view: map, path, waypoints and vehicle, drawn by viser. Clicks and drags are callbacks.

viser is given numbers and fixed names only: no text of a user's, a log's or a vehicle's reaches it.
"""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray, Progress, silent
from gcs_web.comparison.flight_scene import FlightScene
from gcs_web.document import missions
from gcs_web.document.document import Content, Point, Settings
from gcs_web.map.map_view import MapView
from gcs_web.map.mesh_view import MeshView
from gcs_web.protocol.plan import Draft, Preflight, Series
from gcs_web.protocol.view import Colour
from gcs_web.scene import course_view, drawing, picking
from gcs_web.scene.flights_view import FlightsView
from gcs_web.vehicle.vehicle_view import VehicleView
from mapping import Map

if TYPE_CHECKING:
    import viser

_BALL_M = 0.05
_THICK_M, _THIN_M = 0.06, 0.02
"""The path, and among the preflight's flights, which would be inside it."""
_STAND_OFF_M = 0.2
"""Beyond the required clearance, for a waypoint that is placed by a click."""
_PLAIN_LIGHT = 1.0
"""From all sides alike, which costs nothing, in place of the environment."""
_MOST_VIEWS = 64
"""That are remembered; those that asked or moved long ago go first."""
_SAME_SCALE = 0.01
"""Change of a view's height that is told."""
_WHITE, _SELECTED, _GREY, _CAUTION = (233, 237, 240), (121, 176, 255), (120, 120, 120), (240, 184, 73)
_GRID = (60, 70, 78), (100, 110, 118)
"""Lines a metre and five apart, where there is no map."""


class View3D:
    """Thread-safe."""

    def __init__(
        self, server: "viser.ViserServer", *, triangles: int, cache: Path, progress: Progress = silent
    ) -> None:
        """
        Args:
            triangles: of the mesh as it is shown first.
            cache: folder for what is shown of the map.
            progress: of drawing the first map.
        """
        self._server = server
        self._lock = threading.RLock()
        self._points: tuple[Point, ...] = ()
        self._balls: dict[int, Any] = {}
        self._marks: list[Any] = []
        self._course: list[Any] = []
        self._course_shown = ""
        self._selected: tuple[int, ...] = ()
        self._handle: Any = None
        self._series: Series | None = None
        self._required_m = 0.0
        self._colour: Colour = "clearance"
        self._path: Any = None
        self._flights, self._flights_shown = FlightsView(server), True
        self._flights_found = Preflight("none")
        self.map = MapView(server, MeshView(server, triangles, cache, progress), cache)
        self.map.mesh.plain_of = lambda client: self.plain_views.get(self._view_of(client))
        self._has_map = False
        self.is_plain = False
        """Whether shadows and light from all sides are left out."""
        self.plain_views: dict[str, int] = {}
        """By name of a page's 3D view: triangles of the mesh there, where it draws slowly."""
        self._grid = server.scene.add_grid(
            "/grid",
            20.0,
            20.0,
            cell_size=1.0,
            section_size=5.0,
            cell_color=_GRID[0],
            section_color=_GRID[1],
            visible=False,
        )
        self._look_at(np.array([-5.0, -5.0, 0.0]), np.array([5.0, 5.0, 2.0]))
        self._checked = False
        self._dragged_points: dict[int | None, int] = {}
        """By browser (viser's id): the waypoint that is dragged there."""
        self._draft: Any = None
        self._recorded: Any = None
        self._heights_m: dict[str, float] = {}
        self.on_select: Callable[[int], None] = lambda _: None
        """A waypoint was clicked; its id."""
        self.on_drag: Callable[[int, FloatArray], None] = lambda _i, _p: None
        """A waypoint was let go at (3,) world."""
        self.on_pull: Callable[[int, FloatArray], None] = lambda _i, _p: None
        """A waypoint is held at (3,) world."""
        self.on_draft: Callable[[Draft], None] = lambda _: None
        """A draft is drawn now, or none any more; called in the order in which that happens."""
        self.on_moment: Callable[[float], None] = lambda _: None
        """The path was clicked; the plan's time there, s."""
        self.on_add: Callable[[int | None, FloatArray], None] = lambda _i, _p: None
        """The map was shift-clicked: the waypoint to insert after (None: there is none), and where, (3,) world."""
        self.on_box: Callable[[list[int]], None] = lambda _: None
        """A rectangle was drawn round these waypoints (ids)."""
        self.on_scales: Callable[[dict[str, float]], None] = lambda _: None
        """Heights of the world in pages' 3D views at the points looked at, m, by the views' names; one has changed."""
        server.scene.on_click()(self._clicked)
        server.scene.on_rect_select(modifier="cmd/ctrl")(self._boxed)
        server.scene.on_click(modifier="shift")(self._shift_clicked)
        server.on_client_connect(self._browser_came)
        server.on_client_disconnect(self._browser_left)
        server.gui.configure_theme(dark_mode=True, show_share_button=False, show_logo=False, control_layout="floating")
        server.scene.set_up_direction("+z")
        self.flights = FlightScene(server)
        self._set_aside = False
        self._ghost = drawing.draw_vehicle(server, "/planned", opacity=0.55)
        self.vehicle = VehicleView(server)

    def draw_map(self, area: Map) -> None:
        """Show a map, and look at it if it is the first one."""
        with self._lock:
            self.map.mesh.draw(area.mesh)
            if not self._has_map:
                grid = area.field.grid
                low = np.asarray(grid.origin_world_m)
                self._look_at(low, low + np.asarray(grid.shape) * np.broadcast_to(grid.voxel_m, (3,)))
            self._has_map, self._grid.visible = True, False
        self.map.draw(area)

    def draw_no_map(self) -> None:
        """Show a grid of metres at the height zero of the world frame, as long as there was no map."""
        with self._lock:
            self._grid.visible = not self._has_map

    def draw_plainly(self, view: str, triangles: int) -> None:
        """For a browser without a graphics card, which stalls on more.

        Shadows and light from all sides are left out for everybody, triangles of the mesh in this one view.
        """
        with self._lock, self._server.atomic():
            if not self.is_plain:
                self.is_plain = True
                self._server.scene.configure_environment_map(None)
                self._server.scene.configure_default_lights(cast_shadow=False)
                self._server.scene.add_light_ambient("/plain_light", intensity=_PLAIN_LIGHT)  # else walls are black
            self.plain_views.pop(view, None)
            self.plain_views[view] = triangles
            while len(self.plain_views) > _MOST_VIEWS:
                del self.plain_views[next(iter(self.plain_views))]
        self.map.mesh.simplify([client.client_id for client in self.vehicle.browsers_of(view)], triangles)

    def close(self) -> None:
        self.map.close()

    def _boxed(self, event: "viser.SceneRectSelectEvent") -> None:
        with self._lock:
            points, camera = self._points, event.client.camera
        if self._set_aside or not points:
            return
        places = picking.on_screen(
            np.array([p.position_world_m for p in points]),
            np.array(camera.position), np.array(camera.wxyz), camera.fov, camera.aspect,
        )  # fmt: skip
        inside = picking.in_rectangle(places, event.screen_min, event.screen_max)
        self.on_box([points[k].id for k in np.flatnonzero(inside)])

    def draw_recorded(self, line_world_m: FloatArray | None) -> None:
        """Draw (m, 3) straight lines along a recorded path, before they are taken for waypoints; None: no more."""
        with self._lock, self._server.atomic():
            if self._recorded is not None:
                self._recorded.remove()
                self._recorded = None
            if line_world_m is not None and len(line_world_m) > 1:
                colours = np.full((len(line_world_m), 3), _SELECTED, dtype=np.uint8)
                self._recorded = drawing.draw_path(
                    self._server, line_world_m, colours, name="/recorded", thickness_m=0.03
                )

    def draw_waypoints(self, points: tuple[Point, ...]) -> None:
        with self._lock, self._server.atomic():
            self._points = points
            wanted = {p.id: p for p in points}
            for gone in self._balls.keys() - wanted.keys():
                self._balls.pop(gone).remove()
            for point in points:
                self._ball(point).position = point.position_world_m
            self._draw_handle()

    def draw_mission(self, chosen: Settings) -> None:
        """Mark where take-off and landing are, and the point that is looked at."""
        with self._lock, self._server.atomic():
            for mark in self._marks:
                mark.remove()
            grounds = [ground.position_world_m for ground in (chosen.take_off, chosen.landing) if ground is not None]
            target = chosen.look_at_world_m if chosen.yaw == "look_at" else None
            self._marks = drawing.draw_marks(self._server, grounds, target)

    def draw_course(self, content: Content) -> None:
        """Show the gates, and the tube that the path keeps in; unless they are as they were."""
        gates = missions.mission_of(content).gates
        centres = [content.points[gate.waypoint].position_world_m for gate in gates]
        tube = content.settings.keep_in
        line = None if tube is None else missions.tube_line(content)
        shown = repr((gates, centres, tube, None if line is None else line.tobytes()))
        with self._lock, self._server.atomic():
            if shown == self._course_shown:
                return
            for node in self._course:
                node.remove()
            drawn = [course_view.draw_gate(self._server, *pair) for pair in zip(gates, centres, strict=True)]
            if tube is not None and line is not None and len(line):
                drawn.append(course_view.draw_tube(self._server, line, tube.radius_m))
            self._course, self._course_shown = [node for nodes in drawn for node in nodes], shown

    def select(self, waypoints: Sequence[int]) -> None:
        with self._lock, self._server.atomic():
            self._selected = tuple(waypoints)
            for name, ball in self._balls.items():
                ball.color = _SELECTED if name in self._selected else _WHITE
            self._draw_handle()

    def require_clearance(self, required_m: float) -> None:
        """Take what the document asks of a path: waypoints are placed and colours scaled by it from now on."""
        with self._lock:
            if required_m != self._required_m:
                self._required_m = required_m
                self._flights.draw(self._flights_found, required_m)
                self._draw_path()
        self.map.require_clearance(required_m)

    def draw_plan(self, series: Series | None, *, is_coming: bool = False) -> None:
        """Draw a checked plan; None leaves the last good path there in grey, and a draft if a plan `is_coming`."""
        with self._lock, self._server.atomic():
            if not is_coming:
                self._drop_draft()
            self._checked = series is not None
            self._series = series if self._checked else self._series
            self._draw_path()
            if not self._checked:
                self._ghost.visible = False

    def draw_draft(self, shown: Draft, path_world_m: FloatArray | None) -> None:
        """Draw (m, 3) a path that nobody has checked while a waypoint is dragged, and the last good one in grey.

        None: there is no path with the waypoint where it is.
        """
        with self._lock, self._server.atomic():
            if not self._dragged_points:
                return  # it was let go meanwhile
            begins = self._draft is None
            if path_world_m is None:
                self._drop_draft()
            else:
                colour = _CAUTION if shown.state == "too close" else _SELECTED
                colours = np.full((len(path_world_m), 3), colour, dtype=np.uint8)
                self._draft = drawing.draw_path(self._server, path_world_m, colours, name="/draft")
            if begins != (self._draft is None):
                self._draw_path()
            self.on_draft(shown)

    def drop_draft(self) -> None:
        """For a drag that changed nothing: the plan is as good as before."""
        with self._lock, self._server.atomic():
            self._drop_draft()
            self._draw_path()

    def _drop_draft(self) -> None:
        if self._draft is not None:
            self._draft.remove()
            self._draft = None

    def set_plan_aside(self, aside: bool) -> None:
        """Hide plan, waypoints and marks while recorded flights are looked at, or bring them back."""
        with self._lock, self._server.atomic():
            if aside == self._set_aside:
                return
            self._set_aside = aside
            for ball in self._balls.values():
                ball.visible = not aside
            if aside:
                self._ghost.visible = False
            self._draw_handle()
            self._draw_path()

    def look(self, time_s: float | None) -> None:
        """Draw the vehicle where the plan has it at a moment; None hides it."""
        with self._lock:
            series = self._series
            if time_s is None or series is None or not self._checked or self._set_aside:
                self._ghost.visible = False
                return
            k = int(np.clip(np.searchsorted(series.time_s, time_s), 0, len(series.time_s) - 1))
            self._ghost.position = (series.x_m[k], series.y_m[k], series.z_m[k])
            self._ghost.wxyz = tuple(series.q_world_body[4 * k : 4 * k + 4])
            self._ghost.visible = True

    def show(self, colour: Colour, *, flights: bool = True) -> None:
        """`flights`: whether those of the preflight are drawn."""
        with self._lock:
            self._colour, self._flights_shown = colour, flights
            self._draw_path()

    def draw_flights(self, found: Preflight) -> None:
        """Draw the flights of the checked plan's preflight in the place of those before."""
        with self._lock, self._server.atomic():
            self._flights_found = found
            self._flights.draw(found, self._required_m)
            self._draw_path()

    def _show_flights(self) -> None:
        """Only beside the plan that they are of."""
        current = self._checked and self._draft is None and not self._set_aside
        self._flights.set_visible(self._flights_shown and current)

    def _ball(self, point: Point) -> Any:
        if point.id not in self._balls:
            ball = self._server.scene.add_icosphere(
                f"/waypoint_{point.id}",
                radius=_BALL_M,
                color=_WHITE,
                cast_shadow=False,
                position=point.position_world_m,
                visible=not self._set_aside,
            )
            ball.on_click(lambda _: self.on_select(point.id))
            self._balls[point.id] = ball
        return self._balls[point.id]

    def _draw_handle(self) -> None:
        """Arrows at the one selected waypoint, by which it is dragged."""
        chosen = [p for p in self._points if self._selected == (p.id,) and not self._set_aside]
        if not chosen:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        point = chosen[0]
        if self._handle is None or self._handle.name != f"/handle_{point.id}":
            if self._handle is not None:
                self._handle.remove()
            self._handle = self._server.scene.add_transform_controls(
                f"/handle_{point.id}",
                scale=0.5,
                disable_rotations=True,
                depth_test=False,
                position=point.position_world_m,
            )
            self._handle.on_update(lambda event: self._dragged(point.id, event))
        self._handle.position = point.position_world_m

    def _dragged(self, waypoint: int, event: Any) -> None:
        position = np.array(event.target.position, dtype=np.float64)
        with self._lock:
            if event.phase == "start":
                self._dragged_points[event.client_id] = waypoint
            elif event.phase == "end":
                self._dragged_points.pop(event.client_id, None)
            elif self._dragged_points.get(event.client_id) != waypoint:
                return  # events may arrive out of order: this one came after the end
            elif waypoint in self._balls:
                self._balls[waypoint].position = tuple(position)
        if event.phase == "end":
            self.on_drag(waypoint, position)
            self._end_draft()
        elif event.phase == "update":
            self.on_pull(waypoint, position)

    def _end_draft(self) -> None:
        with self._lock:
            self.on_draft(Draft(None))

    def _browser_left(self, client: "viser.ClientHandle") -> None:
        """What was dragged there is where it was: only letting go moves a waypoint."""
        self.vehicle.browser_left(client)
        with self._lock:
            if self._dragged_points.pop(client.client_id, None) is None:
                return
            self.draw_waypoints(self._points)
            self.drop_draft()
            self._end_draft()

    def _clicked(self, event: "viser.SceneClickEvent") -> None:
        if self.map.measuring:
            self.map.click(np.array(event.ray_origin), np.array(event.ray_direction))
            return
        with self._lock:
            series = self._series
            if series is None or not self._checked or self._set_aside:
                return
        path_m = np.stack([series.x_m, series.y_m, series.z_m], axis=1)
        k = picking.nearest_on_path(np.array(event.ray_origin), np.array(event.ray_direction), path_m)
        if k is not None:
            self.on_moment(series.time_s[k])

    def _shift_clicked(self, event: "viser.SceneClickEvent") -> None:
        with self._lock:
            points, selected = self._points, self._selected
            clearance_m = self._required_m + _STAND_OFF_M
        hit = self.map.mesh.first_hit(np.array(event.ray_origin), np.array(event.ray_direction))
        if hit is None:
            return
        before = next((p for p in points if p.id in selected), points[-1] if points else None)
        height_m = hit[0][2] + 1.0 if before is None else before.position_world_m[2]
        placed_m = picking.waypoint_over(*hit, height_m=height_m, clearance_m=clearance_m)
        self.on_add(None if before is None else before.id, placed_m)

    def _draw_path(self) -> None:
        self._show_flights()
        if self._path is not None:
            self._path.remove()
            self._path = None
        series = self._series
        if series is None or self._set_aside:
            return
        positions = np.stack([series.x_m, series.y_m, series.z_m], axis=1)
        is_current = self._checked and self._draft is None
        grey = np.full((len(positions), 3), _GREY, dtype=np.uint8)
        colours = drawing.series_colours(series, self._colour, self._required_m) if is_current else grey
        thickness_m = _THIN_M if self._flights.visible else _THICK_M
        self._path = drawing.draw_path(self._server, positions, colours, thickness_m=thickness_m)

    def _look_at(self, low: FloatArray, high: FloatArray) -> None:
        """Look at the middle of a box (world, m) from behind and above, high enough to see over the walls."""
        target, reach = (low + high) / 2, float(np.linalg.norm((high - low)[:2]))
        self._camera = target + np.array([-0.2, -0.28, 0.4]) * reach, target
        for client in self._server.get_clients().values():
            self._aim_camera(client)

    def _browser_came(self, client: "viser.ClientHandle") -> None:
        self._aim_camera(client)
        client.camera.on_update(lambda _: self._browser_looked(client))
        self.vehicle.browser_came(client, self._view_of(client))

    def _browser_looked(self, client: "viser.ClientHandle") -> None:
        self.vehicle.browser_looked(client)
        height_m, view = picking.height_seen(client.camera), self._view_of(client)
        with self._lock:
            if abs(height_m - self._heights_m.get(view, 0.0)) < _SAME_SCALE * height_m or not view:
                return
            self._heights_m.pop(view, None)
            self._heights_m[view] = round(height_m, 3)
            while len(self._heights_m) > _MOST_VIEWS:
                del self._heights_m[next(iter(self._heights_m))]
            self.on_scales(dict(self._heights_m))

    def _view_of(self, client: "viser.ClientHandle") -> str:
        """The name that the browser's page gave to its 3D view, which the gateway passes on; empty for none."""
        connection = self._server._websock_server._live_connections.get(client.client_id)
        return "" if connection is None or connection.request is None else connection.request.path.rpartition("/")[2]

    def follow(self, view: str, *, following: bool) -> None:
        """Have the camera of one page's 3D view go with the vehicle; or look at everything again."""
        self.vehicle.follow(view, following=following)
        if not following:
            for client in self.vehicle.browsers_of(view):
                self._aim_camera(client)

    def _aim_camera(self, client: "viser.ClientHandle") -> None:
        position, target = self._camera
        client.camera.position, client.camera.look_at = tuple(position), tuple(target)
