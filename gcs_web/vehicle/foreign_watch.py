"""A vehicle of other firmware as the page knows it: looked at on the ground, heard in flight by what flies it.

Nothing is heard of it between the looks: its state says how old the last one is.
"""

import logging
import threading
import time
from collections.abc import Callable

import numpy as np

from firmware_bridge import wire
from firmware_bridge.dialect.generated.messages import Command
from firmware_bridge.offboard.procedure import STEP_S
from flight import FlightError, FlightLog, FloatArray, InputError, LinkError, TrajectoryFile, rotations
from gcs_web.protocol.vehicle import ArmingCheck, Foreign, Held, Vehicle
from gcs_web.protocol.wording import for_page
from gcs_web.vehicle.foreign import Asked, Flyer, Looked, Seen

logger = logging.getLogger(__name__)

_QUIET_S, _FLYING_S = 0.25, 0.05
_SILENT_S = 0.5
"""Without a word of a flight that is under way, it is stale."""
_RETRY_S = 5.0
_PAUSES = f"pauses of {STEP_S:.0f} s in all end the flight: it lands where it stands"
_GROUND, _STARTS, _UNKNOWN = "disarmed", "starting", "not known"
_KILLED_S = 1.5
"""In which whatever flies it says that the rotors are told to stand still."""


