"""The map on the table: what is shown of it, what is measured in it, and what an edit of it would change."""

import contextlib
import threading
from collections.abc import Callable

import msgspec
import numpy as np

import esdf
from esdf import Edit
from esdf.edits import difference
from flight import FlightError, FloatArray, InputError
from flight.project import Project
from gcs_web.document import map_edits
from gcs_web.document.session import Session
from gcs_web.gateway.hub import Hub
from gcs_web.map import section
from gcs_web.map.bodies import Place, triple
from gcs_web.map.map_view import MapView
from gcs_web.planning import inputs
from gcs_web.protocol import map as messages
from gcs_web.protocol.people import Notice, Person
from mapping import Map

_LAYERS: list[messages.Layer] = ["mesh", "edits"]
_LARGEST_BRUSH_M = 10.0
_CUT_STEP_M = 0.25
"""Of the height at which the map is seen from above."""


class MapDesk:
    """Thread-safe."""

    def __init__(self, opened: Project, hub: Hub, session: Session, view: MapView, area: Callable[[], Map]) -> None:
        """`area`: the map as it is now; raises `FlightError` if it cannot be read."""
        self._folder, self._hub, self._session = opened.map / "esdf", hub, session
        self._view, self._area = view, area
        self._lock = threading.RLock()
        self._slice: messages.Slice | None = None
        self._layers, self._author = _LAYERS, ""
        self._cut: tuple[float | None, float, messages.Slice | None] = (None, -1.0, None)
        """Height, required clearance and level slice of the section that the pages have."""
        self._measured: list[Place] = []
        self._preview = messages.MapPreview("")
        self._action: messages.MapAction = "no-fly"
        self._editor: esdf.Editor | None = None
        """Of the map without the previewed edit, while there is one."""
        self._brush_lock = threading.Lock()
        """Of the next three, apart: viser's loop takes it, and must not wait for a preview to be computed."""
        self._painter, self._stroke = "", messages.Paint(serial=0, active=False)
        """Who paints (id), and with which brush."""
        self._painted: list[Place] = []
        self._view.on_shape = self._pulled
        view.mesh.on_paint = self._paint
        view.on_measure = self._take_place

    # --- what is shown ---

    def show(self, wanted: messages.Slice | None, layers: list[messages.Layer], author: str) -> None:
        """Raises `InputError` if the slice is not at a finite place."""
        if wanted is not None:
            numbers = (wanted.at_m, wanted.heading_deg, wanted.tilt_deg)
            if not all(abs(value) <= map_edits.LARGEST_COORDINATE_M for value in numbers):  # NaN is not
                raise InputError(f"a slice at {wanted.at_m} m is refused; give a finite place and direction in the map")
        with self._lock:
            self._slice, self._layers, self._author = wanted, layers, author
        self._view.show(wanted, layers)
        self.cut(self._cut[0])
        self._publish()

    def changed(self) -> None:
        """The map is another one: what it shows, and what a previewed edit would change, is told anew."""
        self._publish()
        self.cut(self._cut[0], anew=True)
        with self._lock:
            self._editor = None
            last = self._preview
            if last.shape is not None:
                with contextlib.suppress(FlightError):
                    self._show_preview(last.author, last.edit, last.shape, drawn=last.drawn)

    def cut(self, height_m: float | None, *, anew: bool = False) -> None:
        """Tell the pages how the map looks from above at a height (world z), unless they know; None: in the middle.

        Where a level slice is shown, it is what they are told.
        """
        step = None if height_m is None else round(height_m / _CUT_STEP_M) * _CUT_STEP_M
        level = self._slice if self._slice is not None and self._slice.axis == "z" else None
        wanted = (step, self._view.required_m, level)
        if wanted == self._cut and not anew:
            return
        self._cut = wanted
        try:
            area = self._area()
        except FlightError:
            self._hub.publish(messages.MapSection(""))
            return  # said when it was drawn
        picture = None if level is None else self._view.picture(level)
        if level is not None and picture is not None:
            self._hub.publish(section.of_slice(picture, level))
            return
        grid = area.field.grid
        middle_m = 0.5 * float(grid.low_world_m[2] + grid.high_world_m[2])
        self._hub.publish(section.of(area, middle_m if step is None else step, self._view.required_m))

    def _publish(self) -> None:
        try:
            area = self._area()
        except FlightError:
            return  # said when it was drawn
        grid, facts = area.field.grid, area.facts
        free_m3 = float(np.count_nonzero(area.field.state == esdf.FREE) * np.prod(grid.voxel_m))
        low = np.array(grid.low_world_m)
        high = low + np.array(grid.shape) * np.array(grid.voxel_m)
        reprojection = facts.get("reprojection_error_px")
        self._hub.publish(
            messages.MapShown(
                slice=self._slice,
                layers=list(self._layers),
                low_m=triple(low),
                high_m=triple(high),
                facts=messages.MapFacts(
                    images=int(facts.get("images", 0)),
                    images_placed=int(facts.get("images_placed", len(area.images))),
                    reprojection_px=None if reprojection is None else float(reprojection),
                    free_m3=free_m3,
                    standing=str(area.standing),
                    doubt=inputs.doubt(area),
                    hash=area.hash,
                ),
                author=self._author,
            )
        )

    # --- measuring ---

    def measure(self, *, active: bool) -> None:
        with self._lock:
            self._view.measuring, self._measured = active, []
        self._tell_measured()

    def _take_place(self, point: Place) -> None:
        """The first or second point, or the first of a new pair."""
        with self._lock:
            self._measured = [point] if len(self._measured) == 2 else [*self._measured, point]
        self._tell_measured()

    def _tell_measured(self) -> None:
        with self._lock:
            points = list(self._measured)
        self._view.mark(points)
        clearances: list[float | None] = []
        if points:
            near = self._area().field.distance(np.array(points))
            clearances = [None if np.isnan(value) else round(float(value), 3) for value in near]
        apart = float(np.linalg.norm(np.subtract(points[0], points[1]))) if len(points) == 2 else None
        self._hub.publish(messages.Measured(self._view.measuring, points, clearances, apart))

    # --- what an edit would change ---

    def preview(self, wanted: messages.PreviewMapEdit, person: Person) -> None:
        """
        Raises:
            InputError: somebody else looks at a preview, or the edit is not possible.
        """
        with self._lock:
            self._require_free(person)
            if wanted.shape is None:
                if not self._painter:  # a brush is put away by `paint`
                    self.end_preview()
                return
            self._action = wanted.action
            self._show_preview(person.id, wanted.edit, wanted.shape, drawn=False)

    def paint(self, wanted: messages.Paint, person: Person) -> None:
        """Take drags over the mesh for this person's strokes, or stop.

        Raises:
            InputError: somebody else looks at a preview, or the brush is not possible.
        """
        with self._lock:
            self._require_free(person)
            if not wanted.active:
                self.end_preview()
                return
            if not 0.0 < wanted.radius_m <= _LARGEST_BRUSH_M:
                raise InputError(f"a brush of radius {wanted.radius_m:g} m is refused; at most {_LARGEST_BRUSH_M:g} m")
            with self._brush_lock:
                self._painter, self._stroke = person.id, wanted
            self._view.mesh.paint(True)

    def _paint(self, point_world_m: FloatArray, is_end: bool) -> None:
        """Another place of a stroke, or its end; then the next one begins."""
        with self._brush_lock:
            if not self._painter:
                return
            if np.isfinite(point_world_m).all() and len(self._painted) < map_edits.MOST_POINTS:
                self._painted.append(triple(point_world_m))
                if len(self._painted) == map_edits.MOST_POINTS:
                    said = (
                        f"A stroke has at most {map_edits.MOST_POINTS} places, and ends here; apply it, then draw on."
                    )
                    self._hub.publish(Notice(said, "caution"), self._painter)
            if not self._painted:
                return
            brush, author = self._stroke, self._painter
            drawn = messages.Shape("stroke", radius_m=brush.radius_m, points_m=list(self._painted))
            self._painted = [] if is_end else self._painted
        shape = map_edits.shape_of(map_edits.solid(drawn))
        if is_end:
            threading.Thread(target=self._show_stroke, args=(author, brush.action, shape), daemon=True).start()
        else:
            self._view.preview(brush.action, shape, None)

    def _show_stroke(self, author: str, action: messages.MapAction, shape: messages.Shape) -> None:
        with self._lock:
            if self._painter != author:
                return  # the brush was put away meanwhile
            self._action = action
            try:
                self._show_preview(author, None, shape, drawn=True)
            except FlightError as error:
                self._hub.publish(Notice(str(error), "danger"), author)

    def _require_free(self, person: Person) -> None:
        holder = self._preview.author or self._painter
        if holder not in ("", person.id) and any(p.id == holder for p in self._hub.people):
            raise InputError("another person is drawing an edit of the map; wait until it is applied or cancelled")

    def end_preview(self, author: str = "") -> None:
        """Of this person, or of anybody; and their brush."""
        with self._lock:
            if self._painter and author in ("", self._painter):
                with self._brush_lock:
                    self._painter, self._painted = "", []
                self._view.mesh.paint(False)
                self._view.preview("no-fly", None, None)
            if self._preview.author and author in ("", self._preview.author):
                self._editor, self._preview = None, messages.MapPreview("")
                self._view.preview("no-fly", None, None)
                self._hub.publish(self._preview)

    def require_possible(self, new: Edit) -> None:
        """
        Raises:
            InputError: the edit touches nothing of the map.
        """
        esdf.open_editor(self._folder).require_reach(new)

    def _show_preview(self, author: str, number: int | None, shape: messages.Shape, *, drawn: bool) -> None:
        if self._editor is None or self._preview.edit != number:
            self._editor = esdf.open_editor(self._folder)
        editor = self._editor
        new = Edit(self._action, map_edits.solid(shape), "preview" if self._action == "no-fly" else "")
        editor.require_reach(new)
        listed = self._session.content.map_edits
        after = [new if each.id == number else each.edit() for each in listed]
        before = editor.snapshot()
        editor.replace(after if number is not None else [*after, new])
        field = editor.snapshot()
        editor.undo()
        change = difference(before, field)
        self._view.preview(self._action, shape, field)
        self._preview = messages.MapPreview(
            author, number, shape, change.closed_m3, change.opened_m3, change.voxels, drawn=drawn
        )
        self._hub.publish(self._preview)

    def _pulled(self, shape: messages.Shape, is_end: bool) -> None:
        """A handle was moved: the numbers follow; what would change is computed when it is let go."""
        with self._lock:
            if self._preview.shape is None:
                return
            if not is_end:
                self._preview = msgspec.structs.replace(self._preview, shape=shape, drawn=True)
                self._hub.publish(self._preview)
                return
            with contextlib.suppress(InputError):  # outside the map: it stays where it is, and cannot be applied
                self._show_preview(self._preview.author, self._preview.edit, shape, drawn=True)
