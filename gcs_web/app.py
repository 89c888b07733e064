"""Starts and stops the ground station: viser, desk, vehicle watch and gateway, in this order and back."""

import asyncio
import contextlib
import io
import logging
import socket
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import msgspec

import planner
from flight import FloatArray, InputError, LinkError, Progress, project, silent
from gcs_web.comparison import reports
from gcs_web.desk import Desk
from gcs_web.gateway import gateway
from gcs_web.gateway.entrants import Entrants
from gcs_web.gateway.hub import Hub
from gcs_web.gateway.page_socket import PageSocket
from gcs_web.gateway.tls import context, is_loopback
from gcs_web.jobs import incoming
from gcs_web.jobs.jobs import Kind
from gcs_web.learning.consent import Consent
from gcs_web.map import display_mesh
from gcs_web.panels import HANDLERS
from gcs_web.protocol.base import Edit
from gcs_web.protocol.document import Insert, Move
from gcs_web.protocol.people import Invitation, InvitationEnded, Person
from gcs_web.protocol.vehicle import Vehicle
from gcs_web.protocol.view import Cursor, Selection, ViewScales
from gcs_web.vehicle import discovery
from gcs_web.vehicle.foreign import NewFlyer
from gcs_web.vehicle.foreign_watch import ForeignWatch
from gcs_web.vehicle.vehicle_watch import VehicleWatch
from gcs_web.vehicle.watch import Watch
from gcs_web.view3d import View3D

if TYPE_CHECKING:
    import viser

logger = logging.getLogger(__name__)

_DRAGGER = Person("3d", "3D view")
"""Author of what is dragged in the 3D view: viser does not say whose browser it was."""