class ForeignWatch:
    """A `Watch`. `on_state`, `on_pose` and `on_setpoint` are called from threads of this object."""

    def __init__(self, url: str, flyer: Flyer) -> None:
        self.url = url
        self._flyer = flyer
        self._looked: Looked | None = None
        self._looked_s = -np.inf
        self._problem = ""
        self._asked: Asked | None = None
        """Of the flight that is under way; None on the ground."""
        self._flown: TrajectoryFile | None = None
        self._seen: Seen | None = None
        self._seen_s = -np.inf
        self._armed: bool | None = None
        """On the ground, by what was heard last; None: not known."""
        self._ended, self._logged = threading.Event(), False
        """The flight's end; whether it came by itself, with a log."""
        self._said = ""
        self._largest_error_m: float | None = None
        self._room_m: float | None = None
        self._lock, self._busy = threading.Lock(), threading.Lock()
        """Of `_asked`; and held while the flyer is looked at or flies."""
        self._stop, self._look_now = threading.Event(), threading.Event()
        self.on_state: Callable[[Vehicle], None] = lambda _: None
        self.on_pose: Callable[[FloatArray, FloatArray], None] = lambda _p, _q: None
        self.on_setpoint: Callable[[FloatArray | None], None] = lambda _: None
        self._looking = threading.Thread(target=self._look, name="look at a vehicle", daemon=True)
        self._telling = threading.Thread(target=self._tell, name="vehicle watch", daemon=True)

    def start(self) -> None:
        self._looking.start()
        self._telling.start()

    def close(self) -> None:
        if (asked := self._asked) is not None:
            asked.land.set()
        self._stop.set()
        self._look_now.set()
        self._telling.join(timeout=5)

    # --- what the page shows ---

    def state(self) -> Vehicle:
        looked = self._looked
        if looked is None:
            return Vehicle("lost", name=self.url, reason=self._problem or "Reading its settings.")
        foreign = Foreign(looked.firmware, list(looked.failsafes), self._flyer.can_pause, looked.kill)
        seen = self._seen if self._flown is not None else None
        if seen is None:
            waits = self._flown is not None
            mission = _STARTS if waits else _UNKNOWN if self._armed is None else "armed" if self._armed else _GROUND
            checks = [
                ArmingCheck(each.name, each.passed, each.finding, for_page(each.remedy)) for each in looked.checks
            ]
            return Vehicle(
                "stale", name=self.url, mission=mission, armed=bool(self._armed), foreign=foreign,
                age_s=self._age_s(self._looked_s), checks=[] if waits else checks,
                reason=self._said or self._problem,
            )  # fmt: skip
        return self._in_flight(seen, foreign)

    def _in_flight(self, seen: Seen, foreign: Foreign) -> Vehicle:
        assert self._flown is not None
        x_m, y_m, z_m = (float(value) for value in seen.position_world_m)
        age_s = self._age_s(self._seen_s)
        return Vehicle(
            "fresh" if age_s < _SILENT_S else "stale",
            name=self.url,
            age_s=age_s,
            mission=seen.mission,
            armed=seen.armed,
            battery_v=seen.battery_v or None,
            x_m=x_m,
            y_m=y_m,
            z_m=z_m,
            yaw_rad=float(rotations.yaw(seen.q_world_body)),
            speed_m_s=float(np.linalg.norm(seen.velocity_world_m_s)),
            error_m=self._error_m(seen),
            largest_error_m=self._largest_error_m,
            along_s=seen.along_s,
            duration_s=self._flown.trajectory.duration_s,
            room_m=self._room_m,
            foreign=foreign,
            reason=_PAUSES if seen.mission == "paused" else self._said,
        )

    @staticmethod
    def _age_s(since_s: float) -> float:
        return round(time.monotonic() - since_s, 2)

    def _setpoint(self, seen: Seen) -> FloatArray | None:
        """(4,) x, y, z, yaw; None off the trajectory."""
        if self._flown is None or seen.along_s is None:
            return None
        way = self._flown.trajectory
        return way.evaluate([min(seen.along_s, way.duration_s)])[0]

    def _error_m(self, seen: Seen) -> float | None:
        wanted = self._setpoint(seen)
        return None if wanted is None else float(np.linalg.norm(seen.position_world_m - wanted[:3]))

    def _tell(self) -> None:
        while not self._stop.wait(_QUIET_S if self._flown is None else _FLYING_S):
            try:
                self.on_state(self.state())
                if (seen := self._seen) is not None:
                    self.on_pose(seen.position_world_m, seen.q_world_body)
                    self.on_setpoint(self._setpoint(seen))
            except Exception:
                logger.exception("the vehicle's state could not be shown")

    # --- on the ground ---

    def look_again(self) -> None:
        if self._flown is not None:
            raise LinkError("it flies; what was read before the flight stands")
        self._look_now.set()

    def _look(self) -> None:
        while not self._stop.is_set():
            self._look_now.clear()
            if self._flown is None:
                self._look_once()
            self._look_now.wait(None if self._looked is not None else _RETRY_S)

    def _look_once(self) -> None:
        with self._busy:
            try:
                self._looked, self._problem = self._flyer.look(), ""
                self._looked_s, self._armed = time.monotonic(), self._looked.armed
            except FlightError as error:
                self._looked, self._problem = None, for_page(str(error))
            except Exception:
                logger.exception("a vehicle could not be read")
                self._looked, self._problem = None, "its settings could not be read; see the log"

    def require_fit(self) -> None:
        if self._looked is None:
            raise LinkError(self._problem or "its settings are being read; wait a moment")
        failed = [str(each) for each in self._looked.checks if not each.passed]
        if failed:
            raise LinkError(for_page(f"not armed. {'. '.join(failed)}"))

    def held(self) -> Held | None:
        return None

    def planned(self, file: TrajectoryFile, name: str) -> Held:
        raise InputError("nothing is uploaded to this vehicle: the station flies it, or hands it the plan as it starts")

    def require_held(self, file: TrajectoryFile, name: str) -> None:
        """It holds no plan of ours on the ground."""

    def upload(self, file: TrajectoryFile, name: str, *, map_hash: str, vehicle_hash: str) -> str:
        raise InputError("nothing is uploaded to this vehicle: start the flight")

    def parameters(self) -> dict[str, float]:
        raise InputError("this vehicle flies by other firmware: what is learnt is not set in it")

    def set_parameters(self, values: dict[str, float]) -> None:
        self.parameters()

    # --- in flight ---

    def begin_flight(self) -> threading.Event:
        with self._lock:
            if self._asked is not None:
                raise LinkError("a flight is under way; land first")
            self._asked = Asked()
            self._ended.clear()
            self._logged = False
            return self._asked.land

    def end_flight(self) -> None:
        """What it is afterwards is looked at anew."""
        flew = self._flown is not None
        self._asked = self._flown = self._seen = None
        self._ended.set()
        self.on_setpoint(None)
        if flew:
            self._look_now.set()

    def fly(
        self, file: TrajectoryFile, aborted: threading.Event, ended_early: Callable[[FlightLog], None]
    ) -> FlightLog:
        asked = self._asked
        assert asked is not None
        assert asked.land is aborted
        if aborted.is_set():
            raise LinkError("aborted before the take-off")
        self._room_m = wire.plan_from_file(file).clearance_m or None  # 0: not known
        self._largest_error_m, self._seen, self._flown = 0.0, None, file
        with self._busy:
            try:
                log, early = self._flyer.fly(file, asked, self._told, self._progress)
                self._logged = True
            finally:
                self._armed = self._armed if self._seen is None else False if not self._seen.armed else None
        if early:
            ended_early(log)
            raise LinkError(early)
        self._said = "landed"
        return log

    def _told(self, seen: Seen) -> None:
        """Called by the flight, which nothing here may hold up or end: `_tell` draws it."""
        self._seen, self._seen_s = seen, time.monotonic()
        if (error_m := self._error_m(seen)) is not None:
            self._largest_error_m = max(self._largest_error_m or 0.0, error_m)

    def _progress(self, stage: str, fraction: float) -> None:
        self._said = for_page(stage)

    def order(self, command: Command) -> None:
        asked = self._asked
        if asked is None or self._flown is None:
            raise LinkError("it is armed as its flight begins, and nothing flies now")
        if command is Command.LAND:
            asked.land.set()
        elif command in (Command.PAUSE, Command.RESUME):
            if not self._flyer.can_pause:
                raise LinkError("this firmware flies its trajectory to the end: Land or Abort ends it")
            asked.pause.set() if command is Command.PAUSE else asked.pause.clear()
        else:
            raise LinkError("it disarms itself when it has landed")

    def land(self) -> None:
        if (asked := self._asked) is None:
            raise LinkError("no flight of this station is under way; there is nothing to abort")
        asked.land.set()

    def kill(self) -> None:
        if (asked := self._asked) is None:
            raise LinkError("no flight of this station is under way: stop it by its own radio")
        asked.kill.set()
        asked.land.set()
        end_s = time.monotonic() + _KILLED_S
        while not self._is_down():
            if self._ended.wait(_FLYING_S) or time.monotonic() > end_s:
                if self._logged:
                    return
                what = self._seen.mission if self._seen is not None else _STARTS
                raise LinkError(f"Kill is sent, but not confirmed after {_KILLED_S:g} s: {what}; use its own radio")

    def _is_down(self) -> bool:
        return self._logged or ((seen := self._seen) is not None and seen.down)
