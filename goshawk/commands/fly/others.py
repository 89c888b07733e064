"""Betaflight, MAVLink autopilots and the Crazyflie as the ground station's page flies them: what `fly --on` does."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import vehicle
from firmware_bridge import arming, controller
from firmware_bridge.autopilot import checks as autopilot_checks
from firmware_bridge.autopilot import line as mavlink_line
from firmware_bridge.controller import Command, State
from firmware_bridge.crazyflie import checks as crazyflie_checks
from firmware_bridge.crazyflie import crtp
from firmware_bridge.crazyflie import flight as crazyflie_flight
from firmware_bridge.crazyflie.client import Bits, Client
from firmware_bridge.link import refuse_unfit
from firmware_bridge.offboard import byte_line, ladder, settings
from firmware_bridge.offboard import checks as betaflight_checks
from firmware_bridge.offboard.guard_process import GuardProcess
from firmware_bridge.offboard.ladder import Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand
from firmware_bridge.offboard.poses import Poses
from firmware_bridge.offboard.tracker import Demand, Tracker
from firmware_bridge.port import is_loopback
from flight import FlightLog, FloatArray, InputError, Progress, TrajectoryFile
from gcs_web.protocol.vehicle import Failsafe
from gcs_web.vehicle.foreign import Asked, Flyer, Looked, Seen
from goshawk.commands.fly import apart, autopilot, crazyflie, offboard
from vehicle import Vehicle

POSES = "udp://127.0.0.1:7777"
_TELL_S = 0.05
_BY_GUARD = {
    Stage.DESCENDING: "the guard brings it down",
    Stage.PILOT: "the pilot has the sticks",
    Stage.DOWN: "rotors off",
}
"""What it does where the controller is not followed any more."""
_ON_PATH = (State.TRAJECTORY, State.PAUSING, State.PAUSED, State.STOPPING)
_CRAZYFLIE_ALONE = "it flies its trajectory to the end, and hovers there until its battery is empty"
_GUARD = "Goshawk's guard"
_NOT_HIS = "not while the pilot has the sticks"
Told = apart.Told


def flyer(address: str, poses: str, model_of: Callable[[], Vehicle]) -> Flyer | None:
    """A `gcs_web.vehicle.foreign.NewFlyer`."""
    if address.startswith(crtp.PREFIX):
        crtp.endpoint(address)
        return CrazyflieFlyer(address, model_of)
    of_mavlink = address.startswith(mavlink_line.PREFIX)
    if not of_mavlink and not address.startswith("betaflight:"):
        return None
    (mavlink_line if of_mavlink else byte_line).parsed(address)
    where = offboard.Where(address, *offboard.pose_address(poses or POSES))
    if not is_loopback(where.pose_host):
        raise InputError(f"poses are taken on this machine only, as the page flies simulators; give {POSES}")
    if of_mavlink:
        return AutopilotFlyer(where, model_of)
    return BetaflightFlyer(where, model_of)


@dataclass
class Heard:
    """The guard's last word, None before the first."""

    status: GuardStatus | None = None


class PageGuard(GuardProcess):
    """Keeps what it hears; a kill reaches the guard whatever the planner is about."""

    def __init__(self, setup_json: str, *, asked: Asked, heard: Heard, **more: str) -> None:
        super().__init__(setup_json, **more)
        self._asked, self._heard = asked, heard

    def hear(self) -> GuardStatus:
        self._heard.status = super().hear()
        return self._heard.status

    def answer(self, command: PlannerCommand) -> None:
        super().answer(replace(command, wish=Wish.KILL) if self._asked.kill.is_set() else command)


