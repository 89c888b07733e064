"""What differs between the 3D views of the browsers: the size of the vehicle's mark, and a camera that follows it.

A mark is a ring and an arrow along the heading, as large as the vehicle and never smaller than a few pixels, so its
size depends on how far the camera of a browser is.
"""

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray, rotations
from gcs_web.scene import drawing

if TYPE_CHECKING:
    import viser

LEAST_PX = 20.0
"""Radius of the ring on the screen, at least."""
_VEHICLE_M = 0.3
"""Radius of the ring, at least: round the drawn vehicle."""
_LINE_PX = 3.0
_CHANGE = 1.08
"""A ring that is off by less is left alone."""
_BEHIND_M, _ABOVE_M = 2.4, 1.2
"""Where the camera stands when it begins to follow; a person may turn and move it from there."""
SEEN, LAST_SEEN = (242, 245, 247), (255, 122, 102)
"""Colours: of a vehicle that is heard, and of the place where one was heard last."""
MOST_FOLLOWING = 64
"""Browsers that are remembered; those that left long ago go first."""


@dataclass(slots=True)
class _Browser:
    client: "viser.ClientHandle"
    view: str
    ring: Any = None
    radius_m: float = 0.0
    colour: tuple[int, int, int] = SEEN


class BrowserViews:
    """Not thread-safe: `VehicleView` calls it under its lock."""

    def __init__(self, server: "viser.ViserServer") -> None:
        self._frame = server.scene.add_frame("/vehicle_mark", show_axes=False, visible=False)
        self._browsers: dict[int, _Browser] = {}
        self._following: dict[str, None] = {}
        self._position_world_m: FloatArray | None = None
        self._yaw_rad = 0.0
        self._colour = SEEN

    def came(self, client: "viser.ClientHandle", view: str) -> None:
        """A browser's 3D view was opened; `view` is the name that its page gave it, empty for none."""
        browser = _Browser(client, view)
        self._browsers[client.client_id] = browser
        self._fit(browser)
        if view in self._following:
            self._stand_behind(browser)

    def left(self, client: "viser.ClientHandle") -> None:
        self._browsers.pop(client.client_id, None)

    def looked(self, client: "viser.ClientHandle") -> None:
        """The camera of a browser moved."""
        if (browser := self._browsers.get(client.client_id)) is not None:
            self._fit(browser)

    def follow(self, view: str, *, following: bool) -> None:
        """Have the camera of one 3D view go with the vehicle, from where it is heard on."""
        self._following.pop(view, None)
        if not following:
            return
        self._following[view] = None
        while len(self._following) > MOST_FOLLOWING:
            del self._following[next(iter(self._following))]
        for browser in self._browsers.values():
            if browser.view == view:
                self._stand_behind(browser)

    def of(self, view: str) -> list["viser.ClientHandle"]:
        return [browser.client for browser in self._browsers.values() if browser.view == view]

    def move(self, position_world_m: FloatArray, q_world_body: FloatArray) -> None:
        """The vehicle is there."""
        first = self._position_world_m is None
        self._position_world_m, self._yaw_rad = position_world_m.copy(), float(rotations.yaw(q_world_body))
        self._colour = SEEN
        self._frame.position, self._frame.wxyz = tuple(position_world_m), tuple(rotations.from_yaw(self._yaw_rad))
        self._frame.visible = True
        for browser in self._browsers.values():
            self._fit(browser)
            if browser.view in self._following:
                self._stand_behind(browser) if first else self._go_along(browser)

    def lose(self) -> None:
        """The vehicle is heard no more: the mark stays where it was last."""
        self._colour = LAST_SEEN
        for browser in self._browsers.values():
            self._fit(browser)

    def forget(self) -> None:
        """There is no vehicle any more."""
        self._position_world_m, self._frame.visible = None, False

    def _stand_behind(self, browser: _Browser) -> None:
        if self._position_world_m is None:
            return
        heading = np.array([np.cos(self._yaw_rad), np.sin(self._yaw_rad), 0.0])
        self._look(browser, _ABOVE_M * np.array([0.0, 0.0, 1.0]) - _BEHIND_M * heading)

    def _go_along(self, browser: _Browser) -> None:
        """Keep the side and the distance from which it is looked at, which the browser told last."""
        camera = browser.client.camera
        self._look(browser, np.array(camera.position) - np.array(camera.look_at))

    def _look(self, browser: _Browser, from_vehicle_m: FloatArray) -> None:
        assert self._position_world_m is not None
        with contextlib.suppress(ValueError):  # a camera in the place that it looks at cannot be turned
            browser.client.camera.position = tuple(self._position_world_m + from_vehicle_m)
            browser.client.camera.look_at = tuple(self._position_world_m)

    def _fit(self, browser: _Browser) -> None:
        """Draw the mark of one browser as large as its camera needs."""
        if self._position_world_m is None:
            return
        radius_m = self._radius_m(browser.client.camera)
        kept = browser.ring is not None and 1 / _CHANGE < browser.radius_m / radius_m < _CHANGE
        if kept and browser.colour == self._colour:
            return
        browser.radius_m, browser.colour = radius_m, self._colour
        browser.ring = drawing.draw_pieces(
            browser.client, radius_m * RING, np.array(self._colour), name="/vehicle_mark/ring", thickness_px=_LINE_PX
        )

    def _radius_m(self, camera: Any) -> float:
        assert self._position_world_m is not None
        away_m = float(np.linalg.norm(np.array(camera.position) - self._position_world_m))
        pixel_m = 2.0 * away_m * np.tan(0.5 * camera.fov) / max(camera.image_height, 1)
        return max(_VEHICLE_M, LEAST_PX * pixel_m)


def _ring() -> FloatArray:
    """(k, 2, 3) pieces of a circle of radius 1 and of an arrow from it along x."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    arrow = np.array([[1.15, 0.35, 0.0], [1.75, 0.0, 0.0], [1.15, -0.35, 0.0]])
    return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in (circle, arrow)])


RING = _ring()
