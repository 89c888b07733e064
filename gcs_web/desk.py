"""What the panels work with: the session, the newest plan, the vehicle, the 3D view and the people."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

import planner
import vehicle
from flight import FlightError, FloatArray, InputError, TrajectoryFile, Waypoints, trajectory
from flight.mission import Mission
from flight.project import Project
from gcs_web.comparison.comparing import Comparing
from gcs_web.comparison.shown_flights import ShownFlights
from gcs_web.document import missions, projects
from gcs_web.document.document import Content, Settings
from gcs_web.document.map_edits import MapEdit
from gcs_web.document.session import Session
from gcs_web.flights.flights import Flights
from gcs_web.gateway.hub import Hub
from gcs_web.jobs.jobs import Jobs, Kind
from gcs_web.learning.consent import Consent
from gcs_web.learning.learning import Learning
from gcs_web.map.map_desk import MapDesk
from gcs_web.planning import inputs, page_values, planning, preflown, saved, snapping
from gcs_web.protocol import flights as flights_messages
from gcs_web.protocol.consent import EffectFiles
from gcs_web.protocol.jobs import Job
from gcs_web.protocol.people import Invitation, Level, Notice, Person
from gcs_web.protocol.plan import Plan, Preflight
from gcs_web.protocol.projects import Projects
from gcs_web.protocol.trajectories import Files
from gcs_web.protocol.vehicle import FoundVehicle, Vehicle
from gcs_web.protocol.wording import for_page
from gcs_web.vehicle import discovery
from gcs_web.vehicle.control import Control
from gcs_web.vehicle.watch import Watch
from gcs_web.view3d import View3D

_STANDING_M = 0.1
"""Height of a standing vehicle's centre above the floor, which the pilot may correct."""


