"""The vehicle as the page knows it: what it said last and how long ago, and how orders get to it.

Listens as one station of the link and takes control only for as long as a person of the page has it.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

import firmware_bridge
from firmware_bridge import port, wire
from firmware_bridge.dialect.generated.messages import Command
from flight import FlightError, FlightLog, FloatArray, InputError, LinkError, TrajectoryFile, rotations
from gcs_web.planning import page_values
from gcs_web.protocol.vehicle import ArmingCheck, Held, Vehicle
from gcs_web.protocol.wording import for_page
from gcs_web.vehicle import link_loss
from gcs_web.vehicle.discharge import Discharge

logger = logging.getLogger(__name__)

STALE_S, LOST_S = 0.5, 2.0
_PERIOD_S = 0.05
_QUIET_S = 0.25
"""A state that has not changed is told again after this long, for its age."""
_FLYING_S = 0.05
"""On a trajectory, for the cursor that runs with it."""
_RETRY_S = 2.0
"""Between attempts to reach a vehicle that does not answer."""
_GROUND = ("disarmed", "armed")
_NOT_LIFTED = (*_GROUND, "take off")


class VehicleWatch:
    """`on_state` and `on_pose` are called from a thread of this object."""

    def __init__(self, url: str, *, key_file: Path | None = None) -> None:
        """
        Raises:
            InputError: `url` is no address of a vehicle; one that does not answer yet is waited for.
        """
        port.parse_url(url)
        self.url = url
        self._key_file = key_file
        self._link: firmware_bridge.Link | None = None
        self._problem = ""
        self._largest_error_m: float | None = None
        self._flown: TrajectoryFile | None = None
        self._room_m: float | None = None
        self._discharge = Discharge()
        self._policy: wire.LinkLoss | None = None
        """Of what is flown, if this station started it."""
        self.on_state: Callable[[Vehicle], None] = lambda _: None
        self.on_pose: Callable[[FloatArray, FloatArray], None] = lambda _p, _q: None
        self.on_setpoint: Callable[[FloatArray | None], None] = lambda _: None
        """Where a flight of this station has the vehicle now: (4,) x, y, z in metres and yaw in radians, world."""
        self.plan_start: Callable[[], FloatArray | None] = lambda: None
        """(3,) where the plan that is shown begins; None without a checked one."""
        self._parameters: dict[str, float] = {}
        self._stop = threading.Event()
        self._flight: threading.Event | None = None
        """Set to give up the flight that is under way; None on the ground."""
        self._flight_lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="vehicle watch", daemon=True)

    def start(self) -> None:
        self._thread.start()

    @property
    def link(self) -> firmware_bridge.Link:
        """
        Raises:
            LinkError: the vehicle has not been heard yet.
        """
        if self._link is None:
            raise LinkError(self._problem or f"no vehicle answers at {self.url} yet")
        return self._link

    def state(self) -> Vehicle:
        """What the page shows of the vehicle."""
        return self._with_checks(self._heard())

    def _heard(self) -> Vehicle:
        """The state without the arming checks, which read the plan and its files."""
        said = self._link.state if self._link is not None else None
        if said is None:
            return Vehicle("lost", name=self.url, reason=self._problem)
        link = "fresh" if said.age_s <= STALE_S else "stale" if said.age_s <= LOST_S else "lost"
        mission = said.mission.name.lower().replace("_", " ")
        x, y, z = (float(value) for value in said.position_world_m)
        error_m = self._error_m(said)
        return Vehicle(
            link,
            name=self.url,
            age_s=round(said.age_s, 2),
            mission=mission,
            armed=mission != "disarmed",
            holds=said.active_name,
            holds_crc32=f"{said.active_crc32:08x}" if said.active_name else "",
            battery_v=said.battery_v or None,
            x_m=x,
            y_m=y,
            z_m=z,
            error_m=error_m,
            largest_error_m=self._largest_error_m,
            room_m=None if self._flown is None else self._room_m,
            yaw_rad=float(rotations.yaw(said.q_world_body)),
            battery_left_s=self._battery_left_s(),
            speed_m_s=float(np.linalg.norm(said.velocity_world_m_s)),
            along_s=said.trajectory_time_s if said.trajectory_time_s >= 0.0 else None,
            duration_s=None if self._flown is None else self._flown.trajectory.duration_s,
            if_link_lost=link_loss.acts(mission, self._policy, self._parameters),
            reason=said.reason,
        )

    def _with_checks(self, heard: Vehicle) -> Vehicle:
        if heard.mission not in _GROUND or heard.link != "fresh" or not self._parameters:
            return heard
        found = self.link.arming_checks(self._parameters, self.plan_start())
        checks = [ArmingCheck(each.name, each.passed, each.finding, each.remedy) for each in found]
        return msgspec.structs.replace(heard, checks=checks)

    def require_fit(self) -> None:
        """
        Raises:
            LinkError: the vehicle is on the ground and not fit to arm for the plan, or does not answer; the message
                says why.
        """
        self._parameters = self.link.parameters()
        failed = [each for each in self.state().checks if not each.passed]
        if failed:
            raise LinkError(f"not armed. {'. '.join(f'{e.name}: {e.finding}; {e.remedy}' for e in failed)}")

    def held(self) -> Held | None:
        """What the vehicle holds, read back from it; None for nothing."""
        plan = self.link.read_back()
        return None if plan is None else page_values.held(plan.name, plan)

    def planned(self, file: TrajectoryFile, name: str) -> Held:
        """What the vehicle would hold after an upload."""
        return page_values.held(name, wire.plan_from_file(replace(file, name=name)))

    def require_held(self, file: TrajectoryFile, name: str) -> None:
        """
        Raises:
            InputError: the vehicle holds another plan, or none.
        """
        wanted, held = self.planned(file, name), self.held()
        if held is None or held.crc32 != wanted.crc32:
            raise InputError(f"the vehicle holds {held.name if held else 'nothing'}, not this plan; upload it first")

    def look_again(self) -> None:
        """It is checked all the time."""

    def upload(self, file: TrajectoryFile, name: str, *, map_hash: str, vehicle_hash: str) -> str:
        """Send, commit, read back; one line on how it went.

        Raises:
            FlightError: it was refused (on either side) or the link died; the message says what the vehicle holds.
        """
        self.link.take_control()
        report = self.link.upload(replace(file, name=name), map_hash=map_hash, vehicle_hash=vehicle_hash)
        return f"uploaded {name}: {report.segments} segments in {report.duration_s:.2f} s, read back and equal"

    def parameters(self) -> dict[str, float]:
        """Those of the controller. Raises `FlightError` where it does not answer."""
        return self.link.parameters()

    def set_parameters(self, values: dict[str, float]) -> None:
        """Set parameters of the controller, all of them or none.

        Raises:
            FlightError: another station has control, the vehicle refused or did not answer, or a name is unknown.
        """
        self.link.take_control()
        self.link.set_parameters(values)
        self._parameters = self.link.parameters()

    def order(self, command: Command) -> None:
        """
        Raises:
            LinkError: the vehicle refused, or did not answer.
        """
        self.link.order(command)

    def begin_flight(self) -> threading.Event:
        """Announce a flight before its preparations, so that an abort during them is not lost; `end_flight` ends it.

        Raises:
            LinkError: one is under way.
        """
        with self._flight_lock:
            if self._flight is not None:
                raise LinkError("a flight is under way; land first")
            self._flight = threading.Event()
            return self._flight

    def end_flight(self) -> None:
        self._flight, self._flown, self._policy = None, None, None

    def fly(
        self, file: TrajectoryFile, aborted: threading.Event, ended_early: Callable[[FlightLog], None]
    ) -> FlightLog:
        """Take off, fly what the vehicle holds, land; the flight's log.

        Args:
            aborted: of `begin_flight`.
            ended_early: is given the log of a flight that is not finished.

        Raises:
            LinkError: refused, aborted, or the flight ended early; the message says which.
        """
        self._flown, self._largest_error_m = file, 0.0
        held = wire.plan_from_file(file)
        self._policy, self._room_m = held.on_link_loss, held.clearance_m or None  # 0: not known
        self.link.take_control()
        if aborted.is_set():
            raise LinkError("aborted before the take-off")
        return self.link.fly(file, cancel=aborted.is_set, ended_early=ended_early)

    def land(self) -> None:
        """Land now, whoever has control; a flight that is under way is given up."""
        flight = self._flight
        if flight is not None:
            flight.set()
        state = self.state()
        if flight is None and state.link == "fresh" and not state.armed:
            raise LinkError("the vehicle is disarmed; there is nothing to abort")
        self.link.order(Command.LAND, force=True)

    def kill(self) -> None:
        """Stop the rotors now, in the air too, whoever has control.

        Raises:
            LinkError: the vehicle did not answer.
        """
        if (flight := self._flight) is not None:
            flight.set()
        self.link.order(Command.KILL, force=True)

    def close(self) -> None:
        if (flight := self._flight) is not None:
            flight.set()
        self._stop.set()
        self._thread.join(timeout=5)
        if self._link is not None:
            self._link.close()

    def _error_m(self, said: firmware_bridge.VehicleState) -> float | None:
        """Distance from the set-point, while a trajectory that this station started is flown."""
        wanted = self._setpoint(said)
        if wanted is None:
            return None
        error_m = float(np.linalg.norm(said.position_world_m - wanted[:3]))
        self._largest_error_m = max(self._largest_error_m or 0.0, error_m)
        return error_m

    def _setpoint(self, said: firmware_bridge.VehicleState) -> FloatArray | None:
        """(4,) x, y, z, yaw of the trajectory that this station started, at the moment that is flown."""
        file = self._flown
        if file is None or said.trajectory_time_s < 0.0:
            return None
        return file.trajectory.evaluate([min(said.trajectory_time_s, file.trajectory.duration_s)])[0]

    def _run(self) -> None:
        told, told_s = Vehicle("none"), 0.0
        while not self._stop.wait(_PERIOD_S):
            try:
                if self._link is None:
                    self._connect()
                now = self._heard()
                said = self._link.state if self._link is not None else None
                if said is not None and now.link == "fresh":
                    self._take_battery(said, now.mission)
                    self.on_pose(said.position_world_m, said.q_world_body)
                    self.on_setpoint(self._setpoint(said))
                quiet_s = _QUIET_S if now.along_s is None else _FLYING_S
                if now != told and (_changed(now, told) or time.monotonic() - told_s > quiet_s):
                    told, told_s = now, time.monotonic()
                    self.on_state(self._with_checks(now))
            except Exception:  # whatever the vehicle says, the watch goes on
                logger.exception("the vehicle's state could not be shown")
                told = Vehicle("lost", name=self.url, reason="its state could not be read; see the log")
                self.on_state(told)

    def _take_battery(self, said: firmware_bridge.VehicleState, mission: str) -> None:
        """Only in the air: it sags as the rotors begin to lift, which says nothing of how fast it empties."""
        self._discharge.take(said.time_s, 0.0 if mission in _NOT_LIFTED else said.battery_v)

    def _battery_left_s(self) -> float | None:
        """Until the controller lands by itself; it is armed with more than that."""
        return self._discharge.left_s(self._parameters.get("battery_land_v", 0.0))

    def _connect(self) -> None:
        try:
            self._link, self._problem = firmware_bridge.connect(self.url, key=self._key_file), ""
        except FlightError as error:
            self._problem = for_page(str(error))
            self._stop.wait(_RETRY_S)
        else:
            threading.Thread(target=self._read_parameters, args=(self._link,), daemon=True).start()

    def _read_parameters(self, link: firmware_bridge.Link) -> None:
        """A vehicle that does not answer is shown all the same; it is asked again before it is armed."""
        try:
            self._parameters = link.parameters()
        except FlightError as error:
            logger.warning("parameters of the vehicle could not be read: %s", error)


def _changed(now: Vehicle, told: Vehicle) -> bool:
    """Whether something changed that a pilot must see at once."""
    names = ("link", "mission", "holds", "holds_crc32", "reason")
    return any(getattr(now, name) != getattr(told, name) for name in names)
