"""The map's mesh in the 3D view: drawn in tiles, met by the rays of clicks, and painted on by drags."""

import threading
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray, Progress, silent
from gcs_web.map import display_mesh
from gcs_web.scene import drawing
from gcs_web.scene.detail_view import DetailView
from gcs_web.scene.picking import Surface

if TYPE_CHECKING:
    import viser


class MeshView:
    """Thread-safe."""

    def __init__(self, server: "viser.ViserServer", triangles: int, cache: Path, progress: Progress) -> None:
        """`progress`: of drawing the first mesh."""
        self._triangles, self._cache, self._progress = triangles, cache, progress
        self._lock = threading.RLock()
        self._tiles = DetailView(server, "/map", _draw, display_mesh.FINE_RATIO * triangles, display_mesh.plain)
        self._file: tuple[int, int] | None = None
        """Time of change (ns) and size of the file that is drawn."""
        self._painting = self._by_height = False
        self._shown = True
        self._server = server
        self._mesh: tuple[np.ndarray, np.ndarray] | None = None
        """Vertices and triangles that are drawn."""
        self._heights: Any = None
        """The mesh in one piece, coloured by height; None until somebody wants it."""
        self.surface: Surface | None = None
        self.on_paint: Callable[[FloatArray, bool], None] = lambda _p, _e: None
        """Painted at (3,) world, NaN beside the mesh; whether the drag ends there."""

    def close(self) -> None:
        self._tiles.close()

    def draw(self, mesh: Path) -> None:
        """Show a mesh; it is only read where the file changed."""
        with self._lock:
            found = mesh.stat() if mesh.exists() else None
            file = (0, 0) if found is None else (found.st_mtime_ns, found.st_size)
            if file == self._file:
                return
            progress, self._progress = self._progress, silent
            shown = display_mesh.load(mesh, self._triangles, self._cache, progress=progress)
            self._mesh = shown.array("vertices"), shown.array("faces")
            self.surface = Surface(*self._mesh)
            self._tiles.show(shown)
            self._file = file
            if self._heights is not None:
                self._heights.remove()
                self._heights = None
            self._show()

    @property
    def plain_of(self) -> Callable[[Any], int | None]:
        return self._tiles.plain_of

    @plain_of.setter
    def plain_of(self, plain_of: Callable[[Any], int | None]) -> None:
        """How many triangles at the most a browser that comes gets in one piece; None: all that it can have."""
        self._tiles.plain_of = plain_of

    def simplify(self, clients: Collection[int], triangles: int) -> None:
        """Give some browsers (viser's ids) the mesh in so many triangles at the most."""
        self._tiles.simplify(clients, triangles)

    def show(self, visible: bool, *, by_height: bool = False) -> None:
        """`by_height`: in colours of height, in place of its own."""
        with self._lock:
            self._shown, self._by_height = visible, by_height
            self._show()

    def _show(self) -> None:
        by_height = self._by_height and not self._painting  # drags are of the tiles
        if by_height and self._shown and self._heights is None and self._mesh is not None:
            self._heights = self._coloured(*self._mesh)
        if self._heights is not None:
            self._heights.visible = by_height and self._shown
        self._tiles.set_visible(self._shown and not (by_height and self._heights is not None))

    def _coloured(self, vertices_m: np.ndarray, faces: np.ndarray) -> Any:
        height_m = vertices_m[:, 2]
        share = (height_m - height_m.min()) / max(float(np.ptp(height_m)), 1e-6)
        mesh = display_mesh.Mesh(vertices_m, faces, drawing.colours(share, "cividis"))
        return self._server.scene.add_glb("/map_heights", mesh.glb().tobytes(), cast_shadow=False)

    def first_hit(self, origin_m: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """As `Surface.first_hit`; None where there is no mesh."""
        return self.surface and self.surface.first_hit(origin_m, direction)

    def paint(self, active: bool) -> None:
        """Take drags over the mesh for strokes of a brush, instead of turning the camera; or stop."""
        with self._lock:
            if active != self._painting:
                self._tiles.set_drag(self._painted if active else None)
            self._painting = active
            self._show()

    async def _painted(self, event: Any) -> None:
        """In the event loop, as only there viser keeps the order of a drag's events."""
        origin_m = np.array(event.client.camera.position, dtype=np.float64)
        direction = np.array(event.start_position if event.phase == "start" else event.end_position) - origin_m
        hit = self.first_hit(origin_m, direction / np.linalg.norm(direction))
        if hit is not None:
            self.on_paint(hit[0], event.phase == "end")
        elif event.phase == "end":
            self.on_paint(np.full(3, np.nan), True)


def _draw(into: "viser.SceneApi", name: str, glb: np.ndarray, fine: bool) -> Any:
    return into.add_glb(name, glb.tobytes(), cast_shadow=False)
