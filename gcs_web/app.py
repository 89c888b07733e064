"""Starts the ground station (session, viser, page, gateway, in this order) and stops it in reverse order."""

import asyncio
import contextlib
import io
import logging
import socket
import threading
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import planner
from flight import InputError, Progress, project, silent
from gcs_web import gateway, scene
from gcs_web.page import Page
from gcs_web.session import Session
from gcs_web.vehicle_watch import VehicleWatch

if TYPE_CHECKING:
    import viser


class GroundStation:
    """A running ground station; use as a context manager. `url` carries the access token."""

    def __init__(
        self,
        folder: Path,
        *,
        port: int = 0,
        vehicle_url: str | None = None,
        key_file: Path | None = None,
        options: planner.PlanOptions | None = None,
        triangles: int = scene.DISPLAY_TRIANGLES,
        progress: Progress = silent,
    ) -> None:
        """Open the project and listen on loopback.

        Args:
            folder: the project.
            port: of the gateway; 0 lets the system choose.
            vehicle_url: where the vehicle answers (`udp:HOST:PORT`), or None to work without one.
            key_file: the link's signing key.
            options: of the planner.
            triangles: the mesh is thinned to this many for display.

        Raises:
            FlightError: the project cannot be opened, or the vehicle does not answer.
            InputError: the port is taken.
        """
        progress("opening the map", 0.0)
        import viser

        logging.getLogger("websockets").setLevel(logging.ERROR)  # viser's HTTP half logs each page load as an error
        self._session = Session(project.open_project(folder), options=options)
        self._watch: VehicleWatch | None = None
        self._server: viser.ViserServer | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="gateway", daemon=True)
        try:
            if vehicle_url is not None:
                progress(f"waiting for the vehicle at {vehicle_url}", 0.0)
                self._watch = VehicleWatch(vehicle_url, key_file=key_file)
            with contextlib.redirect_stdout(io.StringIO()):  # viser prints its own address, which is not for use
                self._server = viser.ViserServer(host=gateway.LOOPBACK, port=_free_port(), verbose=False)
            required_m = (options or planner.PlanOptions()).clearance_m
            self.page = Page(
                self._server,
                self._session,
                self._watch,
                triangles=triangles,
                required_clearance_m=required_m,
                progress=progress,
            )
            self._gateway = gateway.Gateway(
                self._server.get_port(), token=gateway.new_token(), state=self._session.state, port=port
            )
            self._thread.start()
            try:
                asyncio.run_coroutine_threadsafe(self._gateway.start(), self._loop).result(timeout=20)
            except OSError as error:
                raise InputError(
                    f"port {port} cannot be used ({error.strerror}); choose another with --port"
                ) from error
        except BaseException:
            self.close()
            raise

    @property
    def url(self) -> str:
        return self._gateway.url

    @property
    def session(self) -> Session:
        return self._session

    @property
    def watch(self) -> VehicleWatch:
        """The vehicle, for a station that was started with one."""
        assert self._watch is not None
        return self._watch

    @property
    def server(self) -> "viser.ViserServer":
        """viser's server, e.g. for its clients' cameras."""
        assert self._server is not None
        return self._server

    def close(self) -> None:
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._gateway.stop(), self._loop).result(timeout=20)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(timeout=5)
        if self._watch is not None:
            self._watch.close()
        if self._server is not None:
            with contextlib.redirect_stdout(io.StringIO()):
                self._server.stop()
        self._session.close()

    def __enter__(self) -> "GroundStation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((gateway.LOOPBACK, 0))
        return int(probe.getsockname()[1])
