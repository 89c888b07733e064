"""Betaflight, MAVLink autopilots and the Crazyflie as the ground station's page flies them: what `fly --on` does."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import vehicle
from firmware_bridge import arming, controller
from firmware_bridge.autopilot import checks as autopilot_checks
from firmware_bridge.autopilot import line as mavlink_line
from firmware_bridge.controller import Command, State
from firmware_bridge.crazyflie import checks as crazyflie_checks
from firmware_bridge.crazyflie import crtp
from firmware_bridge.crazyflie import flight as crazyflie_flight
from firmware_bridge.crazyflie.client import Client
from firmware_bridge.link import refuse_unfit
from firmware_bridge.offboard import checks as betaflight_checks
from firmware_bridge.offboard import ladder, settings
from firmware_bridge.offboard.poses import Poses
from firmware_bridge.offboard.tracker import Demand, Tracker
from flight import FlightLog, FloatArray, Progress, TrajectoryFile
from gcs_web.protocol.vehicle import Failsafe
from gcs_web.vehicle.foreign import Asked, Flyer, Looked, Seen
from goshawk.commands.fly import autopilot, crazyflie, offboard
from vehicle import Vehicle

POSES = "udp://127.0.0.1:7777"
_TELL_S = 0.05
_ON_PATH = (State.TRAJECTORY, State.PAUSING, State.PAUSED, State.STOPPING)
_CRAZYFLIE_ALONE = "it flies its trajectory to the end, and hovers there until its battery is empty"
_GUARD = "Goshawk's guard"
Told = Callable[[Seen], None]


def flyer(address: str, poses: str, model_of: Callable[[], Vehicle]) -> Flyer | None:
    """A `gcs_web.vehicle.foreign.NewFlyer`."""
    if address.startswith(crtp.PREFIX):
        crtp.endpoint(address)
        return CrazyflieFlyer(address, model_of)
    of_mavlink = address.startswith(mavlink_line.PREFIX)
    if not of_mavlink and not address.startswith("betaflight:"):
        return None
    where = offboard.Where(address, *offboard.pose_address(poses or POSES))
    if of_mavlink:
        mavlink_line.parsed(address)
        return AutopilotFlyer(where, model_of)
    return BetaflightFlyer(where, model_of)


class PageTracker(Tracker):
    """Obeys what people ask of a flight under way, and tells where the vehicle is."""

    def __init__(
        self, configuration: controller.Configuration, poses: Poses, start_world_m: FloatArray, asked: Asked,
        told: Told,
    ) -> None:  # fmt: skip
        super().__init__(configuration, poses)
        self._start_world_m, self._asked, self._told = start_world_m, asked, told
        self._killed, self._told_s = False, -np.inf

    @property
    def state(self) -> State:
        """Of one that was killed: disarmed, so that nobody brings it down softly any more."""
        return State.DISARMED if self._killed else super().state

    @property
    def unready(self) -> str:
        return super().unready or self._too_far()

    def tick(self, now_s: float, *, battery_v: float = 0.0) -> Demand | None:
        self._obey()
        demand = super().tick(now_s, battery_v=battery_v)
        if demand is not None and now_s - self._told_s >= _TELL_S:
            self._told_s = now_s
            self._told(self._seen(battery_v))
        return demand

    def _obey(self) -> None:
        if self._asked.kill.is_set() and not self._killed:
            self._killed = True
            self.controller.command(Command.KILL)
        paused, pause = self.state is State.PAUSED, self._asked.pause.is_set()
        if pause and self.state is State.TRAJECTORY:
            self.controller.command(Command.PAUSE)
        elif paused and not pause:
            self.controller.command(Command.RESUME)

    def _too_far(self) -> str:
        """Said before it is armed: no vehicle climbs for a flight that it then refuses."""
        if self.motion is None or self.state is not State.DISARMED:
            return ""
        top_world_m = self.motion.position_world_m.copy()
        top_world_m[2] = max(self._start_world_m[2], top_world_m[2] + arming.LOWEST_TAKE_OFF_M)
        far_m, most_m = (
            float(np.linalg.norm(self._start_world_m - top_world_m)),
            self.controller.parameters()["start_radius_m"],
        )
        if far_m <= most_m:
            return ""
        x_m, y_m = self._start_world_m[:2]
        return f"the plan begins {far_m:.2f} m from it, at most {most_m:.2f}: put it at x {x_m:.2f}, y {y_m:.2f} m"

    def _seen(self, battery_v: float) -> Seen:
        assert self.motion is not None
        telemetry, motion = self.controller.telemetry, self.motion
        along_s = 1e-6 * float(telemetry["path_time_us"]) if self.state in _ON_PATH else None
        return Seen(
            _words(self.state), motion.position_world_m.copy(), motion.velocity_world_m_s.copy(),
            motion.q_world_body.copy(), battery_v, along_s,
        )  # fmt: skip


@dataclass
class BetaflightFlyer:
    """By MSP: sticks at 250 Hz from the guard on this computer."""

    where: offboard.Where
    model_of: Callable[[], Vehicle]
    restarted: Callable[[], object] = lambda: time.sleep(offboard.RESTART_S)
    """Waits until the firmware has started again after its command line."""
    can_pause = True

    def look(self) -> Looked:
        found = offboard.read(self.where)
        self.restarted()
        return Looked(
            found.firmware, offboard.arming_checks(self.model_of(), found), _betaflight_failsafes(found),
            "throttle to nothing, and disarmed where no pilot's switch arms it",
        )  # fmt: skip

    def fly(self, file: TrajectoryFile, asked: Asked, told: Told, progress: Progress) -> tuple[FlightLog, str]:
        model = _fit(self.model_of(), file)
        log, early = offboard.fly(
            model, file, self.where, progress=progress, cancel=asked.land.is_set, restarted=self.restarted,
            tracker=lambda configuration, poses: PageTracker(configuration, poses, _start(file), asked, told),
        )  # fmt: skip
        return _of_course(log, file), early


@dataclass
class AutopilotFlyer:
    """PX4 or ArduPilot by MAVLink: body rates and thrust from the guard on this computer; armed from the page."""

    where: offboard.Where
    model_of: Callable[[], Vehicle]
    can_pause = True

    def look(self) -> Looked:
        found = autopilot.read(self.where)
        name = found.flavour.name
        failsafes = [*_guards(), Failsafe(name, "this computer stops", autopilot_checks.when_we_die(found))]
        return Looked(
            found.firmware, autopilot.arming_checks(self.model_of(), found, self.where, arms=True), failsafes,
            f"no thrust; {name} decides whether it disarms in the air",
        )  # fmt: skip

    def fly(self, file: TrajectoryFile, asked: Asked, told: Told, progress: Progress) -> tuple[FlightLog, str]:
        model = _fit(self.model_of(), file)
        log, early = autopilot.fly(
            model, file, self.where, arms=True, progress=progress, cancel=asked.land.is_set,
            tracker=lambda configuration, poses: PageTracker(configuration, poses, _start(file), asked, told),
        )  # fmt: skip
        return _of_course(log, file), early


@dataclass
class CrazyflieFlyer:
    """Its own commander flies the plan that its memory holds; armed from the page."""

    address: str
    model_of: Callable[[], Vehicle]
    can_pause = False
    """It has no such command."""

    def look(self) -> Looked:
        transport = crazyflie.process.UdpTransport(*crtp.endpoint(self.address))
        try:
            bits = Client(transport).bits()
        finally:
            transport.close()
        failsafes = [
            Failsafe("A process of ours", "this station stops", "it lands where it is"),
            Failsafe("Crazyflie", "this computer or the radio stops", _CRAZYFLIE_ALONE),
        ]
        checked = tuple(crazyflie_checks.supervisor(bits))
        return Looked("Crazyflie", checked, failsafes, "emergency stop: it is locked until it is switched off")

    def fly(self, file: TrajectoryFile, asked: Asked, told: Told, progress: Progress) -> tuple[FlightLog, str]:
        log, early = crazyflie.fly(
            _fit(self.model_of(), file), file, self.address, arms=True, progress=progress, cancel=asked.land.is_set,
            stop=asked.kill.is_set, told=lambda seen: told(_of_crazyflie(seen)),
        )  # fmt: skip
        return _of_course(log, file), early


def _fit(model: Vehicle, file: TrajectoryFile) -> Vehicle:
    refuse_unfit(file, None, vehicle.vehicle_hash(model), False)
    return model


def _start(file: TrajectoryFile) -> FloatArray:
    return file.trajectory.position([0.0])[0]


def _of_course(log: FlightLog, file: TrajectoryFile) -> FlightLog:
    """Says what it flew, as the logs of our controller do."""
    told = {"trajectory": file.name, "map_hash": file.map_hash, "vehicle_hash": file.vehicle_hash}
    return replace(log, metadata={**log.metadata, **told})


def _of_crazyflie(seen: crazyflie_flight.Seen) -> Seen:
    along_s = seen.since_s if seen.state is State.TRAJECTORY else None
    return Seen(
        _words(seen.state), seen.position_world_m, seen.velocity_world_m_s, seen.q_world_body, seen.battery_v, along_s
    )


def _words(state: State) -> str:
    return state.name.lower().replace("_", " ")


def _guards() -> list[Failsafe]:
    return [
        Failsafe(_GUARD, f"this station stops, or is silent for {ladder.PLANNER_SILENT_S:g} s", "it comes down softly"),
        Failsafe(_GUARD, f"no believable pose for {ladder.POSE_STALE_S:g} s", "it comes down softly"),
    ]


def _betaflight_failsafes(found: settings.Settings) -> list[Failsafe]:
    delay_s = 0.1 * found.number("failsafe_delay", 15.0)
    if not betaflight_checks.by_msp_alone(found):
        own = Failsafe("The pilot", "this computer stops", "has the sticks back, by his own receiver")
        return [*_guards(), own, Failsafe("The pilot", "at any time", "takes the sticks back by the override switch")]
    act = f"{found.values.get('failsafe_procedure', 'unknown')}, by failsafe_procedure"
    return [*_guards(), Failsafe("Betaflight", f"this computer stops, after {delay_s:.1f} s", act)]
