"""Tiles in the 3D view: coarse for every browser at once, in full where its camera is near."""

import logging
import threading
from collections.abc import Awaitable, Callable, Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs_web.scene import tiles
from gcs_web.scene.tiles import Tiles

if TYPE_CHECKING:
    import viser

logger = logging.getLogger(__name__)

_PERIOD_S = 0.25
"""Between two looks at where the cameras are: what a moving camera only passes is not sent."""

Draw = Callable[["viser.SceneApi", str, np.ndarray, bool], Any]
"""Puts a level of a tile into a browser's scene, under a name; whether it is the fine one. What it returns can be
removed."""
Plain = Callable[[Tiles, int], np.ndarray]
"""All tiles in one piece of a certain size, for a browser that draws slowly."""
Drag = Callable[[Any], Awaitable[None]]
"""Takes the events of a drag, in the event loop."""


@dataclass(slots=True, eq=False)
class _Browser:
    client: Any
    drawn: dict[int, Any] = field(default_factory=dict)
    fine: frozenset[int] = frozenset()
    moved: bool = False
    most_plain: int | None = None
    """Size of the one piece that it has in place of tiles; None: it has tiles."""


class DetailView:
    """Thread-safe. A browser is sent each tile once at the coarse level, and holds at most `most` of the fine one."""

    def __init__(
        self, server: "viser.ViserServer", name: str, draw: Draw, most: int, plain: Plain | None = None
    ) -> None:
        """
        Args:
            name: of the scene's node that holds all tiles.
            most: triangles or points of the fine level that a browser holds.
            plain: needed for `simplify`.
        """
        self._name, self._draw, self._most, self._plain = name, draw, most, plain
        self._lock = threading.RLock()
        self._tiles: Tiles | None = None
        self._browsers: dict[int, _Browser] = {}
        self._on_drag: Drag | None = None
        self.plain_of: Callable[[Any], int | None] = lambda _: None
        """Size of the one piece that a browser which comes gets; None: it gets tiles."""
        self._moved, self._closed = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._parent = server.scene.add_frame(name, show_axes=False)
        server.on_client_connect(self._joined)
        server.on_client_disconnect(self._left)

    def show(self, shown: Tiles | None, *, visible: bool = True) -> None:
        """Draw these tiles in place of the others."""
        with self._lock:
            self._tiles = shown
            self._parent.visible = visible
            for browser in self._browsers.values():
                self._begin(browser)
                browser.moved = True
            self._moved.set()
            if shown is not None and self._thread is None and not self._closed.is_set():
                self._thread = threading.Thread(target=self._refine, name=f"detail {self._name}", daemon=True)
                self._thread.start()

    def simplify(self, clients: Collection[int], most: int) -> None:
        """Give some browsers (viser's ids) all tiles in one piece of about so many triangles or points at the most."""
        with self._lock:
            for browser in (self._browsers[name] for name in clients if name in self._browsers):
                if browser.most_plain != most:  # a page that comes again to the station says it again
                    browser.most_plain = most
                    self._begin(browser)

    def set_visible(self, visible: bool) -> None:
        with self._lock:
            self._parent.visible = visible

    def set_drag(self, on_drag: Drag | None) -> None:
        """Have drags over the tiles answered, instead of turning the camera; None: no more."""
        with self._lock:
            for browser in self._browsers.values():
                for node in browser.drawn.values():
                    if self._on_drag is not None:
                        node.remove_drag_callback("all")
                    if on_drag is not None:
                        node.on_drag(on_drag)
            self._on_drag = on_drag

    def close(self) -> None:
        self._closed.set()
        self._moved.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def _joined(self, client: Any) -> None:
        async def moved(_: Any) -> None:
            browser.moved = True
            self._moved.set()

        browser = _Browser(client, most_plain=self.plain_of(client))
        client.camera.on_update(moved)
        with self._lock:
            self._browsers[client.client_id] = browser
            self._begin(browser)

    def _left(self, client: Any) -> None:
        with self._lock:
            self._browsers.pop(client.client_id, None)

    def _begin(self, browser: _Browser) -> None:
        for node in browser.drawn.values():
            node.remove()
        browser.drawn, browser.fine = {}, frozenset()
        if self._tiles is None:
            return
        if browser.most_plain is not None and self._plain is not None:
            self._draw_tile(browser, 0, self._plain(self._tiles, browser.most_plain), fine=False)
            return
        with browser.client.atomic():
            for k in range(len(self._tiles)):
                self._put(browser, k, fine=False)

    def _put(self, browser: _Browser, tile: int, *, fine: bool) -> None:
        assert self._tiles is not None
        self._draw_tile(browser, tile, self._tiles.level(tile, fine=fine), fine=fine)

    def _draw_tile(self, browser: _Browser, tile: int, data: np.ndarray, *, fine: bool) -> None:
        """A node of the same name takes the other's place in the browser."""
        node = self._draw(browser.client.scene, f"{self._name}/{tile}", data, fine)
        if self._on_drag is not None:
            node.on_drag(self._on_drag)
        browser.drawn[tile] = node

    def _refine(self) -> None:
        while not self._closed.is_set():
            self._moved.wait()
            self._moved.clear()
            with self._lock:
                waiting = [browser for browser in self._browsers.values() if browser.moved]
            for browser in waiting:
                try:
                    self._follow(browser)
                except Exception:  # one browser, or a damaged file: the others are served all the same
                    logger.exception("the fine level could not be shown")
            self._closed.wait(_PERIOD_S)

    def _follow(self, browser: _Browser) -> None:
        """Give a browser the fine levels that it should have, first taking away the others."""
        with self._lock:
            if self._tiles is None or self._browsers.get(browser.client.client_id) is not browser:
                return
            if browser.most_plain is not None:
                return
            browser.moved = False
            camera = browser.client.camera
            position_m, look_at_m = np.array(camera.position), np.array(camera.look_at)
            forward = (look_at_m - position_m) / max(float(np.linalg.norm(look_at_m - position_m)), 1e-9)
            wanted = tiles.near(self._tiles, position_m, forward, self._most)
            for tile in sorted(browser.fine - wanted):
                self._put(browser, tile, fine=False)
            for tile in sorted(wanted - browser.fine):
                self._put(browser, tile, fine=True)
            browser.fine = wanted
