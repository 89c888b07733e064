"""The real vehicle in the 3D view: where it is, where it should be, and where it was since it was armed."""

import threading
import time
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray, rotations
from gcs_web.scene import drawing
from gcs_web.vehicle.browser_views import BrowserViews

if TYPE_CHECKING:
    import viser

_SEEN = 1e-3
"""Smallest change of a pose (m, or of a quaternion's number) that is drawn."""
_TRAIL_STEP_M, _TRAIL_POINTS, _TRAIL_PERIOD_S = 0.05, 2000, 0.25
"""Of the trail: least distance between two points, the most points, and how often it is drawn again."""
_TRAIL, _TRAIL_PX = (242, 245, 247), 2.5
"""Its colour and thickness, the same on every screen: thinner than the plan's path near by, and seen from afar."""


class VehicleView:
    """Thread-safe."""

    def __init__(self, server: "viser.ViserServer") -> None:
        self._server = server
        self._lock = threading.Lock()
        self._body = drawing.draw_vehicle(server, "/vehicle", opacity=1.0)
        self._setpoint = drawing.draw_vehicle(server, "/setpoint", opacity=0.3)
        self._browsers = BrowserViews(server)
        self._pose = np.zeros(7)
        self._trail: deque[FloatArray] = deque(maxlen=_TRAIL_POINTS)
        self._line: Any = None
        self._drawn_s = -np.inf
        self._armed = False

    def move(self, position_world_m: FloatArray, q_world_body: FloatArray) -> None:
        """Draw the vehicle where it says that it is; one that stands still costs the browsers nothing."""
        with self._lock:
            pose = np.concatenate([position_world_m, q_world_body])
            if self._body.visible and np.abs(pose - self._pose).max() < _SEEN:
                return
            self._pose = pose
            with self._server.atomic():
                self._body.position, self._body.wxyz = tuple(position_world_m), tuple(q_world_body)
                self._body.visible = True
                self._browsers.move(position_world_m, q_world_body)
                if self._armed:
                    self._extend_trail(position_world_m)

    def aim(self, setpoint_world: FloatArray | None) -> None:
        """Draw where it should be: (4,) x, y, z in metres and yaw in radians; None while nothing is flown."""
        with self._lock:
            if setpoint_world is None:
                if self._setpoint.visible:
                    self._setpoint.visible = False
                return
            with self._server.atomic():
                self._setpoint.position = tuple(setpoint_world[:3])
                self._setpoint.wxyz = tuple(rotations.from_yaw(setpoint_world[3]))
                self._setpoint.visible = True

    def set_armed(self, armed: bool) -> None:
        """A new trail begins when it is armed, and stays after the landing."""
        with self._lock:
            if armed and not self._armed:
                self._trail.clear()
                if self._line is not None:
                    self._line.remove()
                    self._line = None
            self._armed = armed

    def lose(self) -> None:
        """For a vehicle that is not heard any more: only the mark stays where it was."""
        with self._lock, self._server.atomic():
            self._body.visible = self._setpoint.visible = False
            self._browsers.lose()

    def hide(self) -> None:
        """For a vehicle of which nothing is known."""
        with self._lock, self._server.atomic():
            self._body.visible = self._setpoint.visible = False
            self._browsers.forget()

    def follow(self, view: str, *, following: bool) -> None:
        """Have the camera of one browser's 3D view go with the vehicle, or no more."""
        with self._lock, self._server.atomic():
            self._browsers.follow(view, following=following)

    def browsers_of(self, view: str) -> list["viser.ClientHandle"]:
        """Those that show the 3D view of a page: at most one, but while it is loaded again."""
        with self._lock:
            return self._browsers.of(view)

    def browser_came(self, client: "viser.ClientHandle", view: str) -> None:
        with self._lock:
            self._browsers.came(client, view)

    def browser_left(self, client: "viser.ClientHandle") -> None:
        with self._lock:
            self._browsers.left(client)

    def browser_looked(self, client: "viser.ClientHandle") -> None:
        with self._lock:
            self._browsers.looked(client)

    def _extend_trail(self, position_world_m: FloatArray) -> None:
        if self._trail and np.linalg.norm(position_world_m - self._trail[-1]) < _TRAIL_STEP_M:
            return
        self._trail.append(position_world_m.copy())
        if len(self._trail) < 2 or time.monotonic() - self._drawn_s < _TRAIL_PERIOD_S:
            return
        self._drawn_s = time.monotonic()
        path = np.stack(self._trail)
        pieces = np.stack([path[:-1], path[1:]], axis=1)
        self._line = drawing.draw_pieces(self._server, pieces, np.array(_TRAIL), name="/trail", thickness_px=_TRAIL_PX)