class GroundStation:
    """A running ground station; use as a context manager. `url` lets one browser in; then there is a new one."""

    def __init__(
        self,
        folder: Path,
        *,
        port: int = 0,
        host: str = gateway.LOOPBACK,
        tls: tuple[Path, Path] | None = None,
        vehicle_url: str | None = None,
        key_file: Path | None = None,
        options: planner.PlanOptions | None = None,
        triangles: int = display_mesh.DISPLAY_TRIANGLES,
        progress: Progress = silent,
        on_entry: Callable[[str], None] = lambda _: None,
        jobs: Sequence[Kind[Desk]] = (),
        browsers: Sequence[tuple[str, float]] = (),
        on_open: Callable[[Path], None] | None = None,
        opened_before: Callable[[], Sequence[Path]] = list,
        foreign: NewFlyer = lambda *_: None,
    ) -> None:
        """Open the project and listen, on loopback unless told otherwise.

        Args:
            folder: the project.
            port: of the gateway; 0 lets the system choose.
            host: name or address to listen at; another one than loopback needs `tls`.
            tls: certificate and its key, PEM.
            vehicle_url: where the vehicle answers (`udp:HOST:PORT`), or None to work without one; one that does not
                answer yet is waited for.
            key_file: the link's signing key.
            options: what the planner is asked for, beside what the document says.
            triangles: of the mesh as it is shown first; see `display_mesh`.
            on_entry: called with the next address when a browser has come in.
            jobs: kinds of background work that the page offers.
            browsers: those that came in to a station of another project which had this port before, and stay in; who
                came in to this project's stays in for `entrants.LIFE_S`.
            on_open: called with the folder of the project that somebody wants instead of this one; whoever started the
                station closes it then and opens another. None: the page says that it cannot.
            opened_before: folders of projects that the page offers beside the neighbours, on loopback only: whoever is
                let in from elsewhere is let into the neighbours only.
            foreign: flies a vehicle of other firmware at an address; None of one that is our controller's.

        Raises:
            FlightError: the project cannot be opened, or is open in another ground station.
            InputError: the port is taken, or the certificate is not good for `host`.
        """
        if tls is None and not is_loopback(host):
            raise InputError(f"{host} can be reached from other machines: give --tls-cert and --tls-key, or no --host")
        self._foreign = foreign
        self._host, self._tls = host, None if tls is None else context(*tls, host)
        logging.getLogger("websockets").setLevel(logging.ERROR)  # viser's HTTP half logs each page load as an error
        self._key_file, self._opened_before = key_file, opened_before if is_loopback(host) else list
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="gateway", daemon=True)
        self._stack = contextlib.ExitStack()
        self._ended = 0
        try:
            progress("opening the map", 0.0)
            self._open(folder, port, options or planner.PlanOptions(), triangles, on_entry, jobs, progress, browsers)
            self.desk.on_open = on_open
            self.desk.invitation, self.desk.end_invitation = self._invitation, self._end_invitation
            self.desk.find_vehicles = partial(discovery.look, key_file)
            if vehicle_url is not None:
                self.desk.listen_to(vehicle_url)
        except BaseException:
            self._close_after_error()
            raise

    @property
    def url(self) -> str:
        return self._gateway.url

    @property
    def watch(self) -> VehicleWatch:
        """Of the vehicle of ours that is connected."""
        assert isinstance(self.desk.watch, VehicleWatch)
        return self.desk.watch

    @property
    def port(self) -> int:
        return self._gateway.port

    @property
    def browsers(self) -> Sequence[tuple[str, float]]:
        return self._entrants.known

    def close(self) -> None:
        self._stack.close()

    def __enter__(self) -> "GroundStation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._close_after_error()

    def _close_after_error(self) -> None:
        """Close; what fails of it is logged, so that the error which led here is the one that is seen."""
        try:
            self.close()
        except Exception as error:
            logger.error("the ground station was not closed properly: %r", error)

    def _open(
        self,
        folder: Path,
        port: int,
        options: planner.PlanOptions,
        triangles: int,
        on_entry: Callable[[str], None],
        jobs: Sequence[Kind[Desk]],
        progress: Progress,
        browsers: Sequence[tuple[str, float]],
    ) -> None:
        opened = project.open_project(folder)
        self._thread.start()
        self._stack.callback(self._stop_loop)
        self.server = _viser()
        self._stack.callback(_quietly, self.server.stop)
        self.hub = Hub(self._loop)
        self.view = View3D(self.server, triangles=triangles, cache=folder / ".session", progress=progress)
        self._stack.callback(self.view.close)
        consent = Consent(opened)
        self._stack.callback(consent.close)
        self.desk = Desk(
            opened,
            self.hub,
            self.view,
            self._new_watch,
            options,
            jobs,
            consent=consent,
            opened_before=self._opened_before,
        )
        self._stack.callback(self.desk.close)
        self.view.on_select = lambda waypoint: self._selected([waypoint])
        self.view.on_box = self._selected
        self.view.on_moment = self._moment_chosen
        self.view.on_scales = lambda heights_m: self.hub.publish(ViewScales(heights_m))
        self.view.on_drag, self.view.on_add, self.view.on_pull = self._dragged, self._added, self.desk.draft
        self.hub.publish(Vehicle("none"))
        self._stack.callback(self.desk.listen_to, "")
        pages = PageSocket(
            self.hub,
            {command: partial(handler, self.desk) for command, handler in HANDLERS.items()},
            project=opened,
            arrived=self.desk.arrived,
            left=self.desk.left,
        )
        self._entrants = Entrants(opened.folder / ".session" / "entrants.json", browsers)
        self._gateway = gateway.Gateway(
            self.server.get_port(),
            serve_page=pages.serve,
            state=self._state,
            incoming=partial(incoming.place, opened),
            share=self.desk.shared,
            report=partial(reports.read, opened),
            data=self.desk.comparing.asked_table,
            host=self._host,
            port=port,
            tls=self._tls,
            entrants=self._entrants,
        )
        self._gateway.on_entry, self._gateway.on_invited = on_entry, self._end_invitation
        self._stack.callback(self._in_loop, self._gateway.stop)
        try:
            self._in_loop(self._gateway.start)
        except OSError as error:
            where = f"port {port}" if self._host == gateway.LOOPBACK else f"port {port} at {self._host}"
            raise InputError(f"{where} cannot be used ({error.strerror}); choose another with --port") from error

    def _new_watch(self, url: str, poses: str) -> Watch:
        """Begins to listen when it is started. Raises as `VehicleWatch`."""
        flyer = self._foreign(url, poses, lambda: self.desk.parts.vehicle(self.desk.inputs))
        if flyer is not None:
            other = ForeignWatch(url, flyer)
            other.on_state, other.on_pose = self._vehicle_changed, self.view.vehicle.move
            other.on_setpoint = self.view.vehicle.aim
            return other
        made = VehicleWatch(url, key_file=self._key_file)
        made.on_state, made.on_pose = self._vehicle_changed, self.view.vehicle.move
        made.on_setpoint, made.plan_start = self.view.vehicle.aim, self.desk.plan_start
        return made

    def _vehicle_changed(self, now: Vehicle) -> None:
        self.hub.publish(now)
        self.view.vehicle.set_armed(now.armed)
        if now.link == "lost":
            self.view.vehicle.lose()

    def _selected(self, waypoints: list[int]) -> None:
        self.view.select(waypoints)
        self.hub.publish(Selection(waypoints))

    def _moment_chosen(self, time_s: float) -> None:
        self.hub.publish(Cursor(time_s))
        self.view.look(time_s)

    def _dragged(self, waypoint: int, position_world_m: FloatArray) -> None:
        x, y, z = (float(value) for value in position_world_m)
        revision = self.desk.session.revision
        self._edit(Move(serial=0, revision=revision, waypoints=[waypoint], x_m=x, y_m=y, z_m=z))
        if self.desk.session.revision == revision:
            self.view.drop_draft()

    def _added(self, after: int | None, position_world_m: FloatArray) -> None:
        x, y, z = (float(value) for value in position_world_m)
        revision = self.desk.session.revision
        self._edit(Insert(serial=0, revision=revision, after=after, x_m=x, y_m=y, z_m=z))

    def _edit(self, edit: Edit) -> None:
        """Make an edit of the 3D view and say what was done."""
        try:
            done = self.desk.session.edit(edit, _DRAGGER.name)
            self.desk.notice(f"{done[:1].upper()}{done[1:]}.", undo=True)
        except (InputError, LinkError) as error:
            self.desk.notice(str(error), level="danger")
            self.view.draw_waypoints(self.desk.session.content.points)

    def _invitation(self) -> tuple[Invitation, bool]:
        import segno

        address, is_new = self._gateway.invite()
        code = ["".join(map(str, row)) for row in segno.make_qr(address, error="m").matrix]
        return Invitation(address, code, is_loopback(self._host), self._gateway.invited_for_s), is_new

    def _end_invitation(self) -> None:
        self._gateway.end_invitation()
        self._ended += 1
        self.hub.publish(InvitationEnded(self._ended))

    def _state(self) -> dict[str, Any]:
        return {
            "document": msgspec.to_builtins(self.desk.session.document()),
            "people": len(self.hub.people),
            "vehicle": msgspec.to_builtins(self.desk.watch.state()) if self.desk.watch else None,
        }

    def _in_loop(self, coroutine: Callable[[], Any]) -> None:
        asyncio.run_coroutine_threadsafe(coroutine(), self._loop).result(timeout=20)

    def _stop_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(timeout=5)


def _viser() -> "viser.ViserServer":
    import viser

    with contextlib.redirect_stdout(io.StringIO()):  # viser prints its own address, which is not for use
        return viser.ViserServer(host=gateway.LOOPBACK, port=_free_port(), verbose=False)


def _quietly(action: Callable[[], object]) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        action()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((gateway.LOOPBACK, 0))
        return int(probe.getsockname()[1])