class Desk:
    """One project on the table. Thread-safe."""

    def __init__(
        self,
        opened: Project,
        hub: Hub,
        view: View3D,
        new_watch: Callable[[str, str], Watch],
        base: planner.PlanOptions,
        kinds: "Sequence[Kind[Desk]]" = (),
        *,
        consent: Consent,
        opened_before: Callable[[], Sequence[Path]] = list,
    ) -> None:
        """
        Args:
            new_watch: of the vehicle at an address, whose poses may arrive at
                another; raises `InputError` where it is none.
            opened_before: folders of projects anywhere, offered beside the neighbours.

        Raises:
            FlightError: the project cannot be opened, or `base` has a method that the page cannot set.
        """
        self.project, self.hub, self.view, self._new_watch = opened, hub, view, new_watch
        self._opened_before = opened_before
        self.find_vehicles: Callable[[], list[FoundVehicle]] = discovery.look
        self.invitation: Callable[[], tuple[Invitation | None, bool]] = lambda: (None, False)
        """The address for another device, as it is now, and whether it is a new one."""
        self.end_invitation: Callable[[], None] = lambda: None
        self.watch: Watch | None = None
        """Of the vehicle that is connected."""
        self.inputs = inputs.signature(opened.folder)
        self.parts = inputs.Parts(opened.folder)
        self.consent = consent
        self.session = Session(opened, _first_settings(base, self._limits()))
        self._base = base
        self.name = "plan"
        """Of the trajectory that the plan would be saved and uploaded as."""
        self.answer: planning.Answer | None = None
        self.preflight = Preflight("none")
        """Of the plan that was checked last."""
        self._as_saved: tuple[Content, TrajectoryFile] | None = None
        """A saved trajectory that was opened, and the document of which it is the plan."""
        self._map_edits: tuple[tuple[MapEdit, ...], str] = ((), "")
        """Those that the inputs' signature and the 3D view have, and why the map on disk lacked some."""
        self.on_open: Callable[[Path], None] | None = None
        """Opens another project in the place of this one; None where whoever started the station cannot."""
        self._lock, self._connecting = threading.RLock(), threading.Lock()
        self.control = Control(opened, hub, self._lock)
        self._planner = planning.PlanningProcess(opened.folder, base, self._planned, self._drafted)
        view.on_draft = hub.publish
        self.map = MapDesk(opened, hub, self.session, view.map, lambda: self.parts.map(self.inputs))
        self.jobs = Jobs(
            opened,
            kinds,
            self.show_jobs,
            lambda kind, result: kind.done(self, result),
            self._job_ended,
            lambda kind, address: kind.beside(self, address) if kind.beside is not None else lambda: None,
            lambda kind: kind.given(self) if kind.given is not None else {},
        )
        self.flights = Flights(opened, self._flights_changed)
        self.comparing = Comparing(opened, self.flights, view.flights)
        self.shown_flights = ShownFlights(hub, self.comparing, view.flights, view.set_plan_aside)
        self.learning = Learning(opened, self.flights)
        self._watch_files = inputs.Watch(opened.folder, opened.waypoints, self._files_changed)
        self.session.on_change(self._document_changed)
        said = self.session.take_notice() or f"{opened.name} opened, revision {self.session.revision}"
        self._document_changed()
        self.show_files()
        self.show_jobs()
        self.show_projects()
        self._notice_with_map(said, level="fact")
        self._draw_map()

    def close(self) -> None:
        self._watch_files.close()
        self.jobs.close()
        self.flights.close()
        self._planner.close()
        self.session.close()

    # --- telling people ---

    def notice(self, text: str, *, level: Level = "fact", undo: bool = False) -> None:
        self.hub.publish(Notice(for_page(text, self.project.folder), level, undo))

    def show_files(self) -> None:
        """List the saved trajectories and flights, with whether each is checked for the inputs as they are now."""
        try:
            hashes = (self.parts.map(self.inputs).hash, vehicle.vehicle_hash(self.parts.vehicle(self.inputs)))
        except FlightError:
            hashes = ("", "")
        listed = [saved.listed(path, hashes) for path in self.project.trajectories()]
        flights = [path.stem for path in self.project.flights()]
        self.hub.publish(Files(listed, flights, saved.aside(self.project), *self._parts_there()))
        self.flights.refresh()

    def _flights_changed(self, now: flights_messages.Flights) -> None:
        self.hub.publish(now)
        self.show_learning()

    def show_learning(self) -> None:
        """The comparison, the diagnosis, the model and its effect files as they are now."""
        self.hub.publish(EffectFiles(self.consent.files()))
        self.hub.publish(self.comparing.state())
        self.hub.publish(self.learning.diagnosis())
        self.hub.publish(self.learning.identification())
        self.hub.publish(self.learning.next_flight())
        if not self.project.has_vehicle:
            return
        try:
            self.hub.publish(self.learning.model())
        except FlightError as error:
            self.notice(str(error), level="danger")

    def vehicle_readable(self) -> None:
        """Somebody agreed to an effect file: plan with it, and show what could not be read before."""
        self._planner.restart()
        self.request_plan(afresh=True)
        self.show_files()
        self.show_learning()

    def _limits(self) -> vehicle.Limits:
        """Of the vehicle; those of any while there is none, or somebody has to agree to an effect file of its own."""
        try:
            return self.parts.vehicle(self.inputs).limits
        except FlightError:
            needs_consent = any(file.needed and not file.agreed for file in self.consent.files())
            if self.project.has_vehicle and not needs_consent:
                raise
            return vehicle.Limits()

    def _parts_there(self) -> tuple[bool, bool]:
        """Whether the project has what a plan is checked against: a map, and a vehicle."""
        return self.project.has_map, self.project.has_vehicle

    def connect(self, url: str, person: Person, poses: str = "") -> None:
        """Listen to the vehicle at an address in the place of the one before; none for an empty address.

        Raises:
            InputError: it is no address, somebody else is in control, or the vehicle of before is armed.
        """
        with self._lock:
            self.control.require_free(but_for=person.id)
            if self.watch is not None and (now := self.watch.state()).armed and now.link != "lost":
                raise InputError("the vehicle is armed; land it and disarm, then connect to another one")
        self.listen_to(url, poses)
        self.notice(f"{person.name} {f'connected to {url}' if url else 'disconnected the vehicle'}.")

    def listen_to(self, url: str, poses: str = "") -> None:
        """As `connect`, whoever is in control. Raises `InputError` if it is no address."""
        new = self._new_watch(url, poses) if url else None
        with self._connecting:  # not `_lock`: the watch that is closed may wait for that
            old, self.watch, self.control.watch = self.watch, None, None
            if old is not None:
                old.close()
            self.hub.publish(Vehicle("none"))
            self.view.vehicle.hide()
            if new is not None:
                self.watch = self.control.watch = new
                new.start()

    def show_projects(self) -> None:
        self.hub.publish(Projects(projects.offered(self.project, self._opened_before())))

    def open_project(self, key: str, person: Person) -> None:
        """Have the station close this project and open one of those that are offered.

        Raises:
            InputError: a vehicle is armed, somebody is in control, a job runs or waits, or it cannot be opened.
        """
        entry, folder = projects.found(self.project, self._opened_before(), key)
        self._leave_for(lambda: folder, entry.name, person)

    def new_project(self, name: str, person: Person) -> None:
        """As `open_project`, of a new one beside this, which is made only if this one can be left."""
        self._leave_for(lambda: projects.create_beside(self.project, name), name.strip(), person)

    def _leave_for(self, other: Callable[[], Path], name: str, person: Person) -> None:
        with self._lock:
            if self.on_open is None:
                raise InputError(f"this station stays with its project; start another one with: goshawk gcs {name}")
            if self.watch is not None and self.watch.state().armed:
                raise InputError("the vehicle is armed; land it and disarm, then open another project")
            self.control.require_free()
            said = "a job runs or waits; wait for it, or cancel it, then open another project"
            if not self.jobs.is_idle:
                raise InputError(said)
            folder = other()
            if not self.jobs.end_if_idle():
                raise InputError(said)
            self.control.is_left, on_open, self.on_open = True, self.on_open, None
        self.notice(f"{person.name} opens {name}; this page follows in a moment.", level="caution")
        on_open(folder)

    def show_jobs(self) -> None:
        self.hub.publish(self.jobs.state())

    def _job_ended(self, job: Job) -> None:
        if job.state != "cancelled":
            failed = job.state == "failed"
            self.notice(f"{job.title}{' failed' if failed else ''}: {job.words}", level="danger" if failed else "fact")
        self.show_files()

    # --- the plan ---

    def request_plan(self, *, afresh: bool = False) -> None:
        """Plan the document as it is now, from scratch or on from the last plan; people see "planning" at once."""
        with self._lock:
            revision, content = self.session.revision, self.session.content
            if behind := self.session.map_edits_behind:
                said = f"Nothing is planned: {behind}, so the map lacks your edit. Make room, then edit again."
                self._show_plan(Plan(revision, "void", said))
                return
            if not all(self._parts_there()):
                lacking = "vehicle" if self.project.has_map else "map"
                self._show_plan(Plan(revision, "none", f"There is no {lacking}, so no path can be checked."))
                return
            few = len(content.points) < 2
            if few:
                sentence = (
                    "Add at least two waypoints: Insert under the table, the key Insert, or a Shift-click on the map."
                )
                self._show_plan(Plan(revision, "none", sentence))
                return
            self._show_plan(Plan(revision, "planning", "Planning and checking ..."))
            if afresh:
                self._as_saved = None
            known = self._as_saved
            opened = known[1] if known is not None and known[0] == content else None
            self._planner.request(planning.Request(revision, content, self.inputs, afresh, opened))

    def open_saved(self, item: TrajectoryFile, author: str) -> None:
        """Take a saved trajectory as it is for the plan of its waypoints, until they change or are planned again."""
        points = Waypoints(item.waypoints_world_m, np.full(len(item.waypoints_world_m), np.nan))
        label = f"waypoints of {item.name} opened"
        self.name = item.name
        self._as_saved = (missions.with_mission(self.session.content, Mission(points)), item)
        self.session.take(points, label, author)

    def draft(self, waypoint: int, position_world_m: FloatArray) -> None:
        """Show what the path would look like with a waypoint (id) there, without changing the document."""
        self._planner.draft(waypoint, position_world_m)

    def _drafted(self, draft: planning.Draft) -> None:
        if draft.shown is not None:
            self.view.draw_draft(draft.shown, draft.path_world_m)

    def checked(self) -> TrajectoryFile:
        """The plan, if it answers the document and the inputs as they are now.

        Raises:
            InputError: there is none; the message says why.
        """
        with self._lock:
            answer = self.answer
            if answer is None or answer.request.revision != self.session.revision:
                raise InputError("there is no checked plan for these waypoints yet; wait for it, then try again")
            if answer.file is None:
                raise InputError(f"there is no plan: {answer.shown.sentence}")
            if inputs.signature(self.project.folder) != answer.request.inputs:
                raise InputError("the map or the vehicle changed since the check; plan again")
            return answer.file

    def plan_start(self) -> FloatArray | None:
        """(3,) where the checked plan begins, in the world; None without one."""
        try:
            return self.checked().trajectory.position([0.0])[0]
        except InputError:
            return None

    def trajectory(self, name: str) -> TrajectoryFile:
        """A saved trajectory; the checked plan for an empty name.

        Raises:
            FlightError: there is none, or it cannot be read.
        """
        if not name:
            return replace(self.checked(), name=self.name)
        return trajectory.load(self.project.trajectory(name))

    def shared(self, name: str) -> tuple[str, str]:
        """A trajectory's name, and one HTML file that shows it. Raises as `trajectory`, or if there is no map."""
        item = self.trajectory(name)
        return item.name, saved.page(item, self.parts.map(self.inputs), self.parts.vehicle(self.inputs))

    def standing_height_m(self, x_m: float, y_m: float, z_m: float) -> float:
        """Height (world z) of the vehicle's centre when it stands on what is below a point.

        Raises:
            InputError: nothing is known below it.
        """
        ground_m = snapping.surface_below(np.array([x_m, y_m, z_m]), self.parts.map(self.inputs).field, _STANDING_M)
        return round(ground_m + _STANDING_M, 2)

    def planned_with(self) -> planner.PlanOptions:
        """What the document asks of the planner, for the vehicle as it is now.

        Raises:
            FlightError: the vehicle cannot be read.
        """
        base = self._base.sized(self.parts.vehicle(self.inputs))
        return replace(base, margin_m=self.session.content.settings.margin_m)

    def _planned(self, answer: planning.Answer) -> None:
        with self._lock:
            if answer.request.revision != self.session.revision:
                return
            if answer.request.inputs != self.inputs:
                self.request_plan()  # the inputs changed while it was planned
                return
            self.answer = answer
            self._show_plan(answer.shown)

    def _show_plan(self, plan: Plan) -> None:
        crc32 = ""
        if self.answer is not None and self.answer.file is not None and plan.state == "checked":
            crc32 = page_values.crc32(replace(self.answer.file, name=self.name))
            self.show_preflight()
        self.hub.publish(msgspec.structs.replace(plan, name=self.name, crc32=crc32))
        self.view.draw_plan(plan.series if plan.state == "checked" else None, is_coming=plan.state == "planning")

    def show_preflight(self) -> None:
        """Of the plan that was checked last: as it is kept now."""
        with self._lock:
            item = None if self.answer is None else self.answer.file
            found = Preflight("none") if item is None else preflown.of(self.project.folder, item)
            if found != self.preflight:
                self.preflight = found
                self.hub.publish(found)
                self.view.draw_flights(found)

    def rename(self, name: str) -> None:
        """Give the plan another name; its CRC, which covers the name, changes with it."""
        with self._lock:
            self.name = name
            if self.answer is not None and self.answer.request.revision == self.session.revision:
                self._show_plan(self.answer.shown)

    def _document_changed(self) -> None:
        self.hub.publish(self.session.document())
        if said := self.session.take_notice():
            self.notice(said, level="caution")
        self._take_map_edits()
        self._show_clearance()
        heights_m = [point.position_world_m[2] for point in self.session.content.points]
        self.map.cut(float(np.median(heights_m)) if heights_m else None)
        self.view.draw_waypoints(self.session.content.points)
        self.view.draw_mission(self.session.content.settings)
        self.view.draw_course(self.session.content)
        self.request_plan()

    def _take_map_edits(self) -> None:
        """Where the edits of the map changed, no plan of before is about this map."""
        edits = (self.session.content.map_edits, self.session.map_edits_behind)
        with self._lock:
            if edits == self._map_edits:
                return
            self._map_edits, self.inputs = edits, inputs.signature(self.project.folder)
        self.view.map.draw_edits(edits[0])
        self._draw_map()
        self.show_files()

    def _show_clearance(self) -> None:
        try:
            clearance_m = self.planned_with().clearance_m
        except FlightError:
            return  # said with the plan; what was shown stays
        self.view.require_clearance(clearance_m)

    def _files_changed(self) -> None:
        try:
            for name in self.session.take_files():  # not under our lock: an edit takes the session's, then ours
                self.notice(f"{name} was changed by another program", level="caution", undo=True)
        except FlightError as error:
            self.notice(str(error), level="danger")
        with self._lock:
            now = inputs.signature(self.project.folder)
            if now == self.inputs:
                return
            self.inputs = now
            said = "The map or the vehicle changed since the check: this plan is void. Plan again."
            self._show_clearance()
            if self.answer is not None and all(self._parts_there()):
                self._show_plan(Plan(self.session.revision, "void", said))
            else:  # nothing was ever checked, or nothing can be
                self.request_plan()
                said = "The map or the vehicle changed."
        self._notice_with_map(said, level="caution")
        self._draw_map()  # takes seconds for a large mesh: not under the lock
        self.show_files()

    def _notice_with_map(self, said: str, *, level: Level) -> None:
        """One notice, for who comes in later is shown the last one only."""
        try:
            doubt = inputs.doubt(self.parts.map(self.inputs))
        except FlightError:
            doubt = ""  # said by `_draw_map`
        if doubt:
            said, level = f"{said.rstrip('.')}. {doubt}", "caution"
        self.notice(said, level=level)

    def _draw_map(self) -> None:
        if not self.project.has_map:
            self.view.draw_no_map()
            return
        try:
            self.view.draw_map(self.parts.map(self.inputs))
        except FlightError as error:
            self.notice(f"the map cannot be shown: {error}", level="danger")
        self.map.changed()

    def about(self) -> dict[str, object]:
        """Which plan an order given now is about."""
        answer = self.answer
        current = answer is not None and answer.request.revision == self.session.revision
        file = answer.file if answer is not None and current else None
        crc32 = "" if file is None else page_values.crc32(replace(file, name=self.name))
        return {"revision": self.session.revision, "plan": self.name, "crc32": crc32}

    def arrived(self) -> None:
        """Somebody opened the page."""
        self.control.show()
        self.shown_flights.people_changed()

    def left(self, person: Person) -> None:
        """Somebody closed the page: control is free again."""
        self.map.end_preview(person.id)
        self.control.give_up(person)
        self.shown_flights.people_changed()


def _first_settings(base: planner.PlanOptions, limits: vehicle.Limits) -> Settings:
    """Of a document that was never opened."""
    if base.method not in ("fastest", "corridor"):
        raise InputError(f"method is {base.method!r}; the ground station can do fastest or corridor")
    return Settings(
        limits.speed_m_s,
        limits.acceleration_m_s2,
        limits.jerk_m_s3,
        base.margin_m,
        base.yaw,
        base.method,
        heading_rad=base.heading_rad,
        look_at_world_m=base.look_at_world_m,
    )
