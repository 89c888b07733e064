"""The page's link to the vehicle: its pose, its active trajectory, and the upload."""

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import firmware_bridge
from flight import FloatArray, TrajectoryFile

_PERIOD_S = 0.05
_LINK_LOST_S = 2.0
_UPLOAD_SYSTEM = 254


class VehicleWatch:
    """Keeps a link to one vehicle and calls listeners at every new pose."""

    def __init__(self, url: str, *, key_file: Path | None = None) -> None:
        """Raises `LinkError` if no vehicle answers at `url`."""
        self.url = url
        self._key_file = key_file
        self._link = firmware_bridge.connect(url, key=key_file)
        self._listeners: list[Callable[[], None]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="vehicle watch", daemon=True)
        self._thread.start()

    def on_change(self, listener: Callable[[], None]) -> None:
        """Call `listener` at every pose that is received, some twenty times a second."""
        self._listeners.append(listener)

    @property
    def pose(self) -> tuple[FloatArray, FloatArray] | None:
        """Position (3,) and `q_world_body` (4,), or None before the first message or 2 s after the last."""
        state = self._link.state
        if state is None or state.age_s > _LINK_LOST_S:
            return None
        return state.position_world_m, state.q_world_body

    def describe(self) -> str:
        """One line for the pilot."""
        state = self._link.state
        if state is None:
            return f"{self.url}, no message yet"
        if state.age_s > _LINK_LOST_S:
            return f"{self.url}, link lost: no message for {state.age_s:.0f} s"
        held = f"holds {state.active_name}" if state.active_name else "holds no trajectory"
        return f"{self.url}, {state.mission.name.lower().replace('_', ' ')}, {held}"

    def upload(self, file: TrajectoryFile, name: str, *, map_hash: str) -> str:
        """Send, commit, read back; returns a one-line summary.

        Raises:
            FlightError: either side refused it, or the link was lost; the vehicle keeps its trajectory.
        """
        # A second station on the link, so that control is taken for the upload only and given back on leaving.
        with firmware_bridge.connect(self.url, key=self._key_file, system_id=_UPLOAD_SYSTEM) as link:
            report = link.upload(replace(file, name=name), map_hash=map_hash)
        return f"uploaded {name}: {report.segments} segments in {report.duration_s:.2f} s, read back and equal"

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=5)
        self._link.close()

    def _watch(self) -> None:
        last_s = -1.0
        while not self._stop.wait(_PERIOD_S):
            state = self._link.state
            if state is not None and state.time_s != last_s:
                last_s = state.time_s
                for listener in self._listeners:
                    listener()
