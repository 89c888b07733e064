"""The pilot's page: viser's scene and controls wired to the session and, if there is one, to the vehicle."""

import logging
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flight import FlightError, Progress, silent
from gcs_web import scene
from gcs_web.session import Session
from gcs_web.vehicle_watch import VehicleWatch

if TYPE_CHECKING:
    import viser

logger = logging.getLogger(__name__)


class Page:
    """Draws the session into a viser server and turns the pilot's gestures into changes of the session."""

    def __init__(
        self,
        server: "viser.ViserServer",
        session: Session,
        watch: VehicleWatch | None,
        *,
        triangles: int = scene.DISPLAY_TRIANGLES,
        required_clearance_m: float,
        progress: Progress = silent,
    ) -> None:
        self._server = server
        self._session = session
        self._watch = watch
        self._required_m = required_clearance_m
        self._drawing = threading.RLock()
        self._gizmos: list[Any] = []
        self._path: Any = None
        self._message = ""
        server.gui.configure_theme(
            dark_mode=True, show_share_button=False, show_logo=False, control_layout="fixed", control_width="medium"
        )
        server.gui.set_panel_label(f"Goshawk · {session.project.name}")
        server.scene.set_up_direction("+z")
        mesh = scene.display_mesh(session.map.mesh, triangles, progress=progress)
        server.scene.add_mesh_trimesh("/map", mesh, cast_shadow=False)
        self.vehicle_frame = scene.draw_vehicle(server)
        self._build_controls()
        self._place_camera()
        session.on_change(self._refresh)
        if watch is not None:
            watch.on_change(self._show_vehicle)
        self._refresh()

    # --- controls ---

    def _build_controls(self) -> None:
        gui = self._server.gui
        self._status = gui.add_markdown("")
        with gui.add_folder("Waypoints"):
            self._selected = gui.add_slider("number", min=0, max=1, step=1, initial_value=0)
            self._button("Insert after", self._insert, color="gray")
            self._button("Delete", lambda: self._session.delete(self._number()), color="gray")
            self._button("Undo", self._session.undo, color="gray")
            self._button("Redo", self._session.redo, color="gray")
        with gui.add_folder("Trajectory"):
            self._name = gui.add_text("name", initial_value="plan")
            self._button("Save", self._save)
            self._upload = self._button("Upload ...", self._ask_upload, disabled=True)
        field = self._session.map.field
        bottom = float(np.asarray(field.grid.origin_world_m)[2])
        top = bottom + field.grid.shape[2] * float(np.broadcast_to(field.grid.voxel_m, (3,))[2])
        with gui.add_folder("Distance field"):
            self._show_slice = gui.add_checkbox("show slice", initial_value=True)
            start = float(np.clip(self._flight_height_m(), bottom, top))
            self._height = gui.add_slider("height (m)", min=round(bottom, 1), max=top, step=0.1, initial_value=start)
            self._show_slice.on_update(lambda _: self._draw_slice())
            self._height.on_update(lambda _: self._draw_slice())
            gui.add_markdown(f"red: below {self._required_m:.2f} m · green: {self._required_m + 0.7:.2f} m and more")
        self._draw_slice()

    def _button(
        self, label: str, action: Callable[[], Any], *, color: Literal["gray"] | None = None, disabled: bool = False
    ) -> Any:
        """A button whose refusals are shown to the pilot in words."""
        button = self._server.gui.add_button(label, color=color, disabled=disabled)

        @button.on_click
        def _(_event: Any) -> None:
            self._attempt(action)

        return button

    def _attempt(self, action: Callable[[], Any]) -> None:
        try:
            self._message = ""
            action()
        except FlightError as error:
            self._message = str(error)
        self._refresh()

    def _number(self) -> int:
        """The selected waypoint; the slider may still show one that was deleted."""
        return min(int(self._selected.value), len(self._session.positions_world_m) - 1)

    def _insert(self) -> None:
        index, positions = self._number(), self._session.positions_world_m
        if not len(positions):
            self._session.insert(0, self._session.map.T_world_body[0, :3, 3])  # the first picture was taken there
            return
        after = positions[min(index + 1, len(positions) - 1)]
        step = after - positions[index] if index + 1 < len(positions) else np.array([1.0, 0.0, 0.0])
        self._session.insert(index + 1, positions[index] + 0.5 * step)

    # --- what replaces something is shown first and done on a second press ---

    def _save(self) -> None:
        name = self._name.value
        replaced = self._session.would_replace(name)
        if replaced is None:
            self._do_save(name, overwrite=False)
            return
        words = self._replaces(replaced)
        self._confirm("Replace this trajectory?", words, "Replace", lambda: self._do_save(name, overwrite=True))

    def _do_save(self, name: str, *, overwrite: bool) -> None:
        saved = self._session.save_trajectory(name, overwrite=overwrite)
        kept = f"; the one before is kept as {saved.kept.name}" if saved.kept else ""
        self._message = f"saved as {saved.path.relative_to(self._session.project.folder)}{kept}"

    def _ask_upload(self) -> None:
        plan, name = self._session.plan, self._name.value
        if self._watch is None or plan is None or plan.file is None:
            return
        replaced = self._session.would_replace(name)
        facts = (
            f"**{plain(name)}**: {plan.file.trajectory.duration_s:.1f} s, "
            f"{len(plan.file.trajectory.durations_s)} segments, clearance {np.min(plan.clearance_m):.2f} m.\n\n"
            f"To {plain(self._watch.describe())}. It replaces what the vehicle holds; nothing moves before "
            f"`goshawk fly`.\n\n{self._replaces(replaced) if replaced else ''}"
        )
        overwrite = replaced is not None
        self._confirm("Upload this trajectory?", facts, "Upload", lambda: self._do_upload(name, overwrite=overwrite))

    def _replaces(self, path: Path) -> str:
        return f"Another trajectory is saved as **{plain(path.name)}**; it will be kept beside the new one."

    def _confirm(self, question: str, facts: str, yes_label: str, action: Callable[[], None]) -> None:
        modal = self._server.gui.add_modal(question)
        with modal:
            self._server.gui.add_markdown(facts)
            yes = self._server.gui.add_button(yes_label)
            no = self._server.gui.add_button("Cancel")
        no.on_click(lambda _: modal.close())

        @yes.on_click
        def _(_event: Any) -> None:
            modal.close()
            self._attempt(action)

    def _do_upload(self, name: str, *, overwrite: bool) -> None:
        assert self._watch is not None
        plan = self._session.plan
        if plan is None or plan.file is None:
            self._message = "the waypoints changed meanwhile; wait for the new plan"
            return
        self._session.save_trajectory(name, overwrite=overwrite)
        self._message = self._watch.upload(plan.file, name, map_hash=self._session.map.hash)

    # --- drawing ---

    def _refresh(self) -> None:
        with self._drawing:
            self._draw_waypoints()
            self._draw_plan()
            self._status.content = self._summary()
            plan = self._session.plan
            self._upload.disabled = self._watch is None or plan is None or plan.file is None

    def _draw_waypoints(self) -> None:
        positions = self._session.positions_world_m
        if len(self._gizmos) != len(positions):
            for gizmo in self._gizmos:
                gizmo.remove()
            self._gizmos = [self._add_gizmo(i) for i in range(len(positions))]
            self._selected.max = max(1, len(positions) - 1)
        for gizmo, position in zip(self._gizmos, positions, strict=True):
            if not np.allclose(gizmo.position, position, atol=1e-9):
                gizmo.position = tuple(position)

    def _add_gizmo(self, index: int) -> Any:
        position = tuple(self._session.positions_world_m[index])
        name = f"/waypoint_{index}"
        gizmo = self._server.scene.add_transform_controls(
            name, scale=self._gizmo_scale(), disable_rotations=True, depth_test=False, position=position
        )
        self._server.scene.add_icosphere(f"{name}/ball", radius=0.07, color=(38, 139, 210), cast_shadow=False)
        self._server.scene.add_label(f"{name}/label", str(index))

        @gizmo.on_update
        def _(event: Any) -> None:
            if event.phase == "end":
                target = np.array(event.target.position, dtype=np.float64)
                self._attempt(lambda: self._session.move(index, target))

        return gizmo

    def _gizmo_scale(self) -> float:
        """Large enough to grab, small enough not to hide a path with many waypoints."""
        positions = self._session.positions_world_m
        spacing = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        return float(np.clip(0.5 * np.median(spacing), 0.3, 0.6)) if len(spacing) else 0.6

    def _flight_height_m(self) -> float:
        """Where the slice starts: at the height of the waypoints."""
        positions = self._session.positions_world_m
        return float(np.round(np.median(positions[:, 2]), 1)) if len(positions) else 1.2

    def _draw_plan(self) -> None:
        plan = self._session.plan
        if self._path is not None:
            self._path.remove()
            self._path = None
        if plan is not None and plan.file is not None:
            colours = scene.clearance_colours(plan.clearance_m, self._required_m, self._required_m + 0.7)
            self._path = scene.draw_path(self._server, plan.positions_world_m, colours)

    def _draw_slice(self) -> None:
        with self._drawing:
            if not self._show_slice.value:
                self._server.scene.remove_by_name("/esdf_slice")
                return
            scene.draw_slice(self._server, self._session.map.field, float(self._height.value), self._required_m)

    def _summary(self) -> str:
        plan, state = self._session.plan, self._session.state()
        if state["planning"]:
            line = "planning ..."
        elif plan is None or plan.file is None:
            line = f"**no plan:** {plain(plan.problem) if plan else 'drag a waypoint to begin'}"
        else:
            file = plan.file
            line = (
                f"**checked:** {file.trajectory.duration_s:.2f} s through {len(state['waypoints_world_m'])} waypoints, "
                f"clearance {np.min(plan.clearance_m):.2f} m"
            )
        vehicle = plain(self._watch.describe()) if self._watch else "none (start with --vehicle-url)"
        return "\n\n".join(part for part in (line, f"vehicle: {vehicle}", plain(self._message)) if part)

    def _show_vehicle(self) -> None:
        assert self._watch is not None
        pose = self._watch.pose
        if pose is not None:
            with self._server.atomic():
                self.vehicle_frame.position, self.vehicle_frame.wxyz = tuple(pose[0]), tuple(pose[1])
                self.vehicle_frame.visible = True

    def _place_camera(self) -> None:
        """Look at the waypoints (or the map) from behind and above, high enough to see over the walls."""
        positions = self._session.positions_world_m
        grid = self._session.map.field.grid
        low = np.asarray(grid.origin_world_m)
        high = low + np.asarray(grid.shape) * np.broadcast_to(grid.voxel_m, (3,))
        target = positions.mean(axis=0) if len(positions) else (low + high) / 2
        reach = float(np.linalg.norm((high - low)[:2]))

        @self._server.on_client_connect
        def _(client: Any) -> None:
            client.camera.position = tuple(target + np.array([-0.27, -0.37, 0.54]) * reach)
            client.camera.look_at = tuple(target)


def plain(text: str) -> str:
    """Text that the page's Markdown shows as it is: names come from files and from the vehicle."""
    return re.sub(r"[^\w\s.,:;()/+-]", lambda found: f"&#{ord(found[0])};", text)