class PageTracker(Tracker):
    """Obeys what people ask of a flight under way, and tells where the vehicle is."""

    def __init__(
        self, configuration: controller.Configuration, poses: Poses, start_world_m: FloatArray, asked: Asked,
        told: Told, heard: Heard,
    ) -> None:  # fmt: skip
        super().__init__(configuration, poses)
        self._start_world_m, self._asked, self._told, self._heard = start_world_m, asked, told, heard
        self._killed, self._told_s, self._told_of = False, -np.inf, (Stage.WAITING, False)

    @property
    def state(self) -> State:
        """Of one that was killed: disarmed, so that nobody brings it down softly any more."""
        return State.DISARMED if self._killed else super().state

    @property
    def unready(self) -> str:
        return super().unready or self._too_far()

    def tick(self, now_s: float, *, battery_v: float = 0.0, by_targets: bool = False) -> Demand | None:
        self._obey()
        demand = super().tick(now_s, battery_v=battery_v, by_targets=by_targets)
        now = self._heard.status
        of = (now.stage, now.armed) if now is not None else self._told_of
        if demand is not None and (now_s - self._told_s >= _TELL_S or of != self._told_of):
            self._told_s, self._told_of = now_s, of
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
        stage, armed = self._told_of
        return Seen(
            _BY_GUARD.get(stage) or _words(self.state),
            motion.position_world_m.copy(), motion.velocity_world_m_s.copy(),
            motion.q_world_body.copy(), battery_v, along_s, armed, stage in (Stage.DOWN, Stage.ENDED),
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
            f"throttle to nothing, and disarmed where no pilot's switch arms it; {_NOT_HIS}", armed=False,
        )  # fmt: skip

    def fly(self, file: TrajectoryFile, asked: Asked, told: Told, progress: Progress) -> tuple[FlightLog, str]:
        work = partial(_flown, offboard.fly, _fit(self.model_of(), file), file, self.where)
        return apart.fly(work, asked, told, progress, self.restarted)


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
            f"no thrust; {name} decides whether it disarms in the air; {_NOT_HIS}", armed=found.armed,
        )  # fmt: skip

    def fly(self, file: TrajectoryFile, asked: Asked, told: Told, progress: Progress) -> tuple[FlightLog, str]:
        work = partial(_flown, _armed_by_us, _fit(self.model_of(), file), file, self.where)
        return apart.fly(work, asked, told, progress)


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
        kill = "emergency stop: it is locked until it is switched off"
        return Looked("Crazyflie", checked, failsafes, kill, armed=_is_armed(bits))

    def fly(self, file: TrajectoryFile, asked: Asked, told: Told, progress: Progress) -> tuple[FlightLog, str]:
        log, early = crazyflie.fly(
            _fit(self.model_of(), file), file, self.address, arms=True, progress=progress, cancel=asked.land.is_set,
            stop=asked.kill.is_set, told=lambda seen: told(_of_crazyflie(seen)),
        )  # fmt: skip
        return _of_course(log, file), early


def _flown(
    fly: Callable[..., tuple[FlightLog, str]], model: Vehicle, file: TrajectoryFile, where: offboard.Where,
    asked: Asked, told: Told, progress: Progress, restarted: apart.Restarted,
) -> tuple[FlightLog, str]:  # fmt: skip
    """An `apart.Work`, of `offboard.fly`, or of another that takes the same but for what it does not need."""
    heard = Heard()
    log, early = fly(
        model, file, where, progress=progress, cancel=asked.land.is_set, restarted=restarted,
        tracker=_tracker(file, asked, told, heard), guard=partial(PageGuard, asked=asked, heard=heard),
    )  # fmt: skip
    return _of_course(log, file), early


def _armed_by_us(*args: Any, restarted: apart.Restarted, **more: Any) -> tuple[FlightLog, str]:
    """`autopilot.fly`, armed from the page; it does not start anew."""
    del restarted
    return autopilot.fly(*args, arms=True, **more)


def _tracker(file: TrajectoryFile, asked: Asked, told: Told, heard: Heard) -> offboard.NewTracker:
    return lambda configuration, poses: PageTracker(configuration, poses, _start(file), asked, told, heard)


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


def _is_armed(bits: Bits) -> bool:
    """By somebody: one that arms by itself stands armed from when it is switched on."""
    return bool(bits & Bits.FLYING) or bool(bits & Bits.ARMED and not bits & Bits.AUTO_ARMED)


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
